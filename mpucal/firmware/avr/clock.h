/* Microseconds since the start, on timer 0. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_begin(void);

/* Wraps at 2^32; steps of 0.5 us, rounded down. */
uint32_t clock_now_us(void);

/* The same in steps of 128 us, modulo 256: for short waits, without arithmetic in 32 bits. */
uint8_t clock_steps(void);

#define CLOCK_STEP_US 128

/* Sleep until any interrupt, at most a step; interrupts are off when it is called, and on when it returns. */
void clock_nap(void);

#endif
