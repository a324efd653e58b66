/* answer.h - how an answer goes out: whole, in blocks, or beside libmicrohttpd. */
#ifndef ANSWER_H
#define ANSWER_H

#include "http_state.h"

/* Until when the client may take so many bytes. */
int64_t answer_deadline(const struct http *http, int64_t now_us, size_t bytes);

/* Queues the request's response; MHD_NO, for want of memory, closes the connection. */
enum MHD_Result answer_send(struct http *http, struct client *client);

/* The answer is settled in the middle of an upload: send it now, let the client read it. */
enum MHD_Result answer_raw(struct http *http, struct client *client);

/* The answer is settled before the body has been read. */
enum MHD_Result answer_early(struct http *http, struct client *client, const struct head *head);

#endif
