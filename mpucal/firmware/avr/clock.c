#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/atomic.h>

#if F_CPU != 16000000UL
#error "timer 0 counts half microseconds at 16 MHz"
#endif

static volatile uint32_t steps_us;
static volatile uint8_t steps;

ISR(TIMER0_OVF_vect) {
    steps_us += CLOCK_STEP_US;
    steps++;
}

void clock_begin(void) {
    TCCR0A = 0;
    TCCR0B = _BV(CS01); /* 16 MHz / 8 */
    TIMSK0 = _BV(TOIE0);
    set_sleep_mode(SLEEP_MODE_IDLE);
}

uint32_t clock_now_us(void) {
    uint32_t us = 0;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        uint8_t ticks = TCNT0;
        us = steps_us + ticks / 2;
        /* It overflowed after interrupts were disabled and before it was read. */
        if (TIFR0 & _BV(TOV0) && ticks < 128) {
            us += CLOCK_STEP_US;
        }
    }
    return us;
}

uint8_t clock_steps(void) {
    return steps;
}

void clock_nap(void) {
    sleep_enable();
    sei();
    sleep_cpu(); /* the instruction after sei() runs before any interrupt */
    sleep_disable();
}
