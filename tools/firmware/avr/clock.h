/* Microseconds since the start, on timer 0. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_begin(void);

/* Wraps at 2^32; steps of 0.5 us, rounded down. */
uint32_t clock_now_us(void);

/* Sleep until any interrupt, at most 128 us; interrupts are off when it is called, and on when it returns. */
void clock_nap(void);

#endif
