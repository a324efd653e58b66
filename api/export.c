#include "export.h"

#include "export_target.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const api_export_names[] = {"mitsuba", "pbrt", "gltf", "materialx", "glsl", NULL};

/* A candidate on its way into a tool. */
struct job {
    struct call *call;
    const facet_fit_candidate *chosen, *candidate;
    struct target target;
    facet_ellipse ellipse;
    double f0[3], kd[3];
    struct text text, lost;
};

static bool is_turned(const struct job *job)
{
    return job->candidate->anisotropic && job->candidate->material.roughness.rho != 0;
}

static bool has_kd(const struct job *job)
{
    return job->kd[0] > 0 || job->kd[1] > 0 || job->kd[2] > 0;
}

/* "a, b, c" of three numbers that read back the same to 7 digits. */
static void put_rgb(struct text *text, const double v[3], const char *separator)
{
    api_text_print(text, "%.7g%s%.7g%s%.7g", v[0], separator, v[1], separator, v[2]);
}

/* What a weight w between two materials, one number, makes of a coloured kd. */
static double blend(struct job *job, double diffuse[3], double specular[3])
{
    double w = fmax(job->kd[0], fmax(job->kd[1], job->kd[2]));
    for (int c = 0; c < 3; c++) {
        diffuse[c] = w > 0 ? job->kd[c] / w : 0;
        specular[c] = 1; /* (1 - kd)/(1 - w) > 1 is no reflectance */
        job->target.diffuse[c] = job->kd[c];
        job->target.specular[c] = 1 - w;
    }
    if (w > 0 && (job->kd[0] != w || job->kd[1] != w || job->kd[2] != w))
        api_text_put(&job->lost, "; one weight blends all channels, so the specular part is 1 - "
                                 "max(kd) in each");
    return w;
}

/* Tools with eta and k: Schlick's term becomes a metal's. */
static void use_conductor(struct job *job)
{
    facet_fresnel *f = &job->target.material.fresnel;
    f->kind = FACET_FRESNEL_CONDUCTOR;
    f->channels = 3;
    api_export_conductor(job->f0, f->eta, f->k);
    api_text_put(&job->lost, "; the Fresnel term is the conductor closest to Schlick's");
}

/* Tools whose roughness lies along the tangent: the ellipse's axes, the frame turned by hand. */
static void use_ellipse(struct job *job, const char *how)
{
    facet_roughness *r = &job->target.material.roughness;
    if (!is_turned(job)) {
        job->ellipse = (facet_ellipse){r->alpha_x, r->alpha_y, 0};
        return;
    }
    api_text_print(&job->lost,
                   "; rho has no place: turn %s by %.7g rad, which is in no number "
                   "below",
                   how, -job->ellipse.phi);
}

/* ---- Mitsuba 3 ------------------------------------------------------------------------------------ */

static void write_mitsuba(struct job *job)
{
    struct text *t = &job->text;
    facet_fresnel *f = &job->target.material.fresnel;
    double diffuse[3], specular[3], w = blend(job, diffuse, specular);
    use_conductor(job);
    use_ellipse(job, "the tangents (or the texture coordinates)");
    job->target.material.masking = FACET_SMITH_UNCORRELATED;
    api_text_put(&job->lost, "; masking and shadowing are uncorrelated");
    if (w > 0)
        api_text_print(t, "<bsdf type=\"blendbsdf\">\n<float name=\"weight\" value=\"%.7g\"/>\n",
                       w);
    api_text_print(t,
                   "<bsdf type=\"roughconductor\">\n"
                   "    <string name=\"distribution\" value=\"%s\"/>\n",
                   job->target.material.ndf == FACET_GGX ? "ggx" : "beckmann");
    api_text_print(t,
                   "    <float name=\"alpha_u\" value=\"%.9g\"/>\n"
                   "    <float name=\"alpha_v\" value=\"%.9g\"/>\n",
                   job->ellipse.alpha_1, job->ellipse.alpha_2);
    api_text_put(t, "    <rgb name=\"eta\" value=\"");
    put_rgb(t, f->eta, ", ");
    api_text_put(t, "\"/>\n    <rgb name=\"k\" value=\"");
    put_rgb(t, f->k, ", ");
    api_text_put(t, "\"/>\n</bsdf>\n");
    if (w == 0) return;
    api_text_put(t, "<bsdf type=\"diffuse\">\n    <rgb name=\"reflectance\" value=\"");
    put_rgb(t, diffuse, ", ");
    api_text_put(t, "\"/>\n</bsdf>\n</bsdf>\n");
}

/* ---- pbrt-v4 ----------------------------------------------------------------------------------------- */

