#define _GNU_SOURCE /* O_PATH, syscall */
#include "sandbox.h"

#include "log.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

static bool is(const char *mode, const char *word)
{
    return !strcmp(mode, word);
}

/*
 * A part that is missing: fatal if it was demanded, and also where the reason is not the kernel's
 * age or its owner's choice.
 */
static bool missing(const char *mode, const char *part, int error)
{
    const bool kernel = error == ENOSYS || error == EOPNOTSUPP || error == EPERM;
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
    /* A sanitizer's looks at /proc, its threads and its traces at the end exclude a sandbox. */
    if (SANITIZED) *result = missing(mode, part, EOPNOTSUPP);
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
 * that a later libc makes should be an error that somebody handles.  (A table and no library: under
 * a lack of memory libseccomp 2.5.4 loads filters with rules missing.)
 */
static const unsigned allowed[] = {
    /* connections */
    SYS_sendmsg, SYS_recvfrom, SYS_epoll_ctl, SYS_epoll_pwait, SYS_ppoll, SYS_accept4, SYS_close,
    SYS_fcntl, SYS_fstat, SYS_getpeername, SYS_getsockname, SYS_getsockopt, SYS_lseek,
    SYS_newfstatat, SYS_pread64, SYS_read, SYS_readv, SYS_recvmsg, SYS_sendfile, SYS_sendto,
    SYS_setsockopt, SYS_shutdown, SYS_unlinkat, SYS_write, SYS_writev,
#ifdef SYS_epoll_wait /* the older calls, which newer architectures lack */
    SYS_epoll_wait,
#endif
#ifdef SYS_poll
    SYS_poll,
#endif
#ifdef SYS_unlink
    SYS_unlink,
#endif
    /* memory (mmap and mprotect below) */
    SYS_brk, SYS_madvise, SYS_mremap, SYS_munmap,
    /* threads, time, signals, the end */
    SYS_clock_gettime, SYS_clock_nanosleep, SYS_exit, SYS_exit_group, SYS_futex, SYS_getcpu,
    SYS_getpid, SYS_getrandom, SYS_gettid, SYS_gettimeofday, SYS_membarrier, SYS_nanosleep,
    SYS_restart_syscall, SYS_rseq, SYS_rt_sigaction, SYS_rt_sigprocmask, SYS_rt_sigreturn,
    SYS_sched_getaffinity, SYS_sched_yield, SYS_set_robust_list, SYS_sysinfo, SYS_tgkill};

#if defined(__x86_64__)
#define ARCHITECTURE AUDIT_ARCH_X86_64
#elif defined(__aarch64__)
#define ARCHITECTURE AUDIT_ARCH_AARCH64
#endif

#ifdef ARCHITECTURE

enum { ALLOWED = sizeof allowed / sizeof *allowed, PROGRAM_MAX = 2 * ALLOWED + 32 };

#define LOAD(field) BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, field))
#define RETURN(action) BPF_STMT(BPF_RET | BPF_K, action)
#define EQUALS(value, then, otherwise) BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, then, otherwise)
#define HAS_BITS(bits, then, otherwise) BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, bits, then, otherwise)
#define REFUSE (SECCOMP_RET_ERRNO | EPERM)
#define X32 0x40000000 /* the second table of calls of x86-64 */

/* The low half of an argument: both architectures are little-endian. */
#define ARGUMENT(i) args[i]

/* The program; its length. */
static unsigned short assemble(struct sock_filter *program)
{
    const struct sock_filter begin[] = {
        LOAD(arch), EQUALS(ARCHITECTURE, 1, 0), RETURN(SECCOMP_RET_KILL_PROCESS),
        LOAD(nr),   HAS_BITS(X32, 0, 1),        RETURN(SECCOMP_RET_KILL_PROCESS),
    };
    /* No page is ever executable that was not at the start; of ioctl only what isatty asks. */
    const struct sock_filter end[] = {
        EQUALS(SYS_mmap, 2, 0), EQUALS(SYS_mprotect, 1, 0), EQUALS(SYS_ioctl, 3, 6),
        LOAD(ARGUMENT(2)),      HAS_BITS(PROT_EXEC, 4, 0),  RETURN(SECCOMP_RET_ALLOW),
        LOAD(ARGUMENT(1)),      EQUALS(TCGETS, 0, 1),       RETURN(SECCOMP_RET_ALLOW),
        RETURN(REFUSE),
    };
    unsigned short n = 0;
    for (size_t i = 0; i < sizeof begin / sizeof *begin; i++) program[n++] = begin[i];
    for (size_t i = 0; i < ALLOWED; i++) {
        program[n++] = (struct sock_filter)EQUALS(allowed[i], 0, 1);
        program[n++] = (struct sock_filter)RETURN(SECCOMP_RET_ALLOW);
    }
    for (size_t i = 0; i < sizeof end / sizeof *end; i++) program[n++] = end[i];
    return n;
}

bool sandbox_calls(const char *mode)
{
    bool result;
    struct sock_filter program[PROGRAM_MAX];
    const struct sock_fprog filter = {.len = assemble(program), .filter = program};
    if (!applies(mode, "seccomp", &result)) return result;
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) ||
        syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &filter))
        return missing(mode, "seccomp", errno);
    log_line("event=sandbox part=seccomp state=on calls=%d", ALLOWED + 3);
    return true;
}

#else

bool sandbox_calls(const char *mode)
{
    bool result;
    if (!applies(mode, "seccomp", &result)) return result;
    return missing(mode, "seccomp", ENOSYS);
}

#endif
