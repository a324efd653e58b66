/* token.h - the static bearer token (RFC 6750). */
#ifndef TOKEN_H
#define TOKEN_H

#include <stdbool.h>

/*
 * The token of the option: the text, or for @PATH the first line of the file.  Copied into `buffer`
 * and returned; NULL for none.  False with a message if the file cannot be read or the token cannot
 * stand in a header.
 */
enum { TOKEN_SIZE = 512 };
bool token_read(const char *option, char buffer[TOKEN_SIZE], const char **token);

/* Whether an Authorization header, NULL if absent, carries it; takes the same time for every wrong
 * one of the same length. */
bool token_matches(const char *token, const char *authorization);

#endif
