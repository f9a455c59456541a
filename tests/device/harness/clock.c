/* A monotonic clock that runs only while someone waits, for a program under test.
 *
 * Preloaded, with MPUCAL_TEST_CLOCK naming the file of the words below. Only sleeping is left out; what the program
 * does and when it means to do it stay the same. Time stands still while something the program said is to be heard, and
 * while a process of its own works on what it was told: on a busy machine the hand would hear of it later, and the
 * session be another one.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* Shared with the device behind the mocked adapter, which adds what a transfer takes to the time, and with who listens. */
static struct {
    volatile int64_t now_ns;
    volatile int64_t heard;   /* of what is said on stderr, in bytes; -1 where nobody listens */
    _Atomic int64_t told;     /* to a worker, in bytes */
    volatile int64_t worked;  /* off by it, in bytes */
    volatile int64_t worker;  /* its process */
} *shared;
static atomic_llong said, taken;

/* A process that forks for programs with times of their own calls it anew in each. */
__attribute__((constructor)) void share_test_clock(void) {
    const char *path = getenv("MPUCAL_TEST_CLOCK");
    int file = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0)
        return;
    void *page = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (page != MAP_FAILED)
        shared = page;
    close(file);
}

static int is_pipe(int file) {
    struct stat status;
    return fstat(file, &status) == 0 && S_ISFIFO(status.st_mode);
}

/* A worker is told what to do through a pipe; nobody else is written to by one. */
ssize_t write(int file, const void *bytes, size_t count) {
    ssize_t (*real)(int, const void *, size_t) = dlsym(RTLD_NEXT, "write");
    if (file == STDERR_FILENO)
        said += (long long)count;
    int tells = shared && file > STDERR_FILENO && is_pipe(file);
    if (tells)
        shared->told += (int64_t)count;
    ssize_t written = real(file, bytes, count);
    if (tells)
        shared->told -= (int64_t)count - (written > 0 ? written : 0);
    return written;
}

/* A worker that asks for more is done with what it has. */
ssize_t read(int file, void *bytes, size_t count) {
    ssize_t (*real)(int, void *, size_t) = dlsym(RTLD_NEXT, "read");
    int works = shared && file == STDIN_FILENO && is_pipe(file);
    if (works) {
        shared->worker = getpid();
        shared->worked = taken;
    }
    ssize_t done = real(file, bytes, count);
    if (works && done > 0)
        taken += done;
    return done;
}

static int is_behind(void) {
    if (shared->heard >= 0 && shared->heard < said)
        return 1;
    return shared->worked < shared->told && (!shared->worker || kill((pid_t)shared->worker, 0) == 0);
}

int clock_gettime(clockid_t clock, struct timespec *time) {
    if (!shared || clock != CLOCK_MONOTONIC)
        return (int)syscall(SYS_clock_gettime, clock, time);
    time->tv_sec = shared->now_ns / 1000000000;
    time->tv_nsec = shared->now_ns % 1000000000;
    return 0;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted, struct timespec *left) {
    const struct timespec a_little = {.tv_nsec = 50000};
    if (!shared || clock != CLOCK_MONOTONIC)
        return syscall(SYS_clock_nanosleep, clock, flags, wanted, left) ? errno : 0;
    while (is_behind())
        syscall(SYS_clock_nanosleep, clock, 0, &a_little, NULL);
    int64_t until = (int64_t)wanted->tv_sec * 1000000000 + wanted->tv_nsec;
    if (!(flags & TIMER_ABSTIME))
        until += shared->now_ns;
    if (until > shared->now_ns)
        shared->now_ns = until;
    return 0;
}

/* Threads wait for each other in real time. Python would give the deadlines of its global lock in the time above,
 * and spin once they are past; without a monotonic clock for its conditions it takes the time of day. */
int pthread_condattr_setclock(pthread_condattr_t *attributes, clockid_t clock) {
    if (getenv("MPUCAL_TEST_CLOCK") && clock == CLOCK_MONOTONIC)
        return EINVAL;
    int (*real)(pthread_condattr_t *, clockid_t) = dlsym(RTLD_NEXT, "pthread_condattr_setclock");
    return real(attributes, clock);
}
