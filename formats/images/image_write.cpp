#include "formats/images/image_write.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <png.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "formats/images/exr_stream.h"

namespace ambilux {

void write_float_image(const std::string& path, uint32_t width, uint32_t height, const std::vector<float>& rgb) {
    ExrStream stream;
    try {
        Imf::Header header{int(width), int(height)};
        Imf::FrameBuffer buffer;
        const char* names[3] = {"R", "G", "B"};
        for (size_t c = 0; c < 3; ++c) {
            header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
            buffer.insert(names[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(rgb.data() + c)),
                                               3 * sizeof(float), 3 * sizeof(float) * width));
        }
        Imf::OutputFile file(stream, header);
        file.setFrameBuffer(buffer);
        file.writePixels(int(height));
    } catch (const std::exception& e) {
        throw Error(ExitCode::device, "cannot write " + path + ": " + e.what());
    }
    write_file_atomic(path, stream.bytes);
}

std::string png_bytes(uint32_t width, uint32_t height, const std::vector<uint8_t>& rgb) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = width;
    png.height = height;
    png.format = PNG_FORMAT_RGB;
    std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
    png_alloc_size_t size = bytes.size();
    if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, rgb.data(), 0, nullptr))
        throw Error(ExitCode::device, std::string("cannot make a PNG: ") + png.message);
    bytes.resize(size);
    return bytes;
}

void write_byte_image(const std::string& path, uint32_t width, uint32_t height, const std::vector<uint8_t>& rgb) {
    std::string bytes;
    try {
        bytes = png_bytes(width, height, rgb);
    } catch (const Error& e) {
        throw Error(e.code, path + ": " + e.what());
    }
    write_file_atomic(path, bytes);
}

}  // namespace ambilux
