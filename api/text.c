#include "text.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PIECE_MIN = 1024, PIECE_MAX = 65536 };

struct text_piece {
    struct text_piece *next;
    size_t used, room;
    char bytes[];
};

struct text api_text(struct arena *arena)
{
    return (struct text){.arena = arena};
}

char *api_text_reserve(struct text *text, size_t size)
{
    if (text->failed) return NULL;
    struct text_piece *last = text->last;
    if (last && last->room - last->used >= size) return last->bytes + last->used;
    size_t room = text->size < PIECE_MIN ? PIECE_MIN : text->size;
    if (room > PIECE_MAX) room = PIECE_MAX;
    if (room < size) room = size;
    struct text_piece *piece = api_arena_alloc(text->arena, sizeof *piece + room);
    if (!piece) {
        text->failed = true;
        return NULL;
    }
    piece->next = NULL;
    piece->used = 0;
    piece->room = room;
    if (last)
        last->next = piece;
    else
        text->first = piece;
    text->last = piece;
    return piece->bytes;
}

void api_text_commit(struct text *text, size_t size)
{
    text->last->used += size;
    text->size += size;
}

void api_text_bytes(struct text *text, const char *bytes, size_t size)
{
    char *end = api_text_reserve(text, size);
    if (!end) return;
    memcpy(end, bytes, size);
    api_text_commit(text, size);
}

void api_text_put(struct text *text, const char *string)
{
    api_text_bytes(text, string, strlen(string));
}

void api_text_print(struct text *text, const char *format, ...)
{
    enum { ROOM = 512 };
    char *end = api_text_reserve(text, ROOM);
    if (!end) return;
    va_list list;
    va_start(list, format);
    int n = vsnprintf(end, ROOM, format, list);
    va_end(list);
    api_text_commit(text, n < 0 ? 0 : n < ROOM ? (size_t)n : ROOM - 1);
}

/* Bytes of the UTF-8 character that begins here; 0: none does. */
static size_t utf8_size(const unsigned char *s)
{
    static const unsigned char low[] = {[0xe0 - 0xc2] = 0xa0, [0xf0 - 0xc2] = 0x90};
    unsigned char c = *s, high = c == 0xed ? 0x9f : c == 0xf4 ? 0x8f : 0xbf;
    if (c < 0x80) return 1;
    if (c < 0xc2 || c > 0xf4) return 0;
    size_t size = c < 0xe0 ? 2 : c < 0xf0 ? 3 : 4, lead = c - 0xc2u;
    unsigned char least = lead < sizeof low && low[lead] ? low[lead] : 0x80;
    if (s[1] < least || s[1] > high) return 0;
    for (size_t i = 2; i < size; i++)
        if ((s[i] & 0xc0) != 0x80) return 0;
    return size;
}

void api_text_string(struct text *text, const char *string)
{
    api_text_put(text, "\"");
    for (const char *plain = string;;) {
        unsigned char c = (unsigned char)*string;
        size_t size = utf8_size((const unsigned char *)string);
        if (size && c >= 0x20 && c != '"' && c != '\\' && c != 0x7f) {
            string += size;
            continue;
        }
        api_text_bytes(text, plain, (size_t)(string - plain));
        if (!c) break;
        if (c == '"' || c == '\\')
            api_text_print(text, "\\%c", c);
        else
            api_text_print(text, "\\u%04x", size ? c : 0xfffd);
        plain = ++string;
    }
    api_text_put(text, "\"");
}

void api_text_number(struct text *text, double value, int digits)
{
    char *end = api_text_reserve(text, NUMBER_ROOM);
    if (!end) return;
    api_text_commit(text, (size_t)(digits == NUMBER_SHORTEST
                                       ? api_number_print(end, value)
                                       : api_number_print_digits(end, value, digits)));
}

void api_text_join(struct text *text, struct text *tail)
{
    text->failed |= tail->failed;
    if (!tail->first) return;
    if (text->last)
        text->last->next = tail->first;
    else
        text->first = tail->first;
    text->last = tail->last;
    text->size += tail->size;
    *tail = (struct text){.arena = tail->arena};
}

char *api_text_take(const struct text *text, size_t *size)
{
    char *bytes = text->failed ? NULL : malloc(text->size + 1);
    if (!bytes) return NULL;
    char *end = bytes;
    for (const struct text_piece *piece = text->first; piece; piece = piece->next) {
        memcpy(end, piece->bytes, piece->used);
        end += piece->used;
    }
    *end = 0;
    *size = text->size;
    return bytes;
}
