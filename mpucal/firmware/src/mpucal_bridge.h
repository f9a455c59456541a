/* Serial bridge of firmware_protocol.md: requests in, replies and pushed FIFO frames out.
 *
 * It uses the processor through the functions of a port, needs one struct mpucal_bridge (172 bytes on an AVR), and
 * never allocates. The firmware's loop passes every received byte to it, and otherwise lets it look at the FIFO:
 *
 *     mpucal_bridge_begin(&bridge, &port);
 *     for (;;) {
 *         if (serial has a byte) mpucal_bridge_receive(&bridge, that byte);
 *         else mpucal_bridge_look(&bridge);
 *     }
 */
#ifndef MPUCAL_BRIDGE_H
#define MPUCAL_BRIDGE_H

#include "mpucal_state.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sets the state after start-up, in which every request except HELLO is refused. */
void mpucal_bridge_begin(struct mpucal_bridge *bridge, const struct mpucal_port *port);

/* Takes a byte from the host; if it ends a request, carries that out and answers it. */
void mpucal_bridge_receive(struct mpucal_bridge *bridge, uint8_t byte);

/* Pushes a message of the stream if one is due; call it when no byte has come. */
void mpucal_bridge_look(struct mpucal_bridge *bridge);

#ifdef __cplusplus
}
#endif

#endif
