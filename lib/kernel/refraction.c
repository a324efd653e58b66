/*
 * refraction.c - the loops of rough dielectrics, compiled once per (tier, isa) for arrays of
 * doubles.
 *
 * One loop per ndf, of the general shape: both lobes of a pair share its terms, and what nobody
 * asked for is a branch that goes the same way for a whole batch.
 */
#include "crossing.h"

/* A pair turned as wo is turned up: beside, wi is turned up as well. */
struct turned {
    struct sides sides;
    struct given given;
    struct direction beside, o;
    real zi; /* of wi beside wo: negative across the surface */
    mask across;
};

INLINE struct vec3 scaled_vec3(real factor, struct vec3 v)
{
    return (struct vec3){factor * v.x, factor * v.y, factor * v.z};
}

INLINE pair scaled_pair(real factor, pair a)
{
    return (pair){factor * a.hi, factor * a.lo};
}

INLINE struct turned load_turned(const struct kernel_surface *s, struct model m,
                                 const struct kernel_refraction *job, size_t k)
{
    const struct kernel_job pairs = {.wi = {job->wi[0], job->wi[1], job->wi[2]},
                                     .wo = {job->wo[0], job->wo[1], job->wo[2]}};
    struct given g = load_pair(s, m, &pairs, k);
    struct turned p = {.sides = sides_of(job, k)};
    const real turn = p.sides.turn;
    p.zi = turn * g.wi.z;
    p.across = less(p.zi, splat(0));
    const real up = select(p.across, -turn, turn);
    p.beside = direction_of(s, m.shape, scaled_vec3(up, g.wi), scaled_pair(up, g.ci));
    p.given = (struct given){.wi = scaled_vec3(turn, g.wi),
                             .wo = scaled_vec3(turn, g.wo),
                             .sum = scaled_vec3(turn, g.sum)};
    p.o = direction_of(s, m.shape, p.given.wo, scaled_pair(turn, g.co));
    return p;
}

INLINE struct terms terms_of(const struct kernel_surface *s, struct model m, const struct turned *p,
                             const struct given *given)
{
    return (struct terms){
        .given = *given, .i = p->beside, .o = p->o, .h = half_of(s, m.shape, given)};
}

/* Of one lobe: densities, and what it adds to fr and fr cos theta_i on its own side of the surface. */
struct lobe {
    real pdf, weight, fr, fr_cos;
    mask stray;
};

INLINE bool wants(const struct kernel_refraction *job, enum refraction_output which)
{
    return job->out[which] != NULL;
}

/* Whether densities are asked for, whichever side wi is on. */
INLINE bool wants_densities(const struct kernel_refraction *job)
{
    return wants(job, REFRACTION_PDF) || wants(job, REFRACTION_WEIGHT);
}

INLINE void reflect_light(struct model m, const struct kernel_surface *s,
                          const struct kernel_refraction *job, const struct terms *t, real fresnel,
                          struct lobe *l)
{
    if (wants(job, REFRACTION_FR)) {
        real bare = bare_fr(m, s, t->i, t->o, t->h);
        l->stray = (mask)(l->stray | stray(m, s, t, KERNEL_FR, bare));
        l->fr = bare * fr_factor(m, s) * fresnel;
    }
    if (wants(job, REFRACTION_FR_COS)) {
        real bare = bare_fr_cos(m, s, t->i, t->o, t->h);
        l->stray = (mask)(l->stray | stray(m, s, t, KERNEL_FR_COS, bare));
        l->fr_cos = bare * factor_of(m, s) * fresnel;
    }
    if (wants(job, REFRACTION_WEIGHT)) l->weight = quantity_weight(m, s, t->i, t->o, t->h);
}

INLINE struct lobe reflected_lobe(struct model m, const struct kernel_surface *s,
                                  const struct kernel_refraction *job, const struct turned *p)
{
    struct terms t = terms_of(s, m, p, &p->given);
    struct lobe l = {splat(0), splat(0), splat(0), splat(0), less(splat(0), splat(0))};
    struct model other = m;
    other.masking = KERNEL_UNCORRELATED;
    real fresnel = reflection_fresnel(job, &p->sides);
    if (job->is_correlated)
        reflect_light(m, s, job, &t, fresnel, &l);
    else
        reflect_light(other, s, job, &t, fresnel, &l);
    l.weight = select(less(splat(0), p->zi), l.weight, splat(0));
    if (!wants_densities(job)) return l;
    real bare = bare_pdf(m, s, t.i, t.o, t.h);
    l.stray = (mask)(l.stray | stray(m, s, &t, KERNEL_PDF, bare));
    l.pdf = bare * factor_of(m, s) * fresnel;
    return l;
}

