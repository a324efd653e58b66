/* Whatever the table lets pass has a finite answer: the corners of every range, in every
 * combination. */
#include "ask.h"
#include "check.h"

#include <math.h>
#include <stdio.h>

static const char *pick(struct rng *rng, const char *const *names, size_t count)
{
    return names[(size_t)(rng_uniform(rng) * (double)count)];
}

static bool chance(struct rng *rng, double p)
{
    return rng_uniform(rng) < p;
}

static int print_material(char *out, size_t room, struct rng *rng)
{
    static const char *const ndf[] = {"ggx", "beckmann"};
    static const char *const masking[] = {"smith", "smith_uncorrelated", "vgroove", "none"};
    static const char *const fresnel[] = {"\"ideal\"",
                                          "{\"schlick\":{\"f0\":[0,0.5,1]}}",
                                          "{\"dielectric\":{\"eta\":0.001}}",
                                          "{\"dielectric\":{\"eta\":1}}",
                                          "{\"dielectric\":{\"eta\":1000}}",
                                          "{\"conductor\":{\"eta\":0.001,\"k\":1000}}",
                                          "{\"conductor\":{\"eta\":1000,\"k\":0}}"};
    const char *mask = pick(rng, masking, 4);
    bool thesis = mask[0] == 's' && chance(rng, 0.5);
    double rho = chance(rng, 0.3) ? 0 : (chance(rng, 0.5) ? 1 : -1) * (1 - rng_log(rng, 1e-12, 1));
    double slope = chance(rng, 0.5) ? 0 : rng_log(rng, 1e-6, 1e6);
    return snprintf(out, room,
                    "{\"material\":{\"ndf\":\"%s\",\"alpha_x\":%.17g,\"alpha_y\":%.17g,\"rho\":%."
                    "17g,\"mean_slope\":[%.17g,%.17g],"
                    "\"masking\":\"%s\",\"shear\":\"%s\",\"fresnel\":%s}",
                    pick(rng, ndf, 2), rng_log(rng, 1e-8, 1e4), rng_log(rng, 1e-8, 1e4),
                    fmax(rho, -1 + 1e-12), -slope, chance(rng, 0.5) ? 0 : slope, mask,
                    thesis ? "thesis" : "energy_safe", pick(rng, fresnel, 7));
}

/* On the horizon, next to it, on the axis, below, or anywhere. */
static void direction(struct rng *rng, double v[3])
{
    double z = chance(rng, 0.3)   ? rng_log(rng, 1e-300, 1) * (chance(rng, 0.2) ? 1e-15 : 1)
               : chance(rng, 0.2) ? 0
               : chance(rng, 0.1) ? 1
                                  : rng_uniform(rng);
    double phi = chance(rng, 0.3) ? 0 : 6.283185307179586 * rng_uniform(rng), r = sqrt(1 - z * z);
    v[0] = r * cos(phi);
    v[1] = r * sin(phi);
    v[2] = chance(rng, 0.15) ? -z : z;
}

static int print_directions(char *out, size_t room, struct rng *rng)
{
    double wi[3], wo[3];
    direction(rng, wi);
    direction(rng, wo);
    if (chance(rng, 0.15)) /* H = 0 */
        for (int k = 0; k < 3; k++) wo[k] = -wi[k];
    else if (chance(rng, 0.15)) /* mirror images */
        wo[0] = -wi[0], wo[1] = -wi[1], wo[2] = wi[2];
    return snprintf(out, room, ",\"wi\":[[%.17g,%.17g,%.17g]],\"wo\":[[%.17g,%.17g,%.17g]]", wi[0],
                    wi[1], wi[2], wo[0], wo[1], wo[2]);
}

static void check_finite(const char *path, const char *body)
{
    struct answer a = ask_post(path, body);
    if (a.response.status != 200 && a.response.status != 422)
        check_fail(__FILE__, __LINE__, "%s\n  %.300s", body, (char *)a.response.body);
    answer_clear(&a);
}

