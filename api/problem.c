#include "problem.h"

#include "text.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct {
    int status;
    const char *title;
} titles[] = {
    {400, "Bad Request"},
    {401, "Unauthorized"},
    {404, "Not Found"},
    {405, "Method Not Allowed"},
    {406, "Not Acceptable"},
    {408, "Request Timeout"},
    {411, "Length Required"},
    {413, "Content Too Large"},
    {414, "URI Too Long"},
    {415, "Unsupported Media Type"},
    {417, "Expectation Failed"},
    {422, "Unprocessable Content"},
    {429, "Too Many Requests"},
    {431, "Request Header Fields Too Large"},
    {500, "Internal Server Error"},
    {501, "Not Implemented"},
    {503, "Service Unavailable"},
    {505, "HTTP Version Not Supported"},
};

const char *api_status_title(int status)
{
    for (size_t i = 0; i < sizeof titles / sizeof *titles; i++)
        if (titles[i].status == status) return titles[i].title;
    return status < 400 ? "OK" : "Error";
}

/* The text was cut at its end: drop the beginning of a character that lost its rest. */
static void drop_cut_character(char *text)
{
    size_t n = strlen(text), i = n;
    while (i && ((unsigned char)text[i - 1] & 0xc0) == 0x80) i--;
    if (!i || (unsigned char)text[i - 1] < 0xc0) return;
    unsigned char lead = (unsigned char)text[i - 1];
    size_t need = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
    if (n - (i - 1) < need) text[i - 1] = 0;
}

static void format_into(char *out, size_t room, const char *format, va_list list)
{
    vsnprintf(out, room, format, list);
    drop_cut_character(out);
}

/* Outermost first; the recursion is as deep as the tables, about ten. */
static size_t write_pointer(char *out, size_t used, size_t room, const struct place *place)
{
    if (!place) return used;
    used = write_pointer(out, used, room, place->up);
    char number[24];
    const char *name = place->name;
    if (!name) {
        snprintf(number, sizeof number, "%zu", place->index);
        name = number;
    }
    if (used + 1 < room) out[used++] = '/';
    for (; *name && used + 2 < room; name++) {
        if (*name == '~' || *name == '/') {
            out[used++] = '~';
            out[used++] = *name == '~' ? '0' : '1';
        } else {
            out[used++] = *name;
        }
    }
    return used;
}

bool api_problem(struct problem *problem, int status, const char *format, ...)
{
    if (problem->status) return false;
    problem->status = status;
    va_list list;
    va_start(list, format);
    format_into(problem->detail, sizeof problem->detail, format, list);
    va_end(list);
    return false;
}

bool api_problem_at(struct problem *problem, const struct place *place, const char *format, ...)
{
    size_t at = problem->count++;
    if (at >= PROBLEM_ERRORS_MAX) return false;
    struct problem_error *error = &problem->errors[at];
    size_t n = write_pointer(error->pointer, 0, sizeof error->pointer, place);
    error->pointer[n] = 0;
    drop_cut_character(error->pointer);
    va_list list;
    va_start(list, format);
    format_into(error->detail, sizeof error->detail, format, list);
    va_end(list);
    if (problem->status) return false;
    return api_problem(problem, 422, "%s%s%s", error->pointer,
                       *error->pointer ? " " : "the request ", error->detail);
}

bool api_problem_status(struct problem *problem, facet_status status, const struct place *place)
{
    switch (status) {
    case FACET_NO_MEMORY: return api_problem_memory(problem);
    case FACET_CANCELLED: return api_problem(problem, 503, "the request was cancelled");
    case FACET_OK: return api_problem(problem, 500, "a success was reported as an error");
    default: return api_problem_at(problem, place, "%s", facet_status_text(status));
    }
}

bool api_problem_memory(struct problem *problem)
{
    return api_problem(problem, 503, "out of memory");
}

static void print_problem(struct text *text, const struct problem *problem)
{
    api_text_put(text, "{\"type\":\"about:blank\",\"title\":");
    api_text_string(text, api_status_title(problem->status));
    api_text_print(text, ",\"status\":%d,\"detail\":", problem->status);
    api_text_string(text, problem->detail);
    size_t kept = problem->count < PROBLEM_ERRORS_MAX ? problem->count : PROBLEM_ERRORS_MAX;
    for (size_t i = 0; i < kept; i++) {
        api_text_put(text, i ? ",{\"pointer\":" : ",\"errors\":[{\"pointer\":");
        api_text_string(text, problem->errors[i].pointer);
        api_text_put(text, ",\"detail\":");
        api_text_string(text, problem->errors[i].detail);
        api_text_put(text, i + 1 < kept ? "}" : "}]");
    }
    api_text_put(text, "}\n");
}

void api_problem_answer(const struct problem *problem, struct api_response *response)
{
    enum { PROBLEM_BYTES_MAX = 65536 };
    struct arena arena;
    api_arena_open(&arena, PROBLEM_BYTES_MAX);
    struct text text = api_text(&arena);
    print_problem(&text, problem);
    free(response->body);
    response->status = problem->status;
    response->content_type = "application/problem+json";
    response->body_size = 0;
    response->body = api_text_take(&text, &response->body_size);
    if (!response->body) response->status = 503; /* the status line says it all */
    api_arena_close(&arena);
}
