/* roughness.c - the forms of a roughness (Dupuy eqs. 2.25-2.34; signs: lib/NOTATION.md). */
#include "roughness.h"

#include "facet_forms.h"

#include <float.h>
#include <math.h>

/* No more than a rounding is missing in x. */
static bool is_low(double low, double x)
{
    return fabs(low) <= DBL_EPSILON * fabs(x);
}

facet_status facet_roughness_check(const facet_roughness *r)
{
    if (!(r->alpha_x >= FACET_ALPHA_MIN && r->alpha_x <= FACET_ALPHA_MAX)) return FACET_BAD_ALPHA;
    if (!(r->alpha_y >= FACET_ALPHA_MIN && r->alpha_y <= FACET_ALPHA_MAX)) return FACET_BAD_ALPHA;
    if (!is_low(r->low.alpha_x, r->alpha_x) || !is_low(r->low.alpha_y, r->alpha_y))
        return FACET_BAD_ALPHA;
    if (!(fabs(r->rho) <= FACET_RHO_MAX) || !is_low(r->low.rho, r->rho)) return FACET_BAD_RHO;
    if (!(fabs(r->slope_x) <= FACET_MEAN_SLOPE_MAX)) return FACET_BAD_MEAN_SLOPE;
    if (!(fabs(r->slope_y) <= FACET_MEAN_SLOPE_MAX)) return FACET_BAD_MEAN_SLOPE;
    return FACET_OK;
}

/* ---- Pairs ------------------------------------------------------------------------------- */

static struct pair pair_of(double x)
{
    return (struct pair){x, 0};
}

static struct pair pair_square(struct pair a)
{
    return pair_product(a, a);
}

/*
 * Sine and cosine to some 1e-31, absolute: a thin ellipse multiplies an error in its angle by
 * alpha_1/alpha_2.  Taylor's series after the nearest multiple of pi/2 is taken off.
 */
static void sine_cosine(double phi, struct pair *sine, struct pair *cosine)
{
    /* pi/2 as a sum of three doubles; |turns| <= 64 makes the last one's error 1e-47. */
    static const double half_pi[3] = {0x1.921fb54442d18p0, 0x1.1a62633145c07p-54,
                                      -0x1.f1976b7ed8fbcp-110};
    double turns = rint(phi / half_pi[0]);
    struct pair r = pair_of(phi), term = pair_of(1), sums[2] = {{1, 0}, {0, 0}};
    for (int i = 0; i < 3; i++) r = pair_add(r, pair_product(pair_of(-turns), pair_of(half_pi[i])));
    for (int j = 1; j <= 30; j++) { /* (pi/4)^31/31! < 1e-36 */
        term = pair_quotient(pair_product(term, r), pair_of(j));
        sums[j & 1] = pair_add(sums[j & 1], j & 2 ? pair_negative(term) : term);
    }
    int quadrant = (int)turns & 3;
    *cosine = quadrant & 1 ? sums[1] : sums[0];
    *sine = quadrant & 1 ? sums[0] : sums[1];
    if (quadrant == 1 || quadrant == 2) *cosine = pair_negative(*cosine);
    if (quadrant >= 2) *sine = pair_negative(*sine);
}

/* ---- From ellipses and covariances ------------------------------------------------------------- */

/* [xx xy; xy yy] = 2 Cov[x~, y~], whose eigenvalues are alpha_1^2 and alpha_2^2; xx and yy above 0. */
static facet_roughness from_shape(struct pair xx, struct pair yy, struct pair xy)
{
    struct pair x = pair_square_root(xx), y = pair_square_root(yy),
                rho = pair_quotient(xy, pair_product(x, y));
    return (facet_roughness){
        .alpha_x = x.hi, .alpha_y = y.hi, .rho = rho.hi + 0.0, .low = {x.lo, y.lo, rho.lo}};
}

/*
 * alpha_x^2 = (a1^2 + a2^2 + (a1^2 - a2^2) cos 2phi)/2 and so on, written as sums
 * of squares; rho has the sign that agrees with 2.25 (2.31 prints the other).
 */
