/* USART 0, with a queue of 255 bytes each way. */
#ifndef UART_H
#define UART_H

#include <stdint.h>

#define UART_QUEUE_BYTES 255

void uart_begin(void);

/* Returns true if a byte has come; call it with interrupts disabled before a sleep. */
uint8_t uart_has_byte(void);

uint8_t uart_take(void);

/* Queues bytes to send; waits if the queue is full. */
void uart_send(const uint8_t *bytes, uint8_t count);

#endif
