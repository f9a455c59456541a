/* Applies a config blob to a sample: a = inv(D) (y - b_a + applied_b_a), from counts, in float.
 *
 * A single header in C99 (or C++11) for any microcontroller: no heap, no tables, no library to link, 48 bytes of RAM
 * for each sensor. firmware_protocol.md describes the blob.
 *
 *     static struct mpucal sensor;
 *     if (mpucal_load(&sensor, blob, sizeof blob, 0x68, 4.0f) == MPUCAL_OK) {
 *         float a_mps2[3];
 *         mpucal_apply(&sensor, counts, a_mps2);
 *     }
 */
#ifndef MPUCAL_APPLY_H
#define MPUCAL_APPLY_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* firmware_protocol.md, "Layout": offsets and sizes in bytes. */
#define MPUCAL_MAGIC 0x4355504Du /* "MPUC" */
#define MPUCAL_MAJOR 1
#define MPUCAL_MIN_LENGTH 188
#define MPUCAL_MAX_LENGTH 256
#define MPUCAL_HEADER_LENGTH 8
#define MPUCAL_MAJOR_AT 4
#define MPUCAL_LENGTH_AT 6
#define MPUCAL_WHO_AM_I_AT 48
#define MPUCAL_ACCEL_RANGE_G_AT 52
#define MPUCAL_GYRO_RANGE_DPS_AT 56
#define MPUCAL_D_AT 60
#define MPUCAL_B_A_AT 96
#define MPUCAL_TEMPERATURE_C_AT 120
#define MPUCAL_APPLIED_B_A_AT 124
#define MPUCAL_K_AT 136
#define MPUCAL_B_OMEGA_AT 172
#define MPUCAL_B_A_SLOPE_AT 184
#define MPUCAL_RANGE_C_AT 196
#define MPUCAL_LENGTH_WITH_SLOPE 208
#define MPUCAL_GYRO_COUNTS_AT 204
#define MPUCAL_LENGTH_WITH_COUNTS 212

/* Counts at full scale (firmware_protocol.md, "Counts"), from the data sheet's 16384 LSB/g and 131 LSB/(deg/s).
 * Libraries that divide by 32768 / range, such as FastIMU, differ from the latter by 0.055 %. */
#define MPUCAL_ACCEL_COUNTS 32768.0f
#define MPUCAL_GYRO_COUNTS 32750.0f
#define MPUCAL_STANDARD_GRAVITY_MPS2 9.80665f
#define MPUCAL_RAD 0.01745329252f /* one degree */

/* Result of loading a blob; the first five errors are in the order of the checks in firmware_protocol.md, "Reading". */
enum mpucal_status {
    MPUCAL_OK = 0,
    MPUCAL_NO_BLOB,       /* too short, or another magic: no blob was stored */
    MPUCAL_OTHER_MAJOR,   /* unknown layout */
    MPUCAL_BAD_LENGTH,    /* length out of range, or larger than the data */
    MPUCAL_BAD_CRC,       /* damaged */
    MPUCAL_NOT_FINITE,    /* infinity or NaN in D, b_a or applied_b_a */
    MPUCAL_NOT_INVERTIBLE, /* D is not plausible, or its determinant is within rounding errors of 0 */
    MPUCAL_OTHER_CHIP,    /* measured on a chip with another WHO_AM_I */
    MPUCAL_OTHER_RANGE,   /* measured at another, an impossible or an unknown full scale */
    MPUCAL_NOT_FIXED      /* does not fit into struct mpucal_fixed */
};

/* Calibration in the form that is applied: a = gain * counts - bias, in m/s^2. */
struct mpucal {
    float gain[3][3]; /* inv(D) * 9.80665 * accel_range_g / MPUCAL_ACCEL_COUNTS */
    float bias[3];    /* inv(D) (b_a - applied_b_a) */
};

/* Drift of the bias with the chip's temperature: 24 bytes more, for firmware that reads the temperature. */
struct mpucal_drift {
    float slope[3]; /* inv(D) b_a_slope, m/s^2 per degree Celsius; zeros without b_a(T) in the blob */
    float at_c, from_c, to_c;
};

/* Calibration of the gyroscope, 48 bytes more: w = gain * counts - bias, in rad/s. */
struct mpucal_gyro {
    float gain[3][3]; /* K * (pi / 180) * gyro_range_dps / the blob's gyro_counts */
    float bias[3];    /* K b_omega; zeros if it is unknown */
};

