#include "watchdog.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

void watchdog_begin(void) {
    wdt_reset();
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = _BV(WDIE) | _BV(WDP2) | _BV(WDP1) | _BV(WDP0); /* an interrupt after 2 s */
}

/* The interrupt restarts the program. A reset by the watchdog would never end on older boards, whose boot loader leaves
 * the watchdog running. */
ISR(WDT_vect, ISR_NAKED) {
    __asm__ __volatile__("jmp 0");
}
