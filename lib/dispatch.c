/*
 * dispatch.c - the compiled (tier, io, isa) tables and the processor they meet.
 *
 * FACET_ISAS comes from the Makefile, cheapest first: ISA(base) ISA(avx2) ...
 */
#include "dispatch.h"

#include <stdatomic.h>
#include <string.h>

/* FORM(tier, TIER, io, IO): what is compiled for each instruction set. */
#define FORMS_OF_DOUBLES(FORM, isa)                                                                \
    FORM(draft, DRAFT, double, DOUBLE, isa)                                                        \
    FORM(fast, FAST, double, DOUBLE, isa)                                                          \
    FORM(exact32, EXACT32, double, DOUBLE, isa)                                                    \
    FORM(precise, PRECISE, double, DOUBLE, isa)
#define FORMS(FORM, isa)                                                                           \
    FORM(draft, DRAFT, float, FLOAT, isa)                                                          \
    FORM(fast, FAST, float, FLOAT, isa)                                                            \
    FORM(exact32, EXACT32, float, FLOAT, isa)                                                      \
    FORMS_OF_DOUBLES(FORM, isa)

#define DECLARE(tier, TIER, io, IO, isa)                                                           \
    extern const struct facet_kernels facet_kernels_##tier##_##io##_##isa;                         \
    extern const struct facet_samplers facet_samplers_##tier##_##io##_##isa;
#define DECLARE_REFRACTIONS(tier, TIER, io, IO, isa)                                               \
    extern const struct facet_refractions facet_refractions_##tier##_##io##_##isa;
#define ISA(name) FORMS(DECLARE, name) FORMS_OF_DOUBLES(DECLARE_REFRACTIONS, name)
FACET_ISAS
#undef ISA

#define KERNELS(tier, TIER, io, IO, isa)                                                           \
    [FACET_##TIER][KERNEL_##IO] = &facet_kernels_##tier##_##io##_##isa,
#define SAMPLERS(tier, TIER, io, IO, isa)                                                          \
    [FACET_##TIER][KERNEL_##IO] = &facet_samplers_##tier##_##io##_##isa,
#define REFRACTIONS(tier, TIER, io, IO, isa)                                                       \
    [FACET_##TIER] = &facet_refractions_##tier##_##io##_##isa,
static const struct isa {
    const char *name;
    const struct facet_kernels *kernels[FACET_TIER_COUNT][KERNEL_IO_COUNT];
    const struct facet_samplers *samplers[FACET_TIER_COUNT][KERNEL_IO_COUNT];
    const struct facet_refractions *refractions[FACET_TIER_COUNT];
} isas[] = {
#define ISA(name)                                                                                  \
    {#name, {FORMS(KERNELS, name)}, {FORMS(SAMPLERS, name)}, {FORMS_OF_DOUBLES(REFRACTIONS, name)}},
    FACET_ISAS
#undef ISA
};

enum { ISA_COUNT = sizeof isas / sizeof *isas, UNSELECTED = -1 };

static atomic_int selected = UNSELECTED;

static bool processor_runs(const char *name)
{
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (!strcmp(name, "avx2"))
        return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    if (!strcmp(name, "avx512"))
        return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
               __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw");
#endif
    return !strcmp(name, "base");
}

static int best_isa(void)
{
    int best = 0;
    for (int i = 0; i < ISA_COUNT; i++)
        if (processor_runs(isas[i].name)) best = i;
    return best;
}

static const struct isa *current_isa(void)
{
    int i = atomic_load_explicit(&selected, memory_order_relaxed);
    if (i == UNSELECTED) {
        i = best_isa(); /* every thread finds the same */
        atomic_store_explicit(&selected, i, memory_order_relaxed);
    }
    return &isas[i];
}

const struct facet_kernels *facet_kernels_for(facet_tier tier, enum kernel_io io)
{
    return current_isa()->kernels[tier][io];
}

const struct facet_samplers *facet_samplers_for(facet_tier tier, enum kernel_io io)
{
    return current_isa()->samplers[tier][io];
}

const struct facet_refractions *facet_refractions_for(facet_tier tier)
{
    return current_isa()->refractions[tier];
}

const char *facet_isa(void)
{
    return current_isa()->name;
}

const char *facet_isa_list(size_t index)
{
    for (int i = 0; i < ISA_COUNT; i++)
        if (processor_runs(isas[i].name) && index-- == 0) return isas[i].name;
    return NULL;
}

facet_status facet_isa_select(const char *name)
{
    int found = name ? UNSELECTED : best_isa();
    for (int i = 0; name && i < ISA_COUNT; i++)
        if (!strcmp(isas[i].name, name) && processor_runs(name)) found = i;
    if (found == UNSELECTED) return FACET_UNSUPPORTED;
    atomic_store_explicit(&selected, found, memory_order_relaxed);
    return FACET_OK;
}