/* Calibration without floating point, 39 bytes: out = (gain * counts + offset) >> 14, in counts. */
struct mpucal_fixed {
    int16_t gain[3][3];    /* in units of 2^-14 */
    uint8_t fraction[3][3]; /* the rest, in units of 2^-22 */
    int32_t offset[3];     /* in units of 2^-14 counts, including half a count to round */
};

/* Source of a blob's bytes: plain memory, or a device that is read byte by byte, such as an EEPROM. */
struct mpucal_source {
    uint8_t (*read)(const void *where, uint16_t offset);
    const void *where;
    size_t size; /* available bytes, at least the blob's */
};

static inline uint8_t mpucal_read_memory(const void *where, uint16_t offset) {
    return ((const uint8_t *)where)[offset];
}

static inline uint8_t mpucal_u8(const struct mpucal_source *blob, uint16_t offset) {
    return blob->read(blob->where, offset);
}

static inline uint16_t mpucal_u16(const struct mpucal_source *blob, uint16_t offset) {
    return (uint16_t)(mpucal_u8(blob, offset) | (uint16_t)mpucal_u8(blob, (uint16_t)(offset + 1)) << 8);
}

static inline uint32_t mpucal_u32(const struct mpucal_source *blob, uint16_t offset) {
    return mpucal_u16(blob, offset) | (uint32_t)mpucal_u16(blob, (uint16_t)(offset + 2)) << 16;
}

/* Decodes bits instead of a cast, since the blob's byte order may not be the processor's. */
static inline float mpucal_f32(const struct mpucal_source *blob, uint16_t offset) {
    uint32_t bits = mpucal_u32(blob, offset);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* True if neither infinite nor NaN. It tests bits, since -ffast-math assumes that a comparison is true. */
static inline int mpucal_is_finite(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7F800000u) != 0x7F800000u;
}

static inline int mpucal_all_finite(const struct mpucal_source *blob, uint16_t offset, uint8_t count) {
    for (uint8_t i = 0; i < count; i++) {
        if (!mpucal_is_finite(mpucal_f32(blob, (uint16_t)(offset + 4u * i)))) {
            return 0;
        }
    }
    return 1;
}

/* CRC-32 of zlib, PNG and Ethernet of the first `count` bytes, bit by bit: it runs seldom, a table takes 1 KiB. */
static inline uint32_t mpucal_crc32(const struct mpucal_source *blob, uint16_t count) {
    uint32_t crc = 0xFFFFFFFFu;
    for (uint16_t i = 0; i < count; i++) {
        crc ^= mpucal_u8(blob, i);
        for (uint8_t bit = 0; bit < 8; bit++) {
            crc = crc & 1 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
        }
    }
    return ~crc;
}

/* Element (i, j) of the adjugate of D, row-major: inv(D) without the factor 1 / det(D). */
static inline float mpucal_adjugate(const float D[9], uint8_t i, uint8_t j) {
    uint8_t p = (uint8_t)((j + 1) % 3), q = (uint8_t)((j + 2) % 3);
    uint8_t r = (uint8_t)((i + 1) % 3), s = (uint8_t)((i + 2) % 3);
    return D[3 * p + r] * D[3 * q + s] - D[3 * p + s] * D[3 * q + r];
}

/* Reads D and returns its determinant; 0 if D is not plausible, or the determinant is within rounding errors. */
static inline float mpucal_read_D(const struct mpucal_source *blob, float D[9]) {
    float det = 0.0f, most = 0.0f;
    for (uint8_t i = 0; i < 9; i++) {
        D[i] = mpucal_f32(blob, (uint16_t)(MPUCAL_D_AT + 4 * i));
        most = D[i] > most ? D[i] : -D[i] > most ? -D[i] : most;
    }
    if (most < 1e-3f || most > 1e3f) {
        return 0.0f;
    }
    for (uint8_t i = 0; i < 3; i++) {
        det += D[i] * mpucal_adjugate(D, i, 0);
    }
    return (det < 0.0f ? -det : det) > 1e-6f * most * most * most ? det : 0.0f;
}

/* Returns true for a possible full scale; 0: unknown. */
static inline int mpucal_is_range(const struct mpucal_source *blob, uint16_t offset) {
    float value = mpucal_f32(blob, offset);
    return mpucal_is_finite(value) && value >= 0.0f;
}

