#define _GNU_SOURCE /* O_PATH, syscall */
#include "sandbox.h"

#include "log.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <linux/landlock.h>
#include <seccomp.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

/* Sanitizers look at /proc, start threads and trace at the end: they and a sandbox exclude each
 * other. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED true
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define SANITIZED true
#endif
#endif
#ifndef SANITIZED
#define SANITIZED false
#endif

static bool is(const char *mode, const char *word)
{
    return !strcmp(mode, word);
}

/*
 * A part that is missing: fatal if it was demanded, and also where the reason is not the kernel's
 * age or its owner's choice (ECANCELED is libseccomp's word for what the kernel says).
 */
static bool missing(const char *mode, const char *part, int error)
{
    const bool kernel = error == ENOSYS || error == EOPNOTSUPP || error == EPERM ||
                        error == ECANCELED;
    if (is(mode, "on") || !kernel) {
        fprintf(stderr, "facetd: --sandbox %s: no %s: %s\n", mode, part, strerror(error));
        return false;
    }
    log_line("event=sandbox part=%s state=off reason=\"%s\"", part, strerror(error));
    return true;
}

static bool applies(const char *mode, const char *part, bool *result)
{
    *result = true;
    if (is(mode, "off")) log_line("event=sandbox part=%s state=off reason=\"option\"", part);
    if (is(mode, "off")) return false;
    if (SANITIZED) *result = missing(mode, part, ENOTSUP);
    return !SANITIZED;
}

/* ---- Landlock -------------------------------------------------------------------------------- */

/* Of the kernel's later versions, not in the headers of Debian 12 (Linux 6.1). */
#define FS_REFER (1ULL << 13)
#define FS_TRUNCATE (1ULL << 14)
#define FS_IOCTL_DEV (1ULL << 15)
#define NET_ALL 3ULL /* bind and connect over TCP */

struct ruleset {
    __u64 files, net;
};

static long landlock_version(void)
{
    return syscall(SYS_landlock_create_ruleset, NULL, 0, LANDLOCK_CREATE_RULESET_VERSION);
}

static struct ruleset everything(long version)
{
    struct ruleset all = {.files = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1) - 1};
    if (version >= 2) all.files |= FS_REFER;
    if (version >= 3) all.files |= FS_TRUNCATE;
    if (version >= 5) all.files |= FS_IOCTL_DEV;
    if (version >= 4) all.net = NET_ALL;
    return all;
}

/* The directories of our unix sockets: their removal at the end stays allowed. */
static bool allow_removal(int ruleset, const struct listeners *listeners)
{
    for (size_t i = 0; i < listeners->count; i++) {
        char path[LISTEN_NAME_MAX];
        if (!listeners->list[i].path) continue;
        snprintf(path, sizeof path, "%s", listeners->list[i].path);
        struct landlock_path_beneath_attr rule = {.allowed_access = LANDLOCK_ACCESS_FS_REMOVE_FILE};
        rule.parent_fd = open(dirname(path), O_PATH | O_CLOEXEC);
        if (rule.parent_fd < 0) return false;
        long bad = syscall(SYS_landlock_add_rule, ruleset, LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
        close(rule.parent_fd);
        if (bad) return false;
    }
    return true;
}

bool sandbox_files(const char *mode, const struct listeners *main_ones,
                   const struct listeners *admin)
{
    bool result;
    if (!applies(mode, "landlock", &result)) return result;
    const long version = landlock_version();
    if (version < 1) return missing(mode, "landlock", errno);
    const struct ruleset all = everything(version);
    const size_t size = version >= 4 ? sizeof all : sizeof all.files;
    int fd = (int)syscall(SYS_landlock_create_ruleset, &all, size, 0);
    if (fd < 0) return missing(mode, "landlock", errno);
    bool closed = allow_removal(fd, main_ones) && allow_removal(fd, admin) &&
                  !prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) &&
                  !syscall(SYS_landlock_restrict_self, fd, 0);
    int error = errno;
    close(fd);
    if (!closed) return missing(mode, "landlock", error);
    log_line("event=sandbox part=landlock state=on version=%ld", version);
    return true;
}

