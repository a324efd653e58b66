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
        MEMBER(type_, dtype), FIELD_ENUM,                                                          \
            .names = api_dtype_names,                                                              \
            .doc = "of raw arrays in a multipart request (else "                                   \
                   "float32), and of the numbers in a binary answer "                              \
                   "(else float32 for a tolerance from 2.5e-7 on); of numbers as JSON nothing"     \
    }

/* Without "dtype" a binary answer is float32 from this tolerance on. */
#define FLOAT_TOLERANCE 2.5e-7

struct representation {
    const char *type; /* media type */
    enum results_format format;
    double rounding; /* relative error that the format adds */
};

/*
 * Chooses by Accept and dtype (-1: not given) for so many arrays.  False: 422 at /dtype, or 406
 * where the type holds one array.
 */
bool api_represent(const struct call *call, int dtype, const struct tolerance_request *request,
                   size_t count, struct representation *representation);
/* The bound of numbers of this bound once they are represented; for a bound_fn. */
double api_represented(const struct representation *representation, double bound);
/* The promise's bound as it is told: of the numbers as they are represented. */
void api_represent_bound(const struct representation *representation,
                         const struct tolerance_request *request, struct promise *promise);

/* What is wrong with an array, as a problem; false unless it is sound.  what: "pair", "sample". */
bool api_results_check(const struct results *results, const char *name, const char *what,
                       struct problem *problem);

struct named_results {
    const char *name;
    struct results *results;
};

/* Whether this representation can be answered block by block: a .npz knows its sums at the end. */
bool api_can_stream(const struct representation *representation);
/* The headers of a binary answer whose arrays have their count and width; false: a problem. */
bool api_represent_headers(struct call *call, const struct named_results *arrays, size_t count);
/* What stands before the numbers of an array: the header of a .npy, or nothing; and its bytes. */
size_t api_prefix_size(const struct representation *representation);
/* In the call's arena; false: out of memory. */
bool api_prefix_piece(struct call *call, const struct representation *representation,
                      const struct results *results, struct piece *piece);

/* Binary answers: the body and its headers, call->out without its arrays among them. */
bool api_answer_arrays(struct call *call, const struct representation *representation,
                       const struct named_results *arrays, size_t count);

#endif
