// An MPU-6050 at QEMU's SMBus EEPROM 0x57, with an interrupt that QEMU's edu device raises (slot 4, pin A: line 20).
DefinitionBlock ("mpu.aml", "SSDT", 2, "MPUCAL", "MPU6050", 1)
{
  External (\_SB.PCI0, DeviceObj)
  External (\_SB.PCI0.SFB, DeviceObj)
  Scope (\_SB.PCI0)
  {
    Device (MPU0)
    {
      Name (_HID, "PRP0001")
      Name (_CRS, ResourceTemplate ()
      {
        I2cSerialBusV2 (0x57, ControllerInitiated, 400000, AddressingMode7Bit, "\\_SB.PCI0.SFB", 0, ResourceConsumer)
        Interrupt (ResourceConsumer, Edge, ActiveHigh, Exclusive) { 20 }
      })
      Name (_DSD, Package ()
      {
        ToUUID ("daffd814-6eba-4d8c-8a91-bc9bbf4aa301"),
        Package ()
        {
          Package () { "compatible", "invensense,mpu6050" },
          Package () { "mount-matrix", Package () { "0", "1", "0", "-1", "0", "0", "0", "0", "1" } }
        }
      })
    }
  }
}
