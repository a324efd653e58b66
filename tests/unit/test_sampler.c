/* "sampler" of /v1/pdf and /v1/eval: whose density, and who refuses what. */
#include "ask.h"
#include "check.h"

#include <malloc.h>
#include <stdio.h>

static const double pi = 3.14159265358979323846;

#define GGX "\"material\":{\"ndf\":\"ggx\",\"alpha\":0.3}"
#define GLASS(ndf)                                                                                 \
    "\"material\":{\"ndf\":\"" ndf                                                                 \
    "\",\"alpha\":0.3,\"transmission\":true,\"fresnel\":{\"dielectric\":{\"eta\":1.5}}}"
#define PAIR "\"wi\":[[0.6,0,0.8]],\"wo\":[[-0.6,0,0.8]]"

TEST(pdf_is_the_density_of_eval)
{
    struct answer pdf = ask_post("/v1/pdf",
                                 "{" GGX "," PAIR ",\"sampler\":\"caps\",\"tolerance\":1e-10}");
    CHECK_REL(answer_number(&pdf, "pdf", 0), 1 / (pi * 0.09) / (4 * 0.81), 1e-10, 0);
    CHECK_STR(answer_text(&pdf, "sampler"), "caps");
    answer_clear(&pdf);
    pdf = ask_post("/v1/pdf", "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3}," PAIR
                              ",\"sampler\":\"caps\"}");
    CHECK_INT(pdf.response.status, 422);
    CHECK_STR(answer_error(&pdf, "pointer"), "/sampler");
    CHECK(strstr(answer_error(&pdf, "detail"), "auto, slope"));
    answer_clear(&pdf);
}

/* Whoever samples by name finds that method's density beside fr. */
TEST(eval_has_the_pdf_of_the_sampler_named)
{
    static const char *const names[] = {"caps", "bounded", "ndf", "cosine", "vcavity"};
    for (int k = 0; k < 5; k++) {
        char body[400];
        snprintf(body, sizeof body, "{" GGX "," PAIR ",\"sampler\":\"%s\",\"tolerance\":1e-12}",
                 names[k]);
        struct answer pdf = ask_post("/v1/pdf", body);
        snprintf(body, sizeof body,
                 "{" GGX "," PAIR
                 ",\"sampler\":\"%s\",\"outputs\":[\"fr\",\"pdf\"],\"tolerance\":1e-12}",
                 names[k]);
        struct answer eval = ask_post("/v1/eval", body);
        CHECK_STR(answer_text(&eval, "sampler"), names[k]);
        CHECK_REL(answer_number(&eval, "pdf", 0), answer_number(&pdf, "pdf", 0), 1e-12, 0);
        answer_clear(&pdf);
        answer_clear(&eval);
    }
    struct answer plain = ask_post("/v1/eval",
                                   "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3}," PAIR
                                   ",\"sampler\":\"caps\"}");
    CHECK_INT(plain.response.status, 422);
    CHECK_STR(answer_error(&plain, "pointer"), "/sampler");
    answer_clear(&plain);
    plain = ask_post("/v1/eval", "{" GGX "," PAIR ",\"sampler\":\"ndf\"}");
    CHECK_INT(plain.response.status, 200);
    CHECK(!json_object_get(plain.json, "sampler")); /* nothing there depends on it */
    answer_clear(&plain);
}

/* The bytes that stay allocated after an evaluation with the sampler "table". */
static long kept_by_eval(const char *outputs)
{
    char body[400];
    snprintf(body, sizeof body,
             "{\"material\":{\"ndf\":\"beckmann\",\"alpha\":0.3}," PAIR
             ",\"sampler\":\"table\",\"tolerance\":1e-4,\"outputs\":[%s]}",
             outputs);
    const size_t before = mallinfo2().uordblks;
    struct answer a = ask_post("/v1/eval", body);
    CHECK_INT(a.response.status, 200);
    answer_clear(&a);
    return (long)(mallinfo2().uordblks - before);
}

/* A sampler beside outputs without pdf is idle: its table, which takes 25 ms, is not built. */
TEST(a_sampler_is_made_ready_for_pdf_alone)
{
    if (SANITIZED) {
        check_skip("a sanitizer's memory is not counted");
        return;
    }
    struct answer first = ask_post("/v1/eval", "{" GGX "," PAIR "}");
    answer_clear(&first);
    CHECK(kept_by_eval("\"fr\"") < 1024);
    CHECK(kept_by_eval("\"fr\",\"pdf\"") > 16384);
}