/* Returns the gyroscope's counts at full scale, which blobs of minor version 0 and 1 do not contain. */
static inline float mpucal_gyro_counts(const struct mpucal_source *blob) {
    return mpucal_u16(blob, MPUCAL_LENGTH_AT) < MPUCAL_LENGTH_WITH_COUNTS ? MPUCAL_GYRO_COUNTS
                                                                         : mpucal_f32(blob, MPUCAL_GYRO_COUNTS_AT);
}

/* Checks the blob at the beginning of a source: firmware_protocol.md, "Reading". */
static inline enum mpucal_status mpucal_check(const struct mpucal_source *blob) {
    if (blob->size < MPUCAL_HEADER_LENGTH || mpucal_u32(blob, 0) != MPUCAL_MAGIC) {
        return MPUCAL_NO_BLOB;
    }
    if (mpucal_u8(blob, MPUCAL_MAJOR_AT) != MPUCAL_MAJOR) {
        return MPUCAL_OTHER_MAJOR;
    }
    uint16_t length = mpucal_u16(blob, MPUCAL_LENGTH_AT);
    if (length < MPUCAL_MIN_LENGTH || length > MPUCAL_MAX_LENGTH || length > blob->size) {
        return MPUCAL_BAD_LENGTH;
    }
    uint16_t crc_at = (uint16_t)(length - 4);
    if (mpucal_crc32(blob, crc_at) != mpucal_u32(blob, crc_at)) {
        return MPUCAL_BAD_CRC;
    }
    if (!mpucal_all_finite(blob, MPUCAL_D_AT, 9) || !mpucal_all_finite(blob, MPUCAL_B_A_AT, 3) ||
        !mpucal_all_finite(blob, MPUCAL_APPLIED_B_A_AT, 3)) {
        return MPUCAL_NOT_FINITE;
    }
    float D[9], gyro_counts = mpucal_gyro_counts(blob);
    if (mpucal_read_D(blob, D) == 0.0f) {
        return MPUCAL_NOT_INVERTIBLE;
    }
    if (!mpucal_is_range(blob, MPUCAL_ACCEL_RANGE_G_AT) || !mpucal_is_range(blob, MPUCAL_GYRO_RANGE_DPS_AT) ||
        !mpucal_is_finite(gyro_counts) || !(gyro_counts > 0.0f)) {
        return MPUCAL_OTHER_RANGE;
    }
    return MPUCAL_OK;
}

/* Prepares a checked blob for counts at +-range_g. */
static inline enum mpucal_status mpucal_prepare(struct mpucal *sensor, const struct mpucal_source *blob,
                                                float range_g) {
    float D[9], offset[3], det = mpucal_read_D(blob, D);
    for (uint8_t i = 0; i < 3; i++) {
        offset[i] = mpucal_f32(blob, (uint16_t)(MPUCAL_B_A_AT + 4 * i)) -
                    mpucal_f32(blob, (uint16_t)(MPUCAL_APPLIED_B_A_AT + 4 * i));
    }
    float mps2_per_count = MPUCAL_STANDARD_GRAVITY_MPS2 * range_g / MPUCAL_ACCEL_COUNTS;
    struct mpucal made = {{{0.0f}}, {0.0f}};
    int usable = 1;
    for (uint8_t i = 0; i < 3; i++) {
        for (uint8_t j = 0; j < 3; j++) {
            float inverse = mpucal_adjugate(D, i, j) / det;
            made.gain[i][j] = inverse * mps2_per_count;
            made.bias[i] += inverse * offset[j];
            usable = usable && mpucal_is_finite(made.gain[i][j]) && mpucal_is_finite(made.bias[i]);
        }
    }
    if (!usable) {
        return MPUCAL_NOT_INVERTIBLE;
    }
    *sensor = made;
    return MPUCAL_OK;
}

/* Checks a blob and prepares it for use; on any status except MPUCAL_OK, `sensor` is not changed.
 *
 * who_am_i: the chip's register 0x75; 0: any chip.
 * accel_range_g: the chip's present full scale, g; 0: the blob's.
 */
