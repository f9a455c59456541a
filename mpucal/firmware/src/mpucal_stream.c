#include "mpucal_stream.h"

#include "mpucal_messages.h"

/* Registers that the bridge reads by itself. */
#define INT_STATUS 0x3A
#define INT_STATUS_FIFO_OFLOW 0x10
#define FIFO_COUNT_H 0x72
#define FIFO_R_W 0x74

#define FRAMES_BODY 5 /* index, drops, left; then the frames */
#define LOOK_US 800 /* a millisecond is the most, and a port may nap for a while */
#define BEAT_US (MPUCAL_BEAT_MS * 1000UL)

uint8_t mpucal_on_stream(struct mpucal_bridge *bridge, struct mpucal_request request, struct mpucal_message *reply) {
    struct mpucal_stream *stream = &bridge->stream;
    uint8_t frame_bytes = request.size < 2 ? 0xFF : request.payload[0];
    uint8_t batch = request.size < 2 ? 0 : request.payload[1];
    if (frame_bytes > MPUCAL_MAX_READ || (frame_bytes && (batch < 1 || batch > MPUCAL_MAX_BATCH))) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    stream->frame_bytes = frame_bytes;
    stream->batch = batch;
    stream->seq = reply->seq;
    stream->code = MPUCAL_CODE_OK;
    stream->left = 0;
    stream->index = 0;
    stream->look_us = stream->sent_us = reply->t_us;
    return MPUCAL_CODE_OK;
}

static void push(struct mpucal_bridge *bridge, uint32_t t_us, uint8_t frames) {
    struct mpucal_stream *stream = &bridge->stream;
    uint8_t *body = bridge->out + BODY_AT;
    struct mpucal_message message = {MPUCAL_FRAMES, stream->seq, stream->code,
                                     (uint8_t)(FRAMES_BODY + frames * stream->frame_bytes), t_us};
    mpucal_put_u16(body, stream->index);
    mpucal_put_u16(body + 2, stream->drops);
    body[4] = stream->left;
    mpucal_send(bridge, &message);
    stream->index = (uint16_t)(stream->index + frames);
    stream->sent_us = bridge->port->now_us();
}

static void halt(struct mpucal_bridge *bridge, uint8_t code) {
    bridge->stream.code = code;
    bridge->stream.drops++;
    bridge->stream.left = 0;
    push(bridge, bridge->port->now_us(), 0);
}

static uint8_t read_registers(const struct mpucal_bridge *bridge, uint8_t first, uint8_t *data, uint8_t count) {
    return bridge->address ? bridge->port->read_registers(bridge->address, first, data, count) : MPUCAL_CODE_NO_ANSWER;
}

/* Rules 1 to 3 without the frames: returns true if a message is due now. */
static int look(struct mpucal_bridge *bridge, uint32_t now_us) {
    struct mpucal_stream *stream = &bridge->stream;
    uint8_t count[2];
    stream->look_us = now_us;
    uint8_t code = read_registers(bridge, FIFO_COUNT_H, count, sizeof count);
    if (code != MPUCAL_CODE_OK) {
        halt(bridge, code);
        return 0;
    }
    uint16_t bytes = (uint16_t)(count[0] << 8 | count[1]), frames = (uint16_t)(bytes / stream->frame_bytes);
    if (frames > MPUCAL_MAX_LOOK) {
        halt(bridge, MPUCAL_CODE_OVERFLOW);
        return 0;
    }
    if (frames < stream->batch && now_us - stream->sent_us < BEAT_US) {
        return 0;
    }
    stream->left = (uint8_t)frames;
    return 1;
}

/* Rules 3 to 5: makes the next message of a look. */
static void push_next(struct mpucal_bridge *bridge) {
    struct mpucal_stream *stream = &bridge->stream;
    uint8_t fit = (uint8_t)(MPUCAL_MAX_READ / stream->frame_bytes), status = 0;
    uint8_t frames = stream->left < fit ? stream->left : fit;
    uint8_t code = MPUCAL_CODE_OK;
    if (frames) {
        uint8_t *data = bridge->out + BODY_AT + FRAMES_BODY;
        code = read_registers(bridge, FIFO_R_W, data, (uint8_t)(frames * stream->frame_bytes));
    }
    stream->left = (uint8_t)(stream->left - frames);
    if (code == MPUCAL_CODE_OK && stream->left == 0) {
        code = read_registers(bridge, INT_STATUS, &status, 1);
    }
    if (code == MPUCAL_CODE_OK && status & INT_STATUS_FIFO_OFLOW) {
        code = MPUCAL_CODE_OVERFLOW;
    }
    if (code != MPUCAL_CODE_OK) {
        halt(bridge, code);
    } else {
        push(bridge, stream->look_us, frames);
    }
}

void mpucal_stream_look(struct mpucal_bridge *bridge) {
    struct mpucal_stream *stream = &bridge->stream;
    uint32_t now_us = bridge->port->now_us();
    if (!stream->frame_bytes) {
        return;
    }
    if (stream->code != MPUCAL_CODE_OK) {
        if (now_us - stream->sent_us >= BEAT_US) {
            push(bridge, now_us, 0);
        }
    } else if (stream->left || (now_us - stream->look_us >= LOOK_US && look(bridge, now_us))) {
        push_next(bridge);
    }
}