/* What auto stands for, by the material alone: one method and one density wherever it is asked. */
TEST(auto_is_one_method)
{
    static const struct {
        const char *material, *sampler;
    } cases[] = {
        {"\"ndf\":\"ggx\",\"alpha\":0.1", "bounded"},
        {"\"ndf\":\"ggx\",\"alpha\":0.0999", "caps"},
        {"\"ndf\":\"ggx\",\"alpha\":3", "bounded"},
        {"\"ndf\":\"ggx\",\"alpha_1\":0.5,\"alpha_2\":0.101,\"phi\":1", "bounded"},
        {"\"ndf\":\"ggx\",\"alpha_1\":0.5,\"alpha_2\":0.099,\"phi\":1", "caps"},
        {"\"ndf\":\"ggx\",\"alpha\":0.3,\"mean_slope\":[0.1,0]", "caps"},
        {"\"ndf\":\"ggx\",\"alpha\":0.3,\"masking\":\"vgroove\"", "bounded"},
        {"\"ndf\":\"ggx\",\"alpha\":0.3,\"diffuse\":0.5", "bounded"},
        {"\"ndf\":\"ggx\",\"alpha\":0.3,\"transmission\":true,\"fresnel\":{\"dielectric\":{\"eta\":1.5}}",
         "caps"},
        {"\"ndf\":\"beckmann\",\"alpha\":0.3", "slope"},
        {"\"ndf\":\"beckmann\",\"alpha\":0.3,\"masking\":\"vgroove\",\"mean_slope\":[0.1,0]",
         "vcavity"},
        {"\"ndf\":\"lambert\",\"reflectance\":0.5", "cosine"},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char body[400];
        snprintf(body, sizeof body,
                 "{\"material\":{%s},\"wo\":[[-0.6,0,0.8]],\"n\":1,\"seed\":3,\"tolerance\":1e-9}",
                 cases[k].material);
        struct answer sample = ask_post("/v1/sample", body);
        CHECK_INT(sample.response.status, 200);
        CHECK_STR(answer_text(&sample, "sampler"), cases[k].sampler);
        char wi[100];
        snprintf(wi, sizeof wi, "[[%.17g,%.17g,%.17g]]", answer_component(&sample, "wi", 0, 0),
                 answer_component(&sample, "wi", 0, 1), answer_component(&sample, "wi", 0, 2));
        snprintf(body, sizeof body,
                 "{\"material\":{%s},\"wo\":[[-0.6,0,0.8]],\"wi\":%s,\"tolerance\":1e-9}",
                 cases[k].material, wi);
        struct answer pdf = ask_post("/v1/pdf", body);
        CHECK_STR(answer_text(&pdf, "sampler"), cases[k].sampler);
        snprintf(body, sizeof body,
                 "{\"material\":{%s},\"wo\":[[-0.6,0,0.8]],\"wi\":%s,\"tolerance\":1e-9,"
                 "\"outputs\":[\"fr\",\"pdf\"]}",
                 cases[k].material, wi);
        struct answer eval = ask_post("/v1/eval", body);
        CHECK_STR(answer_text(&eval, "sampler"), cases[k].sampler);
        CHECK_REL(answer_number(&eval, "pdf", 0), answer_number(&pdf, "pdf", 0), 3e-9, 0);
        CHECK_REL(answer_number(&sample, "pdf", 0), answer_number(&pdf, "pdf", 0), 1e-6, 0);
        answer_clear(&sample), answer_clear(&pdf), answer_clear(&eval);
    }
}

/* The same request is no good to one endpoint and an answer of another method by the other. */
TEST(eval_and_pdf_refuse_the_same_samplers)
{
    static const struct {
        const char *material, *sampler;
        int status;
    } cases[] = {
        {GLASS("ggx"), "caps", 200},       {GLASS("ggx"), "slope", 200},
        {GLASS("beckmann"), "slope", 200}, {GLASS("ggx"), "bounded", 422},
        {GLASS("ggx"), "ndf", 422},        {GLASS("ggx"), "cosine", 422},
        {GLASS("ggx"), "vcavity", 422},    {GLASS("ggx"), "table", 422},
        {GLASS("beckmann"), "caps", 422},  {GLASS("ggx"), "auto", 200},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char body[500];
        snprintf(body, sizeof body, "{%s," PAIR ",\"sampler\":\"%s\"}", cases[k].material,
                 cases[k].sampler);
        struct answer pdf = ask_post("/v1/pdf", body);
        snprintf(body, sizeof body, "{%s," PAIR ",\"sampler\":\"%s\",\"outputs\":[\"pdf\"]}",
                 cases[k].material, cases[k].sampler);
        struct answer eval = ask_post("/v1/eval", body);
        CHECK_INT(pdf.response.status, cases[k].status);
        CHECK_INT(eval.response.status, cases[k].status);
        if (cases[k].status == 422) {
            CHECK_STR(answer_error(&eval, "pointer"), "/sampler");
            CHECK_STR(answer_error(&eval, "detail"), answer_error(&pdf, "detail"));
            CHECK(strstr(answer_error(&eval, "detail"),
                         "does not sample transmission, which has: auto, "));
        }
        answer_clear(&pdf);
        answer_clear(&eval);
    }
}
