/* Starts the program anew where nobody feeds it for two seconds: the host's next request is answered with NO_HELLO. */
#ifndef MPUCAL_WATCHDOG_H
#define MPUCAL_WATCHDOG_H

void watchdog_begin(void);

#endif
