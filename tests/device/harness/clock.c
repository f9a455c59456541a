/* A monotonic clock that runs only while someone waits, for a program under test.
 *
 * Preloaded, with MPUCAL_TEST_CLOCK naming the file that holds the time. Only sleeping is left out; what the program does
 * and when it means to do it stay the same.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* Shared with the device behind the mocked adapter, which adds the time of a transfer. */
static volatile int64_t *now_ns;

/* A process that forks for programs with times of their own calls it anew in each. */
__attribute__((constructor)) void share_test_clock(void) {
    const char *path = getenv("MPUCAL_TEST_CLOCK");
    int file = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0)
        return;
    void *page = mmap(NULL, sizeof *now_ns, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (page != MAP_FAILED)
        now_ns = page;
    close(file);
}

int clock_gettime(clockid_t clock, struct timespec *time) {
    if (!now_ns || clock != CLOCK_MONOTONIC)
        return (int)syscall(SYS_clock_gettime, clock, time);
    time->tv_sec = *now_ns / 1000000000;
    time->tv_nsec = *now_ns % 1000000000;
    return 0;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted, struct timespec *left) {
    if (!now_ns || clock != CLOCK_MONOTONIC)
        return syscall(SYS_clock_nanosleep, clock, flags, wanted, left) ? errno : 0;
    int64_t until = (int64_t)wanted->tv_sec * 1000000000 + wanted->tv_nsec;
    if (!(flags & TIMER_ABSTIME))
        until += *now_ns;
    if (until > *now_ns)
        *now_ns = until;
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
