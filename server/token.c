#include "token.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

static bool complain(const char *what, const char *why)
{
    fprintf(stderr, "facetd: --token %s: %s\n", what, why);
    return false;
}

static bool read_file(const char *path, char *buffer)
{
    FILE *f = fopen(path, "re");
    if (!f) return complain(path, strerror(errno));
    bool read = fgets(buffer, TOKEN_SIZE, f);
    int error = ferror(f) ? errno : 0;
    fclose(f);
    if (!read) return complain(path, error ? strerror(error) : "the file is empty");
    buffer[strcspn(buffer, "\r\n")] = 0;
    return true;
}

bool token_read(const char *option, char buffer[TOKEN_SIZE], const char **token)
{
    *token = NULL;
    if (!*option) return true;
    if (*option == '@') {
        if (!read_file(option + 1, buffer)) return false;
    } else if ((size_t)snprintf(buffer, TOKEN_SIZE, "%s", option) >= TOKEN_SIZE) {
        return complain("TEXT", "it is longer than 511 bytes");
    }
    for (const char *at = buffer; *at; at++)
        if (*at <= ' ' || *at > '~')
            return complain(*option == '@' ? option + 1 : "TEXT",
                            "a token is made of visible ASCII characters");
    if (!*buffer) return complain(option, "the token is empty");
    *token = buffer;
    return true;
}

bool token_matches(const char *token, const char *authorization)
{
    static const char scheme[] = "Bearer ";
    if (!authorization || strncasecmp(authorization, scheme, sizeof scheme - 1)) return false;
    const char *given = authorization + sizeof scheme - 1;
    given += strspn(given, " ");
    /* No early exit, and no index that depends on the token: time tells only the given length. */
    const size_t given_length = strlen(given), length = strlen(token);
    volatile unsigned difference = given_length != length;
    for (size_t i = 0; i < given_length; i++)
        difference |= (unsigned char)(given[i] ^ token[i < length ? i : 0]);
    return !difference;
}
