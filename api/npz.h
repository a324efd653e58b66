/* npz.h - NumPy's .npz: a zip archive (APPNOTE 6.3) of stored .npy files. */
#ifndef API_NPZ_H
#define API_NPZ_H

#include "results.h"

#include <stdbool.h>

struct named_results;

/*
 * Moves the arrays to the end of `text`, each between the headers of its file, and the directory
 * behind them.  The sums are still missing: they need the bytes in one piece.
 */
void api_npz_write(struct text *text, const struct named_results *arrays, size_t count);

/* Fills in the checksums of such an archive. */
void api_npz_sum(unsigned char *bytes, size_t size);

#endif
