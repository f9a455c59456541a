/* Register transfers as the only master of an I2C bus, at 400 kHz. */
#ifndef TWI_H
#define TWI_H

#include <stdint.h>

void twi_begin(void);

/* Both return MPUCAL_CODE_OK, _NO_ANSWER or _BUS_FAILED, after 25 ms at most. */
uint8_t twi_read(uint8_t address, uint8_t first, uint8_t *data, uint8_t count);
uint8_t twi_write(uint8_t address, uint8_t first, const uint8_t *data, uint8_t count);

#endif
