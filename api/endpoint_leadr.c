/* POST /v1/leadr: a displacement, normal or slope map to slope moments for every distance (Dupuy
 * chapter 3). */
#include "endpoint.h"
#include "leadr_answer.h"
#include "limits.h"
#include "material.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(LIMIT_MAP_PIXELS == FACET_MAP_PIXELS_MAX, "the map is checked in lib");
_Static_assert(LIMIT_MAP_SIDE == FACET_MAP_SIDE_MAX, "the map is checked in lib");

/* Of a texel: "u,v", as a query can hold it, or [u,v]. */
struct texel_place {
    int form;
    const char *text;
    struct numbers uv;
};

struct leadr_request {
    struct matrix heights;
    const char *channel;
    struct texel_place at;
    int kind, encoding, stencil, border, y, type, form, model, compression, preview, base_ndf;
    bool force;
    int64_t level;
    double scale, texel, base_alpha, base_alpha_x, base_alpha_y, base_rho;
};

/* The distributions a base may have, by api_ndf_names. */
static const char *const base_ndfs[] = {"beckmann", "ggx", NULL};

#define M(member) MEMBER(struct leadr_request, member)
#define ALPHA .min = FACET_ALPHA_MIN, .max = FACET_ALPHA_MAX

#define PLACE_DOC                                                                                  \
    " in [0, 1): answer JSON with the material of the texel there; u to the right, v down the rows"

static const struct field place_forms[] = {
    {MEMBER(struct texel_place, text), FIELD_TEXT, .doc = "\"u,v\"" PLACE_DOC},
    {MEMBER(struct texel_place, uv), FIELD_NUMBERS, .min = 0, .max = 1, .open_max = true,
     .min_items = 2, .max_items = 2},
    {0},
};

static const struct field request_fields[] = {
    {M(heights), FIELD_MATRIX,
     .doc = "rows of heights from the top, in a JSON body; else the body is an EXR or PNG file"},
    {M(kind), FIELD_ENUM, FIELD_DEFAULT, .names = api_leadr_kinds, .doc = "what the map holds"},
    {M(channel), FIELD_TEXT,
     .doc =
         "channel of the heights; default: the only one, else the first of height, displacement, "
         "Y, R, Z of an EXR, and the value all channels of a PNG share. Of a normal map three, "
         "of a slope map two, as \"nx,ny,nz\"; default: R,G,B or X,Y,Z or x,y,z (slopes also "
         "E1,E2)"},
    {M(encoding), FIELD_ENUM, .names = api_leadr_encodings,
     .doc = "of normals and slopes: signed, as they are; unorm, 2c - 1; unorm_mid, the same with "
            "the middle code (128 of 255, 32768 of 65535) for 0; unorm_xy, 2c - 1 but z as it is. "
            "Default: signed for half and float, else unorm. Normals need no unit length"},
    {M(scale), FIELD_NUMBER, FIELD_DEFAULT, .min = -1e12, .max = 1e12, .initial = 1,
     .doc = "multiplies the heights, or the slopes; heights of a PNG lie in [0, 1]"},
    {M(texel), FIELD_NUMBER, .min = 0, .max = 1e12, .open_min = true,
     .doc = "edge of a (square) texel in the unit of the scaled heights; default 1/width: the map "
            "is 1 wide. Not of slopes"},
    {M(stencil), FIELD_ENUM, FIELD_DEFAULT, .names = api_stencils, .initial = FACET_BILINEAR,
     .doc = "slopes from heights: central differences, forward differences, or the exact moments "
            "of the bilinear surface through the texels. The last two describe the cell right of "
            "and below a texel's centre"},
    {M(border), FIELD_ENUM, FIELD_DEFAULT, .names = api_borders,
     .doc = "beyond the edge: the opposite edge, a parabola through the last three texels, the "
            "reflected map, or nothing (the result is smaller by the stencil's reach)"},
    {M(y), FIELD_ENUM, FIELD_DEFAULT, .names = api_y_directions,
     .doc = "which way +y points: down the rows, or up; of normals and slopes it is the map's own "
            "and only noted"},
    {M(base_alpha), FIELD_NUMBER, .min = 0, .max = FACET_ALPHA_MAX,
     .doc = "isotropic roughness below the map, added to the moments; none by default"},
    {M(base_alpha_x), FIELD_NUMBER, ALPHA, .doc = "the same, anisotropic, with base_alpha_y"},
    {M(base_alpha_y), FIELD_NUMBER, ALPHA, .doc = "the same, anisotropic, with base_alpha_x"},
    {M(base_rho), FIELD_NUMBER, .min = -FACET_RHO_MAX, .max = FACET_RHO_MAX,
     .doc = "correlation of its slopes, with base_alpha_x and base_alpha_y; 0 by default"},
    {M(base_ndf), FIELD_ENUM, FIELD_DEFAULT, .names = base_ndfs,
     .doc = "distribution of the roughness below; ggx enters by the Beckmann roughness nearest to "
            "it, 1.113287 times as rough"},
    {M(model), FIELD_ENUM, FIELD_DEFAULT, .names = api_models,
     .doc = "what is stored: leadr, five moments; clean, three, of an isotropic lobe with the mean "
            "of the squared principal alphas; clean_max, with the larger one"},
    {M(type), FIELD_ENUM, FIELD_DEFAULT, .names = api_storages,
     .doc = "what the moments are stored as"},
    {M(form), FIELD_ENUM, FIELD_DEFAULT, .names = api_forms,
     .doc =
         "raw: E1..E5, of CLEAN E1, E2, E3; central: E1, E2 and the covariance V11, V22, V12, of "
         "CLEAN E1, E2, A2, which loses less"},
    {M(force), FIELD_BOOL, FIELD_MAY, .doc = "store half even where it loses variance"},
    {M(compression), FIELD_ENUM, FIELD_DEFAULT, .names = api_compressions, .initial = EXR_ZIP,
     .doc = "of the EXR answered; tiles that do not shrink are stored as they are"},
    {M(at), FIELD_UNION, .fields = place_forms,
     .doc =
         "[u,v] or \"u,v\" in [0, 1): answer JSON with the material of the texel there; u to the "
         "right, v down the rows"},
    {M(level), FIELD_INTEGER, .min = 0, .max = FACET_MAP_LEVELS_MAX - 1,
     .doc = "of the texel at `at`, or of the preview; 0 by default"},
    {M(preview), FIELD_ENUM, .names = api_previews,
     .doc = "answer a PNG of one level: roughness (sqrt(V11 + V22) over the largest of the level, "
            "which the header Facet-Preview-Range states), the mean normal (n/2 + 1/2), or "
            "anisotropy (hue: direction of the larger alpha, saturation: 1 - alpha_2/alpha_1)"},
    {0},
};

