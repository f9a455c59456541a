#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "clock.h"

#ifndef BAUD
#define BAUD 115200UL
#endif
/* 115200 is 2.1 % off at 16 MHz, as in the Arduino core; receivers tolerate 4 % */
#define BAUD_TOL 4
#include <util/setbaud.h>

/* Positions are bytes, which wrap around by themselves. */
static volatile uint8_t received[UART_QUEUE_BYTES + 1], received_first, received_end;
static volatile uint8_t to_send[UART_QUEUE_BYTES + 1], to_send_first, to_send_end;

ISR(USART_RX_vect) {
    uint8_t byte = UDR0, end = received_end;
    if ((uint8_t)(end + 1) != received_first) {
        received[end] = byte;
        received_end = (uint8_t)(end + 1);
    }
}

ISR(USART_UDRE_vect) {
    uint8_t first = to_send_first;
    if (first == to_send_end) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    } else {
        UDR0 = to_send[first];
        to_send_first = (uint8_t)(first + 1);
    }
}

void uart_begin(void) {
    UCSR0A = USE_2X ? _BV(U2X0) : 0;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UBRR0H = UBRRH_VALUE;
    UBRR0L = UBRRL_VALUE;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

uint8_t uart_has_byte(void) {
    return received_first != received_end;
}

uint8_t uart_take(void) {
    uint8_t byte = received[received_first];
    received_first = (uint8_t)(received_first + 1);
    return byte;
}

void uart_send(const uint8_t *bytes, uint8_t count) {
    while (count--) {
        uint8_t end = to_send_end;
        for (;;) {
            cli();
            if ((uint8_t)(end + 1) != to_send_first) {
                break;
            }
            clock_nap();
        }
        to_send[end] = *bytes++;
        to_send_end = (uint8_t)(end + 1);
        UCSR0B |= _BV(UDRIE0);
        sei();
    }
}
