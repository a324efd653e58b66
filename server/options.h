/* options.h - the command line and the environment of facetd; the rows are in options.def. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include "api.h"

struct options {
#define OPTION_NUMBER(field, flag, environment, fallback, min, max, help) long field;
#define OPTION_TEXT(field, flag, environment, fallback, help) const char *field;
#define OPTION_FLAG(field, flag, environment, help) long field;
#include "options.def"
};

enum options_action {
    OPTIONS_SERVE,
    OPTIONS_HEALTHCHECK, /* ask the daemon that runs with the same options, and exit */
    OPTIONS_DONE,        /* --help or --version was printed */
    OPTIONS_BAD          /* a message was printed */
};

/* Flags win over the environment, which wins over the defaults.  Texts point into argv or environ. */
enum options_action options_read(int argc, char **argv, struct options *options);

/* The limits among them, for api_announce_limits. */
enum {
    OPTIONS_LIMITS = 0
#define OPTION_LIMIT(field, flag, environment, fallback, min, max, help) +1
#include "options.def"
};
void options_limits(const struct options *options, struct api_limit limits[OPTIONS_LIMITS]);

#endif
