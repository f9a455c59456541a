/* Watchdog: restarts the program if it is not fed for two seconds; the next request is then answered with NO_HELLO. */
#ifndef MPUCAL_WATCHDOG_H
#define MPUCAL_WATCHDOG_H

void watchdog_begin(void);

#endif
