/* leadr_exr.c - a filtered map as one EXR file that a stranger can read. */
#include "leadr_answer.h"

#include <stdio.h>
#include <string.h>

static const char comments[] =
    "Slope moments (Dupuy 2015, chapter 3). Slopes are x = dz/dx, y = dz/dy of the height z, "
    "without unit; x to the right, y as leadrY says. E1 = E[x], E2 = E[y], E3 = E[x^2], "
    "E4 = E[y^2], E5 = E[x y]; V11 = E3 - E1^2, V22 = E4 - E2^2, V12 = E5 - E1 E2. A Beckmann lobe "
    "has alpha_x^2 = 2 V11, alpha_y^2 = 2 V22, rho = V12 / sqrt(V11 V22), mean slope (E1, E2). "
    "Models clean and clean_max: E1, E2, A2 = alpha^2 or E3 = alpha^2 + E1^2 + E2^2 of an "
    "isotropic "
    "lobe. The base roughness is already in. Each level is the mean of its footprint of level 0. "
    "Heights were multiplied by leadrScale; leadrTexel is the edge of a texel in the same unit. "
    "Stencils forward and bilinear describe the cell right of and below a texel's centre. "
    "leadrVarianceError is the largest relative error of a level's mean variance made by storing.";

enum { WARNING_ROOM = 256, ATTRIBUTES = 24 };

struct header {
    struct exr_attribute list[ATTRIBUTES];
    size_t count;
    char source[96], warning[512];
};

static void text(struct header *h, const char *name, const char *value)
{
    h->list[h->count++] = (struct exr_attribute){name, value, 0};
}

static void number(struct header *h, const char *name, double value)
{
    h->list[h->count++] = (struct exr_attribute){name, NULL, value};
}

/* The header of the file; before the map is filtered with whatever stands for what is not known
 * yet: texts of the same length. */
static void describe_header(const struct leadr_work *work, bool filtered, struct header *h)
{
    static const char *const wraps[] = {"periodic", "clamp", "mirror", "clamp"};
    const facet_leadr_options *o = &work->options;
    const struct image *image = &work->map.planes[0];
    const bool displacement = work->map.kind == LEADR_DISPLACEMENT;
    const struct leadr_loss loss = api_leadr_loss(&work->summary);
    h->count = 0;
    memset(h->warning, 0, sizeof h->warning);
    if (filtered) api_leadr_warning(work, h->warning, sizeof h->warning);
    for (size_t n = strlen(h->warning); n < WARNING_ROOM; n++) h->warning[n] = ' ';
    h->warning[WARNING_ROOM] = 0;
    snprintf(h->source, sizeof h->source, "%s %s", *image->type ? image->type : "JSON",
             image->channel);
    text(h, "software", "facetd " FACET_VERSION);
    text(h, "comments", comments);
    text(h, "wrapmodes", displacement ? wraps[o->border] : "clamp");
    text(h, "leadrKind", api_leadr_kinds[work->map.kind]);
    text(h, "leadrModel", api_models[o->model]);
    text(h, "leadrForm", api_forms[o->form]);
    text(h, "leadrY", api_y_directions[o->y_up]);
    text(h, "leadrSource", h->source);
    text(h, "leadrWarning", h->warning);
    text(h, "leadrBase", work->base_note ? work->base_note : "");
    number(h, "leadrScale", o->scale);
    number(h, "leadrBaseAlpha", work->base_alpha[0]);
    number(h, "leadrBaseAlphaY", work->base_alpha[1]);
    number(h, "leadrBaseRho", work->base_rho);
    number(h, "leadrVarianceError", loss.level);
    number(h, "leadrVarianceErrorOfTexel", loss.texel);
    number(h, "leadrTexelsLost", (double)loss.lost);
    if (!displacement) {
        text(h, "leadrEncoding", api_leadr_encodings[work->map.encoding]);
        return;
    }
    text(h, "leadrStencil", api_stencils[o->stencil]);
    text(h, "leadrBorder", api_borders[o->border]);
    number(h, "leadrTexel", o->texel);
    number(h, "leadrCentralOverForward", api_leadr_ratio(&work->summary, FACET_CENTRAL));
    number(h, "leadrBilinearOverForward", api_leadr_ratio(&work->summary, FACET_BILINEAR));
}

static bool begin_rows(void *writer, size_t level, size_t first, size_t count)
{
    return api_exr_writer_begin(writer, level, first, count);
}

static bool put_row(void *writer, size_t level, size_t row,
                    const float *const plane[FACET_PLANES_MAX])
{
    api_exr_writer_put(writer, level, row, plane);
    return true;
}

static bool end_rows(void *writer, size_t level, size_t first, size_t count)
{
    api_exr_writer_end(writer, level, first, count);
    return true;
}

static bool refuse_exr(struct call *call, const struct image_problem *problem)
{
    if (problem->status == IMAGE_NO_MEMORY) return api_problem_memory(call->problem);
    return api_problem(call->problem, 500, "%s", problem->text);
}

static void describe_pyramid(const struct leadr_work *work, const facet_leadr_summary *sizes,
                             struct exr_pyramid *pyramid)
{
    static const char *const names[FACET_MOMENT_FORM_COUNT][2][FACET_PLANES_MAX] = {
        {{"E1", "E2", "E3", "E4", "E5"}, {"E1", "E2", "E3"}},
        {{"E1", "E2", "V11", "V22", "V12"}, {"E1", "E2", "A2"}}};
    *pyramid = (struct exr_pyramid){
        .level_count = sizes->level_count,
        .widths = sizes->width,
        .heights = sizes->height,
        .plane_count = sizes->plane_count,
        .half = work->options.storage == FACET_HALF,
        .compression = work->compression,
    };
    for (size_t k = 0; k < sizes->plane_count; k++)
        pyramid->names[k] = names[work->options.form][work->options.model != FACET_LEADR][k];
}

bool api_leadr_exr(struct call *call, struct leadr_work *work, bool force)
{
    facet_leadr_summary sizes;
    /* Wrong sizes: the filter says what of them. */
    if (facet_leadr_sizes(&work->map.source, &work->options, &sizes) != FACET_OK)
        return api_leadr_filter(call, work, NULL);
    struct exr_pyramid pyramid;
    struct image_problem problem = {0};
    struct header header;
    void *bytes = NULL;
    size_t size = 0;
    facet_crew crew;
    describe_pyramid(work, &sizes, &pyramid);
    pyramid.crew = api_leadr_crew(call, &crew);
    describe_header(work, false, &header);
    struct exr_writer *writer = api_exr_writer_open(&pyramid, header.list, header.count, &problem);
    if (!writer) return refuse_exr(call, &problem);
    const facet_leadr_sink sink = {put_row, writer, begin_rows, end_rows};
    bool ok = api_leadr_filter(call, work, &sink) && api_leadr_loss_check(call, work, force);
    if (ok) {
        describe_header(work, true, &header);
        ok = api_exr_writer_finish(writer, header.list, header.count, &bytes, &size, &problem) ==
                 IMAGE_OK ||
             refuse_exr(call, &problem);
    }
    api_exr_writer_close(writer);
    return ok && api_answer_raw(call, API_EXR_TYPE, bytes, size);
}
