/* body.h - the bytes a case sends: JSON, text, a file of shared data, or generated. */
#ifndef CLIENT_BODY_H
#define CLIENT_BODY_H

#include <jansson.h>
#include <stddef.h>

enum body_result { BODY_NONE, BODY_OK, BODY_ABSENT, BODY_BAD };

struct body {
    char *bytes; /* owned */
    size_t size;
    const char *type; /* Content-Type to send unless the case names one; static */
    char why[256];    /* BODY_ABSENT, BODY_BAD */
};

/*
 * "form": {"request":{...}, "name":{"float32":[..]} | {"float64":[..]} | {"npy":[[..],..]}, ...} ·
 * "json": any value · "text": as it stands · "file": path below shared data ·
 * "generate": {"repeat":"[","count":n,"before":"","after":""} | {"directions":n} |
 *   {"merl":{"dims":[90,90,180],"bytes":n,"value":x}} | {"merl":{"alpha":a,"f0":[r,g,b]}} |
 *   {"exr":{"width":w,"height":h,"value":x}} | {"exr":{"pfm":path}} |
 *   {"png":{"width":w,"height":h,"depth":8,"inflate":bytes}}
 */
enum body_result body_make(const json_t *request, struct body *body);
void body_clear(struct body *body);

/* As compact text, with the fewest digits that give the same numbers back (0.3, not
 * 0.29999999999999999). */
char *body_json(const json_t *value);

/* Path below shared data ($FACET_DATA, else ../shared/data). */
void body_data_path(const char *relative, char *path, size_t size);
/* The whole file, NUL-terminated; NULL if it cannot be read. */
char *body_read(const char *path, size_t *size);

#endif
