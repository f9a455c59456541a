#include "mpucal_messages.h"

void mpucal_send(struct mpucal_bridge *bridge, const struct mpucal_message *message) {
    uint8_t *out = bridge->out;
    out[TYPE_AT] = message->type;
    out[SEQ_AT] = message->seq;
    out[PAYLOAD_AT] = message->code;
    mpucal_put_u32(out + PAYLOAD_AT + 1, message->t_us);
    bridge->port->send(out, mpucal_frame_close(out, (uint8_t)(BODY_AT - TYPE_AT + message->body_size)));
}