static void write_pbrt(struct job *job)
{
    struct text *t = &job->text;
    double diffuse[3], specular[3], w = blend(job, diffuse, specular);
    facet_fresnel *f = &job->target.material.fresnel;
    use_ellipse(job, "dpdu of the shape");
    f->kind = FACET_FRESNEL_CONDUCTOR; /* pbrt's own: eta 1, k from the reflectance */
    f->channels = 3;
    double r[3];
    for (int c = 0; c < 3; c++) {
        r[c] = fmin(job->f0[c], 0.9999);
        f->eta[c] = 1;
        f->k[c] = fmin(2 * sqrt(r[c]) / sqrt(1 - r[c]), FACET_K_MAX);
    }
    api_text_put(&job->lost, "; the Fresnel term is a conductor of eta 1");
    if (w > 0)
        api_text_put(t, "MakeNamedMaterial \"specular\" \"string type\" \"conductor\"\n");
    else
        api_text_put(t, "Material \"conductor\"\n");
    api_text_put(t, "    \"rgb reflectance\" [ ");
    put_rgb(t, r, " ");
    api_text_print(t,
                   " ]\n    \"float uroughness\" [ %.9g ] \"float vroughness\" [ %.9g ]\n"
                   "    \"bool remaproughness\" [ false ]\n",
                   job->ellipse.alpha_1, job->ellipse.alpha_2);
    if (w == 0) return;
    api_text_put(t,
                 "MakeNamedMaterial \"base\" \"string type\" \"diffuse\" \"rgb reflectance\" [ ");
    put_rgb(t, diffuse, " ");
    api_text_print(t,
                   " ]\nMaterial \"mix\" \"string materials\" [ \"specular\" \"base\" ] "
                   "\"float amount\" [ %.7g ]\n",
                   w);
}

/* ---- glTF 2.0 -------------------------------------------------------------------------------------------- */

/* alpha = roughness^2; KHR_materials_anisotropy: alpha_t = mix(alpha_b, 1, strength^2), turned. */
static void write_gltf(struct job *job)
{
    struct text *t = &job->text;
    facet_ellipse e = facet_roughness_to_ellipse(&job->candidate->material.roughness);
    double a = fmin(e.alpha_2, 1), b = fmin(e.alpha_1, 1);
    double strength = a < 1 ? sqrt(fmax(0, (b - a) / (1 - a))) : 0;
    struct target *target = &job->target;
    bool metal = !has_kd(job);
    if (e.alpha_1 > 1) api_text_put(&job->lost, "; alpha ends at 1");
    facet_ellipse kept = {b, a, e.phi};
    facet_roughness_from_ellipse(&kept, 0, 0, &target->material.roughness);
    for (int c = 0; c < 3; c++) {
        target->specular[c] = 1;
        target->diffuse[c] = job->kd[c];
    }
    target->dimmed = true;
    api_text_put(t, "{\n  \"pbrMetallicRoughness\": {\n    \"baseColorFactor\": [");
    put_rgb(t, metal ? job->f0 : job->kd, ", ");
    api_text_print(t, ", 1],\n    \"metallicFactor\": %d,\n    \"roughnessFactor\": %.9g\n  }",
                   metal, sqrt(a));
    if (!metal || strength > 0) api_text_put(t, ",\n  \"extensions\": {");
    if (!metal) { /* f0 = min(0.04 specularColor, 1): dielectrics of ior 1.5 */
        double colour[3];
        for (int c = 0; c < 3; c++) colour[c] = job->f0[c] / 0.04;
        api_text_put(t, "\n    \"KHR_materials_specular\": { \"specularColorFactor\": [");
        put_rgb(t, colour, ", ");
        api_text_put(t, "] }");
        api_text_put(&job->lost, "; the specular part is not dimmed by 1 - kd but the diffuse part "
                                 "by 1 - F");
    }
    if (strength > 0)
        api_text_print(t,
                       "%s\n    \"KHR_materials_anisotropy\": { \"anisotropyStrength\": %.9g, "
                       "\"anisotropyRotation\": %.9g }",
                       metal ? "" : ",", strength, -e.phi);
    if (!metal || strength > 0) api_text_put(t, "\n  }");
    api_text_put(t, "\n}\n");
    if (is_turned(job)) api_text_put(&job->lost, "; glTF knows no rho: it became a rotation");
}

/* ---- MaterialX 1.38 ----------------------------------------------------------------------------------------- */

