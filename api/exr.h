/* exr.h - OpenEXR files in memory, through OpenEXRCore: heights in, pyramids out. */
#ifndef EXR_H
#define EXR_H

#include "facet_leadr.h"
#include "image.h"

#include <stdbool.h>
#include <stdint.h>

/* True if the bytes start like an OpenEXR file. */
bool api_exr_is(const unsigned char *bytes, size_t size);

/*
 * Read one channel of the first part that is not deep and holds it: scanlines or
 * tiles (level 0), half, float or uint.  channel NULL: the only one, else the
 * first of height, displacement, Y, R, Z.  Nothing is trusted: the memory the
 * library may take, its chunks and the size of what they unpack to are bounded
 * by the size of the file.
 * Refused as UNSUPPORTED: deep data, subsampled channels, and the B44 and DWA
 * compressions (lossy: made for what the eye sees, not for differences).
 */
enum image_status api_exr_read(const void *bytes, size_t size, const char *channel,
                               const facet_watch *watch, struct image *image,
                               struct image_problem *problem);

enum { EXR_PLANES_MAX = 8 };

/* A text or a number, never both. */
struct exr_attribute {
    const char *name;
    const char *text; /* NULL: number */
    double number;
};

enum exr_compression { EXR_STORE, EXR_ZIP }; /* EXR's NONE and ZIP */

struct exr_pyramid {
    size_t level_count;
    const size_t *widths, *heights; /* halved and rounded down, to 1 x 1 */
    size_t plane_count;
    const char *names[EXR_PLANES_MAX];
    bool half; /* the rows must hold values binary16 represents */
    enum exr_compression compression;
    const facet_crew *crew; /* compresses too, with the same bytes; NULL: nobody does */
};

/* One tiled, MIP-mapped part, made in memory from rows as they come. */
struct exr_writer;

/* attributes: those of the header, or others of the same length.  NULL: *problem says why. */
struct exr_writer *api_exr_writer_open(const struct exr_pyramid *pyramid,
                                       const struct exr_attribute *attributes,
                                       size_t attribute_count, struct image_problem *problem);
/*
 * Rows of a level in order, levels in any: begin says which `count` rows come, from `first` on, within
 * one multiple of FACET_SINK_ROWS; put takes each, a value per plane and column, on any thread; end
 * takes notice that they are there.  False: out of memory; close it then.
 */
bool api_exr_writer_begin(struct exr_writer *writer, size_t level, size_t first, size_t count);
void api_exr_writer_put(const struct exr_writer *writer, size_t level, size_t row,
                        const float *const *planes);
void api_exr_writer_end(struct exr_writer *writer, size_t level, size_t first, size_t count);
/* After every row of every level: *bytes is to be freed.  The attributes may have changed since,
 * but not in length. */
enum image_status api_exr_writer_finish(struct exr_writer *writer,
                                        const struct exr_attribute *attributes,
                                        size_t attribute_count, void **bytes, size_t *size,
                                        struct image_problem *problem);
void api_exr_writer_close(struct exr_writer *writer); /* NULL is allowed; also after finish */

#endif
