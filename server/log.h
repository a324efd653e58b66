/*
 * log.h - one line per request and per event of the daemon's life, to stderr, as key=value pairs.
 *
 * Lines are gathered in one buffer and written once per turn of the loop, so that a log line costs
 * no system call under load.  Any thread may write.
 */
#ifndef LOG_H
#define LOG_H

#include <stdbool.h>

/* "requests", "events" or "none" */
void log_open(const char *level);
bool log_requests(void);

/* A line that starts with the time; printf-like.  Texts that came from a client go through
 * log_quote. */
__attribute__((format(printf, 1, 2))) void log_line(const char *format, ...);

/* The text in double quotes with everything that is not plain ASCII escaped, cut to the buffer. */
const char *log_quote(const char *text, char *buffer, unsigned long size);

/* Writes what was gathered.  Lines that stderr does not take are counted and reported later. */
void log_flush(void);

#endif
