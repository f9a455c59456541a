// Serial bridge for boards with the Arduino core: `mpucal session --serial PORT` measures through it.
//
// Connect SDA and SCL to the sensor, and 3.3 V. For an Uno, Nano or Pro Mini, mpucal/firmware/avr is the better choice.
#include <Wire.h>

#include <mpucal_arduino.h>
#include <mpucal_bridge.h>

#if defined(__AVR__)
#include <avr/wdt.h>
#endif

// An Arduino core's buffer of 64 bytes holds one request while another is carried out, without overflow at this rate.
// With -DSERIAL_RX_BUFFER_SIZE=256 the rate may be 500000, which is enough for 1000 samples a second.
#ifndef MPUCAL_BAUD
#define MPUCAL_BAUD 115200
#endif

// Pins of the I2C bus for cores with a choice (ESP32, ESP8266, RP2040); by default the board's own.
// #define MPUCAL_SDA 4
// #define MPUCAL_SCL 5

const uint32_t BAUD_RATE = MPUCAL_BAUD;
const uint32_t I2C_HZ = 400000;
const uint32_t I2C_TIMEOUT_MS = 25;
const uint8_t WIRE_BYTES = 32;  // buffer of the smallest Wire library
const uint8_t WIRE_NO_ADDRESS = 2, WIRE_TIMED_OUT = 5;
const uint8_t FIFO_R_W = 0x74, MEM_R_W = 0x6F;  // these do not auto-increment

// Limits the time of a transfer, by the first of these functions that the core's Wire has.
template <typename W> static auto limitTime(W &wire, int) -> decltype(wire.setWireTimeout(1, true)) {
    return wire.setWireTimeout(I2C_TIMEOUT_MS * 1000, true);
}
template <typename W> static auto limitTime(W &wire, long) -> decltype(wire.setTimeOut(1)) {
    return wire.setTimeOut((uint16_t)I2C_TIMEOUT_MS);
}
template <typename W> static void limitTime(W &, ...) {}

static void beginWire() {
#if defined(MPUCAL_SDA) && defined(ARDUINO_ARCH_RP2040)
    Wire.setSDA(MPUCAL_SDA);
    Wire.setSCL(MPUCAL_SCL);
    Wire.begin();
#elif defined(MPUCAL_SDA)
    Wire.begin(MPUCAL_SDA, MPUCAL_SCL);
#else
    Wire.begin();
#endif
    Wire.setClock(I2C_HZ);
    limitTime(Wire, 0);
}

// Frees the bus: a chip that was interrupted within a byte holds SDA low until the rest of it is clocked out.
static void freeBus() {
#if defined(PIN_WIRE_SCL) && defined(WIRE_HAS_END)
    Wire.end();
    for (uint8_t bit = 0; bit < 9; bit++) {
        digitalWrite(PIN_WIRE_SCL, LOW);
        pinMode(PIN_WIRE_SCL, OUTPUT);
        delayMicroseconds(2);
        pinMode(PIN_WIRE_SCL, INPUT_PULLUP);
        delayMicroseconds(2);
    }
    beginWire();
#endif
}

static uint8_t codeOf(uint8_t wire) {
    if (wire == WIRE_TIMED_OUT) {
        freeBus();
    }
    return wire == 0 ? MPUCAL_CODE_OK : wire == WIRE_NO_ADDRESS ? MPUCAL_CODE_NO_ANSWER : MPUCAL_CODE_BUS_FAILED;
}

static uint8_t registerAfter(uint8_t first, uint8_t done) {
    return first == FIFO_R_W || first == MEM_R_W ? first : (uint8_t)(first + done);
}

// Writes byte by byte: an AVR's Wire reports success for several bytes, and drops those that do not fit.
static uint8_t writePiece(uint8_t address, uint8_t first, const uint8_t *data, uint8_t count) {
    Wire.beginTransmission(address);
    bool fits = Wire.write(first) == 1;
    for (uint8_t i = 0; i < count; i++) {
        fits = Wire.write(data[i]) == 1 && fits;
    }
    uint8_t code = codeOf(Wire.endTransmission());
    return code == MPUCAL_CODE_OK && !fits ? (uint8_t)MPUCAL_CODE_BUS_FAILED : code;
}

