/* Stream: reads the chip's FIFO and pushes its frames; firmware_protocol.md, "FRAMES". Private. */
#ifndef MPUCAL_STREAM_H
#define MPUCAL_STREAM_H

#include "mpucal_messages.h"

/* Carries out STREAM, which begins, replaces or ends the stream; returns the reply's code. */
uint8_t mpucal_on_stream(struct mpucal_bridge *bridge, struct mpucal_request request, struct mpucal_message *reply);

/* Pushes a message of the stream if one is due. */
void mpucal_stream_look(struct mpucal_bridge *bridge);

#endif
