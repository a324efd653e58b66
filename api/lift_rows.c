#include "lift_rows.h"

#include "number.h"

#include <stdlib.h>
#include <string.h>

/* Bytes. What a round yields stays in the second-level cache until it is taken. */
enum { STRETCHES = 16, STRETCH = 1 << 16, SEARCH = 1 << 12 };

struct stretch {
    const char *begin, *at, *end;
    double *values;
    size_t rows;
};

struct round {
    struct stretch stretches[STRETCHES];
    double *values; /* of all of them */
    size_t room;    /* numbers a stretch may hold */
    size_t count, columns;
};

static const char *skip_space(const char *p, const char *end)
{
    while (p < end && (*p == ' ' || *p == '\n' || *p == '\t' || *p == '\r')) p++;
    return p;
}

/* The comma of the next "],[" at or behind p; NULL: none within SEARCH bytes. */
static const char *find_cut(const char *p, const char *end)
{
    if (end - p > SEARCH) end = p + SEARCH;
    while (p < end && (p = memchr(p, ']', (size_t)(end - p)))) {
        const char *comma = skip_space(p + 1, end);
        if (comma < end && *comma == ',') {
            const char *bracket = skip_space(comma + 1, end);
            if (bracket < end && *bracket == '[') return comma;
        }
        p++;
    }
    return NULL;
}

static void parse_stretch(void *round_, size_t index)
{
    struct round *round = round_;
    struct stretch *s = &round->stretches[index];
    s->at = s->begin;
    s->rows = api_number_rows(&s->at, s->end, s->values, round->room, round->columns);
}

/* Stretches from at on, each but the last ended by the next one's comma. */
static void cut(struct round *round, const char *at, const char *end)
{
    round->count = 0;
    while (round->count < STRETCHES && at) {
        struct stretch *s = &round->stretches[round->count];
        const char *next = end - at > STRETCH ? find_cut(at + STRETCH - SEARCH, end) : NULL;
        if (!next && end - at > STRETCH) break;
        *s = (struct stretch){.begin = at,
                              .end = next ? next : end,
                              .values = round->values + round->count * round->room};
        round->count++;
        at = next;
    }
}

bool api_lift_rows(const struct document *document, const char **at, const char *end,
                   size_t columns, take_numbers_fn *take, void *user)
{
    struct round round = {.columns = columns, .room = STRETCH / 2};
    if (!document->share || end - *at < ROWS_TOGETHER_MIN) return true;
    round.values = malloc(STRETCHES * round.room * sizeof *round.values);
    bool ok = true, whole = round.values;
    while (whole && ok && end - *at > 2 * STRETCH) {
        cut(&round, *at, end);
        if (!round.count) break;
        document->share(document->crew, round.count, parse_stretch, &round);
        for (size_t i = 0; whole && ok && i < round.count; i++) {
            const struct stretch *s = &round.stretches[i];
            ok = take(user, s->values, s->rows * columns);
            *at = s->at;
            whole = skip_space(s->at, s->end) == s->end;
        }
    }
    free(round.values);
    return ok;
}
