#include "form.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void append(struct form *form, const void *bytes, size_t size)
{
    form->bytes = realloc(form->bytes, form->size + size + 1);
    memcpy(form->bytes + form->size, bytes, size);
    form->size += size;
    form->bytes[form->size] = 0;
}

void form_add(struct form *form, const char *name, const void *bytes, size_t size)
{
    char head[200];
    int n = snprintf(head, sizeof head,
                     "--x 1\r\nContent-Disposition: form-data; name=\"%s\"; filename=\"%s.npy\"\r\n"
                     "Content-Type: application/octet-stream\r\n\r\n",
                     name, name);
    append(form, head, (size_t)n);
    append(form, bytes, size);
    append(form, "\r\n", 2);
}

void form_add_text(struct form *form, const char *name, const char *text)
{
    form_add(form, name, text, strlen(text));
}

void form_add_npy(struct form *form, const char *name, const float *values, size_t n,
                  size_t columns)
{
    size_t count = n * (columns ? columns : 1), size = 128 + count * sizeof *values;
    char *npy = malloc(size), shape[64];
    memset(npy, ' ', 128);
    memcpy(npy, "\x93NUMPY\1\0\x76\0", 10);
    snprintf(shape, sizeof shape, columns ? "(%zu, %zu)" : "(%zu,)", n, columns);
    int length = snprintf(npy + 10, 118, "{'descr': '<f4', 'fortran_order': False, 'shape': %s, }",
                          shape);
    npy[10 + length] = ' ';
    npy[127] = '\n';
    memcpy(npy + 128, values, size - 128);
    form_add(form, name, npy, size);
    free(npy);
}

void form_end(struct form *form)
{
    append(form, "--x 1--\r\n", 9);
}

void form_clear(struct form *form)
{
    free(form->bytes);
    *form = (struct form){0};
}
