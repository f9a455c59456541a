// What a board does once mpucal has stored its calibration: reads the accelerometer, and prints it corrected.
#include <Wire.h>

#include <mpucal_arduino.h>

const uint8_t ADDRESS = 0x68;
const uint8_t WHO_AM_I = 0x75, PWR_MGMT_1 = 0x6B, ACCEL_CONFIG = 0x1C, ACCEL_XOUT_H = 0x3B;
const uint8_t CLKSEL_PLL = 0x01, AFS_4G = 0x08;
const float RANGE_G = 4.0f;

static struct mpucal sensor;
static bool calibrated = false;

static void writeRegister(uint8_t address, uint8_t value) {
    Wire.beginTransmission(ADDRESS);
    Wire.write(address);
    Wire.write(value);
    Wire.endTransmission();
}

static bool readRegisters(uint8_t first, uint8_t *data, uint8_t count) {
    Wire.beginTransmission(ADDRESS);
    Wire.write(first);
    if (Wire.endTransmission(false) != 0 || Wire.requestFrom(ADDRESS, count) != count) {
        return false;
    }
    for (uint8_t i = 0; i < count; i++) {
        data[i] = (uint8_t)Wire.read();
    }
    return true;
}

void setup() {
    Serial.begin(115200);
    Wire.begin();
    mpucalMemoryBegin();
    uint8_t whoAmI = 0;
    readRegisters(WHO_AM_I, &whoAmI, 1);
    writeRegister(PWR_MGMT_1, CLKSEL_PLL);
    writeRegister(ACCEL_CONFIG, AFS_4G);
    enum mpucal_status status = mpucal_slots_load(&mpucalMemory, &sensor, whoAmI, RANGE_G);
    calibrated = status == MPUCAL_OK;
    if (!calibrated) {
        Serial.print("no calibration, mpucal_status ");
        Serial.println((int)status);
    }
}

void loop() {
    uint8_t bytes[6];
    if (calibrated && readRegisters(ACCEL_XOUT_H, bytes, sizeof bytes)) {
        int16_t counts[3];
        float a[3];
        for (uint8_t i = 0; i < 3; i++) {
            counts[i] = (int16_t)((uint16_t)bytes[2 * i] << 8 | bytes[2 * i + 1]);
        }
        mpucal_apply(&sensor, counts, a);
        for (uint8_t i = 0; i < 3; i++) {
            Serial.print(a[i], 4);
            Serial.print(i < 2 ? ' ' : '\n');
        }
    }
    delay(10);
}
