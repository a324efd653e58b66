#include "body.h"

#include "image.h"
#include "merl.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void body_data_path(const char *relative, char *path, size_t size)
{
    const char *root = getenv("FACET_DATA");
    snprintf(path, size, "%s/%s", root ? root : "../shared/data", relative);
}

char *body_read(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    if (!f) return NULL;
    char *bytes = NULL;
    long end;
    if (!fseek(f, 0, SEEK_END) && (end = ftell(f)) >= 0 && !fseek(f, 0, SEEK_SET) &&
        (bytes = malloc((size_t)end + 1))) {
        *size = fread(bytes, 1, (size_t)end, f);
        bytes[*size] = 0;
    }
    fclose(f);
    return bytes;
}

static const char *text_of(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

static size_t size_of(const json_t *object, const char *key)
{
    json_int_t n = json_integer_value(json_object_get(object, key));
    return n > 0 ? (size_t)n : 0;
}

static char *repeated(const char *before, const char *unit, size_t count, const char *after,
                      size_t *size)
{
    size_t head = strlen(before), one = strlen(unit), tail = strlen(after);
    char *bytes = malloc(head + one * count + tail + 1);
    if (!bytes) return NULL;
    memcpy(bytes, before, head);
    for (size_t i = 0; i < count; i++) memcpy(bytes + head + i * one, unit, one);
    memcpy(bytes + head + one * count, after, tail + 1);
    *size = head + one * count + tail;
    return bytes;
}

/* n directions straight up, as the flat list. */
static char *directions(size_t n, size_t *size)
{
    return repeated("{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wo\":[[0,0,1]],\"wi\":[0,0,1",
                    ",0,0,1", n - 1, "]}", size);
}

/* ---- forms ----------------------------------------------------------------------------------------- */

struct bytes {
    char *at;
    size_t size;
};

static void append(struct bytes *out, const void *bytes, size_t size)
{
    char *more = out->at || !out->size ? realloc(out->at, out->size + size + 1) : NULL;
    if (!more) {
        free(out->at);
        out->at = NULL;
        out->size = 1; /* failed for good */
        return;
    }
    out->at = more;
    memcpy(more + out->size, bytes, size);
    out->size += size;
    more[out->size] = 0;
}

/* The numbers of an array, and of the arrays in it, as float32 or float64. */
static void append_numbers(struct bytes *out, const json_t *array, bool wide)
{
    const json_t *item;
    size_t i;
    json_array_foreach(array, i, item)
    {
        double x = json_number_value(item);
        float f = (float)x;
        if (json_is_array(item))
            append_numbers(out, item, wide);
        else
            append(out, wide ? (void *)&x : (void *)&f, wide ? sizeof x : sizeof f);
    }
}

static void append_npy(struct bytes *out, const json_t *rows)
{
    char header[128];
    memset(header, ' ', sizeof header);
    memcpy(header, "\x93NUMPY\1\0\x76\0", 10);
    int n = snprintf(header + 10, sizeof header - 10,
                     "{'descr': '<f4', 'fortran_order': False, 'shape': (%zu, %zu), }",
                     json_array_size(rows), json_array_size(json_array_get(rows, 0)));
    header[10 + n] = ' ';
    header[127] = '\n';
    append(out, header, sizeof header);
    append_numbers(out, rows, false);
}

static char *form(const json_t *parts, size_t *size)
{
    struct bytes out = {NULL, 0};
    const char *name;
    json_t *part;
    json_object_foreach((json_t *)parts, name, part)
    {
        char head[300];
        int n = snprintf(head, sizeof head,
                         "--facet\r\nContent-Disposition: form-data; name=\"%s\"\r\n\r\n", name);
        append(&out, head, (size_t)n);
        if (json_object_get(part, "npy"))
            append_npy(&out, json_object_get(part, "npy"));
        else if (json_object_get(part, "float32"))
            append_numbers(&out, json_object_get(part, "float32"), false);
        else if (json_object_get(part, "float64"))
            append_numbers(&out, json_object_get(part, "float64"), true);
        else {
            char *text = body_json(part);
            if (text) append(&out, text, strlen(text));
            free(text);
        }
        append(&out, "\r\n", 2);
    }
    append(&out, "--facet--\r\n", 11);
    *size = out.size;
    return out.at;
}

static char *generated(const json_t *from, size_t *size)
{
    const json_t *part;
    if (json_object_get(from, "repeat"))
        return repeated(text_of(from, "before"), text_of(from, "repeat"), size_of(from, "count"),
                        text_of(from, "after"), size);
    if (json_object_get(from, "directions")) return directions(size_of(from, "directions"), size);
    if ((part = json_object_get(from, "merl"))) return merl_make(part, size);
    if ((part = json_object_get(from, "png")))
        return image_png(size_of(part, "width"), size_of(part, "height"),
                         (int)size_of(part, "depth"), size_of(part, "inflate"), size);
    if ((part = json_object_get(from, "exr"))) {
        char path[4096];
        if (!json_object_get(part, "pfm"))
            return image_exr(size_of(part, "width"), size_of(part, "height"),
                             (float)json_number_value(json_object_get(part, "value")), size);
        body_data_path(text_of(part, "pfm"), path, sizeof path);
        return image_exr_from_pfm(path, size);
    }
    return NULL;
}

char *body_json(const json_t *value)
{
    char *text = NULL;
    for (size_t digits = 15; digits <= 17; digits++) {
        free(text);
        text = json_dumps(value, JSON_COMPACT | JSON_ENCODE_ANY | JSON_REAL_PRECISION(digits));
        json_t *back = text ? json_loads(text, JSON_DECODE_ANY, NULL) : NULL;
        bool same = json_equal(back, value);
        json_decref(back);
        if (same) break;
    }
    return text;
}

enum body_result body_make(const json_t *request, struct body *body)
{
    const json_t *part;
    memset(body, 0, sizeof *body);
    body->type = "application/x-www-form-urlencoded"; /* what curl -d and --data-binary send */
    if ((part = json_object_get(request, "json"))) {
        body->type = "application/json";
        body->bytes = body_json(part);
        if (body->bytes) body->size = strlen(body->bytes);
    } else if ((part = json_object_get(request, "form"))) {
        body->type = "multipart/form-data; boundary=facet";
        body->bytes = form(part, &body->size);
    } else if ((part = json_object_get(request, "text"))) {
        body->bytes = strdup(json_string_value(part));
        if (body->bytes) body->size = strlen(body->bytes);
    } else if ((part = json_object_get(request, "file"))) {
        char path[4096];
        body_data_path(json_string_value(part), path, sizeof path);
        body->bytes = body_read(path, &body->size);
        if (!body->bytes) {
            snprintf(body->why, sizeof body->why, "shared data lacks %s", json_string_value(part));
            return BODY_ABSENT;
        }
    } else if ((part = json_object_get(request, "generate"))) {
        body->bytes = generated(part, &body->size);
        const json_t *pfm = json_object_get(json_object_get(part, "exr"), "pfm");
        if (!body->bytes && pfm) {
            snprintf(body->why, sizeof body->why, "shared data lacks %s", json_string_value(pfm));
            return BODY_ABSENT;
        }
    } else {
        return BODY_NONE;
    }
    if (body->bytes) return BODY_OK;
    snprintf(body->why, sizeof body->why, "the body cannot be made");
    return BODY_BAD;
}

void body_clear(struct body *body)
{
    free(body->bytes);
    body->bytes = NULL;
}
