/*
 * fault.c - preloaded into a daemon: makes one allocation or one system call fail, the one that the
 * shared page names.  Not part of the product; needs glibc.
 */
#define _GNU_SOURCE
#include "fault.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/random.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

/* The allocator itself, under the names that glibc keeps for interposers. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *block);

static struct fault_page before = {.left = -1}; /* until the shared one is mapped */
static struct fault_page *page = &before;

static bool fails(const char *what)
{
    if (atomic_load(&page->left) < 0) return false;
    if (atomic_fetch_sub(&page->left, 1) != 0) return false;
    snprintf(page->what, sizeof page->what, "%s", what);
    atomic_store(&page->hit, 1);
    return true;
}

static void *held(void *block)
{
    if (block) atomic_fetch_add(&page->live, 1);
    return block;
}

__attribute__((constructor)) static void map(void)
{
    const char *path = getenv(FAULT_PAGE), *at = getenv(FAULT_AT);
    int fd = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (fd < 0) return;
    void *shared = mmap(NULL, sizeof *page, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (shared == MAP_FAILED) return;
    page = shared;
    atomic_store(&page->live, atomic_load(&before.live));
    atomic_store(&page->left, at ? strtol(at, NULL, 10) : -1);
}

/* ---- memory ---------------------------------------------------------------------------------- */

void *malloc(size_t size)
{
    if (fails("malloc")) return errno = ENOMEM, NULL;
    return held(__libc_malloc(size));
}

void *calloc(size_t count, size_t size)
{
    if (fails("calloc")) return errno = ENOMEM, NULL;
    return held(__libc_calloc(count, size));
}

void *realloc(void *block, size_t size)
{
    if (size && fails("realloc")) return errno = ENOMEM, NULL;
    void *now = __libc_realloc(block, size);
    if (!block) return held(now);
    if (!size) atomic_fetch_sub(&page->live, 1);
    return now;
}

void *aligned_alloc(size_t alignment, size_t size)
{
    if (fails("aligned_alloc")) return errno = ENOMEM, NULL;
    return held(__libc_memalign(alignment, size));
}

void *memalign(size_t alignment, size_t size);
void *memalign(size_t alignment, size_t size)
{
    if (fails("memalign")) return errno = ENOMEM, NULL;
    return held(__libc_memalign(alignment, size));
}

int posix_memalign(void **block, size_t alignment, size_t size)
{
    if (fails("posix_memalign")) return ENOMEM;
    *block = held(__libc_memalign(alignment, size));
    return *block ? 0 : ENOMEM;
}

void free(void *block)
{
    if (!block) return;
    atomic_fetch_sub(&page->live, 1);
    __libc_free(block);
}

/* ---- system calls ------------------------------------------------------------------------------ */

/* CALL(type, name, (parameters), (arguments), error, failure): fails with that errno. */
#define CALL(type, name, parameters, arguments, error, failure)                                    \
    type name parameters                                                                           \
    {                                                                                              \
        static type(*real) parameters;                                                             \
        if (!real) *(void **)&real = dlsym(RTLD_NEXT, #name);                                      \
        if (fails(#name)) return errno = (error), (failure);                                       \
        return real arguments;                                                                     \
    }

CALL(int, accept4, (int fd, struct sockaddr *a, socklen_t *n, int flags), (fd, a, n, flags), EMFILE,
     -1)
CALL(int, epoll_create1, (int flags), (flags), EMFILE, -1)
CALL(int, epoll_wait, (int e, struct epoll_event *v, int n, int ms), (e, v, n, ms), EINTR, -1)
CALL(int, poll, (struct pollfd * fds, nfds_t n, int ms), (fds, n, ms), ENOMEM, -1)
CALL(int, eventfd, (unsigned n, int flags), (n, flags), EMFILE, -1)
CALL(int, signalfd, (int fd, const sigset_t *set, int flags), (fd, set, flags), EMFILE, -1)
CALL(int, socket, (int d, int t, int p), (d, t, p), EMFILE, -1)
CALL(int, bind, (int fd, const struct sockaddr *a, socklen_t n), (fd, a, n), EADDRINUSE, -1)
CALL(int, listen, (int fd, int n), (fd, n), EADDRINUSE, -1)
CALL(int, getsockname, (int fd, struct sockaddr *a, socklen_t *n), (fd, a, n), ENOBUFS, -1)
CALL(int, setsockopt, (int fd, int l, int o, const void *v, socklen_t n), (fd, l, o, v, n), ENOMEM,
     -1)
CALL(int, getsockopt, (int fd, int l, int o, void *v, socklen_t *n), (fd, l, o, v, n), ENOBUFS, -1)
CALL(ssize_t, read, (int fd, void *b, size_t n), (fd, b, n), EINTR, -1)
CALL(ssize_t, pread, (int fd, void *b, size_t n, off_t at), (fd, b, n, at), EIO, -1)
CALL(ssize_t, write, (int fd, const void *b, size_t n), (fd, b, n), EAGAIN, -1)
CALL(ssize_t, recv, (int fd, void *b, size_t n, int flags), (fd, b, n, flags), ECONNRESET, -1)
CALL(ssize_t, send, (int fd, const void *b, size_t n, int flags), (fd, b, n, flags), EPIPE, -1)
CALL(ssize_t, sendmsg, (int fd, const struct msghdr *m, int flags), (fd, m, flags), EPIPE, -1)
CALL(ssize_t, writev, (int fd, const struct iovec *v, int n), (fd, v, n), EPIPE, -1)
CALL(ssize_t, getrandom, (void *b, size_t n, unsigned flags), (b, n, flags), EAGAIN, -1)
CALL(int, getrlimit, (__rlimit_resource_t w, struct rlimit *l), (w, l), EPERM, -1)
CALL(int, setrlimit, (__rlimit_resource_t w, const struct rlimit *l), (w, l), EPERM, -1)
CALL(int, sigaction, (int s, const struct sigaction *a, struct sigaction *o), (s, a, o), EINVAL, -1)
CALL(int, sigprocmask, (int how, const sigset_t *s, sigset_t *o), (how, s, o), EINVAL, -1)

/* Not of a removal: it needs nothing that could be missing, and libmicrohttpd aborts over it. */
int epoll_ctl(int e, int op, int fd, struct epoll_event *event)
{
    static int (*real)(int, int, int, struct epoll_event *);
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "epoll_ctl");
    if (op != EPOLL_CTL_DEL && fails("epoll_ctl")) return errno = ENOMEM, -1;
    return real(e, op, fd, event);
}

/* Mappings count as memory that is held: libmicrohttpd keeps a connection in one. */
#define MAPPING(name)                                                                              \
    void *name(void *at, size_t n, int prot, int flags, int fd, off_t offset)                      \
    {                                                                                              \
        static void *(*real)(void *, size_t, int, int, int, off_t);                                \
        if (!real) *(void **)&real = dlsym(RTLD_NEXT, #name);                                      \
        if (fails(#name)) return errno = ENOMEM, MAP_FAILED;                                       \
        void *mapped = real(at, n, prot, flags, fd, offset);                                       \
        if (mapped != MAP_FAILED) held(mapped);                                                    \
        return mapped;                                                                             \
    }
MAPPING(mmap)
MAPPING(mmap64)

int munmap(void *at, size_t n)
{
    static int (*real)(void *, size_t);
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "munmap");
    atomic_fetch_sub(&page->live, 1);
    return real(at, n);
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                   void *user)
{
    static int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "pthread_create");
    return fails("pthread_create") ? EAGAIN : real(thread, attributes, run, user);
}

int fcntl(int fd, int command, ...)
{
    static int (*real)(int, int, ...);
    va_list list;
    va_start(list, command);
    long argument = va_arg(list, long);
    va_end(list);
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "fcntl");
    if (fails("fcntl")) return errno = ENOLCK, -1;
    return real(fd, command, argument);
}
