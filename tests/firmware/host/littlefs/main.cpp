// Stores a second blob, with power for ever more steps, and prints which one is there after each: main OLD NEW
#include <cstdio>
#include <fstream>
#include <iterator>

#include "mpucal_arduino.h"

Flash flash;
FileSystem LittleFS;

static std::string contentOf(const char *name) {
    std::ifstream file(name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

static bool store(const std::string &blob) {
    uint16_t at = mpucal_slots_open(&mpucalMemory);
    for (size_t i = 0; i < blob.size(); i++) {
        mpucalMemory.write((uint16_t)(at + i), (uint8_t)blob[i]);
    }
    return mpucal_slots_seal(&mpucalMemory, at) != 0;
}

int main(int, char **argv) {
    const std::string old_blob = contentOf(argv[1]), new_blob = contentOf(argv[2]);
    flash = Flash{{}, 1000};
    LittleFS.holds_files = false;
    mpucalMemoryBegin();
    std::printf("%s ", mpucal_slots_stored(&mpucalMemory).generation || LittleFS.holds_files ? "taken" : "untouched");
    bool stored = false;
    for (long power = 0; !stored; power++) {
        flash = Flash{{}, 1000};
        mpucalMemoryBegin();
        if (!store(old_blob)) {
            return 1;
        }
        flash.power = power;
        stored = store(new_blob);
        // the power comes back
        flash.power = 1000;
        mpucalMemoryBegin();
        struct mpucal_stored found = mpucal_slots_stored(&mpucalMemory);
        std::string kept;
        for (uint16_t i = 0; i < found.length; i++) {
            kept += (char)mpucalMemory.read((uint16_t)(found.at + i));
        }
        std::printf("%s%s ", stored ? "told " : "", kept == old_blob ? "old" : kept == new_blob ? "new" : "none");
    }
}
