/* Interface to the processor, and state of the bridge between two calls. */
#ifndef MPUCAL_STATE_H
#define MPUCAL_STATE_H

#include "mpucal_frame.h"
#include "mpucal_protocol.h"
#include "mpucal_slots.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Interface to the processor. Register transfers return OK, NO_ANSWER or BUS_FAILED within I2C_MS. */
struct mpucal_port {
    uint8_t (*read_registers)(uint8_t address, uint8_t first, uint8_t *data, uint8_t count);
    uint8_t (*write_registers)(uint8_t address, uint8_t first, const uint8_t *data, uint8_t count); /* count 0: probe */
    uint32_t (*now_us)(void);
    void (*send)(const uint8_t *bytes, uint8_t count); /* waits if its buffer is full */
    const struct mpucal_memory *memory;
    uint8_t window;      /* requests of MPUCAL_FRAME_BYTES that the receiver can hold while the bridge is busy */
    const char *name;    /* at most 16 characters, for people */
};

struct mpucal_stream {
    uint8_t frame_bytes, batch; /* frame_bytes 0: no stream runs */
    uint8_t seq, code;          /* code: why the stream halted */
    uint8_t left;               /* frames of this look that are still in the FIFO */
    uint16_t index, drops;
    uint32_t look_us, sent_us;
};

struct mpucal_new_blob {
    uint8_t begun;
    uint16_t at, length, come;
};

struct mpucal_bridge {
    const struct mpucal_port *port;
    struct mpucal_incoming incoming;
    uint8_t out[MPUCAL_FRAME_BYTES];
    uint8_t greeted, address;
    struct mpucal_stream stream;
    struct mpucal_new_blob new_blob;
};

#ifdef __cplusplus
}
#endif

#endif