static void write_materialx(struct job *job)
{
    struct text *t = &job->text;
    double diffuse[3], specular[3], w = blend(job, diffuse, specular);
    use_ellipse(job, "the tangent input");
    api_text_put(t, "<?xml version=\"1.0\"?>\n<materialx version=\"1.38\">\n"
                    "  <generalized_schlick_bsdf name=\"specular\" type=\"BSDF\">\n"
                    "    <input name=\"color0\" type=\"color3\" value=\"");
    put_rgb(t, job->f0, ", ");
    api_text_print(t,
                   "\"/>\n    <input name=\"color90\" type=\"color3\" value=\"1, 1, 1\"/>\n"
                   "    <input name=\"exponent\" type=\"float\" value=\"5\"/>\n"
                   "    <input name=\"roughness\" type=\"vector2\" value=\"%.9g, %.9g\"/>\n"
                   "    <input name=\"distribution\" type=\"string\" value=\"ggx\"/>\n"
                   "  </generalized_schlick_bsdf>\n",
                   job->ellipse.alpha_1, job->ellipse.alpha_2);
    if (w > 0) {
        api_text_put(t, "  <oren_nayar_diffuse_bsdf name=\"base\" type=\"BSDF\">\n"
                        "    <input name=\"color\" type=\"color3\" value=\"");
        put_rgb(t, diffuse, ", ");
        api_text_print(t,
                       "\"/>\n    <input name=\"roughness\" type=\"float\" value=\"0\"/>\n"
                       "  </oren_nayar_diffuse_bsdf>\n"
                       "  <mix name=\"both\" type=\"BSDF\">\n"
                       "    <input name=\"fg\" type=\"BSDF\" nodename=\"base\"/>\n"
                       "    <input name=\"bg\" type=\"BSDF\" nodename=\"specular\"/>\n"
                       "    <input name=\"mix\" type=\"float\" value=\"%.7g\"/>\n  </mix>\n",
                       w);
    }
    api_text_print(
        t,
        "  <surface name=\"fitted\" type=\"surfaceshader\">\n"
        "    <input name=\"bsdf\" type=\"BSDF\" nodename=\"%s\"/>\n  </surface>\n"
        "  <surfacematerial name=\"material\" type=\"material\">\n"
        "    <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"fitted\"/>\n"
        "  </surfacematerial>\n</materialx>\n",
        w > 0 ? "both" : "specular");
}

/* ---- GLSL ------------------------------------------------------------------------------------------------------ */

static const char glsl_head[] =
    "// f_r of the fitted material, wi and wo in the tangent frame (+z normal); facetd.\n"
    "float facet_sigma(vec3 k, vec3 a) { // alpha_x, alpha_y, rho\n"
    "    float s = length(vec2(a.x*k.x + a.z*a.y*k.y, a.y*sqrt(1.0 - a.z*a.z)*k.y));\n";
static const char glsl_ggx[] = "    return 0.5*(k.z + length(vec2(s, k.z)));\n}\n";
/* Abramowitz & Stegun 7.1.26 for erf: 1.5e-7 */
static const char glsl_beckmann[] =
    "    if (s == 0.0) return k.z;\n"
    "    float v = k.z/s, t = 1.0/(1.0 + 0.3275911*v), e = exp(-v*v);\n"
    "    float q = t*(0.254829592 + t*(-0.284496736 + t*(1.421413741 + t*(-1.453152027 + "
    "t*1.061405429))))*e;\n"
    "    return k.z*(1.0 - 0.5*q) + s*e*0.28209479;\n}\n";

static void write_glsl_fresnel(struct job *job)
{
    struct text *t = &job->text;
    const facet_fresnel *f = &job->candidate->material.fresnel;
    if (f->kind != FACET_FRESNEL_TABLE) {
        api_text_put(t, "vec3 facet_fresnel(float c) {\n    const vec3 f0 = vec3(");
        put_rgb(t, job->f0, ", ");
        api_text_put(t, ");\n    return f0 + (1.0 - f0)*pow(1.0 - c, 5.0);\n}\n");
        return;
    }
    api_text_print(t,
                   "const int FACET_NODES = %zu;\nconst vec4 facet_table[FACET_NODES] = "
                   "vec4[FACET_NODES]( // cos theta_d; F\n",
                   f->count);
    for (size_t i = 0; i < f->count; i++) {
        double v[3];
        for (size_t c = 0; c < 3; c++) v[c] = f->values[f->channels == 3 ? c : 0][i];
        api_text_print(t, "    vec4(%.7g, ", f->cos_theta_d[i]);
        put_rgb(t, v, ", ");
        api_text_put(t, i + 1 < f->count ? "),\n" : "));\n");
    }
    api_text_put(t, "vec3 facet_fresnel(float c) {\n    int i = 1;\n"
                    "    while (i < FACET_NODES - 1 && facet_table[i].x < c) i++;\n"
                    "    vec4 a = facet_table[i - 1], b = facet_table[i];\n"
                    "    return mix(a.yzw, b.yzw, clamp((c - a.x)/(b.x - a.x), 0.0, 1.0));\n}\n");
}

