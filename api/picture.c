#include "picture.h"

#include "text.h"

#include <math.h>
#include <stdio.h>

enum { STEPS = 356, WIDTH = 760, PANEL = 230, LEFT = 60, RIGHT = 20, TOP = 34, INNER = 170 };
enum { VIEWS = 3 };
static const double view_degrees[VIEWS] = {10, 40, 70};
static const char *const colours[3] = {"#c22", "#191", "#22c"};

/* fr cos theta_i of source and fit for one wo; NAN where there are no data. */
struct lobe {
    double source[3][STEPS], fit[3][STEPS];
};

static double angle(int i)
{
    return (-89 + 0.5 * i) * FACET_PI / 180;
}

static facet_status ask(const facet_fit_source *source, const facet_fit_candidate *candidate,
                        double theta_o, struct lobe *lobe)
{
    double x[STEPS], z[STEPS], ox[STEPS], oz[STEPS], zero[STEPS] = {0};
    bool valid[STEPS];
    for (int i = 0; i < STEPS; i++) {
        x[i] = sin(angle(i)), z[i] = cos(angle(i));
        ox[i] = -sin(theta_o), oz[i] = cos(theta_o);
    }
    facet_vec3_in wi = {x, zero, z}, wo = {ox, zero, oz};
    double *const fr[3] = {lobe->source[0], lobe->source[1], lobe->source[2]};
    facet_status status = source->evaluate(source->user, wi, wo, STEPS, fr, valid);
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < STEPS; i++)
            lobe->source[c][i] = valid[i] ? lobe->source[c][i] * z[i] : NAN;
    if (status || !candidate) return status;
    facet_brdf *brdf;
    facet_outputs outputs = {0};
    size_t channels = candidate->material.fresnel.channels;
    for (size_t c = 0; c < channels; c++) outputs.of[FACET_FR_COS][c] = lobe->fit[c];
    status = facet_brdf_create(&candidate->material, &brdf);
    if (status) return status;
    status = facet_eval(brdf, FACET_PRECISE, wi, wo, STEPS, &outputs);
    facet_brdf_destroy(brdf);
    for (int c = 2; c >= 0; c--) {
        double kd = candidate->has_diffuse ? candidate->diffuse[c] : 0;
        for (int i = 0; i < STEPS; i++)
            lobe->fit[c][i] = (1 - kd) * lobe->fit[channels == 3 ? c : 0][i] + kd / FACET_PI * z[i];
    }
    return status;
}

/* log10 of the largest value, rounded up; five decades are shown. */
static int top_decade(const struct lobe *lobe)
{
    double most = 1e-3;
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < STEPS; i++)
            if (lobe->source[c][i] > most) most = lobe->source[c][i];
    return (int)ceil(log10(fmin(most, 1e9)));
}

static void curve(struct text *t, const double *y, int top, int base, const char *style)
{
    bool open = false;
    for (int i = 0; i < STEPS; i++) {
        if (!isfinite(y[i])) {
            if (open) api_text_print(t, "\" %s/>\n", style);
            open = false;
            continue;
        }
        double level = fmax(0, fmin(1, (log10(fmax(y[i], 1e-30)) - top + 5) / 5));
        double px = LEFT + (double)(WIDTH - LEFT - RIGHT) * i / (STEPS - 1);
        if (!open) api_text_put(t, "<polyline fill=\"none\" points=\"");
        api_text_print(t, "%.1f,%.1f ", px, base - level * INNER);
        open = true;
    }
    if (open) api_text_print(t, "\" %s/>\n", style);
}

static void panel(struct text *t, const struct lobe *lobe, bool has_fit, double degrees, int offset)
{
    int top = top_decade(lobe), base = offset + TOP + INNER;
    api_text_print(t,
                   "<text x=\"%d\" y=\"%d\">theta_o = %g degrees: f_r cos theta_i over theta_i, "
                   "-89 to 89 degrees</text>\n",
                   LEFT, offset + TOP - 10, degrees);
    for (int k = 0; k <= 5; k++) {
        int y = base - k * INNER / 5;
        api_text_print(t,
                       "<line x1=\"%d\" x2=\"%d\" y1=\"%d\" y2=\"%d\" stroke=\"#ccc\"/>"
                       "<text x=\"%d\" y=\"%d\" text-anchor=\"end\">1e%d</text>\n",
                       LEFT, WIDTH - RIGHT, y, y, LEFT - 6, y + 4, top - 5 + k);
    }
    for (int c = 0; c < 3; c++) {
        char style[80];
        snprintf(style, sizeof style, "stroke=\"%s\" stroke-width=\"1\"", colours[c]);
        curve(t, lobe->source[c], top, base, style);
        snprintf(style, sizeof style, "stroke=\"%s\" stroke-width=\"1.5\" stroke-dasharray=\"5 4\"",
                 colours[c]);
        if (has_fit) curve(t, lobe->fit[c], top, base, style);
    }
}

bool api_picture(struct call *call, const facet_fit_source *source, const facet_fit *fit,
                 const facet_fit_candidate *candidate)
{
    struct text text = api_text(call->arena);
    struct lobe *lobe = api_arena_alloc(call->arena, sizeof *lobe);
    size_t size;
    if (!lobe) return api_problem_memory(call->problem);
    if (!source->evaluate)
        return api_problem(call->problem, 422,
                           "samples are scattered: there is no lobe to draw; ask for JSON");
    api_text_print(&text,
                   "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
                   "font-family=\"sans-serif\" font-size=\"12\">\n"
                   "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
                   WIDTH, VIEWS * PANEL + 30);
    for (int v = 0; v < VIEWS; v++) {
        facet_status status = ask(source, candidate, view_degrees[v] * FACET_PI / 180, lobe);
        if (status) return api_problem_status(call->problem, status, NULL);
        panel(&text, lobe, candidate != NULL, view_degrees[v], v * PANEL);
    }
    if (candidate)
        api_text_print(&text,
                       "<text x=\"%d\" y=\"%d\">solid: source; dashed: fit, rms_log %.3g, "
                       "%zu bytes</text>\n</svg>\n",
                       LEFT, VIEWS * PANEL + 18, candidate->error.rms_log, candidate->bytes);
    else
        api_text_print(&text,
                       "<text x=\"%d\" y=\"%d\">source; none of %zu candidates fits</text>\n"
                       "</svg>\n",
                       LEFT, VIEWS * PANEL + 18, fit->count);
    char *bytes = api_text_take(&text, &size);
    return bytes ? api_answer_raw(call, PICTURE_TYPE, bytes, size)
                 : api_problem_memory(call->problem);
}
