/* Bridge on an ATmega328P at 16 MHz: an Arduino Uno, Nano or Pro Mini. */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/wdt.h>

#include "clock.h"
#include "mpucal_bridge.h"
#include "twi.h"
#include "uart.h"
#include "watchdog.h"

static uint8_t read_eeprom(uint16_t address) {
    return eeprom_read_byte((const uint8_t *)address);
}

static void write_eeprom(uint16_t address, uint8_t value) {
    eeprom_update_byte((uint8_t *)address, value);
}

static const struct mpucal_memory MEMORY = {read_eeprom, write_eeprom, NULL};

static const struct mpucal_port PORT = {
    .read_registers = twi_read,
    .write_registers = twi_write,
    .now_us = clock_now_us,
    .send = uart_send,
    .memory = &MEMORY,
    .window = UART_QUEUE_BYTES / (MPUCAL_FRAME_BYTES + 1), /* each with a delimiter before it */
    .name = "mpucal-avr 0.1",
};

int main(void) {
    static struct mpucal_bridge bridge;
    watchdog_begin();
    clock_begin();
    uart_begin();
    twi_begin();
    mpucal_bridge_begin(&bridge, &PORT);
    sei();
    for (;;) {
        wdt_reset();
        if (uart_has_byte()) {
            mpucal_bridge_receive(&bridge, uart_take());
            continue;
        }
        mpucal_bridge_look(&bridge);
        cli();
        if (uart_has_byte()) {
            sei();
        } else {
            clock_nap();
        }
    }
}