facet_status facet_roughness_from_ellipse(const facet_ellipse *e, double slope_x, double slope_y,
                                          facet_roughness *r)
{
    double a1 = e->alpha_1, a2 = e->alpha_2;
    if (!(a1 >= FACET_AXIS_MIN && a1 <= FACET_AXIS_MAX)) return FACET_BAD_ALPHA;
    if (!(a2 >= FACET_AXIS_MIN && a2 <= FACET_AXIS_MAX)) return FACET_BAD_ALPHA;
    if (!(fabs(e->phi) <= FACET_PHI_MAX)) return FACET_BAD_PHI;
    if (a1 == a2) {
        *r = (facet_roughness){.alpha_x = a1, .alpha_y = a1};
    } else {
        struct pair s, c, one = pair_of(a1), two = pair_of(a2);
        sine_cosine(e->phi, &s, &c);
        struct pair xx = pair_add(pair_square(pair_product(one, c)),
                                  pair_square(pair_product(two, s)));
        struct pair yy = pair_add(pair_square(pair_product(one, s)),
                                  pair_square(pair_product(two, c)));
        struct pair gap = pair_product(pair_sum(a2, -a1), pair_sum(a2, a1));
        *r = from_shape(xx, yy, pair_product(gap, pair_product(c, s)));
    }
    r->slope_x = slope_x;
    r->slope_y = slope_y;
    return facet_roughness_check(r);
}

facet_status facet_roughness_from_covariance(const facet_covariance *c, double slope_x,
                                             double slope_y, facet_roughness *r)
{
    if (!(c->xx > 0 && c->yy > 0 && isfinite(c->xx) && isfinite(c->yy))) return FACET_BAD_ALPHA;
    *r = from_shape(pair_of(2 * c->xx), pair_of(2 * c->yy), pair_of(2 * c->xy));
    r->slope_x = slope_x;
    r->slope_y = slope_y;
    return facet_roughness_check(r);
}

/* ---- To kernels and ellipses ----------------------------------------------------------------- */

static struct pair alpha_x_of(const facet_roughness *r)
{
    return (struct pair){r->alpha_x, r->low.alpha_x};
}

static struct pair alpha_y_of(const facet_roughness *r)
{
    return (struct pair){r->alpha_y, r->low.alpha_y};
}

static struct pair rho_of(const facet_roughness *r)
{
    return (struct pair){r->rho, r->low.rho};
}

/* sqrt(1 - rho^2) */
static struct pair kappa_of(const facet_roughness *r)
{
    struct pair below = pair_add(pair_sum(1, -r->rho), pair_of(-r->low.rho));
    struct pair above = pair_add(pair_sum(1, r->rho), pair_of(r->low.rho));
    return pair_square_root(pair_product(below, above));
}

struct roughness_form facet_roughness_form(const facet_roughness *r)
{
    struct pair alpha_y = pair_product(alpha_y_of(r),
                                       pair_quotient(pair_of(r->alpha_x), alpha_x_of(r)));
    return (struct roughness_form){r->alpha_x, pair_product(rho_of(r), alpha_y),
                                   pair_product(kappa_of(r), alpha_y)};
}

/* sqrt(a^2 + b^2), not both 0. */
static struct pair pair_hypotenuse(struct pair a, struct pair b)
{
    double h = hypot(a.hi, b.hi);
    struct pair rest = pair_add(pair_add(pair_square(a), pair_square(b)),
                                pair_negative(pair_square(pair_of(h))));
    return pair_sum(h, rest.hi / (2 * h));
}

/*
 * alpha_2 by the determinant (2.33 cancels), phi by atan2 (2.34 is 0/0 at rho = 0).  In pairs, each
 * rounded once, so that an ellipse comes back as it was given.
 */
