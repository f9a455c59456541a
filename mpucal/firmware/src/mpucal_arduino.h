/* Memory for the blob on an Arduino board: the EEPROM of an AVR from MPUCAL_EEPROM_AT on; a file of LittleFS on an
 * ESP32, ESP8266 or RP2040. Other boards, and those with too small an EEPROM, have none; a host gets an error then.
 *
 * Include it once in a sketch. The EEPROM libraries of other boards erase the whole flash before a write, which would
 * lose both slots; LittleFS renames a file atomically. Each library is included by name for its cores: the Arduino IDE
 * and arduino-cli discover a library by an include that fails, and not by __has_include.
 */
#ifndef MPUCAL_ARDUINO_H
#define MPUCAL_ARDUINO_H

#include <Arduino.h>

#include "mpucal_slots.h"

/* Address of the two slots of MPUCAL_SLOTS_BYTES; mpucal asks before it overwrites other data there. */
#ifndef MPUCAL_EEPROM_AT
#define MPUCAL_EEPROM_AT 0
#endif

#if defined(__AVR__)
#include <avr/io.h>
#ifdef EEPROM_START /* of an EEPROM in the data space, as an ATmega4809 has; E2END is an address there, too */
#define MPUCAL_E2START EEPROM_START
#else
#define MPUCAL_E2START 0
#endif
#if E2END + 1 - MPUCAL_E2START >= MPUCAL_EEPROM_AT + MPUCAL_SLOTS_BYTES
#define MPUCAL_IN_EEPROM
#endif
#elif defined(ESP32) || defined(ESP8266) || (defined(ARDUINO_ARCH_RP2040) && !defined(ARDUINO_ARCH_MBED))
#define MPUCAL_IN_LITTLEFS
#endif

#if defined(MPUCAL_IN_EEPROM)

#include <EEPROM.h>

static uint8_t mpucalRead(uint16_t address) { return EEPROM.read((int)address + MPUCAL_EEPROM_AT); }
static void mpucalWrite(uint16_t address, uint8_t value) { EEPROM.update((int)address + MPUCAL_EEPROM_AT, value); }
static const struct mpucal_memory mpucalMemory = {mpucalRead, mpucalWrite, NULL};
static inline void mpucalMemoryBegin() {}

#elif defined(MPUCAL_IN_LITTLEFS)

#include <LittleFS.h>

static const char *const MPUCAL_FILE = "/mpucal.bin";
static const char *const MPUCAL_NEW_FILE = "/mpucal.new";
static uint8_t mpucalImage[MPUCAL_SLOTS_BYTES];
static bool mpucalMounted = false;

/* Only a write formats a flash without a file system: reading must not destroy other data. */
static void mpucalMount(bool format) {
#if defined(ESP32)
    mpucalMounted = LittleFS.begin(format);
#else
    LittleFSConfig config;
    config.setAutoFormat(format);
    LittleFS.setConfig(config);
    mpucalMounted = LittleFS.begin();
#endif
}

/* Content of the file; zeros, which are not a blob, without a file; other data, if the flash must be formatted first. */
static void mpucalReload() {
    memset(mpucalImage, 0, sizeof mpucalImage);
    if (!mpucalMounted) {
        mpucalImage[0] = 1;
        return;
    }
    File file = LittleFS.open(MPUCAL_FILE, "r");
    if (file) {
        file.read(mpucalImage, sizeof mpucalImage);
        file.close();
    }
}

static void mpucalCommit() {
    if (!mpucalMounted) {
        mpucalMount(true);
    }
    if (!mpucalMounted) {
        return;
    }
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
    mpucalReload(); /* so that the next check reads the stored data */
}

static uint8_t mpucalRead(uint16_t address) { return mpucalImage[address]; }
static void mpucalWrite(uint16_t address, uint8_t value) { mpucalImage[address] = value; }
static const struct mpucal_memory mpucalMemory = {mpucalRead, mpucalWrite, mpucalSave};

static inline void mpucalMemoryBegin() {
    mpucalMount(false);
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
