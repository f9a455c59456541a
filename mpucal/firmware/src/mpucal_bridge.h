/* The serial bridge of firmware_protocol.md: requests in, replies and pushed FIFO frames out.
 *
 * It reaches the processor through the functions of a port, keeps one struct mpucal_bridge (172 bytes on an AVR), and
 * never allocates. The loop of a firmware gives it every byte that came in, and otherwise lets it look:
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
