#include "client.h"

#include "clock.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>

const char *client_header(const struct client *client, const char *name)
{
    return MHD_lookup_connection_value(client->connection, MHD_HEADER_KIND, name);
}

static enum MHD_Result note_header(void *user, enum MHD_ValueKind kind, const char *name,
                                   const char *value)
{
    struct client_framing *framing = user;
    (void)kind;
    if (strpbrk(name, " \t")) framing->fault = "white space in a header's name";
    if (!strcasecmp(name, "Host")) framing->hosts++;
    if (!strcasecmp(name, "Expect") && value)
        framing->expects_continue = !strcasecmp(value, "100-continue");
    if (!strcasecmp(name, "Content-Length") && value) {
        framing->lengths++;
        framing->length = strtoull(value, NULL, 10); /* libmicrohttpd has refused non-digits */
    }
    if (!strcasecmp(name, "Transfer-Encoding")) {
        framing->encodings++;
        framing->chunked = true;
        if (!value || strcasecmp(value, "chunked"))
            framing->fault = "the only Transfer-Encoding here is chunked";
    }
    return MHD_YES;
}

struct client_framing client_framing(const struct client *client)
{
    struct client_framing framing = {0};
    MHD_get_connection_values(client->connection, MHD_HEADER_KIND, note_header, &framing);
    if (framing.hosts > 1) framing.fault = "more than one Host";
    if (framing.lengths > 1) framing.fault = "more than one Content-Length";
    if (framing.encodings > 1) framing.fault = "more than one Transfer-Encoding";
    if (framing.lengths && framing.encodings)
        framing.fault = "both Content-Length and Transfer-Encoding";
    return framing;
}

void client_extend(struct client *client, size_t bytes, long min_rate, int64_t grace_us)
{
    int64_t latest = clock_us() + grace_us;
    double bought = 1e6 * (double)bytes / (double)min_rate;
    if (client->deadline_us > latest || bought >= (double)(latest - client->deadline_us))
        client->deadline_us = latest;
    else
        client->deadline_us += (int64_t)bought;
}

void client_cut(struct client *client, bool tell)
{
    const bool half_here = client->phase == CLIENT_HEADERS || client->phase == CLIENT_BODY ||
                           (client->phase == CLIENT_IDLE && !client->used);
    client->cut = true;
    client->deadline_us = CLIENT_NEVER;
    if (tell && half_here && !client->raw) {
        client->request.close = true;
        request_refuse(&client->request, 408, "the request came too slowly");
        request_send_raw(&client->request, client->fd);
        client->raw = true;
    }
    shutdown(client->fd, SHUT_RDWR);
}