static inline enum mpucal_status mpucal_load_from(struct mpucal *sensor, const struct mpucal_source *blob,
                                                  uint8_t who_am_i, float accel_range_g) {
    enum mpucal_status status = mpucal_check(blob);
    if (status != MPUCAL_OK) {
        return status;
    }
    uint8_t measured_on = mpucal_u8(blob, MPUCAL_WHO_AM_I_AT);
    if (who_am_i && measured_on && measured_on != who_am_i) {
        return MPUCAL_OTHER_CHIP;
    }
    float measured_at_g = mpucal_f32(blob, MPUCAL_ACCEL_RANGE_G_AT);
    float range_g = accel_range_g > 0.0f ? accel_range_g : measured_at_g;
    if (!(range_g > 0.0f) || (measured_at_g > 0.0f && measured_at_g != range_g)) {
        return MPUCAL_OTHER_RANGE;
    }
    return mpucal_prepare(sensor, blob, range_g);
}

/* Loads a blob from `size` bytes of `memory`; see mpucal_load_from. */
static inline enum mpucal_status mpucal_load(struct mpucal *sensor, const void *memory, size_t size, uint8_t who_am_i,
                                             float accel_range_g) {
    struct mpucal_source blob = {mpucal_read_memory, memory, size};
    return mpucal_load_from(sensor, &blob, who_am_i, accel_range_g);
}

/* Converts the accelerometer `counts` (x, y, z) of a sample to specific force (m/s^2; at rest, +gravity upward). */
static inline void mpucal_apply(const struct mpucal *sensor, const int16_t counts[3], float a_mps2[3]) {
    float x = counts[0], y = counts[1], z = counts[2];
    for (uint8_t i = 0; i < 3; i++) {
        const float *gain = sensor->gain[i];
        a_mps2[i] = gain[0] * x + gain[1] * y + gain[2] * z - sensor->bias[i];
    }
}

/* Loads the gyroscope's K and b_omega from a blob; on any status except MPUCAL_OK, `gyro` is not changed.
 *
 * gyro_range_dps: the chip's present full scale, deg/s; 0: the blob's.
 */
static inline enum mpucal_status mpucal_load_gyro(struct mpucal_gyro *gyro, const struct mpucal_source *blob,
                                                  float gyro_range_dps) {
    enum mpucal_status status = mpucal_check(blob);
    if (status != MPUCAL_OK) {
        return status;
    }
    float measured_at_dps = mpucal_f32(blob, MPUCAL_GYRO_RANGE_DPS_AT);
    float range_dps = gyro_range_dps > 0.0f ? gyro_range_dps : measured_at_dps;
    if (!(range_dps > 0.0f) || (measured_at_dps > 0.0f && measured_at_dps != range_dps)) {
        return MPUCAL_OTHER_RANGE;
    }
    float rad_s_per_count = MPUCAL_RAD * range_dps / mpucal_gyro_counts(blob);
    int has_K = mpucal_all_finite(blob, MPUCAL_K_AT, 9), has_bias = mpucal_all_finite(blob, MPUCAL_B_OMEGA_AT, 3);
    for (uint8_t i = 0; i < 3; i++) {
        gyro->bias[i] = 0.0f;
        for (uint8_t j = 0; j < 3; j++) {
            float K = has_K ? mpucal_f32(blob, (uint16_t)(MPUCAL_K_AT + 4 * (3 * i + j))) : (i == j ? 1.0f : 0.0f);
            gyro->gain[i][j] = K * rad_s_per_count;
            gyro->bias[i] += has_bias ? K * mpucal_f32(blob, (uint16_t)(MPUCAL_B_OMEGA_AT + 4 * j)) : 0.0f;
        }
    }
    return MPUCAL_OK;
}

/* Converts the gyroscope `counts` (x, y, z) of a sample to a rate (rad/s). */
static inline void mpucal_apply_gyro(const struct mpucal_gyro *gyro, const int16_t counts[3], float w_rad_s[3]) {
    float x = counts[0], y = counts[1], z = counts[2];
    for (uint8_t i = 0; i < 3; i++) {
        const float *gain = gyro->gain[i];
        w_rad_s[i] = gain[0] * x + gain[1] * y + gain[2] * z - gyro->bias[i];
    }
}