/* D / sigma(wo) of M times what the index makes of it.  What counts as 0 is known of the product alone: the Jacobian may be large. */
INLINE real transmitted_density(struct model m, const struct kernel_surface *s,
                                const struct terms *t, real where, real spread)
{
    struct fraction d = bare_density_scaled(m, s, t->h, t->o);
    real seen = saturated(
        quotient(d.num, d.den * real_max(sigma_scaled(m, s, t->o), splat(REAL_MIN))));
    return counted(m, factor_of(m, s), where, saturated(seen * saturated(spread))) *
           factor_of(m, s);
}

/* A cosine of M that a `wider` rounding decides about. */
#define UNSURE_CROSSING (REAL_IS_FLOAT ? 0x1p-24 : 0x1p-80)

INLINE struct lobe transmitted_lobe(struct model m, const struct kernel_surface *s,
                                    const struct kernel_refraction *job, const struct turned *p)
{
    const struct crossing x = crossing_of(job, &p->sides);
    const struct given normal = {.wi = x.m, .wo = x.m_low, .sum = x.m};
    const struct terms t = terms_of(s, m, p, &normal);
    const real where = real_min(t.h.hz, real_min(x.to_o, x.to_i));
    const mask there = less(splat(0), where);
    real spread = select(there, crossing_spread(&x), splat(0));
    struct lobe l = {.pdf = transmitted_density(m, s, &t, where, spread),
                     .weight = splat(0),
                     .fr = splat(0),
                     .fr_cos = splat(0),
                     .stray = less(splat(0), splat(0))};
    if (!COMPENSATED) {
        real least = real_min(real_abs(x.to_o), real_abs(x.to_i)) - R(UNSURE_CROSSING);
        l.stray = (mask)(not_less(splat(0), least) | (there & stray(m, s, &t, KERNEL_PDF, l.pdf)));
    }
    const bool lights = wants(job, REFRACTION_FR) || wants(job, REFRACTION_FR_COS) ||
                        wants(job, REFRACTION_WEIGHT) || wants(job, REFRACTION_MASKING);
    if (!lights || !any(p->across)) return l;
    mask unsure;
    real scale = select(p->sides.below, splat(R(job->side[BELOW].scale)),
                        splat(R(job->side[ABOVE].scale)));
    l.weight = select(p->across, crossing_weight(m, s, t.i, t.o, job->is_correlated, &unsure),
                      splat(0));
    l.stray = (mask)(l.stray | (unsure & p->across & less(splat(0), l.pdf)));
    l.fr_cos = saturated(l.pdf * l.weight * scale);
    if (wants(job, REFRACTION_FR)) l.fr = ratio(l.fr_cos, real_abs(p->zi));
    return l;
}

INLINE void put(const struct kernel_refraction *job, enum refraction_output which, size_t k,
                real value)
{
    if (job->out[which]) store_at(job->out[which], k, value);
}

/* Densities of a sample: the lobe that was chosen has that of its normal, which a rounded wi no longer tells next to n = 1. */
INLINE void choose_densities(const struct kernel_refraction *job, size_t k, struct lobe *r,
                             struct lobe *t)
{
    if (!job->chosen) return;
    real own = load_at(job->chosen, k);
    r->pdf = select(less(own, splat(0)), r->pdf, own);
    t->pdf = select(less(own, splat(0)), -own, t->pdf);
}

/* fr cos theta_i / pdf, no more than 1 with IMPORTANCE: a share of the density times what masking keeps. */
INLINE real weight_of(const struct kernel_refraction *job, const struct turned *p, struct lobe r,
                      struct lobe t, real pdf)
{
    real scale = select(p->sides.below, splat(R(job->side[BELOW].scale)),
                        splat(R(job->side[ABOVE].scale)));
    real own = select(p->across, t.pdf, r.pdf),
         kept = select(p->across, t.weight * scale, r.weight);
    return select(less(splat(0), pdf), quotient(own, real_max(pdf, splat(REAL_MIN))) * kept,
                  splat(0));
}

