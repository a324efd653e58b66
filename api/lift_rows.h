/*
 * lift_rows.h - the rows of a large array, parsed by several threads at once.
 *
 * The text is cut behind rows, wherever "],[" stands; each stretch is parsed as if it were reached.  It
 * counts only if the one before it ended exactly there, so that the result is that of reading from
 * the front, whatever the text holds.
 */
#ifndef API_LIFT_ROWS_H
#define API_LIFT_ROWS_H

#include "array.h"

/* Of fewer bytes one thread is fast enough, and spends less: it need not gather what others parsed. */
enum { ROWS_TOGETHER_MIN = 1 << 22 };

/* Takes n numbers, of whole rows; false: no memory. */
typedef bool take_numbers_fn(void *user, const double *values, size_t n);

/*
 * Behind a row of `columns` numbers: the rows that follow, as far as that goes; *at moves behind
 * them.  Does nothing where there are no threads or no memory.  False: take said so.
 */
bool api_lift_rows(const struct document *document, const char **at, const char *end,
                   size_t columns, take_numbers_fn *take, void *user);

#endif
