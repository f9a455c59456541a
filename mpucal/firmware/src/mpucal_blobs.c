#include "mpucal_blobs.h"

static uint8_t on_state(struct mpucal_bridge *bridge, struct mpucal_message *reply) {
    const struct mpucal_memory *memory = bridge->port->memory;
    struct mpucal_stored stored = mpucal_slots_stored(memory);
    uint8_t *body = bridge->out + BODY_AT;
    if (!stored.generation) {
        return MPUCAL_CODE_NO_BLOB;
    }
    mpucal_put_u32(body, stored.generation);
    mpucal_put_u16(body + 4, stored.length);
    for (uint8_t i = 0; i < 4; i++) {
        body[6 + i] = memory->read((uint16_t)(stored.at + stored.length - 4 + i));
    }
    reply->body_size = 10;
    return MPUCAL_CODE_OK;
}

static uint8_t on_read(struct mpucal_bridge *bridge, struct mpucal_request request, struct mpucal_message *reply) {
    if (request.size < 3 || request.payload[2] < 1 || request.payload[2] > MPUCAL_MAX_READ) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    struct mpucal_stored stored = mpucal_slots_stored(bridge->port->memory);
    uint16_t offset = mpucal_get_u16(request.payload);
    uint8_t count = request.payload[2];
    if (!stored.generation) {
        return MPUCAL_CODE_NO_BLOB;
    }
    if (offset > stored.length || count > stored.length - offset) {
        return MPUCAL_CODE_BAD_OFFSET;
    }
    for (uint8_t i = 0; i < count; i++) {
        bridge->out[BODY_AT + i] = bridge->port->memory->read((uint16_t)(stored.at + offset + i));
    }
    reply->body_size = count;
    return MPUCAL_CODE_OK;
}

static uint8_t on_begin(struct mpucal_bridge *bridge, struct mpucal_request request) {
    if (request.size < 2) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    uint16_t length = mpucal_get_u16(request.payload);
    if (length > MPUCAL_MAX_LENGTH) {
        return MPUCAL_CODE_NO_ROOM;
    }
    if (mpucal_slots_occupied(bridge->port->memory)) {
        return MPUCAL_CODE_OCCUPIED;
    }
    bridge->stream.frame_bytes = 0;
    bridge->new_blob.length = length;
    bridge->new_blob.at = mpucal_slots_open(bridge->port->memory);
    bridge->new_blob.come = 0;
    bridge->new_blob.begun = 1;
    return MPUCAL_CODE_OK;
}

static uint8_t on_data(struct mpucal_bridge *bridge, struct mpucal_request request) {
    const struct mpucal_memory *memory = bridge->port->memory;
    struct mpucal_new_blob *blob = &bridge->new_blob;
    if (request.size < 3 || request.size - 2 > MPUCAL_MAX_CHUNK) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    uint16_t offset = mpucal_get_u16(request.payload);
    const uint8_t *data = request.payload + 2;
    uint8_t count = (uint8_t)(request.size - 2);
    if (!blob->begun) {
        return MPUCAL_CODE_NOT_BEGUN;
    }
    if (offset > blob->come || count > blob->length - offset) {
        return MPUCAL_CODE_BAD_OFFSET;
    }
    for (uint8_t i = 0; i < count; i++) {
        uint16_t address = (uint16_t)(blob->at + offset + i);
        memory->write(address, data[i]);
        if (memory->read(address) != data[i]) {
            return MPUCAL_CODE_STORAGE_FAILED;
        }
    }
    if (offset + count > blob->come) {
        blob->come = (uint16_t)(offset + count);
    }
    return MPUCAL_CODE_OK;
}

/* If no blob was begun, a repeated commit refers to the stored one. */
static uint8_t repeated(const struct mpucal_bridge *bridge, uint16_t length, uint32_t crc, uint32_t *generation) {
    struct mpucal_stored stored = mpucal_slots_stored(bridge->port->memory);
    *generation = stored.generation;
    return stored.generation && mpucal_slots_check(bridge->port->memory, stored.at, length, crc)
               ? MPUCAL_CODE_OK
               : MPUCAL_CODE_NOT_BEGUN;
}

static uint8_t commit(struct mpucal_bridge *bridge, uint16_t length, uint32_t crc, uint32_t *generation) {
    const struct mpucal_memory *memory = bridge->port->memory;
    struct mpucal_new_blob *blob = &bridge->new_blob;
    if (!blob->begun) {
        return repeated(bridge, length, crc, generation);
    }
    if (blob->come < blob->length || length != blob->length) {
        return MPUCAL_CODE_BAD_OFFSET;
    }
    if (!mpucal_slots_check(memory, blob->at, length, crc)) {
        return MPUCAL_CODE_BAD_BLOB;
    }
    *generation = mpucal_slots_seal(memory, blob->at);
    blob->begun = 0;
    return *generation ? MPUCAL_CODE_OK : MPUCAL_CODE_STORAGE_FAILED;
}

static uint8_t on_commit(struct mpucal_bridge *bridge, struct mpucal_request request, struct mpucal_message *reply) {
    uint32_t generation = 0;
    if (request.size < 6) {
        return MPUCAL_CODE_BAD_PAYLOAD;
    }
    uint8_t code = commit(bridge, mpucal_get_u16(request.payload), mpucal_get_u32(request.payload + 2), &generation);
    mpucal_put_u32(bridge->out + BODY_AT, generation);
    reply->body_size = 4;
    return code;
}

static uint8_t on_erase(struct mpucal_bridge *bridge) {
    bridge->new_blob.begun = 0;
    return mpucal_slots_erase(bridge->port->memory) ? MPUCAL_CODE_OK : MPUCAL_CODE_STORAGE_FAILED;
}

uint8_t mpucal_on_blob(struct mpucal_bridge *bridge, uint8_t type, struct mpucal_request request,
                       struct mpucal_message *reply) {
    switch (type) {
    case MPUCAL_BLOB_STATE:
        return on_state(bridge, reply);
    case MPUCAL_BLOB_READ:
        return on_read(bridge, request, reply);
    case MPUCAL_BLOB_BEGIN:
        return on_begin(bridge, request);
    case MPUCAL_BLOB_DATA:
        return on_data(bridge, request);
    case MPUCAL_BLOB_COMMIT:
        return on_commit(bridge, request, reply);
    case MPUCAL_BLOB_ERASE:
        return on_erase(bridge);
    default:
        return MPUCAL_CODE_UNKNOWN_TYPE;
    }
}