// The register takes one byte of Wire's buffer.
static uint8_t writeRegisters(uint8_t address, uint8_t first, const uint8_t *data, uint8_t count) {
    uint8_t done = 0, code;
    do {
        uint8_t left = (uint8_t)(count - done), piece = left < WIRE_BYTES ? left : (uint8_t)(WIRE_BYTES - 1);
        code = writePiece(address, registerAfter(first, done), data + done, piece);
        done = (uint8_t)(done + piece);
    } while (code == MPUCAL_CODE_OK && done < count);
    return code;
}

// Some cores send the register only together with the read, and then cannot report a missing acknowledge.
static uint8_t whyNothing(uint8_t address) {
    Wire.beginTransmission(address);
    uint8_t code = codeOf(Wire.endTransmission());
    return code == MPUCAL_CODE_OK ? (uint8_t)MPUCAL_CODE_BUS_FAILED : code;
}

static uint8_t readPiece(uint8_t address, uint8_t first, uint8_t *data, uint8_t count) {
    Wire.beginTransmission(address);
    Wire.write(first);
    uint8_t code = codeOf(Wire.endTransmission(false));
    if (code != MPUCAL_CODE_OK) {
        return code;
    }
    if (Wire.requestFrom(address, (size_t)count) != count) {
        return whyNothing(address);
    }
    for (uint8_t i = 0; i < count; i++) {
        data[i] = (uint8_t)Wire.read();
    }
    return MPUCAL_CODE_OK;
}

// Several parts make one transfer only for the FIFO: a host reads at most 14 other registers at once.
static uint8_t readRegisters(uint8_t address, uint8_t first, uint8_t *data, uint8_t count) {
    for (uint8_t done = 0; done < count; done = (uint8_t)(done + WIRE_BYTES)) {
        uint8_t left = (uint8_t)(count - done), piece = left < WIRE_BYTES ? left : WIRE_BYTES;
        uint8_t code = readPiece(address, registerAfter(first, done), data + done, piece);
        if (code != MPUCAL_CODE_OK) {
            return code;
        }
    }
    return MPUCAL_CODE_OK;
}

static uint32_t nowUs() { return micros(); }

static void sendBytes(const uint8_t *bytes, uint8_t count) { Serial.write(bytes, count); }

static const struct mpucal_port port = {readRegisters, writeRegisters, nowUs,           sendBytes,
                                        &mpucalMemory, 2,              "mpucal-ino 0.1"};
static struct mpucal_bridge bridge;

#if defined(WDTCSR)
// Restarts the program if it was not fed for two seconds; the next request is then answered with NO_HELLO. A reset by
// the watchdog itself would never end on older boards, whose boot loader leaves the watchdog running.
ISR(WDT_vect, ISR_NAKED) { __asm__ __volatile__("jmp 0"); }

static void watchdogBegin() {
    noInterrupts();
    wdt_reset();
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = _BV(WDIE) | _BV(WDP2) | _BV(WDP1) | _BV(WDP0);
    interrupts();
}

static void watchdogFeed() { wdt_reset(); }
#elif defined(__AVR__)
// A megaAVR's watchdog has no interrupt, and its boot loader does not have this fault.
static void watchdogBegin() { _PROTECTED_WRITE(WDT.CTRLA, WDT_PERIOD_2KCLK_gc); }
static void watchdogFeed() { wdt_reset(); }
#else
static void watchdogBegin() {}
static void watchdogFeed() {}
#endif

void setup() {
#if defined(ESP32) || defined(ESP8266)
    Serial.setRxBufferSize(1024);
#endif
    Serial.begin(BAUD_RATE);
    beginWire();
    mpucalMemoryBegin();
    mpucal_bridge_begin(&bridge, &port);
    watchdogBegin();
}

void loop() {
    watchdogFeed();
    if (Serial.available()) {
        mpucal_bridge_receive(&bridge, (uint8_t)Serial.read());
    } else {
        mpucal_bridge_look(&bridge);
    }
}
