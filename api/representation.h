/*
 * representation.h - how arrays of results are answered, by the client's Accept and "dtype".
 *
 *   application/json           everything, printed with the digits that the bound supports
 *   application/octet-stream   the arrays one after the other, little-endian float32 or float64
 *   application/x-npy          the only array as a .npy file
 *   application/zip            every array as a .npy file in a .npz
 *
 * What a binary answer has no place for stands in two headers, as JSON: Facet-Layout, a list of
 * {"name","dtype","shape"}, and Facet-Answer, the members of the JSON answer that are no arrays.
 */
#ifndef API_REPRESENTATION_H
#define API_REPRESENTATION_H

#include "endpoint.h"
#include "results.h"
#include "tolerance.h"

/* For endpoint->answers. */
extern const char *const api_array_answers[];

extern const char *const api_dtype_names[];
#define DTYPE_FIELD(type_)                                                                         \
    {                                                                                              \
        MEMBER(type_, dtype), FIELD_ENUM, .names = api_dtype_names,                                \
                                          .doc = "of raw arrays in a multipart request (else "     \
                                                 "float32), and of the numbers in a binary answer "\
                                                 "(else the smaller that meets the tolerance)"     \
    }

struct representation {
    const char *type; /* media type */
    enum results_format format;
};

/*
 * Chooses by Accept and dtype (-1: not given).  promise is then that of the numbers as they are
 * represented.  False: 422 at /dtype where float32 cannot hold the tolerance.
 */
bool api_represent(const struct call *call, int dtype, const struct tolerance_request *request,
                   struct promise *promise, struct representation *representation);

/* What is wrong with an array, as a problem; false unless it is sound.  what: "pair", "sample". */
bool api_results_check(enum results_fault fault, const struct results *results, const char *name,
                       const char *what, struct problem *problem);

struct named_results {
    const char *name;
    struct results *results;
};

/* Binary answers: the body and its headers, call->out without its arrays among them. */
bool api_answer_arrays(struct call *call, const struct representation *representation,
                       const struct named_results *arrays, size_t count);

#endif