TEST(corners_evaluate_to_finite_numbers)
{
    struct rng rng;
    rng_seed(&rng, 11);
    static const char *const tiers[] = {"fast", "precise"};
    for (int i = 0; i < 12000; i++) {
        char body[2000];
        int n = print_material(body, sizeof body, &rng);
        n += print_directions(body + n, sizeof body - (size_t)n, &rng);
        snprintf(body + n, sizeof body - (size_t)n,
                 ",\"tier\":\"%s\",\"outputs\":[\"fr\",\"fr_cos\",\"pdf\",\"D\",\"D_vis\",\"G\","
                 "\"G1_i\",\"G1_o\",\"F\",\"sigma_o\"]}",
                 pick(&rng, tiers, 2));
        check_finite("/v1/eval", body);
    }
}

TEST(corners_sample_finite_directions)
{
    struct rng rng;
    rng_seed(&rng, 12);
    static const char *const tiers[] = {"fast", "precise"};
    for (int i = 0; i < 6000; i++) {
        char body[2000];
        double wo[3];
        direction(&rng, wo);
        int n = print_material(body, sizeof body, &rng);
        snprintf(body + n, sizeof body - (size_t)n,
                 ",\"wo\":[[%.17g,%.17g,%.17g]],\"u\":[[0,0],[0,0.9999999999999999],[0."
                 "9999999999999999,0],"
                 "[0.9999999999999999,0.9999999999999999],[1e-300,0.75],[0.25,1e-300],[0.5,0.5]],"
                 "\"tier\":\"%s\","
                 "\"outputs\":[\"wi\",\"weight\",\"pdf\",\"h\"]}",
                 wo[0], wo[1], wo[2], pick(&rng, tiers, 2));
        check_finite("/v1/sample", body);
    }
}

TEST(opposite_directions_see_no_facet)
{
    static const char *const maskings[] = {"smith", "smith_uncorrelated", "vgroove", "none"};
    for (int i = 0; i < 4; i++) {
        char body[400];
        snprintf(body, sizeof body,
                 "{\"material\":{\"alpha\":0.3,\"masking\":\"%s\"},\"wi\":[[0.6,0,0.8]],\"wo\":[[-"
                 "0.6,0,-0.8]],"
                 "\"outputs\":[\"D\",\"D_vis\",\"pdf\",\"fr\"]}",
                 maskings[i]);
        struct answer a = ask_post("/v1/eval", body);
        CHECK(answer_count(&a, "D_vis") == 1 && answer_number(&a, "D_vis", 0) == 0);
        CHECK(answer_number(&a, "D", 0) == 0 && answer_number(&a, "pdf", 0) == 0 &&
              answer_number(&a, "fr", 0) == 0);
        answer_clear(&a);
    }
}

TEST(from_straight_below_there_is_nothing_to_sample)
{
    static const char *const ndf[] = {"ggx", "beckmann"};
    for (int i = 0; i < 2; i++) {
        char body[300];
        snprintf(
            body, sizeof body,
            "{\"material\":{\"ndf\":\"%s\",\"alpha\":0.3},\"wo\":[[0,0,-1]],\"u\":[[0.3,0.6]]}",
            ndf[i]);
        struct answer a = ask_post("/v1/sample", body);
        CHECK_INT(a.response.status, 200);
        CHECK(answer_count(&a, "weight") == 1 && answer_number(&a, "weight", 0) == 0 &&
              answer_number(&a, "pdf", 0) == 0);
        answer_clear(&a);
    }
}

/* Masking "none": G1 = 2 cos(theta_k) H_z / |H|^2, 1 for mirror images however low. */
TEST(grazing_mirror_images_keep_their_masking)
{
    struct answer a = ask_post("/v1/eval", "{\"material\":{\"alpha\":0.3,\"masking\":\"none\"},"
                                           "\"wi\":[[1,0,1e-300]],\"wo\":[[-1,0,1e-300]],"
                                           "\"outputs\":[\"G1_i\"],\"tier\":\"precise\"}");
    CHECK_REL(answer_number(&a, "G1_i", 0), 1, 1e-6, 0);
    answer_clear(&a);
}
