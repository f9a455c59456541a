#include "mpucal_bridge.h"

#include <string.h>

#include "mpucal_blobs.h"
#include "mpucal_messages.h"
#include "mpucal_stream.h"

#define HELLO_MAGIC "MPUB"
#define HELLO_VERSION_BYTES 6
#define HELLO_BYTES 7
#define HELLO_REPLY_BODY 27
#define NAME_BYTES 16
#define FEATURE_STREAM 1
#define FEATURE_BLOB 2
#define FEATURE_OCCUPIED 8
#define MAX_I2C_ADDRESS 0x7F

/* Returns the requested address, or for 0 the first of the chip's two, if it acknowledges; else 0. */
static uint8_t find_chip(const struct mpucal_port *port, uint8_t asked) {
    uint8_t last = asked ? asked : 0x69;
    for (uint8_t address = asked ? asked : 0x68; address <= last; address++) {
        if (port->write_registers(address, 0, NULL, 0) == MPUCAL_CODE_OK) {
            return address;
        }
    }
    return 0;
}

static void greet(struct mpucal_bridge *bridge, uint8_t asked_address) {
    memset(&bridge->stream, 0, sizeof bridge->stream);
    bridge->new_blob.begun = 0;
    bridge->greeted = 1;
    bridge->address = find_chip(bridge->port, asked_address);
}

static uint8_t on_hello(struct mpucal_bridge *bridge, struct mpucal_request request, struct mpucal_message *reply) {
    if (request.size < HELLO_VERSION_BYTES || memcmp(request.payload, HELLO_MAGIC, 4) != 0) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    uint8_t speaks = request.payload[4] == MPUCAL_PROTOCOL_MAJOR;
    if (speaks && (request.size < HELLO_BYTES || request.payload[6] > MAX_I2C_ADDRESS)) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    if (speaks) {
        greet(bridge, request.payload[6]);
    }
    uint8_t *body = bridge->out + BODY_AT;
    memset(body, 0, HELLO_REPLY_BODY);
    memcpy(body, HELLO_MAGIC, 4);
    body[4] = MPUCAL_PROTOCOL_MAJOR;
    body[5] = MPUCAL_PROTOCOL_MINOR;
    body[6] = bridge->address;
    body[7] = FEATURE_STREAM | FEATURE_BLOB;
    if (mpucal_slots_occupied(bridge->port->memory)) {
        body[7] |= FEATURE_OCCUPIED;
    }
    body[8] = bridge->port->window;
    mpucal_put_u16(body + 9, MPUCAL_MAX_LENGTH);
    size_t name_bytes = strlen(bridge->port->name);
    memcpy(body + 11, bridge->port->name, name_bytes < NAME_BYTES ? name_bytes : NAME_BYTES);
    reply->body_size = HELLO_REPLY_BODY;
    return speaks ? MPUCAL_CODE_OK : MPUCAL_CODE_BAD_VERSION;
}

static uint8_t on_read(struct mpucal_bridge *bridge, struct mpucal_request request, struct mpucal_message *reply) {
    if (request.size < 2 || request.payload[1] < 1 || request.payload[1] > MPUCAL_MAX_READ) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    if (!bridge->address) {
        return MPUCAL_CODE_NO_ANSWER;
    }
    reply->body_size = request.payload[1];
    return bridge->port->read_registers(bridge->address, request.payload[0], bridge->out + BODY_AT, reply->body_size);
}

/* Sends every part except the last one, which the caller sends. */
static uint8_t on_burst(struct mpucal_bridge *bridge, struct mpucal_request request, struct mpucal_message *reply) {
    uint16_t count = request.size < 3 ? 0 : mpucal_get_u16(request.payload + 1), offset = 0;
    if (count < 1 || count > MPUCAL_MAX_BURST) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    if (!bridge->address) {
        return MPUCAL_CODE_NO_ANSWER;
    }
    uint8_t *body = bridge->out + BODY_AT;
    for (;;) {
        uint16_t left = (uint16_t)(count - offset);
        uint8_t piece = (uint8_t)(left < MPUCAL_MAX_READ ? left : MPUCAL_MAX_READ);
        reply->t_us = bridge->port->now_us();
        reply->code = bridge->port->read_registers(bridge->address, request.payload[0], body + 2, piece);
        reply->body_size = (uint8_t)(2 + piece);
        mpucal_put_u16(body, offset);
        if (reply->code != MPUCAL_CODE_OK || piece == left) {
            return reply->code;
        }
        mpucal_send(bridge, reply);
        offset = (uint16_t)(offset + piece);
    }
}

static uint8_t on_write(struct mpucal_bridge *bridge, struct mpucal_request request) {
    if (request.size < 2 || request.size - 1 > MPUCAL_MAX_WRITE) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    if (!bridge->address) {
        return MPUCAL_CODE_NO_ANSWER; /* and no general call, which address 0 is */
    }
    return bridge->port->write_registers(bridge->address, request.payload[0], request.payload + 1,
                                         (uint8_t)(request.size - 1));
}

static uint8_t carry_out(struct mpucal_bridge *bridge, uint8_t type, struct mpucal_request request,
                         struct mpucal_message *reply) {
    if (type == MPUCAL_HELLO) {
        return on_hello(bridge, request, reply);
    }
    if (!bridge->greeted) {
        return MPUCAL_CODE_NO_HELLO;
    }
    switch (type) {
    case MPUCAL_READ:
        return on_read(bridge, request, reply);
    case MPUCAL_BURST:
        return on_burst(bridge, request, reply);
    case MPUCAL_WRITE:
        return on_write(bridge, request);
    case MPUCAL_STREAM:
        return mpucal_on_stream(bridge, request, reply);
    default:
        return mpucal_on_blob(bridge, type, request, reply);
    }
}

void mpucal_bridge_begin(struct mpucal_bridge *bridge, const struct mpucal_port *port) {
    memset(bridge, 0, sizeof *bridge);
    bridge->port = port;
}

void mpucal_bridge_receive(struct mpucal_bridge *bridge, uint8_t byte) {
    uint8_t size = mpucal_frame_receive(&bridge->incoming, byte);
    const uint8_t *frame = bridge->incoming.bytes;
    if (size == 0 || frame[TYPE_AT] & MPUCAL_REPLY) {
        return;
    }
    struct mpucal_request request = {frame + PAYLOAD_AT, (uint8_t)(size - (PAYLOAD_AT - TYPE_AT))};
    struct mpucal_message reply = {frame[TYPE_AT] | MPUCAL_REPLY, frame[SEQ_AT], 0, 0, bridge->port->now_us()};
    reply.code = carry_out(bridge, frame[TYPE_AT], request, &reply);
    if (reply.code != MPUCAL_CODE_OK && reply.code != MPUCAL_CODE_BAD_VERSION) {
        reply.body_size = 0;
    }
    mpucal_send(bridge, &reply);
}

void mpucal_bridge_look(struct mpucal_bridge *bridge) {
    mpucal_stream_look(bridge);
}