/* Returns what the tiers below precise leave to it. */
INLINE mask store_lobes(const struct kernel_refraction *job, size_t k, const struct turned *p,
                        struct lobe r, struct lobe t)
{
    const mask across = p->across;
    choose_densities(job, k, &r, &t);
    real fr = select(across, t.fr, r.fr), fr_cos = select(across, t.fr_cos, r.fr_cos),
         pdf = saturated(r.pdf + t.pdf);
    real weight = weight_of(job, p, r, t, pdf);
    mask some = less(splat(0), splat(0));
    if (!COMPENSATED) {
        mask either = (mask)(r.stray | t.stray),
             own = (mask)((across & t.stray) | ((mask)~across & r.stray));
        some = wants_densities(job) ? either : own;
        if (__builtin_expect(any(some), 0))
            pdf = marked(either, pdf), weight = marked(either, weight),
            fr_cos = marked(own, fr_cos), fr = marked(own, fr);
    }
    put(job, REFRACTION_FR, k, fr);
    put(job, REFRACTION_FR_COS, k, fr_cos);
    put(job, REFRACTION_PDF, k, pdf);
    if (wants(job, REFRACTION_WEIGHT)) put(job, REFRACTION_WEIGHT, k, weight);
    put(job, REFRACTION_MASKING, k, t.weight);
    return some;
}

/* Of the normal M alone. */
INLINE void store_normal(struct model m, const struct kernel_surface *s,
                         const struct kernel_refraction *job, size_t k, const struct turned *p)
{
    const struct crossing x = crossing_of(job, &p->sides);
    const struct given normal = {.wi = x.m, .wo = x.m_low, .sum = x.m};
    const struct terms t = terms_of(s, m, p, &normal);
    const mask there = less(splat(0), real_min(x.to_o, x.to_i));
    real excess_ = select(p->sides.below, splat(R(job->side[BELOW].excess)),
                          splat(R(job->side[ABOVE].excess))),
         m2 = square_of(x.m);
    put(job, REFRACTION_D, k,
        select(there, bare_d(m, s, t.i, t.o, t.h) * factor_of(m, s), splat(0)));
    put(job, REFRACTION_F, k, select(there, crossing_fresnel(&x, excess_, m2), splat(0)));
    put(job, REFRACTION_COSINE, k, select(there, quotient(x.to_o, real_sqrt(m2)), splat(0)));
    put(job, REFRACTION_SIGMA_O, k, sigma(m, s, t.o));
    put(job, REFRACTION_SIGMA_I, k, sigma(m, s, t.i));
}

INLINE mask refract(struct model m, const struct kernel_surface *s,
                    const struct kernel_refraction *job, size_t k)
{
    struct lobe r = {splat(0), splat(0), splat(0), splat(0), less(splat(0), splat(0))}, t = r;
    const struct turned p = load_turned(s, m, job, k);
    const bool densities = wants_densities(job);
    if (wants(job, REFRACTION_FRESNEL))
        put(job, REFRACTION_FRESNEL, k, reflection_fresnel(job, &p.sides));
    if (wants(job, REFRACTION_D)) store_normal(m, s, job, k, &p);
    if (!densities && !wants(job, REFRACTION_FR) && !wants(job, REFRACTION_FR_COS) &&
        !wants(job, REFRACTION_MASKING))
        return r.stray;
    if (densities || any(less(splat(0), p.zi))) r = reflected_lobe(m, s, job, &p);
    if (densities || any(p.across)) t = transmitted_lobe(m, s, job, &p);
    return store_lobes(job, k, &p, r, t);
}

