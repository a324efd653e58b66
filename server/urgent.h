/* urgent.h - threads that should answer soon even when every CPU computes. */
#ifndef URGENT_H
#define URGENT_H

enum { URGENT_SLICE_NS = 100000 }; /* the shortest there is */

/*
 * The calling thread asks the scheduler for short slices, so that it runs soon after it wakes (Linux
 * 6.12 and later; earlier ones ignore it).  It gets no more CPU than before.
 */
void urgent_thread(void);

#endif
