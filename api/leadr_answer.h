/* leadr_answer.h - a filtered map as JSON, as an EXR file, or as a picture. */
#ifndef LEADR_ANSWER_H
#define LEADR_ANSWER_H

#include "exr.h"
#include "leadr_map.h"

/* The words of the options, in the order of lib's enumerations. */
extern const char *const api_stencils[],
    *const api_borders[], *const api_storages[], *const api_forms[],
                                                     *const api_models[],
                                                         *const api_y_directions[],
                                                             *const api_previews[],
                                                                 *const api_compressions[];

enum leadr_preview { PREVIEW_ROUGHNESS, PREVIEW_NORMAL, PREVIEW_ANISOTROPY };

/* Levels of up to this many texels are printed whole. */
enum { LEADR_SHOWN_TEXELS = 16 };

struct leadr_work {
    struct leadr_map map;
    facet_leadr_options options;
    facet_leadr_summary summary;
    const char *base_note;          /* what was made of the base; NULL: nothing to say */
    double base_alpha[2], base_rho; /* as Beckmann */
    enum exr_compression compression;
    /* One texel to be looked at, or no level. */
    double at[2];
    int64_t level; /* of the texel or of the picture; -1: none */
    int preview;   /* -1: none */
};

/* Filter for one of the answers, and answer.  False: call->problem is set. */
bool api_leadr_json(struct call *call, struct leadr_work *work);
bool api_leadr_exr(struct call *call, struct leadr_work *work, bool force);
bool api_leadr_picture(struct call *call, struct leadr_work *work);

/* The server's other threads, or NULL; *crew is to live as long. */
const facet_crew *api_leadr_crew(const struct call *call, facet_crew *crew);

/* Run lib's filter; false: call->problem is set. */
bool api_leadr_filter(struct call *call, struct leadr_work *work, const facet_leadr_sink *sink);

/* What the stored form loses: of a level's variance at worst, and texels that lose all. */
struct leadr_loss {
    double level, texel; /* relative */
    size_t lost;
};
struct leadr_loss api_leadr_loss(const facet_leadr_summary *summary);
/* What to beware of; "" where there is nothing. */
void api_leadr_warning(const struct leadr_work *work, char *out, size_t room);
/* The variance a stencil sees of the whole map over that of forward differences; NaN: none. */
double api_leadr_ratio(const facet_leadr_summary *summary, facet_stencil stencil);
/* Refuses half that loses variance.  True: it does not, or force. */
bool api_leadr_loss_check(struct call *call, const struct leadr_work *work, bool force);

/* The JSON answer, by api_leadr_fields. */
struct leadr_material_out;
struct leadr_probe_out;

struct leadr_error_out {
    double level, texel;
    int64_t lost;
};

struct leadr_out {
    int64_t width, height;
    const char *channel, *sample, *base_note, *warning;
    int kind, encoding, stencil, border, y, type, form, model;
    double scale, texel, base_alpha, base_alpha_x, base_alpha_y, base_rho;
    struct list levels, stencils;
    struct numbers moments;
    struct leadr_error_out variance_error;
    struct leadr_material_out *material;
    struct leadr_probe_out *probe;
    bool floored;
};

extern const struct field api_leadr_fields[];

#endif
