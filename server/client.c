#include "client.h"

#include "metrics.h"

#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>

void client_set_address(struct client *client, const struct sockaddr *address)
{
    if (address && address->sa_family == AF_INET6) {
        memcpy(client->address, &((const struct sockaddr_in6 *)address)->sin6_addr, 16);
    } else if (address && address->sa_family == AF_INET) {
        client->address[10] = client->address[11] = 0xff;
        memcpy(client->address + 12, &((const struct sockaddr_in *)address)->sin_addr, 4);
    }
}

bool client_has_address(const struct client *client)
{
    static const unsigned char none[sizeof client->address];
    return memcmp(client->address, none, sizeof none) != 0;
}

void client_extend(struct client *client, int64_t now_us, size_t bytes, long min_rate,
                   int64_t grace_us)
{
    int64_t latest = now_us + grace_us;
    double bought = 1e6 * (double)bytes / (double)min_rate;
    if (client->deadline_us > latest || bought >= (double)(latest - client->deadline_us))
        client->deadline_us = latest;
    else
        client->deadline_us += (int64_t)bought;
}

static void tell_too_slow(struct client *client)
{
    static const char detail[] = "the request came too slowly";
    if (!client->request) {
        request_send_refusal(client->fd, 408, detail);
    } else {
        client->request->close = true;
        request_refuse(client->request, 408, detail);
        request_send_raw(client->request, client->fd);
    }
    client->raw = true;
}

void client_cut(struct client *client, bool tell)
{
    const bool half_here = client->phase == CLIENT_HEADERS || client->phase == CLIENT_BODY ||
                           (client->phase == CLIENT_IDLE && !client->used);
    client->cut = true;
    if (tell && !client->raw) /* one of those has had its answer */
        metrics_add(client->phase == CLIENT_IDLE && client->used ? METRIC_IDLE_CONNECTIONS
                                                                 : METRIC_CUT_CONNECTIONS,
                    1);
    client->deadline_us = CLIENT_NEVER;
    if (tell && half_here && !client->raw) tell_too_slow(client);
    shutdown(client->fd, SHUT_RDWR);
}
