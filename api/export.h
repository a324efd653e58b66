/* export.h - a fitted material in another tool's convention, and what that loses. */
#ifndef API_EXPORT_H
#define API_EXPORT_H

#include "fit_answer.h"

enum { EXPORT_MITSUBA, EXPORT_PBRT, EXPORT_GLTF, EXPORT_MATERIALX, EXPORT_GLSL };
extern const char *const api_export_names[];

/* The chosen candidate, or where the tool has no such model the closest one it has. */
bool api_export(struct call *call, int tool, const facet_fit *fit,
                const facet_fit_candidate *chosen, struct fit_export *out);

#endif
