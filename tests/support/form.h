/* form.h - multipart/form-data bodies for tests. */
#ifndef FORM_H
#define FORM_H

#include <stddef.h>

#define FORM_TYPE "multipart/form-data; boundary=\"x 1\""

struct form {
    char *bytes; /* malloc'd */
    size_t size;
};

void form_add(struct form *form, const char *name, const void *bytes, size_t size);
void form_add_text(struct form *form, const char *name, const char *text);
/* A part that is a .npy file of n x columns floats (columns 0: one dimension). */
void form_add_npy(struct form *form, const char *name, const float *values, size_t n,
                  size_t columns);
void form_end(struct form *form);
void form_clear(struct form *form);

#endif
