/* Two slots for a config blob, of which at least one is whole at any moment: firmware_protocol.md, "Storage".
 *
 * Power may fail at any moment, and leave any value in the byte that is being written: until the seal of the new blob
 * is whole the old one counts, from then on the new one.
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

/* A memory that keeps its bytes without power; addresses count from where the slots begin. */
struct mpucal_memory {
    uint8_t (*read)(uint16_t address);
    void (*write)(uint16_t address, uint8_t value);
    void (*commit)(void); /* makes what was written permanent; NULL where `write` does */
};

/* The stored blob; generation 0: none. */
struct mpucal_stored {
    uint32_t generation;
    uint16_t at, length;
};

struct mpucal_stored mpucal_slots_stored(const struct mpucal_memory *memory);

/* Where a new blob may be written: the other slot, whose seal is broken by this. */
uint16_t mpucal_slots_open(const struct mpucal_memory *memory);

/* Whether the blob at `at` is one that a reader may accept, of this length and CRC. */
int mpucal_slots_check(const struct mpucal_memory *memory, uint16_t at, uint16_t length, uint32_t crc);

/* Make the blob at `at` count, which was checked; the generation it has now, 0: the memory did not keep it. */
uint32_t mpucal_slots_seal(const struct mpucal_memory *memory, uint16_t at);

/* Break both seals, the older one first; whether no blob is stored any more. */
int mpucal_slots_erase(const struct mpucal_memory *memory);

/* Whether what lies there is neither a blob nor erased: somebody else's, which storing overwrites. */
int mpucal_slots_occupied(const struct mpucal_memory *memory);

/* Prepare to apply the stored blob, as mpucal_load does one in memory. */
enum mpucal_status mpucal_slots_load(const struct mpucal_memory *memory, struct mpucal *sensor, uint8_t who_am_i,
                                     float accel_range_g);

/* The same of its K and b_omega, and of its b_a(T). */
enum mpucal_status mpucal_slots_load_gyro(const struct mpucal_memory *memory, struct mpucal_gyro *gyro,
                                          float gyro_range_dps);
enum mpucal_status mpucal_slots_load_drift(const struct mpucal_memory *memory, struct mpucal_drift *drift);

#ifdef __cplusplus
}
#endif

#endif