/* Loads b_a(T) from a blob, in addition to mpucal_load; on any status except MPUCAL_OK, `drift` is not changed. */
static inline enum mpucal_status mpucal_load_drift(struct mpucal_drift *drift, const struct mpucal_source *blob) {
    enum mpucal_status status = mpucal_check(blob);
    if (status != MPUCAL_OK) {
        return status;
    }
    struct mpucal_drift made = {{0.0f, 0.0f, 0.0f}, 0.0f, 0.0f, 0.0f};
    float at_c = mpucal_f32(blob, MPUCAL_TEMPERATURE_C_AT), D[9], slope[3], det = mpucal_read_D(blob, D);
    if (mpucal_u16(blob, MPUCAL_LENGTH_AT) < MPUCAL_LENGTH_WITH_SLOPE || !mpucal_is_finite(at_c) ||
        !mpucal_all_finite(blob, MPUCAL_B_A_SLOPE_AT, 5) || mpucal_f32(blob, MPUCAL_RANGE_C_AT) > at_c ||
        mpucal_f32(blob, MPUCAL_RANGE_C_AT + 4) < at_c) {
        *drift = made;
        return MPUCAL_OK;
    }
    for (uint8_t i = 0; i < 3; i++) {
        slope[i] = mpucal_f32(blob, (uint16_t)(MPUCAL_B_A_SLOPE_AT + 4 * i));
    }
    for (uint8_t i = 0; i < 3; i++) {
        for (uint8_t j = 0; j < 3; j++) {
            made.slope[i] += mpucal_adjugate(D, i, j) / det * slope[j];
        }
    }
    made.at_c = at_c;
    made.from_c = mpucal_f32(blob, MPUCAL_RANGE_C_AT);
    made.to_c = mpucal_f32(blob, MPUCAL_RANGE_C_AT + 4);
    *drift = made;
    return MPUCAL_OK;
}

/* Returns the difference to the temperature of b_a, deg C; 0 for an unknown temperature, NaN. */
static inline float mpucal_away_c(const struct mpucal_drift *drift, float temperature_c) {
    float known = mpucal_is_finite(temperature_c) ? temperature_c : drift->at_c;
    float within = known < drift->from_c ? drift->from_c : known;
    return (within > drift->to_c ? drift->to_c : within) - drift->at_c;
}

/* Applies b_a(T) at the chip's temperature_c; beyond the measured temperatures it is constant. */
static inline void mpucal_apply_at(const struct mpucal *sensor, const struct mpucal_drift *drift,
                                   const int16_t counts[3], float temperature_c, float a_mps2[3]) {
    float away_c = mpucal_away_c(drift, temperature_c);
    mpucal_apply(sensor, counts, a_mps2);
    for (uint8_t i = 0; i < 3; i++) {
        a_mps2[i] -= drift->slope[i] * away_c;
    }
}

/* Prepares a calibration for a temperature, to be applied until the temperature changes. */
static inline struct mpucal mpucal_at(const struct mpucal *sensor, const struct mpucal_drift *drift,
                                      float temperature_c) {
    struct mpucal at = *sensor;
    float away_c = mpucal_away_c(drift, temperature_c);
    for (uint8_t i = 0; i < 3; i++) {
        at.bias[i] += drift->slope[i] * away_c;
    }
    return at;
}

#define MPUCAL_FIXED_ONE 16384.0f /* 2^14 */
#define MPUCAL_FIXED_LIMIT 131064.0f /* counts that fit into 32 bits, less 8 for rounding */

/* Converts gain * counts - bias to fixed point; `unit`: one count. On any status except MPUCAL_OK, `fixed` stays. */
static inline enum mpucal_status mpucal_fix(struct mpucal_fixed *fixed, const float gain[3][3], const float bias[3],
                                            float unit) {
    struct mpucal_fixed made;
    for (uint8_t i = 0; i < 3; i++) {
        float offset = bias[i] / unit, most = offset < 0.0f ? -offset : offset;
        for (uint8_t j = 0; j < 3; j++) {
            float ratio = gain[i][j] / unit, size = ratio < 0.0f ? -ratio : ratio;
            if (!(size < 1.999f)) {
                return MPUCAL_NOT_FIXED;
            }
            most += size * MPUCAL_ACCEL_COUNTS;
            int32_t units = (int32_t)(ratio * MPUCAL_FIXED_ONE * 256.0f + (ratio < 0.0f ? -0.5f : 0.5f));
            made.gain[i][j] = (int16_t)(units >> 8);
            made.fraction[i][j] = (uint8_t)(units & 0xFF);
        }
        if (!(most < MPUCAL_FIXED_LIMIT)) {
            return MPUCAL_NOT_FIXED;
        }
        made.offset[i] = (int32_t)((0.5f - offset) * MPUCAL_FIXED_ONE);
    }
    *fixed = made;
    return MPUCAL_OK;
}

