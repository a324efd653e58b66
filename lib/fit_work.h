/*
 * fit_work.h - one fit on its way: what fit.c, fit_extract.c and fit_candidates.c share.
 */
#ifndef FACET_FIT_WORK_H
#define FACET_FIT_WORK_H

#include "fit_backscatter.h"
#include "fit_model.h"
#include "fit_pairs.h"
#include "fit_turn.h"

/* theta_d at every degree: the nodes of the Fresnel table. */
enum { FIT_DIFFERENCES = 90 };

/* u = 1/2 of the slope table lies at this many median slopes: both tails are then resolved. */
#define FIT_SCALE_PER_MEDIAN 1.5

/*
 * rms of log P about a model below which a slope distribution is that model's.
 */
#define FIT_PURE 1e-4

/* A Fresnel table ends at the horizon, where nothing can be asked: one node more. */
enum { FRESNEL_NODES = FIT_DIFFERENCES + 1 };

/* Fresnel tables: of each ndf, without and with a diffuse part, isotropic and not. */
enum { FRESNEL_TABLES = 4 * FACET_NDF_COUNT };

struct fit_owned {
    /* Each without and with a diffuse part. */
    facet_slope_table *table[2], *compact_table[2];
    facet_slope_table *turned_table[2], *compact_turned[2]; /* over the azimuth */
    double *turned_log_d[2];                                /* FACET_FIT_ROWS rows of nodes */
    double compact_turned_log_d[2][FACET_FIT_ROWS / 2][FACET_FIT_COMPACT + 1];
    double cos_theta_d[FRESNEL_NODES], fresnel[FRESNEL_TABLES][3][FRESNEL_NODES];
    double compact_cos[FRESNEL_NODES], compact_fresnel[FRESNEL_TABLES][3][FRESNEL_NODES];
    double compact_log_d[2][FACET_FIT_COMPACT + 1];
    double log_d[]; /* twice nodes */
};

struct fit_work {
    const facet_fit_source *source;
    const facet_fit_options *options;
    const facet_watch *watch;
    facet_fit *fit;
    struct fit_owned *owned;
    size_t nodes; /* of a slope table */
    struct fit_pairs pairs, thin, errors, backscatter;
    struct fit_density density[FACET_FIT_CONVENTION_COUNT];
    double pure[FACET_FIT_CONVENTION_COUNT][2]; /* rms of log P about GGX, Beckmann */
    struct fit_turn turn;
    bool anisotropic, has_turn;
    facet_roughness roughness; /* anisotropic: of the best model so far */
    double best_cost;          /* and what it leaves */
    facet_fit_spread spread;   /* of samples; else no end of pairs */
    size_t nodes_told;    /* groups of theta_d with pairs: what a Fresnel table has of its own */
    double round_cost[2]; /* of this ndf's isotropic models, without and with a diffuse part */
    bool elongated;       /* the anisotropic model leaves less than half of its error */
    double values[3][FIT_DIFFERENCES], *value[3];
    struct fit_model diffuse;        /* the best model with a diffuse part */
    double diffuse_cost, plain_cost; /* with a Fresnel table, with and without a diffuse part */
    facet_status status;
};

/* Asks the watch; true where the work has a status other than OK: the caller returns. */
bool facet_fit_cancelled(struct fit_work *work);

/*
 * The slope distribution: under both conventions, the better one's table to owned;
 * that which goes with a diffuse part; of an anisotropic source, its shape.
 */
facet_status facet_fit_choose_convention(struct fit_work *work);
facet_status facet_fit_extract_diffuse(struct fit_work *work);
void facet_fit_open_turned(struct fit_work *work);
/*
 * Its tables in standard slopes of the best model's roughness: of all azimuths and, if `rows`, over
 * them, where there is one; with a diffuse part, those of what that leaves.
 */
void facet_fit_tabulate_turned(struct fit_work *work, bool diffuse, bool rows);

/* All candidates that the options ask for, into work->fit. */
void facet_fit_candidates(struct fit_work *work);

#endif
