/* Preloaded by tools/attack/syscalls.py: counts the calls that touch files below a folder, fails the one that is asked for, and
 * logs each, for a model of a power cut. Counts allocations too, and fails one, or all from one on.
 * A call is of libc, as CPython and NumPy make it. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

static char below[PATH_MAX];
static int fail_at, fail_with, log_fd = -1, count;
static size_t least;
static int none_at, none_since, allocated;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

/* Arm: paths below `folder` count from now on; the call number `n` (from 1; 0: none) fails with `error`. */
void syscalls_arm(const char *folder, int n, int error, int log)
{
    snprintf(below, sizeof below, "%s", folder);
    fail_at = n, fail_with = error, log_fd = log, count = 0;
}

/* Say whose code it was. */
static void crashed(int signal)
{
    void *at[64];
    backtrace_symbols_fd(at, backtrace(at, 64), 2);
    _exit(128 + signal);
}

/* Allocations of `size` bytes or more count from now on (0: none); number `n` gets no memory, nor those after it with
 * `since`. */
void allocations_arm(size_t size, int n, int since)
{
    void *first[1];
    /* loads what it needs */
    backtrace(first, 1);
    signal(SIGSEGV, crashed), signal(SIGABRT, crashed);
    none_at = n, none_since = since, allocated = 0, least = size;
}

int allocations_count(void) { return allocated; }

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
    char here[PATH_MAX];
    if (!below[0] || !path)
        return 0;
    if (path[0] != '/' && !getcwd(here, sizeof here))
        return 0;
    return strncmp(path[0] == '/' ? path : here, below, strlen(below)) == 0;
}

static int counts_fd(int fd) { return below[0] && fd > 2 && fd != log_fd && counts(path_of(fd)); }

/* Whether this call is to fail. */
static int fails(void)
{
    if (__atomic_add_fetch(&count, 1, __ATOMIC_RELAXED) != fail_at)
        return 0;
    errno = fail_with;
    return 1;
}

static void note(char op, int done, long long at, size_t size, const void *data, const char *path, const char *other)
{
    if (log_fd < 0)
        return;
    char head[2 * PATH_MAX + 100];
    int n = snprintf(head, sizeof head, "%c\t%d\t%lld\t%zu\t%s\t%s\n", op, done, at, size, path, other ? other : "");
    int kept = errno;
    REAL(write)(log_fd, head, n);
    if (size)
        REAL(write)(log_fd, data, size);
    errno = kept;
}

/* Log what a device holds from now on. */
void syscalls_device(const char *state) { note('d', 1, 0, strlen(state), state, "", 0); }

#define OPEN(name, first, at)                                                   \
    int name(first const char *path, int flags, ...)                           \
    {                                                                          \
        va_list rest;                                                          \
        va_start(rest, flags);                                                 \
        int mode = va_arg(rest, int), mine = counts(path);                     \
        va_end(rest);                                                          \
        if (mine && fails())                                                   \
            return -1;                                                         \
        int fd = REAL(name)(at path, flags, mode);                             \
        if (mine)                                                              \
            note('o', fd >= 0, flags, 0, 0, fd >= 0 ? path_of(fd) : path, 0);  \
        return fd;                                                             \
    }
#define NOTHING
#define AT int at,
#define COMMA at,
OPEN(open, NOTHING, NOTHING)
OPEN(open64, NOTHING, NOTHING)
OPEN(openat, AT, COMMA)
OPEN(openat64, AT, COMMA)

ssize_t read(int fd, void *data, size_t size)
{
    int mine = counts_fd(fd);
    if (mine && fails())
        return -1;
    ssize_t n = REAL(read)(fd, data, size);
    if (mine)
        note('i', 1, 0, 0, 0, path_of(fd), 0);
    return n;
}

ssize_t write(int fd, const void *data, size_t size)
{
    int mine = counts_fd(fd);
    if (mine && fails())
        return -1;
    ssize_t n = REAL(write)(fd, data, size);
    if (mine)
        note('w', n > 0, n > 0 ? lseek(fd, 0, SEEK_CUR) - n : 0, n > 0 ? n : 0, data, path_of(fd), 0);
    return n;
}

