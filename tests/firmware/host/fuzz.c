/* The core for libFuzzer: bytes and requests from a host, a chip, and a memory of any content; see tools/attack/fuzz_core.py.
 *
 * The input is pieces, each a kind and a length: bytes as they are; bytes as the content of a frame, whose sum is made
 * here; nothing, for so many looks; a blob, whose CRC is made here; and the memory's content. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "mpucal_apply.h"
#include "mpucal_bridge.h"

enum { MEMORY = 1024, KINDS = 5, CRC_BYTES = 4, MOST_CONTENT = MPUCAL_MAX_CONTENT - MPUCAL_CRC_BYTES };

static uint8_t memory[MEMORY], registers[256], failing;
static uint32_t now_us;

static uint8_t read_memory(uint16_t at) {
    return memory[at < MEMORY ? at : (__builtin_trap(), 0)];
}

static void write_memory(uint16_t at, uint8_t value) {
    memory[at < MEMORY ? at : (__builtin_trap(), 0)] = value;
}

static uint8_t read_registers(uint8_t address, uint8_t first, uint8_t *data, uint8_t count) {
    (void)address;
    for (uint8_t i = 0; i < count; i++) {
        data[i] = registers[(uint8_t)(first + (first == 0x74 ? 0 : i))];
    }
    return failing;
}

static uint8_t write_registers(uint8_t address, uint8_t first, const uint8_t *data, uint8_t count) {
    (void)address;
    for (uint8_t i = 0; i < count; i++) {
        registers[(uint8_t)(first + i)] = data[i];
    }
    return failing;
}

static uint32_t now(void) {
    return now_us += 100;
}

static volatile uint8_t sum;

static void send(const uint8_t *data, uint8_t count) {
    for (uint8_t i = 0; i < count; i++) {
        sum ^= data[i];
    }
}

/* Each use of a blob, in a block of memory of its own: a byte too far is seen. */
static void load(const uint8_t *data, uint8_t size) {
    static const int16_t counts[3] = {1, -32768, 32767};
    uint8_t *blob = malloc(size);
    struct mpucal_source source = {mpucal_read_memory, blob, size};
    struct mpucal sensor;
    struct mpucal_gyro gyro;
    struct mpucal_drift drift;
    struct mpucal_fixed fixed;
    float corrected[3];
    int32_t whole[3];
    memcpy(blob, data, size);
    if (size >= CRC_BYTES) {
        uint32_t crc = mpucal_crc32(&source, (uint16_t)(size - CRC_BYTES));
        memcpy(blob + size - CRC_BYTES, &crc, CRC_BYTES);
    }
    if (mpucal_load(&sensor, blob, size, 0, 0.0f) == MPUCAL_OK) {
        mpucal_apply(&sensor, counts, corrected);
        if (mpucal_load_drift(&drift, &source) == MPUCAL_OK) {
            mpucal_apply_at(&sensor, &drift, counts, 1e9f, corrected);
        }
        if (mpucal_fix_accel(&fixed, &sensor, 1000.0f) == MPUCAL_OK) {
            mpucal_apply_fixed(&fixed, counts, whole);
        }
    }
    if (mpucal_load_gyro(&gyro, &source, 0.0f) == MPUCAL_OK) {
        mpucal_apply_gyro(&gyro, counts, corrected);
    }
    free(blob);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    const struct mpucal_memory kept = {read_memory, write_memory, NULL};
    const struct mpucal_port port = {read_registers, write_registers, now, send, &kept, 3, "core"};
    struct mpucal_bridge bridge;
    memset(memory, 0xff, sizeof memory);
    memset(registers, 0, sizeof registers);
    registers[0x75] = 0x68;
    now_us = failing = 0;
    mpucal_bridge_begin(&bridge, &port);
    while (size >= 2) {
        uint8_t kind = data[0] % KINDS, length = data[1] < size - 2 ? data[1] : (uint8_t)(size - 2);
        failing = data[0] >= 250;
        const uint8_t *piece = data + 2;
        data = piece + length;
        size -= 2u + length;
        if (kind == 0) {
            uint8_t frame[MPUCAL_FRAME_BYTES];
            uint8_t content = length < MOST_CONTENT ? length : MOST_CONTENT;
            memcpy(frame + 1, piece, content);
            uint8_t count = mpucal_frame_close(frame, content);
            for (uint8_t i = 0; i < count; i++) {
                mpucal_bridge_receive(&bridge, frame[i]);
            }
        } else if (kind == 1) {
            for (uint8_t i = 0; i < length; i++) {
                mpucal_bridge_receive(&bridge, piece[i]);
            }
        } else if (kind == 2) {
            registers[0x72] = length >> 4;
            registers[0x73] = length;
            mpucal_bridge_look(&bridge);
        } else if (kind == 3) {
            load(piece, length);
        } else {
            for (uint8_t i = 0; i + 2 < length; i = (uint8_t)(i + 3)) {
                memory[(piece[i] << 8 | piece[i + 1]) % MEMORY] = piece[i + 2];
            }
        }
    }
    return 0;
}
