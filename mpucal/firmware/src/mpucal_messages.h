/* Request and reply as the parts of the bridge share them. Private. */
#ifndef MPUCAL_MESSAGES_H
#define MPUCAL_MESSAGES_H

#include "mpucal_state.h"

/* Offsets in a frame's buffer: byte of COBS, type, seq, payload; a bridge's payload begins with status and t_us. */
#define TYPE_AT 1
#define SEQ_AT 2
#define PAYLOAD_AT 3
#define BODY_AT (PAYLOAD_AT + 5)

/* Message of the bridge; its body, after status and t_us, is in the bridge's `out`. */
struct mpucal_message {
    uint8_t type, seq, code, body_size;
    uint32_t t_us;
};

/* Payload of a request. */
struct mpucal_request {
    const uint8_t *payload;
    uint8_t size;
};

static inline void mpucal_put_u16(uint8_t *bytes, uint16_t value) {
    bytes[0] = (uint8_t)value;
    bytes[1] = (uint8_t)(value >> 8);
}

static inline void mpucal_put_u32(uint8_t *bytes, uint32_t value) {
    mpucal_put_u16(bytes, (uint16_t)value);
    mpucal_put_u16(bytes + 2, (uint16_t)(value >> 16));
}

static inline uint16_t mpucal_get_u16(const uint8_t *bytes) {
    return (uint16_t)(bytes[0] | (uint16_t)bytes[1] << 8);
}

static inline uint32_t mpucal_get_u32(const uint8_t *bytes) {
    return mpucal_get_u16(bytes) | (uint32_t)mpucal_get_u16(bytes + 2) << 16;
}

/* Sends a message whose body is in bridge->out. */
void mpucal_send(struct mpucal_bridge *bridge, const struct mpucal_message *message);

#endif
