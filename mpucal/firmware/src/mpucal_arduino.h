/* Where an Arduino board keeps its blob: in the EEPROM of an AVR from MPUCAL_EEPROM_AT on, elsewhere in a file of
 * LittleFS; where the core has neither, nowhere, and a host that stores a blob is told so.
 *
 * For sketches, once each. The flash behind other boards' EEPROM library is erased whole before it is written, which
 * would lose both slots; LittleFS renames a file at once or not at all.
 */
#ifndef MPUCAL_ARDUINO_H
#define MPUCAL_ARDUINO_H

#include <Arduino.h>

#include "mpucal_slots.h"

#if defined(__AVR__)

#include <EEPROM.h>

#ifndef MPUCAL_EEPROM_AT
#define MPUCAL_EEPROM_AT 0
#endif

static uint8_t mpucalRead(uint16_t address) { return EEPROM.read((int)address + MPUCAL_EEPROM_AT); }
static void mpucalWrite(uint16_t address, uint8_t value) { EEPROM.update((int)address + MPUCAL_EEPROM_AT, value); }
static const struct mpucal_memory mpucalMemory = {mpucalRead, mpucalWrite, NULL};
static inline void mpucalMemoryBegin() {}

#elif __has_include(<LittleFS.h>)

#include <LittleFS.h>

static const char *const MPUCAL_FILE = "/mpucal.bin";
static const char *const MPUCAL_NEW_FILE = "/mpucal.new";
static uint8_t mpucalImage[MPUCAL_SLOTS_BYTES];

/* What the file holds; all zeros, which is no blob, where there is none. */
static void mpucalReload() {
    memset(mpucalImage, 0, sizeof mpucalImage);
    File file = LittleFS.open(MPUCAL_FILE, "r");
    if (file) {
        file.read(mpucalImage, sizeof mpucalImage);
        file.close();
    }
}

static void mpucalCommit() {
    File file = LittleFS.open(MPUCAL_NEW_FILE, "w");
    if (file) {
        size_t written = file.write(mpucalImage, sizeof mpucalImage);
        file.close();
        if (written == sizeof mpucalImage) {
            LittleFS.rename(MPUCAL_NEW_FILE, MPUCAL_FILE);
        }
    }
}

static void mpucalSave() {
    mpucalCommit();
    mpucalReload(); /* what is checked next is what was kept */
}

static uint8_t mpucalRead(uint16_t address) { return mpucalImage[address]; }
static void mpucalWrite(uint16_t address, uint8_t value) { mpucalImage[address] = value; }
static const struct mpucal_memory mpucalMemory = {mpucalRead, mpucalWrite, mpucalSave};

static inline void mpucalMemoryBegin() {
#if defined(ESP32)
    LittleFS.begin(true); /* formats a flash that never held files */
#else
    LittleFS.begin();
#endif
    mpucalReload();
}

#else

static uint8_t mpucalRead(uint16_t address) {
    (void)address;
    return 0;
}
static void mpucalWrite(uint16_t address, uint8_t value) {
    (void)address;
    (void)value;
}
static const struct mpucal_memory mpucalMemory = {mpucalRead, mpucalWrite, NULL};
static inline void mpucalMemoryBegin() {}

#endif

#endif
