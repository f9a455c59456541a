/* Counts the cycles of mpucal_apply on an ATmega328P: `make cycles` runs it in an emulator and prints its output. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdio.h>

#include "blob.h"
#include "mpucal_apply.h"

#define RUNS 200
#define TIMER_CYCLES 64 /* timer 1 counts every 64th cycle, enough for loading a blob */

static int put(char c, FILE *stream) {
    (void)stream;
    loop_until_bit_is_set(UCSR0A, UDRE0);
    UDR0 = (uint8_t)c;
    return 0;
}

static FILE out = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

/* Not inlined, as in a real call. */
static void __attribute__((noinline)) apply(const struct mpucal *sensor, const int16_t counts[3], float a_mps2[3]) {
    mpucal_apply(sensor, counts, a_mps2);
}

static struct mpucal_fixed fixed;

static void __attribute__((noinline)) apply_fixed(const struct mpucal *sensor, const int16_t counts[3], float a[3]) {
    (void)sensor;
    int32_t corrected[3];
    mpucal_apply_fixed(&fixed, counts, corrected);
    __asm__ __volatile__("" : : "r"(corrected), "r"(a) : "memory");
}

static void __attribute__((noinline)) nothing(const struct mpucal *sensor, const int16_t counts[3], float a_mps2[3]) {
    __asm__ __volatile__("" : : "r"(sensor), "r"(counts), "r"(a_mps2) : "memory");
}

/* Returns the cycles of RUNS calls with counts over the whole range. */
static uint32_t cycles_of(void (*call)(const struct mpucal *, const int16_t *, float *), const struct mpucal *sensor) {
    float a_mps2[3];
    uint16_t began = TCNT1;
    for (uint16_t i = 0; i < RUNS; i++) {
        int16_t counts[3] = {(int16_t)(i * 331), (int16_t)(i * 173 - 9000), (int16_t)(8192 - i * 57)};
        call(sensor, counts, a_mps2);
    }
    return (uint32_t)(uint16_t)(TCNT1 - began) * TIMER_CYCLES;
}

/* Returns the largest difference of both over the whole range, in thousandths of a count. */
static uint16_t apart(const struct mpucal *sensor, float mps2_per_count) {
    static const int16_t ENDS[] = {INT16_MIN, INT16_MIN + 1, -12345, -1, 0, 1, 12345, INT16_MAX};
    float worst = 0.0f;
    for (uint16_t i = 0; i < 512; i++) {
        int16_t counts[3] = {ENDS[i & 7], ENDS[i >> 3 & 7], ENDS[i >> 6]};
        float a_mps2[3];
        int32_t corrected[3];
        mpucal_apply(sensor, counts, a_mps2);
        mpucal_apply_fixed(&fixed, counts, corrected);
        for (uint8_t j = 0; j < 3; j++) {
            float off = (float)corrected[j] - a_mps2[j] / mps2_per_count;
            worst = off > worst ? off : -off > worst ? -off : worst;
        }
    }
    return (uint16_t)(worst * 1000.0f);
}

int main(void) {
    struct mpucal sensor;
    stdout = &out;
    UCSR0B = _BV(TXEN0);
    TCCR1B = _BV(CS11) | _BV(CS10);
    uint16_t began = TCNT1;
    enum mpucal_status status = mpucal_load(&sensor, BLOB, sizeof BLOB, 0x68, 4.0f);
    uint32_t load = (uint32_t)(uint16_t)(TCNT1 - began) * TIMER_CYCLES;
    status |= mpucal_fix_accel(&fixed, &sensor, 4.0f);
    uint32_t none = cycles_of(nothing, &sensor), calls = cycles_of(apply, &sensor) - none;
    uint32_t fixed_calls = cycles_of(apply_fixed, &sensor) - none;
    printf("status %u, apply %lu cycles, apply_fixed %lu cycles, load %lu cycles, apart %u\n", status, calls / RUNS,
           fixed_calls / RUNS, load, apart(&sensor, 4.0f * 9.80665f / 32768.0f));
    cli();
    sleep_enable();
    sleep_cpu(); /* without interrupts: the emulator ends */
}