#define ON_FILE(op, name)                                                      \
    int name(int fd)                                                           \
    {                                                                          \
        int mine = counts_fd(fd);                                              \
        if (mine && fails())                                                   \
            return -1;                                                         \
        int done = REAL(name)(fd);                                             \
        if (mine)                                                              \
            note(op, done == 0, 0, 0, 0, path_of(fd), 0);                      \
        return done;                                                           \
    }
ON_FILE('s', fsync)
ON_FILE('s', fdatasync)

int close(int fd)
{
    char path[PATH_MAX] = "";
    /* what was only read is closed without an error */
    int mine = counts_fd(fd) && (fcntl(fd, F_GETFL) & O_ACCMODE) != O_RDONLY;
    if (mine)
        strcpy(path, path_of(fd));
    /* as Linux does: it is closed all the same */
    int done = REAL(close)(fd);
    if (mine)
        note('c', 1, 0, 0, 0, path, 0);
    return mine && fails() ? -1 : done;
}

/* An operation on a path. */
#define ON_PATH(op, type, failed, name, rest, ...)                             \
    type name(const char *path rest)                                           \
    {                                                                          \
        int mine = counts(path);                                               \
        if (mine && fails())                                                   \
            return failed;                                                     \
        type done = REAL(name)(path, ##__VA_ARGS__);                           \
        if (mine)                                                              \
            note(op, done != failed, 0, 0, 0, path, 0);                        \
        return done;                                                           \
    }
#define MODE , mode_t mode
#define STAT , struct stat64 *into
ON_PATH('u', int, -1, unlink, NOTHING)
ON_PATH('u', int, -1, rmdir, NOTHING)
ON_PATH('m', int, -1, mkdir, MODE, mode)
ON_PATH('p', int, -1, chmod, MODE, mode)
ON_PATH('l', int, -1, stat64, STAT, into)
ON_PATH('l', int, -1, lstat64, STAT, into)
ON_PATH('l', DIR *, NULL, opendir, NOTHING)

int rename(const char *from, const char *to)
{
    int mine = counts(from) || counts(to);
    if (mine && fails())
        return -1;
    int done = REAL(rename)(from, to);
    if (mine)
        note('r', done == 0, 0, 0, 0, from, to);
    return done;
}

/* Whether this allocation gets no memory. */
static int none(size_t size)
{
    if (!least || size < least)
        return 0;
    int n = __atomic_add_fetch(&allocated, 1, __ATOMIC_RELAXED);
    if (!none_at || !(n == none_at || (none_since && n > none_at)))
        return 0;
    errno = ENOMEM;
    return 1;
}

#define MMAP(name)                                                                    \
    void *name(void *at, size_t size, int prot, int flags, int fd, off_t offset)     \
    {                                                                                 \
        int mine = fd >= 0 && counts_fd(fd);                                          \
        if (mine)                                                                     \
            note('a', 1, 0, 0, 0, path_of(fd), 0);                                    \
        if ((mine && fails()) || (fd < 0 && none(size)))                              \
            return MAP_FAILED;                                                        \
        return REAL(name)(at, size, prot, flags, fd, offset);                         \
    }
MMAP(mmap)
MMAP(mmap64)

/* glibc's own, as dlsym would allocate */
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

void *malloc(size_t size) { return none(size) ? NULL : __libc_malloc(size); }
void *calloc(size_t n, size_t size) { return none(n * size) ? NULL : __libc_calloc(n, size); }
void *realloc(void *old, size_t size) { return none(size) ? NULL : __libc_realloc(old, size); }
void *memalign(size_t align, size_t size) { return none(size) ? NULL : __libc_memalign(align, size); }
void *aligned_alloc(size_t align, size_t size) { return memalign(align, size); }

int posix_memalign(void **at, size_t align, size_t size)
{
    void *made = memalign(align, size);
    if (made)
        *at = made;
    return made ? 0 : ENOMEM;
}
