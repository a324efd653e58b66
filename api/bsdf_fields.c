#include "bsdf_fields.h"

#include "little.h"

#include <stdio.h>

enum { HEADER = 18 };
static const char mark[12] = "tensor_file";

static unsigned read_u16(const unsigned char *p)
{
    return p[0] | (unsigned)p[1] << 8;
}

bool api_tensor_open(const unsigned char *bytes, size_t size, struct tensor_file *file,
                     struct problem *problem)
{
    if (size < HEADER || memcmp(bytes, mark, sizeof mark))
        return api_problem(problem, 422,
                           "an RGL .bsdf file starts with \"tensor_file\" and has more than %d "
                           "bytes; this one has %zu%s",
                           HEADER, size, size < HEADER ? "" : " and starts otherwise");
    if (bytes[12] != 1)
        return api_problem(problem, 422, "the tensor file has version %d.%d; 1.0 is read",
                           bytes[12], bytes[13]);
    *file = (struct tensor_file){bytes, size, api_little_u32(bytes + 14)};
    return true;
}

static size_t size_of(unsigned type)
{
    static const unsigned char sizes[] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
    return type < sizeof sizes ? sizes[type] : 0;
}

/* The field at *at, and *at behind it; false where the file ends or a number cannot be. */
static bool read_field(const struct tensor_file *file, size_t *at, const unsigned char **name,
                       size_t *name_size, struct tensor *tensor)
{
    const unsigned char *b = file->bytes;
    if (file->size - *at < 2) return false;
    *name_size = read_u16(b + *at);
    if (file->size - *at < 2 + *name_size + 11) return false;
    *name = b + *at + 2;
    *at += 2 + *name_size;
    *tensor = (struct tensor){.dimensions = read_u16(b + *at), .type = b[*at + 2], .count = 1};
    uint64_t offset = api_little_u64(b + *at + 3);
    *at += 11;
    if (file->size - *at < 8 * tensor->dimensions) return false;
    for (size_t k = 0; k < tensor->dimensions; k++) {
        uint64_t n = api_little_u64(b + *at + 8 * k);
        if (n == 0 || n > TENSOR_NUMBERS_MAX || tensor->count > TENSOR_NUMBERS_MAX / n)
            return false;
        tensor->count *= n;
        if (k < TENSOR_DIMENSIONS_MAX) tensor->shape[k] = n;
    }
    *at += 8 * tensor->dimensions;
    size_t bytes = tensor->count * size_of(tensor->type);
    if (bytes == 0 || offset > file->size || bytes > file->size - offset) return false;
    tensor->bytes = b + offset;
    return true;
}

bool api_tensor_look(const struct tensor_file *file, const char *name, unsigned type,
                     size_t dimensions, struct tensor *tensor, struct problem *problem)
{
    size_t at = HEADER;
    for (uint32_t i = 0; i < file->fields; i++) {
        const unsigned char *own;
        size_t size;
        if (!read_field(file, &at, &own, &size, tensor))
            return api_problem(problem, 422,
                               "field %u of the tensor file lies outside its %zu bytes, or claims "
                               "an impossible size",
                               i, file->size);
        if (size != strlen(name) || memcmp(own, name, size)) continue;
        if (tensor->type != type || tensor->dimensions != dimensions)
            return api_problem(problem, 422,
                               "field \"%s\" has type %u and %zu dimensions; %u and %zu are needed",
                               name, tensor->type, tensor->dimensions, type, dimensions);
        return true;
    }
    *tensor = (struct tensor){0};
    return true;
}

bool api_tensor_find(const struct tensor_file *file, const char *name, unsigned type,
                     size_t dimensions, struct tensor *tensor, struct problem *problem)
{
    if (!api_tensor_look(file, name, type, dimensions, tensor, problem)) return false;
    return tensor->bytes || api_problem(problem, 422, "the tensor file has no field \"%s\"", name);
}