/* ---- Options ------------------------------------------------------------------------------- */

static bool given(double x)
{
    return !isnan(x);
}

static bool take_base(struct call *call, const struct leadr_request *in, struct leadr_work *work)
{
    const struct place x = {NULL, "base_alpha_x", 0}, y = {NULL, "base_alpha_y", 0},
                       alpha = {NULL, "base_alpha", 0}, ndf = {NULL, "base_ndf", 0};
    const bool pair = given(in->base_alpha_x) || given(in->base_alpha_y) || given(in->base_rho);
    if (pair && !given(in->base_alpha_x))
        return api_problem_at(call->problem, &x, "is required with base_alpha_y and base_rho");
    if (pair && !given(in->base_alpha_y))
        return api_problem_at(call->problem, &y, "is required with base_alpha_x");
    if (pair && given(in->base_alpha))
        return api_problem_at(call->problem, &alpha, "is given beside base_alpha_x");
    const bool ggx = in->base_ndf == 1;
    const double factor = ggx ? FACET_BECKMANN_OF_GGX : 1;
    const double isotropic = given(in->base_alpha) ? in->base_alpha : 0;
    work->base_alpha[0] = factor * (pair ? in->base_alpha_x : isotropic);
    work->base_alpha[1] = factor * (pair ? in->base_alpha_y : isotropic);
    work->base_rho = given(in->base_rho) ? in->base_rho : 0;
    if (ggx && !pair && !given(in->base_alpha))
        return api_problem_at(call->problem, &ndf,
                              "\"ggx\" needs base_alpha, or base_alpha_x and base_alpha_y");
    const facet_roughness r = {
        .alpha_x = work->base_alpha[0], .alpha_y = work->base_alpha[1], .rho = work->base_rho};
    work->options.base = facet_covariance_from_roughness(&r);
    if (ggx && r.alpha_x > 0)
        work->base_note = "the GGX base enters as the Beckmann roughness nearest to it";
    return true;
}

static bool take_options(struct call *call, const struct leadr_request *in, struct leadr_work *work)
{
    const struct place texel = {NULL, "texel", 0};
    const bool slopes = work->map.kind != LEADR_DISPLACEMENT;
    if (slopes && given(in->texel))
        return api_problem_at(call->problem, &texel,
                              "is of displacement maps: slopes have no unit");
    work->options = (facet_leadr_options){
        .stencil = (facet_stencil)in->stencil,
        .border = (facet_border)in->border,
        .y_up = in->y == 1,
        .scale = in->scale,
        .texel = given(in->texel) ? in->texel : 1.0 / (double)work->map.width,
        .storage = (facet_storage)in->type,
        .form = (facet_moment_form)in->form,
        .model = (facet_moment_model)in->model,
    };
    work->compression = (enum exr_compression)in->compression;
    return take_base(call, in, work);
}

