/* USART 0, with a queue of 255 bytes each way. */
#ifndef UART_H
#define UART_H

#include <stdint.h>

#define UART_QUEUE_BYTES 255

void uart_begin(void);

/* Whether a byte has come; call it with interrupts off before a nap. */
uint8_t uart_has_byte(void);

uint8_t uart_take(void);

/* Queue bytes to be sent; waits where there is no room. */
void uart_send(const uint8_t *bytes, uint8_t count);

#endif
