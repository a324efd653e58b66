/*
 * memory.h - what libc keeps of the memory that requests gave back.
 *
 * Left to itself glibc maps each array beyond 128 KiB anew, until the largest one freed so far has
 * raised that threshold: whether a request pays a page fault for every 4 KiB it touches, and how much
 * stays with the process, would depend on which requests came before it.
 */
#ifndef MEMORY_H
#define MEMORY_H

#include <stdbool.h>

/* Before any thread: fixes what libc keeps from one request to the next. */
void memory_open(void);

/* On the main network thread: a request that was not small has ended. */
void memory_used(void);
bool memory_is_kept(void);

/* To be called a few times a second while memory is kept: gives back what is free. */
void memory_tick(void);

#endif
