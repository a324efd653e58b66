/* exchange.h - a request from its first line to its log line, as libmicrohttpd calls for it. */
#ifndef EXCHANGE_H
#define EXCHANGE_H

#include "http_state.h"

/* MHD_OPTION_URI_LOG_CALLBACK: the request line, before libmicrohttpd decodes it in place. */
void *exchange_begin(void *user, const char *target, struct MHD_Connection *connection);

/* The access handler: headers complete, each piece of the body, its end, and back from a worker. */
enum MHD_Result exchange_step(void *user, struct MHD_Connection *connection, const char *url,
                              const char *method, const char *version, const char *data,
                              size_t *size, void **context);

/* MHD_OPTION_NOTIFY_COMPLETED */
void exchange_end(void *user, struct MHD_Connection *connection, void **context,
                  enum MHD_RequestTerminationCode code);

#endif
