/*
 * systemd.h - the two ends of systemd's protocols that a service needs: sockets that were passed
 * (sd_listen_fds(3)) and telling how it goes (sd_notify(3)).  Both are a few environment variables,
 * documented as stable; libsystemd would bring in more than it spares.
 */
#ifndef SYSTEMD_H
#define SYSTEMD_H

/* The index-th passed socket and its name ("" if it has none); -1: there is none. */
int systemd_socket(int index, const char **name);

/* Before the sandbox closes: a socket to systemd, if it listens. */
void systemd_open(void);
/* "READY=1", "STOPPING=1"; nothing when systemd does not listen. */
void systemd_notify(const char *state);
void systemd_close(void);

#endif
