/* Preloaded by tools/syscalls.py: counts the calls that touch files below a folder, fails the one that is asked for, and
 * logs each for a model of a power cut. A call is of libc, as CPython makes it. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/types.h>
#include <unistd.h>

static char below[PATH_MAX];
static int fail_at, fail_with, log_fd = -1, count;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

/* Arm: paths below `folder` count from now on; the call number `n` (from 1; 0: none) fails with `error`. */
void syscalls_arm(const char *folder, int n, int error, int log)
{
    snprintf(below, sizeof below, "%s", folder);
    fail_at = n, fail_with = error, log_fd = log, count = 0;
}

int syscalls_count(void) { return count; }

static const char *path_of(int fd)
{
    static __thread char path[PATH_MAX];
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    path[n > 0 ? n : 0] = 0;
    return path;
}

static int counts(const char *path)
{
    char whole[PATH_MAX];
    if (!below[0] || !path)
        return 0;
    if (path[0] != '/') {
        if (!getcwd(whole, sizeof whole))
            return 0;
        return strncmp(whole, below, strlen(below)) == 0;
    }
    return strncmp(path, below, strlen(below)) == 0;
}

/* Whether this call is to fail. */
static int fails(void)
{
    if (++count != fail_at)
        return 0;
    errno = fail_with;
    return 1;
}

static void note(char op, int fd, long long at, size_t size, const void *data, const char *path, const char *other)
{
    if (log_fd < 0)
        return;
    char head[2 * PATH_MAX + 100];
    int n = snprintf(head, sizeof head, "%c\t%d\t%lld\t%zu\t%s\t%s\n", op, fd, at, size, path, other ? other : "");
    int kept = errno;
    REAL(write)(log_fd, head, n);
    if (size)
        REAL(write)(log_fd, data, size);
    errno = kept;
}

#define OPEN(name)                                                             \
    int name(const char *path, int flags, ...)                                 \
    {                                                                          \
        va_list rest;                                                          \
        va_start(rest, flags);                                                 \
        int mode = va_arg(rest, int), mine = counts(path);                     \
        va_end(rest);                                                          \
        if (mine && fails())                                                   \
            return -1;                                                         \
        int fd = REAL(name)(path, flags, mode);                                \
        if (mine && fd >= 0)                                                   \
            note('o', fd, flags, 0, 0, path_of(fd), 0);                        \
        return fd;                                                             \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                           \
    int name(int at, const char *path, int flags, ...)                         \
    {                                                                          \
        va_list rest;                                                          \
        va_start(rest, flags);                                                 \
        int mode = va_arg(rest, int), mine = counts(path);                     \
        va_end(rest);                                                          \
        if (mine && fails())                                                   \
            return -1;                                                         \
        int fd = REAL(name)(at, path, flags, mode);                            \
        if (mine && fd >= 0)                                                   \
            note('o', fd, flags, 0, 0, path_of(fd), 0);                        \
        return fd;                                                             \
    }
OPENAT(openat)
OPENAT(openat64)

ssize_t write(int fd, const void *data, size_t size)
{
    int mine = below[0] && fd > 2 && fd != log_fd && counts(path_of(fd));
    if (mine && fails())
        return -1;
    long long at = mine ? lseek(fd, 0, SEEK_CUR) : 0;
    ssize_t n = REAL(write)(fd, data, size);
    if (mine && n > 0)
        note('w', fd, at, n, data, path_of(fd), 0);
    return n;
}

#define SYNC(name)                                                             \
    int name(int fd)                                                           \
    {                                                                          \
        int mine = counts(path_of(fd));                                        \
        if (mine && fails())                                                   \
            return -1;                                                         \
        int done = REAL(name)(fd);                                             \
        if (mine && done == 0)                                                 \
            note('s', fd, 0, 0, 0, path_of(fd), 0);                            \
        return done;                                                           \
    }
SYNC(fsync)
SYNC(fdatasync)

int close(int fd)
{
    int mine = below[0] && fd > 2 && fd != log_fd && counts(path_of(fd));
    /* as Linux does: it is closed all the same */
    int done = REAL(close)(fd);
    return mine && fails() ? -1 : done;
}

int rename(const char *from, const char *to)
{
    int mine = counts(from) || counts(to);
    if (mine && fails())
        return -1;
    int done = REAL(rename)(from, to);
    if (mine && done == 0)
        note('r', 0, 0, 0, 0, from, to);
    return done;
}

int unlink(const char *path)
{
    int mine = counts(path);
    if (mine && fails())
        return -1;
    int done = REAL(unlink)(path);
    if (mine && done == 0)
        note('u', 0, 0, 0, 0, path, 0);
    return done;
}

int mkdir(const char *path, mode_t mode)
{
    return counts(path) && fails() ? -1 : REAL(mkdir)(path, mode);
}

#define MMAP(name)                                                                    \
    void *name(void *at, size_t size, int prot, int flags, int fd, off_t offset)     \
    {                                                                                 \
        if (fd >= 0 && counts(path_of(fd)) && fails())                                \
            return MAP_FAILED;                                                        \
        return REAL(name)(at, size, prot, flags, fd, offset);                         \
    }
MMAP(mmap)
MMAP(mmap64)
