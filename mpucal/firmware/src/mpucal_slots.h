/* Two slots for a config blob, of which at least one is valid at any moment: firmware_protocol.md, "Storage".
 *
 * Power may fail at any moment, and leave any value in the byte that is being written. The old blob is valid until the
 * seal of the new one is complete.
 */
#ifndef MPUCAL_SLOTS_H
#define MPUCAL_SLOTS_H

#include "mpucal_apply.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MPUCAL_SEAL_BYTES 8 /* the generation and its complement */
#define MPUCAL_SLOT_BYTES (MPUCAL_SEAL_BYTES + MPUCAL_MAX_LENGTH)
#define MPUCAL_SLOTS_BYTES (2 * MPUCAL_SLOT_BYTES)

/* Non-volatile memory; addresses count from the beginning of the slots. */
struct mpucal_memory {
    uint8_t (*read)(uint16_t address);
    void (*write)(uint16_t address, uint8_t value);
    void (*commit)(void); /* makes writes permanent; NULL if `write` does */
};

/* Place of the stored blob; generation 0: none. */
struct mpucal_stored {
    uint32_t generation;
    uint16_t at, length;
};

/* Returns the place of the stored blob. */
struct mpucal_stored mpucal_slots_stored(const struct mpucal_memory *memory);

/* Returns the address for a new blob: the other slot, whose seal this breaks. It overwrites other data. */
uint16_t mpucal_slots_open(const struct mpucal_memory *memory);

/* Returns true if the blob at `at` is valid and has this length and CRC. */
int mpucal_slots_check(const struct mpucal_memory *memory, uint16_t at, uint16_t length, uint32_t crc);

/* Seals the checked blob at `at`; returns its generation, 0 if the memory did not keep it. */
uint32_t mpucal_slots_seal(const struct mpucal_memory *memory, uint16_t at);

/* Breaks both seals, the older one first, and gives up other data; returns true if no blob is stored any more. */
int mpucal_slots_erase(const struct mpucal_memory *memory);

/* Returns true if the memory holds other data, neither a blob nor erased: only mpucal_slots_erase gives it up. */
int mpucal_slots_occupied(const struct mpucal_memory *memory);

/* Loads the stored blob; see mpucal_load. */
enum mpucal_status mpucal_slots_load(const struct mpucal_memory *memory, struct mpucal *sensor, uint8_t who_am_i,
                                     float accel_range_g);

/* Loads K and b_omega, and b_a(T), of the stored blob. */
enum mpucal_status mpucal_slots_load_gyro(const struct mpucal_memory *memory, struct mpucal_gyro *gyro,
                                          float gyro_range_dps);
enum mpucal_status mpucal_slots_load_drift(const struct mpucal_memory *memory, struct mpucal_drift *drift);

#ifdef __cplusplus
}
#endif

#endif
