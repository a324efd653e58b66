/* bsdf_fields.h - the fields of a tensor file, found and checked. */
#ifndef API_BSDF_FIELDS_H
#define API_BSDF_FIELDS_H

#include "problem.h"

#include <stdint.h>

enum { TENSOR_DIMENSIONS_MAX = 5 };
/* Numbers in one field: more than any measurement has. */
#define TENSOR_NUMBERS_MAX ((uint64_t)1 << 24)

struct tensor {
    const unsigned char *bytes; /* NULL: no such field */
    size_t dimensions;
    size_t shape[TENSOR_DIMENSIONS_MAX], count;
    unsigned type;
};

enum { TENSOR_UINT8 = 1, TENSOR_FLOAT32 = 10 };

struct tensor_file {
    const unsigned char *bytes;
    size_t size;
    uint32_t fields;
};

bool api_tensor_open(const unsigned char *bytes, size_t size, struct tensor_file *file,
                     struct problem *problem);
/* A field that must be there, of this type and so many dimensions. */
bool api_tensor_find(const struct tensor_file *file, const char *name, unsigned type,
                     size_t dimensions, struct tensor *tensor, struct problem *problem);
/* The same where it may be absent: tensor->bytes NULL. */
bool api_tensor_look(const struct tensor_file *file, const char *name, unsigned type,
                     size_t dimensions, struct tensor *tensor, struct problem *problem);

#endif
