/*
 * ndf_table.h - a tabulated radial distribution: struct kernel_table says what
 * its cubics hold.  Their variables are bounded and need no trigonometry.
 */
#ifndef FACET_NDF_TABLE_H
#define FACET_NDF_TABLE_H

#include "surface.h"
#include "vmath.h"

/* Lane by lane: looking up does not vectorise. */
INLINE real cubic_at(struct kernel_cubic f, real u)
{
    lane at[LANES];
    memcpy(at, &u, sizeof at);
    for (size_t k = 0; k < LANES; k++) {
        lane x = at[k] * R(f.cells);
        x = x > 0 ? x : 0;
        size_t last = f.cells - 1, i = x < R(last) ? (size_t)x : last;
        lane t = x - R(i);
        const double *c = f.c + 4 * i;
        at[k] = ((R(c[3]) * t + R(c[2])) * t + R(c[1])) * t + R(c[0]);
    }
    memcpy(&u, at, sizeof u);
    return u;
}

INLINE real exp_any(real x)
{
    real e = exp_minus(real_abs(x));
    return select(less(splat(0), x), quotient(splat(1), real_max(e, splat(REAL_MIN))), e);
}

/* Even in H, as the other distributions are: pdf_ndf turns it up. */
INLINE real table_density(const struct kernel_surface *s, struct half h)
{
    real r = root_from_zero(madd(h.x, h.x, h.y * h.y)), bz = R(s->table->slope_scale) * real_abs(h.z);
    real inverse = recip(bz + r), near = R(s->table->slope_scale) * inverse;
    real q = R(SQRT_PI) * h.hh * near * near;
    return q * q * exp_any(cubic_at(s->table->log_q, r * inverse));
}

INLINE real table_excess(const struct kernel_surface *s, struct direction k)
{
    real length = R(s->table->slope_scale) * root_from_zero(k.s2);
    real w = quotient(length, real_max(length + real_abs(k.c), splat(REAL_MIN)));
    return length * w * exp_any(cubic_at(s->table->log_psi, w));
}

#endif
