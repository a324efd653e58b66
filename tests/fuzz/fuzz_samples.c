/* JSON samples, through the decoder's table. */
#include "opened.h"

#include "json.h"
#include "samples.h"

struct holder {
    struct samples *samples;
};

static const struct field fields[] = {
    {MEMBER(struct holder, samples), FIELD_OPTION, FIELD_MUST, .fields = api_samples_fields,
     .size = sizeof(struct samples)},
    {0},
};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct arena arena;
    struct problem problem = {0};
    struct document document = {0};
    struct holder holder = {0};
    struct measurement m;
    static bool is_open;
    if (!is_open) is_open = api_open();
    api_arena_open(&arena, (size_t)1 << 28);
    struct decoder decoder = {.arena = &arena, .problem = &problem};
    struct place place = {NULL, "samples", 0};
    api_field_clear(fields, &holder);
    if (api_json_read(data, size, &arena, &problem, &document) &&
        api_decode(document.root, fields, &holder, NULL, &decoder) &&
        api_samples_open(holder.samples, &place, &decoder, &m))
        fuzz_ask(&m.source);
    else if (!problem.status)
        abort();
    json_decref(document.root);
    api_arena_close(&arena);
    return 0;
}
