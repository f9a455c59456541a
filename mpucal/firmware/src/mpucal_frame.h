/* A frame: COBS(type | seq | payload | CRC-16) and a zero. Made and opened in place, in one buffer.
 *
 * firmware_protocol.md, "Framing". Byte 0 of the buffer is COBS's, the content begins at byte 1.
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

/* Bytes as they come in, up to a delimiter; one that begins longer than any frame is no frame. */
struct mpucal_incoming {
    uint8_t bytes[MPUCAL_MAX_ENCODED];
    uint8_t size; /* MPUCAL_MAX_ENCODED + 1: too long */
};

/* CRC-16/CCITT-FALSE of `size` bytes. */
uint16_t mpucal_crc16(const uint8_t *bytes, uint8_t size);

/* Make a frame of the `size` bytes of type, seq and payload from frame + 1 on; how many bytes to send. */
uint8_t mpucal_frame_close(uint8_t *frame, uint8_t size);

/* Open the `size` bytes that came before a delimiter; how many bytes of type, seq and payload lie from frame + 1 on,
 * 0: it is no frame. */
uint8_t mpucal_frame_open(uint8_t *frame, uint8_t size);

/* A byte came in: as mpucal_frame_open where it ends a frame (in incoming->bytes, until the next call), otherwise 0. */
uint8_t mpucal_frame_receive(struct mpucal_incoming *incoming, uint8_t byte);

#ifdef __cplusplus
}
#endif

#endif
