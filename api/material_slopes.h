/* material_slopes.h - the member "slopes" of a material: the table of its distribution. */
#ifndef MATERIAL_SLOPES_H
#define MATERIAL_SLOPES_H

#include "material.h"

extern const struct field api_slopes_fields[];

/* Of rows, what a field table cannot say: it knows one dimension.  object: a struct slopes. */
bool api_slopes_check(void *object, const struct place *place, struct decoder *decoder);

/* material->table, which lives as long as the request. */
bool api_slopes_open(const struct slopes *slopes, const struct place *place,
                     struct decoder *decoder, facet_material *material);

#endif
