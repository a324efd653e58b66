/* Light finds its way back. */
#include "check.h"
#include "draw.h"

#include <string.h>

enum { N = 64 };

struct pairs {
    double i[3][N], o[3][N], there[3][N], back[3][N];
};

static facet_vec3_in in(const double v[3][N])
{
    return (facet_vec3_in){v[0], v[1], v[2]};
}

/* Central surfaces with Smith or V-groove masking, and the thesis's shear. */
static facet_material reciprocal_material(struct rng *rng, size_t round)
{
    facet_material m = {.ndf = rng_uniform(rng) < 0.5 ? FACET_GGX : FACET_BECKMANN};
    static const facet_masking maskings[] = {FACET_SMITH, FACET_SMITH_UNCORRELATED, FACET_VGROOVE,
                                             FACET_SMITH_UNCORRELATED};
    m.masking = maskings[round % 4];
    draw_roughness(rng, &draw_everywhere, &m.roughness);
    draw_fresnel(rng, (facet_fresnel_kind)(int)(rng_uniform(rng) * FACET_FRESNEL_COUNT),
                 &m.fresnel);
    if (round % 4 == 3)
        m.shear = FACET_THESIS;
    else
        m.roughness.slope_x = m.roughness.slope_y = 0;
    return m;
}

static void eval_fr(const facet_brdf *brdf, facet_tier tier, size_t channels, facet_vec3_in wi,
                    facet_vec3_in wo, double fr[3][N])
{
    facet_outputs outputs;
    memset(&outputs, 0, sizeof outputs);
    for (size_t c = 0; c < channels; c++) outputs.of[FACET_FR][c] = fr[c];
    CHECK_INT(facet_eval(brdf, tier, wi, wo, N, &outputs), FACET_OK);
}

TEST(fr_is_reciprocal)
{
    struct rng rng;
    rng_seed(&rng, 14);
    static struct pairs p;
    size_t checked = 0;
    for (size_t round = draw_count(1000); round--;) {
        facet_tier tier = (facet_tier)(round / 4 % FACET_TIER_COUNT);
        facet_material m = reciprocal_material(&rng, round);
        facet_brdf *brdf = NULL;
        double bound = 0;
        CHECK_INT(facet_brdf_create(&m, &brdf), FACET_OK);
        if (!brdf) continue;
        for (size_t k = 0; k < N; k++) {
            double wi[3], wo[3];
            draw_pair(&rng, &draw_everywhere, &m, wi, wo);
            for (int j = 0; j < 3; j++) {
                p.i[j][k] = wi[j];
                p.o[j][k] = wo[j];
            }
        }
        eval_fr(brdf, tier, m.fresnel.channels, in(p.i), in(p.o), p.there);
        eval_fr(brdf, tier, m.fresnel.channels, in(p.o), in(p.i), p.back);
        if (facet_bound(brdf, tier, FACET_FR, 0, &bound) && bound < 0.1)
            for (size_t k = 0; k < N; k++)
                for (size_t c = 0; c < m.fresnel.channels; c++) {
                    checked += p.there[c][k] > 0;
                    if (check_within(p.there[c][k], p.back[c][k], 2.1 * bound, FACET_FLOOR))
                        continue;
                    check_fail(
                        __FILE__, __LINE__,
                        "fr %.17g, back %.17g, bound %.3g, %s\n    %s\n    wi {%.17g, %.17g, "
                        "%.17g} wo {%.17g, %.17g, %.17g}",
                        p.there[c][k], p.back[c][k], bound, facet_tier_name(tier), draw_text(&m),
                        p.i[0][k], p.i[1][k], p.i[2][k], p.o[0][k], p.o[1][k], p.o[2][k]);
                }
        facet_brdf_destroy(brdf);
    }
    check_note("checked", (double)checked);
    if (draw_count(100) >= 100) CHECK(checked >= 20000);
}