/* ---- seccomp --------------------------------------------------------------------------------- */

/*
 * What serving needs, and libc to stop and to fail.  All else gives EPERM rather than an end: a call
 * that a later libc makes should be an error that somebody handles.
 */
static const int allowed[] = {
    /* connections */
    SCMP_SYS(accept4), SCMP_SYS(close), SCMP_SYS(epoll_ctl), SCMP_SYS(epoll_pwait),
    SCMP_SYS(epoll_wait), SCMP_SYS(fcntl), SCMP_SYS(fstat), SCMP_SYS(getpeername),
    SCMP_SYS(getsockname), SCMP_SYS(getsockopt), SCMP_SYS(newfstatat), SCMP_SYS(poll),
    SCMP_SYS(ppoll), SCMP_SYS(pread64), SCMP_SYS(read), SCMP_SYS(readv), SCMP_SYS(recvfrom),
    SCMP_SYS(recvmsg), SCMP_SYS(sendfile), SCMP_SYS(sendmsg), SCMP_SYS(sendto),
    SCMP_SYS(setsockopt), SCMP_SYS(shutdown), SCMP_SYS(write), SCMP_SYS(writev),
    SCMP_SYS(lseek), SCMP_SYS(unlink), SCMP_SYS(unlinkat),
    /* memory (mmap and mprotect below) */
    SCMP_SYS(brk), SCMP_SYS(madvise), SCMP_SYS(mremap), SCMP_SYS(munmap),
    /* threads, time, signals, the end */
    SCMP_SYS(clock_gettime), SCMP_SYS(clock_nanosleep), SCMP_SYS(exit), SCMP_SYS(exit_group),
    SCMP_SYS(futex), SCMP_SYS(getcpu), SCMP_SYS(getpid), SCMP_SYS(getrandom), SCMP_SYS(gettid),
    SCMP_SYS(gettimeofday), SCMP_SYS(membarrier), SCMP_SYS(nanosleep), SCMP_SYS(restart_syscall),
    SCMP_SYS(rseq), SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn),
    SCMP_SYS(sched_getaffinity), SCMP_SYS(sched_yield), SCMP_SYS(set_robust_list),
    SCMP_SYS(sysinfo), SCMP_SYS(tgkill),
};

static int add_rules(scmp_filter_ctx filter)
{
    /* ioctl: only what isatty asks.  No page is ever executable that was not at the start. */
    const struct scmp_arg_cmp not_executable = SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0),
                              is_tty = SCMP_A1(SCMP_CMP_EQ, 0x5401);
    int bad = 0;
    for (size_t i = 0; !bad && i < sizeof allowed / sizeof *allowed; i++)
        bad = seccomp_rule_add(filter, SCMP_ACT_ALLOW, allowed[i], 0);
    if (!bad) bad = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mmap), 1, not_executable);
    if (!bad) bad = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mprotect), 1, not_executable);
    if (!bad) bad = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(ioctl), 1, is_tty);
    return bad;
}

bool sandbox_calls(const char *mode)
{
    bool result;
    if (!applies(mode, "seccomp", &result)) return result;
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
    if (!filter) return missing(mode, "seccomp", ENOMEM);
    int bad = seccomp_attr_set(filter, SCMP_FLTATR_CTL_TSYNC, 1);
    if (!bad) bad = seccomp_attr_set(filter, SCMP_FLTATR_CTL_OPTIMIZE, 2); /* a binary tree */
    if (!bad) bad = add_rules(filter);
    if (!bad) bad = seccomp_load(filter);
    seccomp_release(filter);
    if (bad) return missing(mode, "seccomp", -bad);
    log_line("event=sandbox part=seccomp state=on calls=%zu", sizeof allowed / sizeof *allowed + 3);
    return true;
}
