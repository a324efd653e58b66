#include "sample_floats.h"

#include "diffuse.h"

#include <string.h>

struct columns {
    float wo[3][SAMPLE_FLOATS_MAX], u[2][SAMPLE_FLOATS_MAX], wi[3][SAMPLE_FLOATS_MAX],
        h[3][SAMPLE_FLOATS_MAX];
    float weight[3][SAMPLE_FLOATS_MAX], pdf[SAMPLE_FLOATS_MAX];
};

bool api_takes_float_samples(const struct float_samples *job, enum results_format format)
{
    return format == RESULTS_FLOAT32 && job->tier != FACET_PRECISE &&
           api_surface_takes_floats(job->surface) && job->u->floats && !job->pairing->outer &&
           api_plan_is_float(job->wo);
}

static void fill(const struct float_samples *job, size_t start, size_t n, struct columns *c)
{
    const char *u = job->u->floats;
    bool one_wo = job->pairing->first == 1, one_u = job->pairing->second == 1;
    api_plan_fill_floats(job->wo, one_wo ? 0 : start, one_wo ? 1 : n, c->wo[0], c->wo[1], c->wo[2]);
    for (size_t i = 1; one_wo && i < n; i++)
        for (int k = 0; k < 3; k++) c->wo[k][i] = c->wo[k][0];
    for (size_t i = 0; i < n; i++) {
        float pair[2];
        memcpy(pair, u + (one_u ? 0 : start + i) * sizeof pair, sizeof pair);
        c->u[0][i] = pair[0];
        c->u[1][i] = pair[1];
    }
}

static void add(struct results *r, float *const columns[], size_t n)
{
    size_t size = api_results_room(r, n);
    char *bytes = api_text_reserve(&r->text, size);
    r->count += n;
    if (!bytes) return; /* the text remembers */
    api_results_write_floats(r->width, columns, n, bytes);
    api_text_commit(&r->text, size);
}

bool api_add_float_samples(struct float_samples *job, size_t start, size_t n)
{
    struct columns c;
    size_t channels = job->surface->channels;
    facet_samples_float samples = {.wi = {c.wi[0], c.wi[1], c.wi[2]},
                                   .pdf = job->pdf ? c.pdf : NULL};
    if (job->h) samples.h = (facet_vec3_out_float){c.h[0], c.h[1], c.h[2]};
    for (size_t k = 0; k < channels && job->weight; k++) samples.weight[k] = c.weight[k];
    fill(job, start, n, &c);
    if (facet_sample_float(job->surface->brdf, job->tier, job->sampler,
                           (facet_vec3_in_float){c.wo[0], c.wo[1], c.wo[2]}, c.u[0], c.u[1], n,
                           &samples))
        return false;
    bool sound = !job->pdf || api_floats_are_sound(c.pdf, n);
    for (size_t k = 0; k < 3; k++) {
        sound = sound && api_floats_are_sound(c.wi[k], n) &&
                (!job->h || api_floats_are_sound(c.h[k], n));
        if (job->weight && k < channels) sound = sound && api_floats_are_sound(c.weight[k], n);
    }
    if (!sound) return false;
    for (size_t i = 0; i < n; i++) job->wasted += !(c.wi[2][i] > 0);
    float *pdf[3] = {c.pdf, c.pdf, c.pdf}, *weight[3], *wi[3] = {c.wi[0], c.wi[1], c.wi[2]},
          *h[3] = {c.h[0], c.h[1], c.h[2]};
    for (size_t k = 0; k < 3; k++) weight[k] = c.weight[k < channels ? k : 0];
    if (job->wi) add(job->wi, wi, n);
    if (job->weight) add(job->weight, weight, n);
    if (job->pdf) add(job->pdf, pdf, n);
    if (job->h) add(job->h, h, n);
    return true;
}
