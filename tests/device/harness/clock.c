/* A monotonic clock that runs only while someone waits, for a program under test.
 *
 * Preloaded, with MPUCAL_TEST_CLOCK naming a file of two int64. The first is nanoseconds, shared with the device
 * behind the mocked adapter, which adds what a transfer takes. Only sleeping is left out; what the program does and
 * when it means to do it stay the same. The second is how much of what the program says on stderr was heard, in
 * bytes, or -1 where nobody listens: time stands still while something is to be heard, or a hand would be told in
 * one run sooner than in another.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static volatile int64_t *now_ns, *heard;
static atomic_llong said;

__attribute__((constructor)) static void share(void) {
    const char *path = getenv("MPUCAL_TEST_CLOCK");
    int file = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0)
        return;
    void *page = mmap(NULL, 2 * sizeof *now_ns, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (page != MAP_FAILED) {
        now_ns = page;
        heard = now_ns + 1;
    }
    close(file);
}

ssize_t write(int file, const void *bytes, size_t count) {
    ssize_t (*real)(int, const void *, size_t) = dlsym(RTLD_NEXT, "write");
    if (file == STDERR_FILENO)
        said += (long long)count;
    return real(file, bytes, count);
}

static void wait_until_heard(void) {
    const struct timespec a_little = {.tv_nsec = 50000};
    while (*heard >= 0 && *heard < said)
        syscall(SYS_clock_nanosleep, CLOCK_MONOTONIC, 0, &a_little, NULL);
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
    wait_until_heard();
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
    if (now_ns && clock == CLOCK_MONOTONIC)
        return EINVAL;
    int (*real)(pthread_condattr_t *, clockid_t) = dlsym(RTLD_NEXT, "pthread_condattr_setclock");
    return real(attributes, clock);
}
