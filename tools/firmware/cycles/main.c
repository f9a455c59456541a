/* How many cycles mpucal_apply takes on an ATmega328P: `make cycles` runs this in an emulator and prints what it says. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdio.h>

#include "blob.h"
#include "mpucal_apply.h"

#define RUNS 200
#define TIMER_CYCLES 64 /* timer 1 counts every 64th cycle, so that loading a blob fits */

static int put(char c, FILE *stream) {
    (void)stream;
    loop_until_bit_is_set(UCSR0A, UDRE0);
    UDR0 = (uint8_t)c;
    return 0;
}

static FILE out = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

/* Not inlined, as it would be called. */
static void __attribute__((noinline)) apply(const struct mpucal *sensor, const int16_t counts[3], float a_mps2[3]) {
    mpucal_apply(sensor, counts, a_mps2);
}

static void __attribute__((noinline)) nothing(const struct mpucal *sensor, const int16_t counts[3], float a_mps2[3]) {
    __asm__ __volatile__("" : : "r"(sensor), "r"(counts), "r"(a_mps2) : "memory");
}

/* Cycles of RUNS calls with counts all over the range. */
static uint32_t cycles_of(void (*call)(const struct mpucal *, const int16_t *, float *), const struct mpucal *sensor) {
    float a_mps2[3];
    uint16_t began = TCNT1;
    for (uint16_t i = 0; i < RUNS; i++) {
        int16_t counts[3] = {(int16_t)(i * 331), (int16_t)(i * 173 - 9000), (int16_t)(8192 - i * 57)};
        call(sensor, counts, a_mps2);
    }
    return (uint32_t)(uint16_t)(TCNT1 - began) * TIMER_CYCLES;
}

int main(void) {
    struct mpucal sensor;
    stdout = &out;
    UCSR0B = _BV(TXEN0);
    TCCR1B = _BV(CS11) | _BV(CS10);
    uint16_t began = TCNT1;
    enum mpucal_status status = mpucal_load(&sensor, BLOB, sizeof BLOB, 0x68, 4.0f);
    uint32_t load = (uint32_t)(uint16_t)(TCNT1 - began) * TIMER_CYCLES;
    uint32_t calls = cycles_of(apply, &sensor) - cycles_of(nothing, &sensor);
    printf("status %u, apply %lu cycles, load %lu cycles\n", status, calls / RUNS, load);
    cli();
    sleep_enable();
    sleep_cpu(); /* without interrupts: the emulator ends */
}
