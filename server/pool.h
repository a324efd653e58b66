/*
 * pool.h - a bounded pool of worker threads for long requests.
 *
 * One thread (the network loop) submits, withdraws and collects; the workers only run jobs.
 * A finished job waits until it is collected, and pool_fd becomes readable.
 */
#ifndef POOL_H
#define POOL_H

#include <stdbool.h>
#include <stddef.h>

/* Embed it in what is to be done; the pool allocates nothing per job. */
struct pool_job {
    void (*run)(struct pool_job *job); /* on a worker */
    struct pool_job *next;
};

struct pool;

/* NULL: out of memory, threads or descriptors; errno tells. */
struct pool *pool_create(unsigned workers, unsigned queue_max);

/* False: all workers are busy and the queue is full. */
bool pool_submit(struct pool *pool, struct pool_job *job);

/* True: the job had not begun; it is the caller's again and is never run. */
bool pool_withdraw(struct pool *pool, struct pool_job *job);

/* Poll this for reading, then collect until NULL. */
int pool_fd(const struct pool *pool);
struct pool_job *pool_collect(struct pool *pool);

/*
 * On a worker: task(arg, 0) .. task(arg, count - 1), helped by workers that have nothing else to do;
 * returns when all have ended.
 */
void pool_share(struct pool *pool, size_t count, void (*task)(void *arg, size_t index), void *arg);

/* Jobs submitted and neither collected nor withdrawn. */
unsigned pool_pending(const struct pool *pool);

/* Waits for running jobs; every job must have been collected or withdrawn.  NULL is fine. */
void pool_destroy(struct pool *pool);

#endif
