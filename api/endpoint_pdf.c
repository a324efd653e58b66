/* POST /v1/pdf: the density with which a sampler produces wi from wo. */
#include "endpoint.h"
#include "evaluate.h"
#include "sampler.h"

struct pdf_request {
    struct material material;
    struct pair_request pairs;
    struct tolerance_request accuracy;
    int sampler, dtype;
};

struct pdf_response {
    struct text *pdf;
    const char *sampler;
    int64_t count;
    struct accuracy accuracy;
};

static const struct field request_fields[] = {
    MATERIAL_FIELD(struct pdf_request),
    PAIR_FIELDS(struct pdf_request),
    SAMPLER_FIELD(struct pdf_request, "whose density"),
    DTYPE_FIELD(struct pdf_request),
    TOLERANCE_FIELDS(struct pdf_request),
    {0},
};

static const struct field response_fields[] = {
    {MEMBER(struct pdf_response, pdf), FIELD_PRINTED, FIELD_MUST, .width = 1,
     .doc = "density of wi, per steradian"},
    {MEMBER(struct pdf_response, sampler), FIELD_TEXT, FIELD_MUST,
     .doc = "the method it belongs to"},
    COUNT_FIELD(struct pdf_response),
    ACCURACY_FIELD(struct pdf_response),
    {0},
};

static bool handle(struct call *call)
{
    const struct pdf_request *in = call->in;
    struct pdf_response *out = call->out;
    struct evaluation evaluation = {
        .material = &in->material,
        .pairs = &in->pairs,
        .accuracy = &in->accuracy,
        .outputs = 1 << FACET_PDF,
        .channels = -1,
        .dtype = in->dtype,
    };
    if (!api_sampler(in->sampler, true, &in->material, call->problem, &evaluation.sampler) ||
        !api_evaluate(call, &evaluation))
        return false;
    out->sampler = api_sampler_names[evaluation.sampler];
    out->pdf = evaluation.of[FACET_PDF];
    out->count = (int64_t)evaluation.count;
    out->accuracy = evaluation.answer;
    return api_answer_evaluation(call, &evaluation);
}

const struct endpoint api_endpoint_pdf = {
    .method = "POST",
    .path = "/v1/pdf",
    .summary = "Density of the directions a sampler produces",
    .request = request_fields,
    .request_size = sizeof(struct pdf_request),
    .response = response_fields,
    .response_size = sizeof(struct pdf_response),
    .answers = api_array_answers,
    .is_long = true,
    .grows_by_words = true,
    .example = "{\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3},\"wi\":[[0.6,0,0.8]],"
               "\"wo\":[[-0.6,0,0.8]]}",
    .handle = handle,
};
