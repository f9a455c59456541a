// As much of an Arduino core as mpucal_arduino.h asks for.
#include <stddef.h>
#include <stdint.h>
#include <string.h>
