/*
 * ndf_table.h - a tabulated radial distribution: struct kernel_table says what
 * its cubics hold.  Their variables are bounded and need no trigonometry.
 */
#ifndef FACET_NDF_TABLE_H
#define FACET_NDF_TABLE_H

#include "surface.h"
#include "vmath.h"

INLINE real cubic_at(struct kernel_cubic f, real u)
{
    real x = u * (real)f.cells;
    int32_t i = (int32_t)x, last = (int32_t)f.cells - 1;
    i = i > last ? last : i;
    i = i < 0 ? 0 : i;
    real t = x - (real)i;
    const double *c = f.c + 4 * (size_t)i;
    return madd(madd(madd((real)c[3], t, (real)c[2]), t, (real)c[1]), t, (real)c[0]);
}

INLINE real exp_any(real x)
{
    real e = exp_minus(real_abs(x));
    return x > 0 ? 1 / real_max(e, (real)REAL_MIN) : e;
}

INLINE real table_density(const struct kernel_surface *s, struct half h)
{
    real r = real_sqrt(madd(h.x, h.x, h.y * h.y)), bz = (real)s->table->slope_scale * h.z;
    real u = r / (bz + r), near = (real)s->table->slope_scale / (bz + r);
    real q = (real)s->root_det * h.hh * near * near;
    real value = q * q * exp_any(cubic_at(s->table->log_q, u));
    return h.hz > 0 ? value : 0;
}

INLINE real table_excess(const struct kernel_surface *s, struct direction k)
{
    real length = (real)s->table->slope_scale * real_sqrt(k.s2);
    real w = length / real_max(length + real_abs(k.c), (real)REAL_MIN);
    return length * w * exp_any(cubic_at(s->table->log_psi, w));
}

#endif
