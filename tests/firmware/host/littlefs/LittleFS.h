// The interface of an Arduino core's LittleFS, with files in memory and a power that lasts for so many steps. A file is
// empty once it is opened for writing, which the real one keeps until it is closed: worse is not to be had.
#include <map>
#include <string>

struct Flash {
    std::map<std::string, std::string> files;
    long power;
    bool works() { return power-- > 0; }
};
extern Flash flash;

struct LittleFSConfig {
    bool formats = true;
    void setAutoFormat(bool value) { formats = value; }
};

class File {
  public:
    File() = default;
    explicit File(std::string *content) : content(content) {}
    explicit operator bool() const { return content != nullptr; }
    size_t read(uint8_t *into, size_t count) { return content->copy(reinterpret_cast<char *>(into), count); }
    size_t write(const uint8_t *from, size_t count) {
        size_t kept = flash.works() ? count : count / 2;
        content->assign(reinterpret_cast<const char *>(from), kept);
        return kept;
    }
    void close() {}

  private:
    std::string *content = nullptr;
};

struct FileSystem {
    LittleFSConfig config;
    bool holds_files = true; // otherwise what mounts only once it is formatted, and is lost then
    void setConfig(const LittleFSConfig &other) { config = other; }
    bool begin() { return begin(config.formats); }
    bool begin(bool formats) { return holds_files = holds_files || formats; }
    File open(const char *name, const char *mode) {
        bool is_there = flash.files.count(name) != 0;
        if (*mode == 'r') {
            return is_there ? File(&flash.files[name]) : File();
        }
        if (!flash.works()) {
            return File();
        }
        flash.files[name].clear();
        return File(&flash.files[name]);
    }
    bool rename(const char *from, const char *to) {
        if (!flash.works()) {
            return false;
        }
        flash.files[to] = flash.files[from];
        flash.files.erase(from);
        return true;
    }
};
extern FileSystem LittleFS;
