#include "formats/images/image_io.h"

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_NO_STDIO
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wshadow"
#endif
#include <stb/stb_image.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>

#include <cstring>
#include <memory>

#include "core/error.h"

namespace ambilux {

namespace {

/// Bytes in memory as OpenEXR's stream.
class MemoryStream : public Imf::IStream {
public:
    MemoryStream(const std::string& name, std::string_view bytes) : IStream(name.c_str()), bytes_(bytes) {}
    bool read(char c[], int n) override {
        if (n < 0 || position_ + uint64_t(n) > bytes_.size()) throw std::runtime_error("file ends too early");
        memcpy(c, bytes_.data() + position_, size_t(n));
        position_ += uint64_t(n);
        return position_ < bytes_.size();
    }
    uint64_t tellg() override { return position_; }
    void seekg(uint64_t pos) override { position_ = pos; }

private:
    std::string_view bytes_;
    uint64_t position_ = 0;
};

Image read_exr(const std::string& path, std::string_view bytes) {
    Image image;
    image.is_linear = true;
    try {
        MemoryStream stream(path, bytes);
        Imf::InputFile file(stream);
        const Imath::Box2i window = file.header().dataWindow();
        const int64_t width = int64_t(window.max.x) - window.min.x + 1,
                      height = int64_t(window.max.y) - window.min.y + 1;
        image.width = uint32_t(width);
        image.height = uint32_t(height);
        image.floats.assign(size_t(width) * size_t(height) * 4, 0.0f);
        const Imf::ChannelList& channels = file.header().channels();
        const bool grey = channels.findChannel("Y") && !channels.findChannel("R");
        if (!grey && !(channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B")))
            throw std::runtime_error("has neither channels R, G, B nor Y");
        Imf::FrameBuffer buffer;
        const char* names[4] = {grey ? "Y" : "R", "G", "B", "A"};
        for (int c = 0; c < 4; ++c) {
            if (grey && (c == 1 || c == 2)) continue;
            char* base = reinterpret_cast<char*>(image.floats.data() + c) - (window.min.x + window.min.y * width) * 16;
            buffer.insert(names[c], Imf::Slice(Imf::FLOAT, base, 16, size_t(width) * 16, 1, 1, c == 3 ? 1.0 : 0.0));
        }
        file.setFrameBuffer(buffer);
        file.readPixels(window.min.y, window.max.y);
        if (grey)
            for (size_t i = 0; i < image.floats.size(); i += 4)
                image.floats[i + 1] = image.floats[i + 2] = image.floats[i];
    } catch (const std::exception& e) {
        throw input_error(path, 0, std::string("cannot read EXR image: ") + e.what());
    }
    return image;
}

}  // namespace

Image read_image(const std::string& path, std::string_view bytes) {
    if (bytes.size() >= 4 && memcmp(bytes.data(), "\x76\x2f\x31\x01", 4) == 0) return read_exr(path, bytes);
    const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
    if (bytes.size() > 0x7fffffff) throw input_error(path, 0, "image file is too large");
    const int size = int(bytes.size());
    int width = 0, height = 0, channels = 0;
    Image image;
    const auto check = [&](const void* pixels) {
        if (!pixels) throw input_error(path, 0, std::string("cannot read image: ") + stbi_failure_reason());
        image.width = uint32_t(width);
        image.height = uint32_t(height);
        return size_t(width) * size_t(height) * 4;
    };
    if (stbi_is_hdr_from_memory(data, size)) {
        const std::unique_ptr<float, void (*)(void*)> pixels(
            stbi_loadf_from_memory(data, size, &width, &height, &channels, 4), stbi_image_free);
        const size_t count = check(pixels.get());
        image.is_linear = true;
        image.floats.assign(pixels.get(), pixels.get() + count);
    } else if (stbi_is_16_bit_from_memory(data, size)) {
        const std::unique_ptr<stbi_us, void (*)(void*)> pixels(
            stbi_load_16_from_memory(data, size, &width, &height, &channels, 4), stbi_image_free);
        const size_t count = check(pixels.get());
        image.floats.resize(count);
        for (size_t i = 0; i < count; ++i) image.floats[i] = float(pixels.get()[i]) / 65535.0f;
    } else {
        const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
            stbi_load_from_memory(data, size, &width, &height, &channels, 4), stbi_image_free);
        const size_t count = check(pixels.get());
        image.is_8bit = true;
        image.bytes.assign(pixels.get(), pixels.get() + count);
    }
    return image;
}

}  // namespace ambilux
