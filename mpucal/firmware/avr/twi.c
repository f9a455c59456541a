#include "twi.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/delay.h>
#include <util/twi.h>

#include "clock.h"
#include "mpucal_bridge.h"

#define SCL_HZ 400000UL
#define TIMEOUT_STEPS (25000 / CLOCK_STEP_US)
#define HALF_BIT_US 2
#define SDA PC4
#define SCL PC5

#define RUNNING 0xFF

#define GO (_BV(TWEN) | _BV(TWIE) | _BV(TWINT))

/* Transfer that the interrupt carries out. */
static uint8_t address, first, reading, register_sent;
static uint8_t *data;
static uint8_t left;
static volatile uint8_t code = MPUCAL_CODE_OK;

static void finish(uint8_t with) {
    TWCR = _BV(TWEN) | _BV(TWINT) | _BV(TWSTO);
    code = with;
}

/* Continues after an acknowledge of the address, the register or a byte of data. */
static void send_next(void) {
    if (!register_sent) {
        register_sent = 1;
        TWDR = first;
        TWCR = GO;
    } else if (reading) {
        TWCR = GO | _BV(TWSTA);
    } else if (left) {
        left--;
        TWDR = *data++;
        TWCR = GO;
    } else {
        finish(MPUCAL_CODE_OK);
    }
}

ISR(TWI_vect) {
    switch (TW_STATUS) {
    case TW_START:
        TWDR = (uint8_t)(address << 1 | TW_WRITE);
        TWCR = GO;
        break;
    case TW_REP_START:
        TWDR = (uint8_t)(address << 1 | TW_READ);
        TWCR = GO;
        break;
    case TW_MT_SLA_ACK:
    case TW_MT_DATA_ACK:
        send_next();
        break;
    case TW_MR_DATA_ACK:
        *data++ = TWDR;
        left--;
        /* fall through: the last byte is not acknowledged */
    case TW_MR_SLA_ACK:
        TWCR = left > 1 ? GO | _BV(TWEA) : GO;
        break;
    case TW_MR_DATA_NACK:
        *data = TWDR;
        finish(MPUCAL_CODE_OK);
        break;
    case TW_MT_SLA_NACK:
    case TW_MT_DATA_NACK:
        finish(register_sent ? MPUCAL_CODE_BUS_FAILED : MPUCAL_CODE_NO_ANSWER);
        break;
    case TW_MR_SLA_NACK:
        finish(MPUCAL_CODE_NO_ANSWER);
        break;
    default: /* arbitration lost, bus error */
        finish(MPUCAL_CODE_BUS_FAILED);
    }
}

void twi_begin(void) {
    PORTC |= _BV(SDA) | _BV(SCL); /* pull-ups, for a chip without a board */
    TWSR = 0;
    TWBR = (F_CPU / SCL_HZ - 16) / 2;
    TWCR = _BV(TWEN);
}

/* Frees the bus: a chip that was interrupted within a byte holds SDA low until the rest of it is clocked out. */
static void free_bus(void) {
    TWCR = 0;
    for (uint8_t bit = 0; bit < 9; bit++) {
        PORTC &= (uint8_t)~_BV(SCL);
        DDRC |= _BV(SCL);
        _delay_us(HALF_BIT_US);
        DDRC &= (uint8_t)~_BV(SCL);
        PORTC |= _BV(SCL);
        _delay_us(HALF_BIT_US);
    }
    twi_begin();
}

static uint8_t give_up(void) {
    sei();
    free_bus();
    return MPUCAL_CODE_BUS_FAILED;
}

static uint8_t transfer(uint8_t count) {
    uint8_t began = clock_steps();
    left = count;
    register_sent = 0;
    while (TWCR & _BV(TWSTO)) { /* stop of the last transfer */
        if ((uint8_t)(clock_steps() - began) > TIMEOUT_STEPS) {
            return give_up();
        }
    }
    cli();
    code = RUNNING;
    TWCR = GO | _BV(TWSTA);
    while (code == RUNNING) {
        clock_nap();
        cli();
        if (code == RUNNING && (uint8_t)(clock_steps() - began) > TIMEOUT_STEPS) {
            return give_up();
        }
    }
    sei();
    return code;
}

uint8_t twi_read(uint8_t at, uint8_t from, uint8_t *to, uint8_t count) {
    address = at;
    first = from;
    reading = 1;
    data = to;
    return transfer(count);
}

uint8_t twi_write(uint8_t at, uint8_t from, const uint8_t *bytes, uint8_t count) {
    address = at;
    first = from;
    reading = 0;
    data = (uint8_t *)bytes; /* only read */
    return transfer(count);
}
