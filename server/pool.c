#include "pool.h"

#include <errno.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* Tasks that idle workers take a hand in; on the stack of who shares them. */
struct share {
    struct share *next;
    void (*task)(void *arg, size_t index);
    void *arg;
    size_t taken, count;
    unsigned helpers; /* running a task of it */
};

struct pool {
    pthread_mutex_t mutex;
    pthread_cond_t helped; /* a helper has ended */
    struct share *shares;
    pthread_cond_t work;
    struct pool_job *first, **last; /* waiting, oldest first */
    struct pool_job *done;          /* finished, newest first */
    bool stopping;
    int fd;               /* readable while done is not empty */
    unsigned pending_max; /* workers + queue */
    unsigned pending;     /* network thread only */
    unsigned thread_count;
    pthread_t threads[];
};

/*
 * Whoever is woken takes the mutex first: so all wake-ups come after it is free, or the woken
 * thread would go back to sleep at once.
 */
static void tell_done(const struct pool *pool)
{
    const uint64_t one = 1;
    /* Fails only if 2^64 - 2 signals were waiting; the fd is readable then anyway. */
    while (write(pool->fd, &one, sizeof one) < 0 && errno == EINTR) {
    }
}

/* Tasks of a share until none is left; the mutex is held on entry and on return. */
static void take_tasks(struct pool *pool, struct share *share)
{
    while (share->taken < share->count) {
        size_t index = share->taken++;
        pthread_mutex_unlock(&pool->mutex);
        share->task(share->arg, index);
        pthread_mutex_lock(&pool->mutex);
    }
}

static struct share *open_share(const struct pool *pool)
{
    struct share *share = pool->shares;
    while (share && share->taken == share->count) share = share->next;
    return share;
}

void pool_share(struct pool *pool, size_t count, void (*task)(void *arg, size_t index), void *arg)
{
    struct share share = {.task = task, .arg = arg, .count = count};
    pthread_mutex_lock(&pool->mutex);
    share.next = pool->shares;
    pool->shares = &share;
    pthread_mutex_unlock(&pool->mutex);
    pthread_cond_broadcast(&pool->work);
    pthread_mutex_lock(&pool->mutex);
    take_tasks(pool, &share);
    while (share.helpers) pthread_cond_wait(&pool->helped, &pool->mutex);
    struct share **at = &pool->shares;
    while (*at != &share) at = &(*at)->next;
    *at = share.next;
    pthread_mutex_unlock(&pool->mutex);
}

/* Waiting requests first: a helper is who would be idle. */
static bool help(struct pool *pool)
{
    struct share *share = pool->first ? NULL : open_share(pool);
    if (!share) return false;
    share->helpers++;
    take_tasks(pool, share);
    if (!--share->helpers) pthread_cond_broadcast(&pool->helped);
    return true;
}

static void *work(void *user)
{
    struct pool *pool = user;
    pthread_mutex_lock(&pool->mutex);
    for (;;) {
        if (help(pool)) continue;
        if (!pool->first && !pool->stopping) {
            pthread_cond_wait(&pool->work, &pool->mutex);
            continue;
        }
        if (!pool->first) break;
        struct pool_job *job = pool->first;
        pool->first = job->next;
        if (!pool->first) pool->last = &pool->first;
        pthread_mutex_unlock(&pool->mutex);
        job->run(job);
        pthread_mutex_lock(&pool->mutex);
        job->next = pool->done;
        pool->done = job;
        pthread_mutex_unlock(&pool->mutex);
        tell_done(pool);
        pthread_mutex_lock(&pool->mutex);
    }
    pthread_mutex_unlock(&pool->mutex);
    return NULL;
}

/* errno says why the pool is NULL. */
static struct pool *allocate(unsigned workers, unsigned queue_max)
{
    struct pool *pool = calloc(1, sizeof *pool + workers * sizeof *pool->threads);
    if (!pool) return NULL;
    pool->last = &pool->first;
    pool->pending_max = workers + queue_max;
    pool->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (pool->fd < 0) goto no_fd;
    if ((errno = pthread_mutex_init(&pool->mutex, NULL))) goto no_mutex;
    if ((errno = pthread_cond_init(&pool->work, NULL))) goto no_cond;
    if ((errno = pthread_cond_init(&pool->helped, NULL))) goto no_helped;
    return pool;
no_helped:
    pthread_cond_destroy(&pool->work);
no_cond:
    pthread_mutex_destroy(&pool->mutex);
no_mutex:
    close(pool->fd);
no_fd:
    free(pool);
    return NULL;
}

struct pool *pool_create(unsigned workers, unsigned queue_max)
{
    struct pool *pool = allocate(workers, queue_max);
    if (!pool) return NULL;
    while (pool->thread_count < workers) {
        int error = pthread_create(&pool->threads[pool->thread_count], NULL, work, pool);
        if (error) {
            pool_destroy(pool);
            errno = error;
            return NULL;
        }
        pool->thread_count++;
    }
    return pool;
}

bool pool_submit(struct pool *pool, struct pool_job *job)
{
    if (pool->pending == pool->pending_max) return false;
    pool->pending++;
    job->next = NULL;
    pthread_mutex_lock(&pool->mutex);
    *pool->last = job;
    pool->last = &job->next;
    pthread_mutex_unlock(&pool->mutex);
    pthread_cond_signal(&pool->work);
    return true;
}

bool pool_withdraw(struct pool *pool, struct pool_job *job)
{
    bool found = false;
    pthread_mutex_lock(&pool->mutex);
    for (struct pool_job **at = &pool->first; *at; at = &(*at)->next) {
        if (*at != job) continue;
        *at = job->next;
        if (!*at) pool->last = at;
        found = true;
        break;
    }
    pthread_mutex_unlock(&pool->mutex);
    if (found) pool->pending--;
    return found;
}

int pool_fd(const struct pool *pool)
{
    return pool->fd;
}

struct pool_job *pool_collect(struct pool *pool)
{
    uint64_t count;
    pthread_mutex_lock(&pool->mutex);
    struct pool_job *job = pool->done;
    if (job) pool->done = job->next;
    /* Under the lock, so that no later job is missed: it is told of after that.  EAGAIN: it was
     * read before. */
    if (!pool->done)
        while (read(pool->fd, &count, sizeof count) < 0 && errno == EINTR) {
        }
    pthread_mutex_unlock(&pool->mutex);
    if (job) pool->pending--;
    return job;
}

unsigned pool_pending(const struct pool *pool)
{
    return pool->pending;
}

void pool_destroy(struct pool *pool)
{
    if (!pool) return;
    pthread_mutex_lock(&pool->mutex);
    pool->stopping = true;
    pthread_cond_broadcast(&pool->work);
    pthread_mutex_unlock(&pool->mutex);
    for (unsigned i = 0; i < pool->thread_count; i++) pthread_join(pool->threads[i], NULL);
    pthread_cond_destroy(&pool->helped);
    pthread_cond_destroy(&pool->work);
    pthread_mutex_destroy(&pool->mutex);
    close(pool->fd);
    free(pool);
}
