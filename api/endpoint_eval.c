/* POST /v1/eval: quantities of pairs of directions. */
#include "endpoint.h"
#include "evaluate.h"
#include "sampler.h"

#include <string.h>

struct eval_request {
    struct material material;
    struct pair_request pairs;
    struct tolerance_request accuracy;
    uint32_t outputs;
    int64_t channels;
    bool flat;
    int sampler, dtype;
};

struct eval_response {
    struct text *of[FACET_QUANTITY_COUNT];
    const char *sampler; /* NULL: no pdf */
    int64_t count;
    struct accuracy accuracy;
};

static const char *const quantity_names[] = {
#define QUANTITY(id, name, coloured, doc) name,
#include "quantities.def"
#undef QUANTITY
    NULL,
};

static const struct field request_fields[] = {
    MATERIAL_FIELD(struct eval_request),
    PAIR_FIELDS(struct eval_request),
    {MEMBER(struct eval_request, outputs), FIELD_SET, FIELD_DEFAULT, .names = quantity_names,
     .initial = 1 << FACET_FR, .doc = "what to compute"},
    SAMPLER_FIELD(struct eval_request, "whose density pdf is, where outputs has pdf"),
    CHANNELS_FIELD(struct eval_request),
    FLAT_FIELD(struct eval_request),
    DTYPE_FIELD(struct eval_request),
    TOLERANCE_FIELDS(struct eval_request),
    {0},
};

static const struct field response_fields[] = {
#define QUANTITY(id, name_, coloured, doc_)                                                        \
    {.name = name_,                                                                                \
     .offset = offsetof(struct eval_response, of[FACET_##id]),                                     \
     .type = FIELD_PRINTED,                                                                        \
     .width = (coloured) ? 0 : 1,                                                                  \
     .doc = doc_},
#include "quantities.def"
#undef QUANTITY
    {MEMBER(struct eval_response, sampler), FIELD_TEXT,
     .doc = "the method that pdf belongs to, if it was asked for"},
    COUNT_FIELD(struct eval_response),
    ACCURACY_FIELD(struct eval_response),
    {0},
};

static bool handle(struct call *call)
{
    const struct eval_request *in = call->in;
    struct eval_response *out = call->out;
    struct evaluation evaluation = {
        .material = &in->material,
        .pairs = &in->pairs,
        .accuracy = &in->accuracy,
        .outputs = in->outputs,
        .channels = in->channels,
        .flat = in->flat,
        .dtype = in->dtype,
    };
    const bool asks_pdf = in->outputs >> FACET_PDF & 1;
    if (!api_sampler(in->sampler, asks_pdf, &in->material, call->problem, &evaluation.sampler) ||
        !api_evaluate(call, &evaluation))
        return false;
    out->sampler = asks_pdf ? api_sampler_names[evaluation.sampler] : NULL;
    memcpy(out->of, evaluation.of, sizeof out->of);
    out->count = (int64_t)evaluation.count;
    out->accuracy = evaluation.answer;
    return api_answer_evaluation(call, &evaluation);
}

const struct endpoint api_endpoint_eval = {
    .method = "POST",
    .path = "/v1/eval",
    .summary = "Evaluate a BRDF and its factors for pairs of directions",
    .request = request_fields,
    .request_size = sizeof(struct eval_request),
    .response = response_fields,
    .response_size = sizeof(struct eval_response),
    .answers = api_array_answers,
    .is_long = true,
    .grows_by_words = true,
    .example = "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wi\":[[0.6,0,0.8]],"
               "\"wo\":[[-0.6,0,0.8]],\"tolerance\":1e-12}",
    .handle = handle,
};
