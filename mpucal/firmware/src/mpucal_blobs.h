/* Requests that read and replace the stored blob: firmware_protocol.md, "BLOB_STATE" to "BLOB_ERASE". Private. */
#ifndef MPUCAL_BLOBS_H
#define MPUCAL_BLOBS_H

#include "mpucal_messages.h"

/* Carries out a BLOB_ request, puts the reply's body into bridge->out, and returns the reply's code. */
uint8_t mpucal_on_blob(struct mpucal_bridge *bridge, uint8_t type, struct mpucal_request request,
                       struct mpucal_message *reply);

#endif
