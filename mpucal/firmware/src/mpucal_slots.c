#include "mpucal_slots.h"

/* Position of a source: the blob of a slot. */
struct place {
    const struct mpucal_memory *memory;
    uint16_t at;
};

static uint8_t read_place(const void *where, uint16_t offset) {
    const struct place *place = (const struct place *)where;
    return place->memory->read((uint16_t)(place->at + offset));
}

static uint16_t blob_at(uint8_t slot) {
    return (uint16_t)(slot * MPUCAL_SLOT_BYTES + MPUCAL_SEAL_BYTES);
}

static uint16_t generation_at(uint16_t at) {
    return (uint16_t)(at - MPUCAL_SEAL_BYTES);
}

static uint16_t complement_at(uint16_t at) {
    return (uint16_t)(at - MPUCAL_SEAL_BYTES + 4);
}

static uint32_t read_u32(const struct mpucal_memory *memory, uint16_t address) {
    struct place place = {memory, address};
    struct mpucal_source source = {read_place, &place, 4};
    return mpucal_u32(&source, 0);
}

static void write_u32(const struct mpucal_memory *memory, uint16_t address, uint32_t value) {
    for (uint8_t i = 0; i < 4; i++) {
        memory->write((uint16_t)(address + i), (uint8_t)(value >> 8 * i));
    }
}

static void commit(const struct mpucal_memory *memory) {
    if (memory->commit) {
        memory->commit();
    }
}

static int is_sealed(const struct mpucal_memory *memory, uint16_t at) {
    return read_u32(memory, generation_at(at)) == ~read_u32(memory, complement_at(at));
}

/* Breaks the seal of the blob at `at`, and begins it with the magic, so that the slot no longer looks like other data. */
static void claim(const struct mpucal_memory *memory, uint16_t at) {
    if (is_sealed(memory, at)) {
        /* No number is its own complement. */
        memory->write(complement_at(at), memory->read(generation_at(at)));
    }
    write_u32(memory, at, MPUCAL_MAGIC);
    commit(memory);
}

/* Reads a slot; generation 0: it is not valid. */
static struct mpucal_stored slot_stored(const struct mpucal_memory *memory, uint8_t slot) {
    struct mpucal_stored stored = {0, blob_at(slot), 0};
    struct place place = {memory, stored.at};
    struct mpucal_source blob = {read_place, &place, MPUCAL_MAX_LENGTH};
    if (is_sealed(memory, stored.at) && mpucal_check(&blob) == MPUCAL_OK) {
        stored.generation = read_u32(memory, generation_at(stored.at));
        stored.length = mpucal_u16(&blob, MPUCAL_LENGTH_AT);
    }
    return stored;
}

struct mpucal_stored mpucal_slots_stored(const struct mpucal_memory *memory) {
    struct mpucal_stored first = slot_stored(memory, 0), second = slot_stored(memory, 1);
    if (!first.generation || !second.generation) {
        return first.generation ? first : second;
    }
    /* Generations wrap around: the later one is ahead by less than half of all numbers. */
    return second.generation - first.generation < 0x80000000u ? second : first;
}

uint16_t mpucal_slots_open(const struct mpucal_memory *memory) {
    struct mpucal_stored stored = mpucal_slots_stored(memory);
    uint16_t at = blob_at(stored.generation && stored.at == blob_at(0));
    claim(memory, at);
    return at;
}

int mpucal_slots_check(const struct mpucal_memory *memory, uint16_t at, uint16_t length, uint32_t crc) {
    struct place place = {memory, at};
    struct mpucal_source blob = {read_place, &place, length};
    return mpucal_check(&blob) == MPUCAL_OK && mpucal_u16(&blob, MPUCAL_LENGTH_AT) == length &&
           mpucal_u32(&blob, (uint16_t)(length - 4)) == crc;
}

uint32_t mpucal_slots_seal(const struct mpucal_memory *memory, uint16_t at) {
    uint32_t generation = mpucal_slots_stored(memory).generation + 1;
    generation += generation == 0; /* 0 says that there is none */
    write_u32(memory, generation_at(at), generation);
    write_u32(memory, complement_at(at), ~generation);
    commit(memory);
    struct mpucal_stored stored = mpucal_slots_stored(memory);
    return stored.at == at && stored.generation == generation ? generation : 0;
}

int mpucal_slots_erase(const struct mpucal_memory *memory) {
    uint16_t at = mpucal_slots_stored(memory).at;
    claim(memory, at == blob_at(0) ? blob_at(1) : blob_at(0));
    claim(memory, at);
    return !mpucal_slots_stored(memory).generation;
}

static int is_foreign(const struct mpucal_memory *memory, uint8_t slot) {
    uint16_t at = generation_at(blob_at(slot));
    if (read_u32(memory, blob_at(slot)) == MPUCAL_MAGIC) {
        return 0;
    }
    for (uint16_t i = 1; i < MPUCAL_SLOT_BYTES; i++) {
        if (memory->read((uint16_t)(at + i)) != memory->read(at)) {
            return 1;
        }
    }
    return 0;
}

int mpucal_slots_occupied(const struct mpucal_memory *memory) {
    return is_foreign(memory, 0) || is_foreign(memory, 1);
}

/* Makes a source of the stored blob, which reads `place`; without a blob it has no bytes. */
static struct mpucal_source stored_blob(const struct mpucal_memory *memory, struct place *place) {
    struct mpucal_stored stored = mpucal_slots_stored(memory);
    place->memory = memory;
    place->at = stored.at;
    struct mpucal_source blob = {read_place, place, stored.generation ? stored.length : 0};
    return blob;
}

enum mpucal_status mpucal_slots_load(const struct mpucal_memory *memory, struct mpucal *sensor, uint8_t who_am_i,
                                     float accel_range_g) {
    struct place place;
    struct mpucal_source blob = stored_blob(memory, &place);
    return mpucal_load_from(sensor, &blob, who_am_i, accel_range_g);
}

enum mpucal_status mpucal_slots_load_gyro(const struct mpucal_memory *memory, struct mpucal_gyro *gyro,
                                          float gyro_range_dps) {
    struct place place;
    struct mpucal_source blob = stored_blob(memory, &place);
    return mpucal_load_gyro(gyro, &blob, gyro_range_dps);
}

enum mpucal_status mpucal_slots_load_drift(const struct mpucal_memory *memory, struct mpucal_drift *drift) {
    struct place place;
    struct mpucal_source blob = stored_blob(memory, &place);
    return mpucal_load_drift(drift, &blob);
}
