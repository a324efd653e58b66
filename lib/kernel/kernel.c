/*
 * kernel.c - the batch loops, compiled once per (tier, io, isa).
 *
 * Each loop computes one quantity for one model; what the model lacks (shear,
 * correlation, masking) is gone by constant folding.  A quantity that nobody
 * asked for has no loop running.  The Fresnel kind is a branch that goes the same
 * way for a whole batch, but for those kinds that loops.def gives loops of their own.
 */
#include "loop.h"

#define EVAL_LOOP(q, ndf, shape, masking)                                                          \
    LOOP(q##_##ndf##_##shape##_##masking, ndf, shape, KERNEL_##masking, (void)0, ONE_QUANTITY(q))
/* The masking is a branch that goes the same way for a whole batch. */
#define ANY_LOOP(q, ndf, shape)                                                                    \
    LOOP(q##_##ndf##_##shape##_ANY, ndf, shape, job->masking, (void)0, ONE_QUANTITY(q))
/* One channel and a Fresnel kind known in advance. */
#define FRESNEL_LOOP(q, ndf, shape, kind_)                                                         \
    LOOP(q##_##ndf##_##shape##_##kind_, ndf, shape, KERNEL_SMITH,                                  \
         const struct kernel_fresnel only = *job->fresnel;                                         \
         own.fresnel = &only; own.kind = FACET_FRESNEL_##kind_; own.channels = 1, ONE_QUANTITY(q))
/* Both at once: what a renderer asks for. */
#define FR_PDF_LOOP(ndf, shape)                                                                    \
    LOOP(FR_PDF_##ndf##_##shape, ndf, shape, KERNEL_SMITH, (void)0,                                \
         ONE_QUANTITY(FR) ONE_QUANTITY(PDF))
#include "loops.def"
#undef EVAL_LOOP
#undef ANY_LOOP
#undef FRESNEL_LOOP
#undef FR_PDF_LOOP

/* ---- the table --------------------------------------------------------------------------- */

extern const struct facet_kernels TABLE_NAME(kernels, FACET_TIER, FACET_IO, FACET_ISA);
const struct facet_kernels TABLE_NAME(kernels, FACET_TIER, FACET_IO, FACET_ISA) = {
#define EVAL_LOOP(q, ndf, shape, masking)                                                          \
    .eval[KERNEL_##q][FACET_##ndf][KERNEL_##shape][KERNEL_##masking] =                             \
        q##_##ndf##_##shape##_##masking,
/* Under SMITH eval.c finds what serves every masking. */
#define ANY_LOOP(q, ndf, shape)                                                                    \
    .eval[KERNEL_##q][FACET_##ndf][KERNEL_##shape][KERNEL_SMITH] = q##_##ndf##_##shape##_ANY,
#define FRESNEL_LOOP(q, ndf, shape, kind)                                                          \
    .fr_achromatic[FACET_##ndf][KERNEL_##shape][FACET_FRESNEL_##kind] =                            \
        q##_##ndf##_##shape##_##kind,
#define FR_PDF_LOOP(ndf, shape) .fr_pdf[FACET_##ndf][KERNEL_##shape] = FR_PDF_##ndf##_##shape,
#include "loops.def"
};
