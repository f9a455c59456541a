/* Numbers of firmware_protocol.md: version, limits, messages, status codes. */
#ifndef MPUCAL_PROTOCOL_H
#define MPUCAL_PROTOCOL_H

#define MPUCAL_PROTOCOL_MAJOR 1
#define MPUCAL_PROTOCOL_MINOR 0

/* firmware_protocol.md, "Limits" and "Timing". */
#define MPUCAL_MAX_PAYLOAD 66
#define MPUCAL_MAX_READ 56
#define MPUCAL_MAX_WRITE 32
#define MPUCAL_MAX_BURST 4096
#define MPUCAL_MAX_CHUNK 32
#define MPUCAL_MAX_LOOK 73
#define MPUCAL_MAX_BATCH 32
#define MPUCAL_MIN_WINDOW 2
#define MPUCAL_BEAT_MS 100

/* firmware_protocol.md, "Messages". */
enum mpucal_type {
    MPUCAL_HELLO = 0x01,
    MPUCAL_READ = 0x02,
    MPUCAL_BURST = 0x03,
    MPUCAL_WRITE = 0x04,
    MPUCAL_STREAM = 0x05,
    MPUCAL_LEAVE = 0x06,
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
    MPUCAL_CODE_STORAGE_FAILED = 13,
    MPUCAL_CODE_OCCUPIED = 14
};

#endif
