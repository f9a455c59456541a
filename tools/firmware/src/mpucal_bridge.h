/* The serial bridge of firmware_protocol.md: requests in, replies and pushed FIFO frames out.
 *
 * Knows the processor only through the functions of a port, keeps no more than struct mpucal_bridge (176 bytes on an
 * AVR), and never allocates. The loop of a firmware gives it every byte that came in, and otherwise lets it look:
 *
 *     mpucal_bridge_begin(&bridge, &port);
 *     for (;;) {
 *         if (serial has a byte) mpucal_bridge_receive(&bridge, that byte);
 *         else mpucal_bridge_look(&bridge);
 *     }
 */
#ifndef MPUCAL_BRIDGE_H
#define MPUCAL_BRIDGE_H

#include "mpucal_frame.h"
#include "mpucal_slots.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MPUCAL_PROTOCOL_MAJOR 1
#define MPUCAL_PROTOCOL_MINOR 0

/* firmware_protocol.md, "Limits" and "Timing". */
#define MPUCAL_MAX_PAYLOAD 66
#define MPUCAL_MAX_READ 56
#define MPUCAL_MAX_WRITE 32
#define MPUCAL_MAX_BURST 4096
#define MPUCAL_MAX_CHUNK 32
#define MPUCAL_MAX_LOOK 32
#define MPUCAL_MIN_WINDOW 2
#define MPUCAL_BEAT_MS 100

/* firmware_protocol.md, "Messages". */
enum mpucal_type {
    MPUCAL_HELLO = 0x01,
    MPUCAL_READ = 0x02,
    MPUCAL_BURST = 0x03,
    MPUCAL_WRITE = 0x04,
    MPUCAL_STREAM = 0x05,
    MPUCAL_BLOB_STATE = 0x10,
    MPUCAL_BLOB_READ = 0x11,
    MPUCAL_BLOB_BEGIN = 0x12,
    MPUCAL_BLOB_DATA = 0x13,
    MPUCAL_BLOB_COMMIT = 0x14,
    MPUCAL_BLOB_ERASE = 0x15,
    MPUCAL_REPLY = 0x80, /* added to a request's type */
    MPUCAL_FRAMES = 0xC0
};

/* firmware_protocol.md, "Status codes". */
enum mpucal_code {
    MPUCAL_CODE_OK = 0,
    MPUCAL_CODE_NO_HELLO = 1,
    MPUCAL_CODE_UNKNOWN_TYPE = 2,
    MPUCAL_CODE_BAD_PAYLOAD = 3,
    MPUCAL_CODE_BAD_VERSION = 4,
    MPUCAL_CODE_NO_ANSWER = 5,
    MPUCAL_CODE_BUS_FAILED = 6,
    MPUCAL_CODE_OVERFLOW = 7,
    MPUCAL_CODE_NO_BLOB = 8,
    MPUCAL_CODE_BAD_BLOB = 9,
    MPUCAL_CODE_BAD_OFFSET = 10,
    MPUCAL_CODE_NO_ROOM = 11,
    MPUCAL_CODE_NOT_BEGUN = 12,
    MPUCAL_CODE_STORAGE_FAILED = 13
};

/* What the bridge needs of a processor. Register transfers return OK, NO_ANSWER or BUS_FAILED, within I2C_MS. */
struct mpucal_port {
    uint8_t (*read_registers)(uint8_t address, uint8_t first, uint8_t *data, uint8_t count);
    uint8_t (*write_registers)(uint8_t address, uint8_t first, const uint8_t *data, uint8_t count); /* count 0: ask */
    uint32_t (*now_us)(void);
    void (*send)(const uint8_t *bytes, uint8_t count); /* waits where there is no room */
    const struct mpucal_memory *memory;
    uint8_t window;      /* requests of MPUCAL_FRAME_BYTES that the receiver holds while the bridge is busy */
    const char *name;    /* at most 16 characters, for people */
};

struct mpucal_stream {
    uint8_t frame_bytes, batch; /* frame_bytes 0: no stream runs */
    uint8_t seq, code;          /* code: why it stands */
    uint8_t left;               /* frames of this look that are still in the FIFO */
    uint16_t index, drops;
    uint32_t look_us, looked_us, sent_us;
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

/* The state after start-up: every request but HELLO is refused. */
void mpucal_bridge_begin(struct mpucal_bridge *bridge, const struct mpucal_port *port);

/* A byte came from the host; where it ends a request, that is carried out and answered now. */
void mpucal_bridge_receive(struct mpucal_bridge *bridge, uint8_t byte);

/* Nothing came from the host: push a message of the stream, if one is due. */
void mpucal_bridge_look(struct mpucal_bridge *bridge);

#ifdef __cplusplus
}
#endif

#endif
