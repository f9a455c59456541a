/* Clock in microseconds since the start, on timer 0. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_begin(void);

/* Returns microseconds modulo 2^32, rounded down from 0.5 us. */
uint32_t clock_now_us(void);

/* Returns steps of 128 us modulo 256, for short waits without 32-bit arithmetic. */
uint8_t clock_steps(void);

#define CLOCK_STEP_US 128

/* Sleeps until any interrupt, for a step at most; interrupts must be disabled before, and are enabled after. */
void clock_nap(void);

#endif
