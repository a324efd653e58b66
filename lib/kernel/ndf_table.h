/*
 * ndf_table.h - a tabulated distribution: struct kernel_table says what its cubics and
 * sheets hold.  Their variables are bounded, and only that of the azimuth needs trigonometry.
 */
#ifndef FACET_NDF_TABLE_H
#define FACET_NDF_TABLE_H

#include "surface.h"
#include "vmath.h"

/* Where x >= 0, in units of cells, lies: in which of `count`, and how far from its start. */
struct cell {
    lane_index number;
    real t;
};

/* Where x is no number, in the last. */
INLINE struct cell cell_of(real x, size_t count)
{
    lane_index number = whole_part(real_min(x, splat(R(count - 1))));
    return (struct cell){number, x - real_of(number)};
}

INLINE real cubic_of(const lane *c, const int32_t at[LANES], real t)
{
    struct fours f = fours_at(c, at);
    return madd(madd(madd(f.of[3], t, f.of[2]), t, f.of[1]), t, f.of[0]);
}

/* The cubic with that number. */
INLINE real cubic_at(const lane *c, lane_index number, real t)
{
    int32_t at[LANES];
    put_in_memory(number * 4, at);
    return cubic_of(c, at, t);
}

/* The patch with that number. */
INLINE real patch_at(const lane *c, lane_index number, real t, real s)
{
    int32_t at[LANES];
    put_in_memory(number * 16, at);
    real sum = cubic_of(c + 12, at, t);
    for (size_t m = 3; m-- > 0;) sum = madd(sum, s, cubic_of(c + 4 * m, at, t));
    return sum;
}

/* The azimuth of (x, y) or of (-x, -y) in units of pi, in [0, 1]. */
INLINE real half_turn_of(real x, real y)
{
    real ax = real_abs(x), ay = real_abs(y);
    real q = quotient(real_min(ax, ay), real_max(real_max(ax, ay), splat(REAL_MIN)));
    real beyond = quotient(q - splat(1), q + splat(1)); /* tan of what is left of the eighth */
    real z = select(less(splat(R(ATAN_END)), q), beyond, q);
    real a = madd(z, POLY(ATAN_PRECISE, z * z),
                  select(less(splat(R(ATAN_END)), q), splat(R(0.25)), splat(0)));
    a = select(less(ax, ay), splat(R(0.5)) - a, a);
    return select(less(x * y, splat(0)), splat(1) - a, a);
}

/* u = from_0 / (from_0 + from_1), 0 at one end and 1 at the other. */
struct place {
    real from_0, from_1;
    real inverse; /* of their sum */
    real x, y;    /* what has the azimuth */
};

INLINE struct place place_of(real from_0, real from_1, real x, real y)
{
    real whole = real_max(from_0 + from_1, splat(REAL_MIN));
    return (struct place){from_0, from_1, recip_fine(whole), x, y};
}

/*
 * Over the azimuth and not: each a function apart, whose vectors go in registers one by one.
 */
#if REAL_IS_FLOAT
/* In cells from the nearer end; and the first cell of those counted from there. */
struct nearer {
    real x;
    lane_index first;
};

INLINE struct nearer nearer_of(size_t cells, size_t later, real from_0, real from_1, real inverse)
{
    lane_index none = {0};
    return (struct nearer){real_min(from_0, from_1) * R(cells) * inverse,
                           select_index(less(from_1, from_0), none + (int32_t)later, none)};
}

APART real halves_at(const struct kernel_halves *f, real from_0, real from_1, real inverse)
{
    struct nearer n = nearer_of(f->cells, f->half, from_0, from_1, inverse);
    struct cell cell = cell_of(n.x, f->half);
    return cubic_at(f->c, cell.number + n.first, cell.t);
}

APART real turned_halves_at(const struct kernel_halves *f, real from_0, real from_1, real inverse,
                            real x, real y)
{
    struct nearer n = nearer_of(f->cells, f->half * f->turns, from_0, from_1, inverse);
    struct cell cell = cell_of(n.x, f->half),
                turn = cell_of(half_turn_of(x, y) * R(f->turns), f->turns);
    return patch_at(f->c, turn.number * (int32_t)f->half + cell.number + n.first, cell.t, turn.t);
}

INLINE real halves_of_place(const struct kernel_halves *f, struct place p)
{
    return f->turns ? turned_halves_at(f, p.from_0, p.from_1, p.inverse, p.x, p.y)
                    : halves_at(f, p.from_0, p.from_1, p.inverse);
}

