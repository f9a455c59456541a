"""Pure codecs, as firmware_protocol.md says: bytes in, values out, and back. Knows no file or port."""
