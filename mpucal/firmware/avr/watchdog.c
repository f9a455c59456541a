#include "watchdog.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

void watchdog_begin(void) {
    wdt_reset();
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = _BV(WDIE) | _BV(WDP2) | _BV(WDP1) | _BV(WDP0); /* an interrupt after 2 s */
}

/* No reset by the watchdog itself: the boot loader of older boards leaves it on then, and is reset for ever. */
ISR(WDT_vect, ISR_NAKED) {
    __asm__ __volatile__("jmp 0");
}