/* Converts a calibration at +-range_g for mpucal_apply_fixed. */
static inline enum mpucal_status mpucal_fix_accel(struct mpucal_fixed *fixed, const struct mpucal *sensor,
                                                  float range_g) {
    return mpucal_fix(fixed, sensor->gain, sensor->bias, MPUCAL_STANDARD_GRAVITY_MPS2 * range_g / MPUCAL_ACCEL_COUNTS);
}

/* Converts the gyroscope's calibration at +-range_dps, in counts of MPUCAL_GYRO_COUNTS at full scale. */
static inline enum mpucal_status mpucal_fix_gyro(struct mpucal_fixed *fixed, const struct mpucal_gyro *gyro,
                                                 float range_dps) {
    return mpucal_fix(fixed, gyro->gain, gyro->bias, MPUCAL_RAD * range_dps / MPUCAL_GYRO_COUNTS);
}

#ifdef __AVR_HAVE_MUL__
/* sum + (256 gain + fraction) count / 256, byte by byte: avr-gcc needs three times as many cycles for the C below. */
static inline int32_t mpucal_plus(int32_t sum, int16_t gain, uint8_t fraction, int16_t count) {
    __asm__("mul %[f], %A[c]\n\tadd %A[s], r1\n\tadc %B[s], %[o]\n\tadc %C[s], %[o]\n\tadc %D[s], %[o]\n\t"
            "mulsu %B[c], %[f]\n\tsbc %C[s], %[o]\n\tsbc %D[s], %[o]\n\t" /* the carry is the product's sign */
            "add %A[s], r0\n\tadc %B[s], r1\n\tadc %C[s], %[o]\n\tadc %D[s], %[o]\n\t"
            "mul %A[g], %A[c]\n\tadd %A[s], r0\n\tadc %B[s], r1\n\tadc %C[s], %[o]\n\tadc %D[s], %[o]\n\t"
            "mulsu %B[c], %A[g]\n\tsbc %D[s], %[o]\n\tadd %B[s], r0\n\tadc %C[s], r1\n\tadc %D[s], %[o]\n\t"
            "mulsu %B[g], %A[c]\n\tsbc %D[s], %[o]\n\tadd %B[s], r0\n\tadc %C[s], r1\n\tadc %D[s], %[o]\n\t"
            "muls %B[g], %B[c]\n\tadd %C[s], r0\n\tadc %D[s], r1\n\tclr r1"
            : [s] "+r"(sum)
            : [g] "a"(gain), [f] "a"(fraction), [c] "a"(count), [o] "r"((uint8_t)0));
    return sum;
}

/* sum / 2^14 by two bytes and two bits, since an AVR shifts by one bit at a time. */
static inline int32_t mpucal_shifted(int32_t sum) {
    int32_t above = sum >> 8;
    __asm__("" : "+r"(above));
    return (int32_t)((uint32_t)above << 2) >> 8;
}
#else
static inline int32_t mpucal_plus(int32_t sum, int16_t gain, uint8_t fraction, int16_t count) {
    return sum + (int32_t)gain * count + ((int32_t)fraction * count >> 8);
}

static inline int32_t mpucal_shifted(int32_t sum) {
    return sum >> 14;
}
#endif

/* Applies a calibration without floating point. The result is in counts at the nominal scale, within 1 count of
 * mpucal_apply or mpucal_apply_gyro over the whole range. */
static inline void mpucal_apply_fixed(const struct mpucal_fixed *fixed, const int16_t counts[3], int32_t corrected[3]) {
    int16_t x = counts[0], y = counts[1], z = counts[2];
    for (uint8_t i = 0; i < 3; i++) {
        const int16_t *gain = fixed->gain[i];
        const uint8_t *fraction = fixed->fraction[i];
        int32_t sum = mpucal_plus(fixed->offset[i], gain[0], fraction[0], x);
        sum = mpucal_plus(sum, gain[1], fraction[1], y);
        corrected[i] = mpucal_shifted(mpucal_plus(sum, gain[2], fraction[2], z));
    }
}

#ifdef __cplusplus
}
#endif

#endif
