// The serial bridge for boards with the Arduino core: `mpucal session --serial PORT` measures through it.
//
// SDA and SCL go to the sensor, which gets 3.3 V. An Uno, Nano or Pro Mini is better served by tools/firmware/avr.
#include <Wire.h>

#include <mpucal_arduino.h>
#include <mpucal_bridge.h>

#if defined(SERIAL_RX_BUFFER_SIZE) && !defined(USBCON)
#if SERIAL_RX_BUFFER_SIZE < 256
#error "Two requests do not fit the serial buffer: build with -DSERIAL_RX_BUFFER_SIZE=256, or use tools/firmware/avr."
#endif
#endif

const uint32_t BAUD_RATE = 500000;
const uint32_t I2C_HZ = 400000;
const uint32_t I2C_TIMEOUT_US = 25000;
const uint8_t WIRE_BYTES = 32;  // what the smallest Wire library takes at once
const uint8_t WIRE_NO_ADDRESS = 2;
const uint8_t FIFO_R_W = 0x74;

static uint8_t codeOf(uint8_t wire) {
    return wire == 0 ? MPUCAL_CODE_OK : wire == WIRE_NO_ADDRESS ? MPUCAL_CODE_NO_ANSWER : MPUCAL_CODE_BUS_FAILED;
}

static uint8_t writeRegisters(uint8_t address, uint8_t first, const uint8_t *data, uint8_t count) {
    Wire.beginTransmission(address);
    bool fits = Wire.write(first) == 1 && (count == 0 || Wire.write(data, count) == count);
    uint8_t code = codeOf(Wire.endTransmission());
    return code == MPUCAL_CODE_OK && !fits ? (uint8_t)MPUCAL_CODE_BUS_FAILED : code;
}

static uint8_t readPiece(uint8_t address, uint8_t first, uint8_t *data, uint8_t count) {
    Wire.beginTransmission(address);
    Wire.write(first);
    uint8_t code = codeOf(Wire.endTransmission(false));
    if (code != MPUCAL_CODE_OK) {
        return code;
    }
    if (Wire.requestFrom(address, count) != count) {
        return MPUCAL_CODE_BUS_FAILED;
    }
    for (uint8_t i = 0; i < count; i++) {
        data[i] = (uint8_t)Wire.read();
    }
    return MPUCAL_CODE_OK;
}

// More than one piece is one transfer only for the FIFO: a host reads no more than 14 other registers at once.
static uint8_t readRegisters(uint8_t address, uint8_t first, uint8_t *data, uint8_t count) {
    for (uint8_t done = 0; done < count; done += WIRE_BYTES) {
        uint8_t left = count - done, piece = left < WIRE_BYTES ? left : WIRE_BYTES;
        uint8_t from = first == FIFO_R_W ? first : (uint8_t)(first + done);
        uint8_t code = readPiece(address, from, data + done, piece);
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

void setup() {
#if defined(ESP32) || defined(ESP8266)
    Serial.setRxBufferSize(1024);
#endif
    Serial.begin(BAUD_RATE);
    Wire.begin();
    Wire.setClock(I2C_HZ);
#if defined(WIRE_HAS_TIMEOUT)
    Wire.setWireTimeout(I2C_TIMEOUT_US, true);
#endif
    mpucalMemoryBegin();
    mpucal_bridge_begin(&bridge, &port);
}

void loop() {
    if (Serial.available()) {
        mpucal_bridge_receive(&bridge, (uint8_t)Serial.read());
    } else {
        mpucal_bridge_look(&bridge);
    }
}
