// Example of a board with a stored calibration: it reads the chip, and prints corrected accelerations and rates.
#include <Wire.h>

#include <mpucal_arduino.h>

// 0x69 if AD0 is high.
#ifndef MPUCAL_ADDRESS
#define MPUCAL_ADDRESS 0x68
#endif

const uint8_t ADDRESS = MPUCAL_ADDRESS;
const uint8_t WHO_AM_I = 0x75, PWR_MGMT_1 = 0x6B, GYRO_CONFIG = 0x1B, ACCEL_CONFIG = 0x1C, ACCEL_XOUT_H = 0x3B;
const uint8_t CLKSEL_PLL = 0x01, AFS_4G = 0x08, FS_500DPS = 0x08;
const float RANGE_G = 4.0f, RANGE_DPS = 500.0f;
const uint8_t MPU6050 = 0x68;  // its temperature scale differs from that of later chips

static struct mpucal sensor;
static struct mpucal_drift drift;
static struct mpucal_gyro gyro;
static bool calibrated = false;
static uint8_t whoAmI = 0;

static void writeRegister(uint8_t address, uint8_t value) {
    Wire.beginTransmission(ADDRESS);
    Wire.write(address);
    Wire.write(value);
    Wire.endTransmission();
}

static bool readRegisters(uint8_t first, uint8_t *data, uint8_t count) {
    Wire.beginTransmission(ADDRESS);
    Wire.write(first);
    if (Wire.endTransmission(false) != 0 || Wire.requestFrom(ADDRESS, (size_t)count) != count) {
        return false;
    }
    for (uint8_t i = 0; i < count; i++) {
        data[i] = (uint8_t)Wire.read();
    }
    return true;
}

static float celsius(int16_t counts) {
    return whoAmI == MPU6050 ? counts / 340.0f + 36.53f : counts / 333.87f + 21.0f;
}

void setup() {
    Serial.begin(115200);
    Wire.begin();
    mpucalMemoryBegin();
    readRegisters(WHO_AM_I, &whoAmI, 1);
    writeRegister(PWR_MGMT_1, CLKSEL_PLL);
    writeRegister(GYRO_CONFIG, FS_500DPS);
    writeRegister(ACCEL_CONFIG, AFS_4G);
    enum mpucal_status status = mpucal_slots_load(&mpucalMemory, &sensor, whoAmI, RANGE_G);
    if (status == MPUCAL_OK) {
        status = mpucal_slots_load_drift(&mpucalMemory, &drift);
    }
    if (status == MPUCAL_OK) {
        status = mpucal_slots_load_gyro(&mpucalMemory, &gyro, RANGE_DPS);
    }
    calibrated = status == MPUCAL_OK;
    if (!calibrated) {
        Serial.print("no calibration, mpucal_status ");
        Serial.println((int)status);
    }
}

void loop() {
    uint8_t bytes[14];
    if (calibrated && readRegisters(ACCEL_XOUT_H, bytes, sizeof bytes)) {
        int16_t counts[7];  // accelerometer x, y, z, temperature, gyroscope x, y, z
        float of[6];        // m/s^2, then rad/s
        for (uint8_t i = 0; i < 7; i++) {
            counts[i] = (int16_t)((uint16_t)bytes[2 * i] << 8 | bytes[2 * i + 1]);
        }
        mpucal_apply_at(&sensor, &drift, counts, celsius(counts[3]), of);
        mpucal_apply_gyro(&gyro, counts + 4, of + 3);
        for (uint8_t i = 0; i < 6; i++) {
            Serial.print(of[i], 4);
            Serial.print(i < 5 ? ' ' : '\n');
        }
    }
    delay(10);
}