facet_ellipse facet_roughness_to_ellipse(const facet_roughness *r)
{
    struct pair ax = alpha_x_of(r), ay = alpha_y_of(r), two = pair_of(2);
    struct pair difference = pair_product(pair_add(ax, pair_negative(ay)), pair_add(ax, ay));
    struct pair cross = pair_product(two, pair_product(rho_of(r), pair_product(ax, ay)));
    if (difference.hi == 0 && cross.hi == 0) return (facet_ellipse){r->alpha_x, r->alpha_y, 0};
    double phi = -0.5 * atan2(cross.hi, difference.hi);
    if (r->rho == 0) return (facet_ellipse){fmax(ax.hi, ay.hi), fmin(ax.hi, ay.hi), phi};
    struct pair root = pair_hypotenuse(difference, cross),
                sum = pair_add(pair_square(ax), pair_square(ay));
    struct pair a1 = pair_square_root(pair_product(pair_add(sum, root), pair_of(0.5)));
    struct pair a2 = pair_quotient(pair_product(pair_product(ax, ay), kappa_of(r)), a1);
    struct pair s, c;
    sine_cosine(2 * phi, &s, &c);
    struct pair off = pair_add(pair_product(s, difference), pair_product(c, cross));
    return (facet_ellipse){a1.hi, a2.hi, phi - off.hi / (2 * root.hi)};
}

/* ---- What is read back --------------------------------------------------------------------------- */

/* sqrt(1 + more) - 1 */
static double root_less_one(double more)
{
    return more / (1 + sqrt(fmax(0, 1 + more)));
}

/*
 * With the maps to slopes L = [alpha_x 0; rho alpha_y  kappa alpha_y] (2.26) the width of b along a
 * direction is that of a times |B^T m| for some unit m, B = L_a^-1 L_b: between B's singular values.
 * B - 1 = [u 0; v w] in pairs, as rho over kappa cancels.
 */
double facet_roughness_difference(const facet_roughness *a, const facet_roughness *b)
{
    const struct pair minus_one = {-1, 0};
    struct pair x = pair_quotient(alpha_x_of(b), alpha_x_of(a)),
                y = pair_quotient(alpha_y_of(b), alpha_y_of(a)), kappa = kappa_of(a);
    struct pair turn = pair_add(pair_product(y, rho_of(b)),
                                pair_negative(pair_product(x, rho_of(a))));
    const double u = pair_add(x, minus_one).hi, v = pair_quotient(turn, kappa).hi,
                 w = pair_add(pair_quotient(pair_product(y, kappa_of(b)), kappa), minus_one).hi;
    /* B B^T - 1, and its eigenvalues */
    const double xx = u * (2 + u), xy = (1 + u) * v, yy = v * v + w * (2 + w);
    const double mean = (xx + yy) / 2, half = hypot((xx - yy) / 2, xy);
    return fmax(fabs(root_less_one(mean + half)), fabs(root_less_one(mean - half)));
}

/* Both alphas by one factor where that serves, as 1e-6 of one alone may turn a thin ellipse off itself. */
facet_roughness facet_roughness_inside(const facet_roughness *r, double by)
{
    const double least = FACET_ALPHA_MIN * (1 + by), most = FACET_ALPHA_MAX * (1 - by),
                 rho = FACET_RHO_MAX - 4 * by * (1 - FACET_RHO_MAX);
    const double scale = fmax(1, least / fmin(r->alpha_x, r->alpha_y)) *
                         fmin(1, most / fmax(r->alpha_x, r->alpha_y));
    facet_roughness m = *r;
    if (scale != 1) {
        m.alpha_x = fmin(fmax(r->alpha_x * scale, least), most);
        m.alpha_y = fmin(fmax(r->alpha_y * scale, least), most);
        m.low.alpha_x = m.low.alpha_y = 0;
    }
    if (fabs(m.rho) > rho) {
        m.rho = copysign(rho, m.rho);
        m.low.rho = 0;
    }
    return m;
}

bool facet_ellipse_readable(const facet_roughness *r, facet_ellipse *e, double *difference)
{
    facet_roughness inside = *r, back;
    for (double by = DBL_EPSILON; by < FORM_NEAR; by *= 2) {
        *e = facet_roughness_to_ellipse(&inside);
        if (!facet_roughness_from_ellipse(e, r->slope_x, r->slope_y, &back)) {
            *difference = facet_roughness_difference(r, &back);
            return *difference <= FORM_NEAR;
        }
        inside = facet_roughness_inside(r, by);
    }
    return false;
}