/* "u,v" */
static bool read_place(const char *text, double at[2])
{
    char *end = NULL;
    at[0] = strtod(text, &end);
    if (end == text || *end != ',') return false;
    const char *second = end + 1;
    at[1] = strtod(second, &end);
    return end != second && !*end && at[0] >= 0 && at[0] < 1 && at[1] >= 0 && at[1] < 1;
}

static bool take_place(struct call *call, const struct leadr_request *in, struct leadr_work *work)
{
    const struct place at = {NULL, "at", 0}, level = {NULL, "level", 0};
    work->level = in->level;
    work->preview = in->preview;
    if (in->at.form < 0) {
        if (in->level >= 0 && in->preview < 0)
            return api_problem_at(call->problem, &level, "needs at or preview");
        if (work->level < 0 && in->preview >= 0) work->level = 0;
        return true;
    }
    if (in->preview >= 0) return api_problem_at(call->problem, &at, "is given beside preview");
    if (work->level < 0) work->level = 0;
    if (in->at.uv.values) {
        memcpy(work->at, in->at.uv.values, sizeof work->at);
        return true;
    }
    if (read_place(in->at.text, work->at)) return true;
    return api_problem_at(call->problem, &at,
                          "\"%.60s\" is not u,v with both in [0, 1), like 0.5,0.25", in->at.text);
}

static bool check_level(struct call *call, struct leadr_work *work)
{
    const struct place level = {NULL, "level", 0};
    facet_leadr_summary sizes;
    const facet_status status = facet_leadr_sizes(&work->map.source, &work->options, &sizes);
    if (status != FACET_OK || work->level < (int64_t)sizes.level_count) return true;
    return api_problem_at(call->problem, &level, "%lld is outside [0, %zu], the levels of this map",
                          (long long)work->level, sizes.level_count - 1);
}

/* ---- Answer ---------------------------------------------------------------------------------- */

static bool answer(struct call *call, const struct leadr_request *in, struct leadr_work *work)
{
    const char *type = api_answer_type(call, in->preview >= 0 ? API_PNG_TYPE
                                             : call->medium && in->at.form < 0
                                                 ? API_EXR_TYPE
                                                 : "application/json");
    if (in->at.form >= 0)
        return api_leadr_json(call, work) && api_leadr_loss_check(call, work, in->force);
    if (!strcmp(type, API_PNG_TYPE) || in->preview >= 0) {
        if (work->preview < 0) work->preview = PREVIEW_ROUGHNESS;
        if (work->level < 0) work->level = 0;
        return api_leadr_picture(call, work);
    }
    if (!strcmp(type, API_EXR_TYPE)) return api_leadr_exr(call, work, in->force);
    return api_leadr_json(call, work) && api_leadr_loss_check(call, work, in->force);
}

static bool handle(struct call *call)
{
    const struct leadr_request *in = call->in;
    struct leadr_work work = {.level = -1};
    struct api_trace *trace = &call->response->trace;
    double start = api_clock();
    bool ok = take_place(call, in, &work) &&
              api_leadr_map_read(call, (enum leadr_kind)in->kind, in->channel, in->encoding,
                                 &in->heights, &work.map);
    trace->decode_us += api_clock() - start;
    start = api_clock();
    if (ok) {
        ok = take_options(call, in, &work) && check_level(call, &work) && answer(call, in, &work);
        trace->evaluations = work.map.width * work.map.height;
    }
    trace->compute_us += api_clock() - start;
    api_leadr_map_clear(&work.map);
    return ok;
}

static const char *const answers[] = {API_EXR_TYPE, API_PNG_TYPE, NULL};

const struct endpoint api_endpoint_leadr = {
    .method = "POST",
    .path = "/v1/leadr",
    .summary = "Slope moments of a displacement, normal or slope map, for every distance",
    .doc = "Body: an EXR or PNG map with the options in the query (answered by default with one "
           "tiled MIP-mapped EXR of E1..E5), or JSON heights (answered with JSON). With `at` the "
           "material of one texel, with `preview` a picture of one level.",
    .request = request_fields,
    .request_size = sizeof(struct leadr_request),
    .response = api_leadr_fields,
    .response_size = sizeof(struct leadr_out),
    .bodies = api_leadr_media,
    .answers = answers,
    .is_long = true,
    .example = "{\"heights\":[[0,1,0,1],[1,0,2,0],[0,1,0,1],[1,0,1,0]],\"scale\":0.1,"
               "\"border\":\"clamp\",\"stencil\":\"bilinear\"}",
    .handle = handle,
};