INLINE const struct kernel_floats *floats_of(const struct kernel_surface *s)
{
    return atomic_load_explicit(&s->table->floats, memory_order_acquire);
}

/* 2^LIFT Q, and what LIFT is for. */
INLINE real table_q(const struct kernel_surface *s, struct place p)
{
    return exp_lifted((pair){-halves_of_place(&floats_of(s)->q, p), splat(0)});
}

/* What is so small beside c counts as no more than that: it is not to become denormal. */
#define PSI_EXPONENT_MAX 60

/* -log_psi to base 2. */
INLINE real turned_exponent(const struct kernel_surface *s, struct place p)
{
    real f = turned_halves_at(&floats_of(s)->psi, p.from_0, p.from_1, p.inverse, p.x, p.y);
    real least = splat(R(KERNEL_PSI_LEAST / KERNEL_PSI_UNIT / EXPONENT_UNIT));
    return recip_fine(real_max(f, least)) - R(EXPONENT_UNIT * s->table->psi_top);
}

INLINE real table_psi(const struct kernel_surface *s, struct place p)
{
    const struct kernel_halves *f = &floats_of(s)->psi;
    real exponent = f->turns ? turned_exponent(s, p) : -halves_at(f, p.from_0, p.from_1, p.inverse);
    return exp_minus_pair((pair){real_min(exponent, splat(R(PSI_EXPONENT_MAX))), splat(0)});
}

/* Positive where floats hold what is seen from k of the surface. */
INLINE real table_front(const struct kernel_surface *s, struct direction k)
{
    double most = s->table->behind_most;
    return madd(k.c, real_abs(k.c), k.s2 * R(most * most));
}
#else
APART real cubic_logarithm(const struct kernel_cubic *f, real u)
{
    struct cell cell = cell_of(u * R(f->cells), f->cells);
    return cubic_at(f->c, cell.number, cell.t);
}

APART real sheet_at(const struct kernel_sheet *f, real u, real x, real y)
{
    struct cell cell = cell_of(u * R(f->cells), f->cells),
                turn = cell_of(half_turn_of(x, y) * R(f->turns), f->turns);
    return patch_at(f->c, turn.number * (int32_t)f->cells + cell.number, cell.t, turn.t);
}

/* Where it is above 1 too: it is far from what overflows. */
INLINE real table_exp(real x)
{
    return exp_minus(-x);
}

INLINE real table_q(const struct kernel_surface *s, struct place p)
{
    const struct kernel_table *t = s->table;
    real u = p.from_0 * p.inverse;
    return table_exp(t->turned_q.turns ? sheet_at(&t->turned_q, u, p.x, p.y)
                                       : cubic_logarithm(&t->log_q, u));
}

/* The sheet is over 1 - w. */
INLINE real turned_log_psi(const struct kernel_table *t, struct place p)
{
    real f = sheet_at(&t->turned_psi, p.from_1 * p.inverse, p.x, p.y);
    return R(t->psi_top) -
           quotient_fine(splat(R(KERNEL_PSI_UNIT)), real_max(f, splat(R(KERNEL_PSI_LEAST))));
}

INLINE real table_psi(const struct kernel_surface *s, struct place p)
{
    const struct kernel_table *t = s->table;
    return table_exp(t->turned_psi.turns ? turned_log_psi(t, p)
                                         : cubic_logarithm(&t->log_psi, p.from_0 * p.inverse));
}

INLINE real table_front(const struct kernel_surface *s, struct direction k)
{
    (void)s, (void)k;
    return splat(1);
}
#endif

/* Even in H, as the other distributions are: pdf_ndf turns it up. */
INLINE real table_density(const struct kernel_surface *s, struct half h)
{
    real r = root_from_zero(madd(h.x, h.x, h.y * h.y)),
         bz = R(s->table->slope_scale) * real_abs(h.z);
    struct place p = place_of(r, bz, h.x, h.y);
    real near = R(s->table->slope_scale) * p.inverse, q = R(SQRT_PI) * h.hh * near * near;
    return q * q * table_q(s, p);
}

INLINE real table_excess(const struct kernel_surface *s, struct direction k)
{
    real length = R(s->table->psi_scale) * root_from_zero(k.s2);
    struct place p = place_of(length, real_abs(k.c), k.a, k.b);
    return length * (length * p.inverse) * table_psi(s, p);
}

#endif
