// Where OpenEXR writes to.
#pragma once

#include <ImfIO.h>

#include <cstring>
#include <string>

namespace ambilux {

/// Collects the file in memory, so that it reaches the disk in one atomic step.
class ExrStream : public Imf::OStream {
public:
    ExrStream() : Imf::OStream("memory") {}
    void write(const char c[], int n) override {
        if (position_ + size_t(n) > bytes.size()) bytes.resize(position_ + size_t(n));
        std::memcpy(bytes.data() + position_, c, size_t(n));
        position_ += size_t(n);
    }
    uint64_t tellp() override { return position_; }
    void seekp(uint64_t position) override { position_ = size_t(position); }
    std::string bytes;

private:
    size_t position_ = 0;
};

}  // namespace ambilux
