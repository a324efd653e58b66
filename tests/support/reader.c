#include "reader.h"

#include "check.h"

#include <math.h>
#include <string.h>

bool reader_open(struct reader *o, const void *bytes, size_t size, int format)
{
    memset(o, 0, sizeof *o);
    api_arena_open(&o->arena, (size_t)1 << 28);
    return api_measurement_open(bytes, size, format, &o->arena, &o->problem, &o->m);
}

void reader_close(struct reader *o)
{
    api_arena_close(&o->arena);
}

void reader_direction(double theta, double phi, double v[3])
{
    v[0] = sin(theta) * cos(phi), v[1] = sin(theta) * sin(phi), v[2] = cos(theta);
}

bool reader_ask(const facet_fit_source *source, const double i[3], const double o[3], double rgb[3])
{
    double *const fr[3] = {rgb, rgb + 1, rgb + 2};
    bool valid = false;
    CHECK_INT(source->evaluate(source->user, (facet_vec3_in){i, i + 1, i + 2},
                               (facet_vec3_in){o, o + 1, o + 2}, 1, fr, &valid),
              FACET_OK);
    return valid;
}

void reader_refuses(const void *bytes, size_t size, int format, const char *says)
{
    struct reader o;
    CHECK(!reader_open(&o, bytes, size, format));
    CHECK_INT(o.problem.status, 422);
    if (!strstr(o.problem.detail, says))
        check_fail(__FILE__, __LINE__, "\"%s\" does not say \"%s\"", o.problem.detail, says);
    reader_close(&o);
}
