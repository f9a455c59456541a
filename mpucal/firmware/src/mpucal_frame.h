/* Frame: COBS(type | seq | payload | CRC-16) and a zero. It is encoded and decoded in place, in one buffer.
 *
 * See firmware_protocol.md, "Framing". Byte 0 of the buffer is for COBS, the content begins at byte 1.
 */
#ifndef MPUCAL_FRAME_H
#define MPUCAL_FRAME_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MPUCAL_MAX_CONTENT 70
#define MPUCAL_MAX_ENCODED 71
#define MPUCAL_MIN_CONTENT 4
#define MPUCAL_CRC_BYTES 2
#define MPUCAL_FRAME_BYTES (MPUCAL_MAX_ENCODED + 1)

/* Received bytes up to a delimiter; more than a frame's length is not a frame. */
struct mpucal_incoming {
    uint8_t bytes[MPUCAL_MAX_ENCODED];
    uint8_t size; /* MPUCAL_MAX_ENCODED + 1: too long */
};

/* Returns the CRC-16/CCITT-FALSE of `size` bytes. */
uint16_t mpucal_crc16(const uint8_t *bytes, uint8_t size);

/* Encodes the `size` bytes of type, seq and payload from frame + 1 on; returns the number of bytes to send. */
uint8_t mpucal_frame_close(uint8_t *frame, uint8_t size);

/* Decodes the `size` bytes before a delimiter; returns the number of bytes of type, seq and payload from frame + 1 on,
 * 0 if it is not a frame. */
uint8_t mpucal_frame_open(uint8_t *frame, uint8_t size);

/* Takes a byte; if it ends a frame, decodes that as mpucal_frame_open does (in incoming->bytes), else returns 0. */
uint8_t mpucal_frame_receive(struct mpucal_incoming *incoming, uint8_t byte);

#ifdef __cplusplus
}
#endif

#endif
