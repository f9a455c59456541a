#include "mpucal_frame.h"

uint16_t mpucal_crc16(const uint8_t *bytes, uint8_t size) {
    uint16_t crc = 0xFFFF;
    while (size--) {
        /* The eight steps of polynomial 0x1021 at once, without a table. */
        uint8_t x = (uint8_t)(crc >> 8 ^ *bytes++);
        x ^= x >> 4;
        crc = (uint16_t)(crc << 8 ^ (uint16_t)x << 12 ^ (uint16_t)x << 5 ^ x);
    }
    return crc;
}

uint8_t mpucal_frame_close(uint8_t *frame, uint8_t size) {
    uint16_t crc = mpucal_crc16(frame + 1, size);
    uint8_t end = (uint8_t)(size + MPUCAL_CRC_BYTES + 1), piece_at = 0;
    frame[size + 1] = (uint8_t)crc;
    frame[size + 2] = (uint8_t)(crc >> 8);
    frame[end] = 0;
    for (uint8_t i = 1; i <= end; i++) {
        if (frame[i] == 0) {
            frame[piece_at] = (uint8_t)(i - piece_at);
            piece_at = i;
        }
    }
    return (uint8_t)(end + 1);
}

uint8_t mpucal_frame_open(uint8_t *frame, uint8_t size) {
    uint8_t at = 0;
    while (at < size) {
        uint8_t piece = frame[at];
        frame[at] = 0;
        if (piece == 0 || piece > size - at) {
            return 0;
        }
        at = (uint8_t)(at + piece);
    }
    if (size < MPUCAL_MIN_CONTENT + 1) {
        return 0;
    }
    uint8_t content = (uint8_t)(size - 1 - MPUCAL_CRC_BYTES);
    uint16_t crc = (uint16_t)(frame[content + 1] | (uint16_t)frame[content + 2] << 8);
    return mpucal_crc16(frame + 1, content) == crc ? content : 0;
}

uint8_t mpucal_frame_receive(struct mpucal_incoming *incoming, uint8_t byte) {
    uint8_t size = incoming->size;
    if (byte == 0) {
        incoming->size = 0;
        return size <= MPUCAL_MAX_ENCODED ? mpucal_frame_open(incoming->bytes, size) : 0;
    }
    if (size < MPUCAL_MAX_ENCODED) {
        incoming->bytes[size] = byte;
    }
    if (size <= MPUCAL_MAX_ENCODED) {
        incoming->size++;
    }
    return 0;
}
