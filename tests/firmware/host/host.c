/* What the tests of the core need in C: the sizes that ctypes cannot know, and what is done millions of times. */
#include <stdint.h>
#include <string.h>

#include "mpucal_bridge.h"

enum { FIELDS = 16 };

uint32_t host_bridge_bytes(void) {
    return sizeof(struct mpucal_bridge);
}

/* xorshift64* */
static uint64_t draw(uint64_t *state) {
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return *state * 2685821657736338717u;
}

/* Make COBS of frame[1..size], whatever is in it. */
static void stuff(uint8_t *frame, uint8_t size) {
    uint8_t piece_at = 0;
    frame[size + 1] = 0;
    for (uint8_t i = 1; i <= size + 1; i++) {
        if (frame[i] == 0) {
            frame[piece_at] = (uint8_t)(i - piece_at);
            piece_at = i;
        }
    }
}

/* How many of `count` frames of 4 to 70 random bytes the codec takes for frames. */
uint32_t host_accepted(uint64_t seed, uint32_t count) {
    uint32_t accepted = 0;
    while (count--) {
        uint8_t frame[MPUCAL_FRAME_BYTES + 8];
        uint8_t size = (uint8_t)(MPUCAL_MIN_CONTENT + draw(&seed) % (MPUCAL_MAX_CONTENT - MPUCAL_MIN_CONTENT + 1));
        for (uint8_t at = 1; at <= size; at += 8) {
            uint64_t bits = draw(&seed);
            memcpy(frame + at, &bits, sizeof bits);
        }
        stuff(frame, size);
        accepted += mpucal_frame_open(frame, (uint8_t)(size + 1)) != 0;
    }
    return accepted;
}

static void read_fields(const struct mpucal_source *blob, float *fields) {
    for (uint8_t i = 0; i < 9; i++) {
        fields[i] = mpucal_f32(blob, (uint16_t)(MPUCAL_D_AT + 4 * i));
    }
    for (uint8_t i = 0; i < 3; i++) {
        fields[9 + i] = mpucal_f32(blob, (uint16_t)(MPUCAL_B_A_AT + 4 * i));
        fields[12 + i] = mpucal_f32(blob, (uint16_t)(MPUCAL_APPLIED_B_A_AT + 4 * i));
    }
    fields[15] = mpucal_f32(blob, MPUCAL_ACCEL_RANGE_G_AT);
}

/* Of `count` blobs, `stride` bytes apart: whether each is accepted, and then its D, b_a, applied_b_a and range, and
 * what it makes of three counts. A blob's own length has to be the number of bytes that there are, as in a file. */
void host_read_blobs(const uint8_t *blobs, uint32_t stride, const uint16_t *sizes, uint32_t count,
                     const int16_t *counts, uint8_t *checked, uint8_t *loaded, float *fields, float *a_mps2) {
    for (uint32_t i = 0; i < count; i++) {
        struct mpucal_source blob = {mpucal_read_memory, blobs + (size_t)i * stride, sizes[i]};
        struct mpucal sensor;
        checked[i] = (uint8_t)mpucal_check(&blob);
        loaded[i] = (uint8_t)mpucal_load_from(&sensor, &blob, 0, 0.0f);
        if (checked[i] == MPUCAL_OK) {
            read_fields(&blob, fields + (size_t)i * FIELDS);
        }
        if (loaded[i] == MPUCAL_OK) {
            mpucal_apply(&sensor, counts + (size_t)i * 3, a_mps2 + (size_t)i * 3);
        }
    }
}

/* mpucal_load of one blob, and mpucal_apply to three counts. */
uint8_t host_apply(const uint8_t *blob, uint32_t size, uint8_t who_am_i, float accel_range_g, const int16_t *counts,
                   float *a_mps2) {
    struct mpucal sensor;
    enum mpucal_status status = mpucal_load(&sensor, blob, size, who_am_i, accel_range_g);
    if (status == MPUCAL_OK) {
        mpucal_apply(&sensor, counts, a_mps2);
    }
    return (uint8_t)status;
}

/* mpucal_apply_at of three counts at +-4 g. */
uint8_t host_apply_at(const uint8_t *blob, uint32_t size, float temperature_c, const int16_t *counts, float *a_mps2) {
    struct mpucal sensor;
    struct mpucal_drift drift;
    struct mpucal_source source = {mpucal_read_memory, blob, (uint16_t)size};
    enum mpucal_status status = mpucal_load_from(&sensor, &source, 0, 4.0f);
    if (status == MPUCAL_OK) {
        status = mpucal_load_drift(&drift, &source);
    }
    if (status == MPUCAL_OK) {
        mpucal_apply_at(&sensor, &drift, counts, temperature_c, a_mps2);
    }
    return (uint8_t)status;
}

/* mpucal_apply_gyro of three counts. */
uint8_t host_apply_gyro(const uint8_t *blob, uint32_t size, float range_dps, const int16_t *counts, float *w) {
    struct mpucal_gyro gyro;
    struct mpucal_source source = {mpucal_read_memory, blob, (uint16_t)size};
    enum mpucal_status status = mpucal_load_gyro(&gyro, &source, range_dps);
    if (status == MPUCAL_OK) {
        mpucal_apply_gyro(&gyro, counts, w);
    }
    return (uint8_t)status;
}

/* mpucal_apply_fixed of `count` samples at +-4 g. */
uint8_t host_apply_fixed(const uint8_t *blob, uint32_t size, uint32_t count, const int16_t *counts, int32_t *corrected) {
    struct mpucal sensor;
    struct mpucal_fixed fixed;
    enum mpucal_status status = mpucal_load(&sensor, blob, size, 0, 4.0f);
    if (status == MPUCAL_OK) {
        status = mpucal_fix_accel(&fixed, &sensor, 4.0f);
    }
    for (; status == MPUCAL_OK && count--; counts += 3, corrected += 3) {
        mpucal_apply_fixed(&fixed, counts, corrected);
    }
    return (uint8_t)status;
}