#define REFRACT_LOOP(ndf_)                                                                         \
    static bool refract_##ndf_(const struct kernel_surface *surface,                               \
                               const struct kernel_refraction *job, size_t n)                      \
    {                                                                                              \
        const struct kernel_surface s = *surface;                                                  \
        const struct kernel_refraction own = *job;                                                 \
        const struct model m = {FACET_##ndf_, KERNEL_SHEARED, KERNEL_SMITH};                       \
        mask some = less(splat(0), splat(0));                                                      \
        for (size_t k = 0; k < n; k += LANES) some = (mask)(some | refract(m, &s, &own, k));       \
        return any(some);                                                                          \
    }

REFRACT_LOOP(GGX)
REFRACT_LOOP(BECKMANN)

/*
 * The lobe of a normal h of wo turned up: wi = -(wo + (g - c) h)/n by Snell's law, g - c = (n^2 - 1)/(g + c),
 * and the density of facet_transmission.h over wi with |M| = |g - c|: nothing cancels, unlike M of the rounded wi.
 */
INLINE void choose(const struct kernel_refraction *job, const struct kernel_normals *d, size_t k)
{
    struct vec3 wo = load_vec3((const void *const[3]){job->wo[0], job->wo[1], job->wo[2]}, k);
    struct vec3 wi = load_vec3((const void *const[3]){d->wi[0], d->wi[1], d->wi[2]}, k);
    struct vec3 h = load_vec3((const void *const[3]){d->h[0], d->h[1], d->h[2]}, k);
    /* An estimated root leaves h right to 1e-4 of its length, which bending has no use for. */
    if (REAL_IS_FLOAT) h = scaled_vec3(nmadd(splat(R(0.5)), square_of(h), splat(R(1.5))), h);
    /* The pair that F is of: wi turned back to wo. */
    struct sides p = sides_of(job, k);
    wider turn = wider_choice(p.oz, -1, 0, 1, 0);
    p.ix = wider_product(turn, wider_at(d->wi[0], k));
    p.iy = wider_product(turn, wider_at(d->wi[1], k));
    p.iz = wider_product(turn, wider_at(d->wi[2], k));
    real fresnel = reflection_fresnel(job, &p), pdf = load_at(d->pdf, k), index = p.index;
    real excess_ = select(p.below, splat(R(job->side[BELOW].excess)),
                          splat(R(job->side[ABOVE].excess)));
    wo = scaled_vec3(p.turn, wo);
    real c = madd(wo.x, h.x, madd(wo.y, h.y, wo.z * h.z)), g2 = madd(c, c, excess_);
    mask refracts = (mask)(not_less(load_at(d->u, k), fresnel) & less(splat(0), c) &
                           less(splat(0), g2));
    real g = real_sqrt(real_max(g2, splat(0))), bend = excess_ / select(refracts, g + c, splat(1));
    struct vec3 bent = {madd(bend, h.x, wo.x) / -index, madd(bend, h.y, wo.y) / -index,
                        madd(bend, h.z, wo.z) / -index};
    store_at(d->wi[0], k, p.turn * select(refracts, bent.x, wi.x));
    store_at(d->wi[1], k, p.turn * select(refracts, bent.y, wi.y));
    store_at(d->wi[2], k, p.turn * select(refracts, bent.z, wi.z));
    if (!COMPENSATED) return;
    struct fraction t = transmittance(index, c, g);
    real own = quotient(4 * pdf * c * t.num * index * g,
                        select(refracts, t.den * bend * bend, splat(1)));
    store_at(d->chosen, k, select(refracts, -own, fresnel * pdf));
}

static void choose_loop(const struct kernel_refraction *job, const struct kernel_normals *normals,
                        size_t n)
{
    const struct kernel_refraction own = *job;
    const struct kernel_normals d = *normals;
    for (size_t k = 0; k < n; k += LANES) choose(&own, &d, k);
}

static void opposite_loop(const double *a, const double *b, double *to, size_t n)
{
    for (size_t k = 0; k < n; k += LANES) store_at(to, k, opposite(load_at(a, k), load_at(b, k)));
}

static void transmittance_loop(double index, const double *c, const double *g, double *to, size_t n)
{
    for (size_t k = 0; k < n; k += LANES) {
        struct fraction t = transmittance(splat(R(index)), load_at(c, k), load_at(g, k));
        store_at(to, k, quotient(t.num, t.den));
    }
}

extern const struct facet_refractions TABLE_NAME(refractions, FACET_TIER, FACET_IO, FACET_ISA);
const struct facet_refractions TABLE_NAME(refractions, FACET_TIER, FACET_IO, FACET_ISA) = {
    .eval = {[FACET_GGX] = refract_GGX, [FACET_BECKMANN] = refract_BECKMANN},
    .choose = choose_loop,
    .opposite = opposite_loop,
    .transmittance = transmittance_loop,
};