static void write_glsl(struct job *job)
{
    struct text *t = &job->text;
    const facet_material *m = &job->candidate->material;
    const facet_roughness *r = &m->roughness;
    bool ggx = m->ndf == FACET_GGX;
    for (int c = 0; c < 3; c++) {
        job->target.specular[c] = 1 - job->kd[c];
        job->target.diffuse[c] = job->kd[c];
    }
    api_text_put(t, glsl_head);
    api_text_put(t, ggx ? glsl_ggx : glsl_beckmann);
    write_glsl_fresnel(job);
    api_text_print(t,
                   "vec3 facet_fr(vec3 wi, vec3 wo) {\n"
                   "    if (wi.z <= 0.0 || wo.z <= 0.0) return vec3(0.0);\n"
                   "    const vec3 a = vec3(%.9g, %.9g, %.9g);\n    const vec3 kd = vec3(",
                   r->alpha_x, r->alpha_y, r->rho);
    put_rgb(t, job->kd, ", ");
    api_text_put(
        t, ");\n    vec3 H = wi + wo;\n    float kappa = sqrt(1.0 - a.z*a.z), hh = dot(H, H);\n"
           "    float x = H.x/a.x, y = (H.y/a.y - a.z*x)/kappa;\n");
    api_text_put(t, ggx ? "    float w = H.z*H.z + x*x + y*y;\n"
                          "    float D = hh*hh/(3.14159265*a.x*a.y*kappa*w*w);\n"
                        : "    float D = hh*hh*exp(-(x*x + y*y)/(H.z*H.z))/"
                          "(3.14159265*a.x*a.y*kappa*H.z*H.z*H.z*H.z);\n");
    api_text_put(t, "    float si = facet_sigma(wi, a), so = facet_sigma(wo, a);\n"
                    "    float s = D/(4.0*(so*wi.z + wo.z*(si - wi.z)));\n"
                    "    return (1.0 - kd)*facet_fresnel(0.5*sqrt(hh))*s + kd/3.14159265;\n}\n");
}

/* ---- All of them ------------------------------------------------------------------------------------------------ */

static void open_job(struct job *job, const facet_fit_candidate *candidate)
{
    const facet_material *m = &candidate->material;
    size_t channels = m->fresnel.channels;
    job->candidate = candidate;
    job->target.material = *m;
    job->ellipse = facet_roughness_to_ellipse(&m->roughness);
    for (size_t c = 0; c < 3; c++) {
        job->f0[c] = m->fresnel.f0[channels == 3 ? c : 0];
        job->kd[c] = candidate->has_diffuse ? candidate->diffuse[c] : 0;
    }
    if (candidate != job->chosen)
        api_text_print(&job->lost,
                       "; the chosen %s is not known there, this is the closest that is",
                       job->chosen->material.ndf == FACET_TABULATED ? "tabulated distribution"
                                                                    : "Fresnel table or ndf");
}

bool api_export(struct call *call, int tool, const facet_fit *fit,
                const facet_fit_candidate *chosen, struct fit_export *out)
{
    static void (*const write[])(struct job *) = {write_mitsuba, write_pbrt, write_gltf,
                                                  write_materialx, write_glsl};
    struct job job = {.call = call,
                      .chosen = chosen,
                      .text = api_text(call->arena),
                      .lost = api_text(call->arena)};
    struct place at = {NULL, "export", 0};
    bool beckmann = tool == EXPORT_MITSUBA || tool == EXPORT_GLSL;
    const facet_fit_candidate *candidate = api_export_choose(fit, chosen, beckmann,
                                                             tool == EXPORT_GLSL);
    if (!candidate)
        return api_problem_at(call->problem, &at,
                              "no candidate that %s knows was fitted: ask for model auto or ggx",
                              api_export_names[tool]);
    open_job(&job, candidate);
    write[tool](&job);
    size_t size;
    char *text = api_text_take(&job.text, &size), *lost = api_text_take(&job.lost, &size);
    out->tool = api_export_names[tool];
    out->text = text ? api_arena_text(call->arena, text, strlen(text)) : NULL;
    const char *said = lost && strlen(lost) > 2 ? lost + 2 : "nothing";
    out->lost = lost ? api_arena_text(call->arena, said, strlen(said)) : NULL;
    free(text);
    free(lost);
    if (!out->text || !out->lost) return api_problem_memory(call->problem);
    return api_export_loss(call, chosen, &job.target, &out->rms_log);
}
