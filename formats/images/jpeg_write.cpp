#include "formats/images/jpeg_write.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <jpeglib.h>

#include "core/error.h"
#include "core/parallel.h"

namespace ambilux {
namespace {

constexpr uint32_t kUnit = 16;  ///< pixels along a side of what is coded at once: two blocks of colour, four of light

/// Rows of the image from `first` on.
struct Strip {
    const uint8_t* rgb;
    uint32_t width, rows;
};

struct Compressor {
    jpeg_compress_struct info{};
    jpeg_error_mgr errors{};
    std::jmp_buf jump{};
    unsigned char* bytes = nullptr;
    unsigned long size = 0;

    Compressor() = default;
    Compressor(const Compressor&) = delete;
    ~Compressor() {
        jpeg_destroy_compress(&info);
        std::free(bytes);
    }
};

/// Errors of libjpeg come by longjmp, over C alone.
bool compress(Compressor& c, const Strip& strip, int quality, uint32_t unit_rows) {
    c.info.err = jpeg_std_error(&c.errors);
    c.info.client_data = &c;
    c.errors.output_message = [](j_common_ptr) {};
    c.errors.error_exit = [](j_common_ptr info) { std::longjmp(static_cast<Compressor*>(info->client_data)->jump, 1); };
    if (setjmp(c.jump) != 0) return false;
    jpeg_create_compress(&c.info);
    jpeg_mem_dest(&c.info, &c.bytes, &c.size);
    c.info.image_width = strip.width;
    c.info.image_height = strip.rows;
    c.info.input_components = 3;
    c.info.in_color_space = JCS_RGB;
    jpeg_set_defaults(&c.info);
    jpeg_set_quality(&c.info, quality, TRUE);
    c.info.dct_method = JDCT_ISLOW;
    c.info.restart_in_rows = int(unit_rows);
    jpeg_start_compress(&c.info, TRUE);
    while (c.info.next_scanline < strip.rows) {
        JSAMPROW row = const_cast<uint8_t*>(strip.rgb) + size_t(c.info.next_scanline) * strip.width * 3;
        jpeg_write_scanlines(&c.info, &row, 1);
    }
    jpeg_finish_compress(&c.info);
    return true;
}

/// Where the coded pixels begin, after all headers. `height`, if not 0, is written in place of the strip's.
size_t end_of_headers(std::string& jpeg, uint32_t height) {
    size_t at = 2;
    for (;;) {
        const auto byte = [&](size_t i) { return uint32_t(uint8_t(jpeg[at + i])); };
        const uint32_t marker = byte(1), length = byte(2) << 8 | byte(3);
        if (marker == 0xc0 && height) {
            jpeg[at + 5] = char(height >> 8);
            jpeg[at + 6] = char(height & 255);
        }
        at += 2 + length;
        if (marker == 0xda) return at;
    }
}

}  // namespace

std::string jpeg_bytes(uint32_t width, uint32_t height, const uint8_t* rgb, int quality) {
    if (std::min(width, height) == 0 || std::max(width, height) > kLargestJpeg)
        throw Error(ExitCode::usage, "a JPEG has 1 to " + std::to_string(kLargestJpeg) +
                                         " pixels along each side, not " + std::to_string(width) + "x" +
                                         std::to_string(height));
    // A decoder forgets at a restart marker what came before, so that what lies between two of them is coded by itself.
    // The same number of rows lies between all; it is counted in units of 16 bits.
    const uint32_t units = (height + kUnit - 1) / kUnit, per_row = (width + kUnit - 1) / kUnit;
    const auto threads = uint32_t(std::max(1, tbb::this_task_arena::max_concurrency()));
    const uint32_t unit_rows = std::clamp((units + threads - 1) / threads, 1u, std::max(1u, 65535 / per_row));
    std::vector<std::string> strips((units + unit_rows - 1) / unit_rows);
    parallel_for(uint32_t(strips.size()), [&](uint32_t s) {
        const uint32_t first = s * unit_rows * kUnit, rows = std::min(unit_rows * kUnit, height - first);
        Compressor c;
        if (!compress(c, {rgb + size_t(first) * width * 3, width, rows}, std::clamp(quality, 1, 100), unit_rows)) {
            char message[JMSG_LENGTH_MAX];
            c.errors.format_message(reinterpret_cast<j_common_ptr>(&c.info), message);
            throw Error(ExitCode::device, std::string("cannot make a JPEG: ") + message);
        }
        strips[s].assign(reinterpret_cast<const char*>(c.bytes), c.size);
    });
    std::string all = strips[0].substr(0, end_of_headers(strips[0], height));
    for (size_t s = 0; s < strips.size(); ++s) {
        if (s > 0) all += {char(0xff), char(0xd0 + (s - 1) % 8)};
        const size_t begin = end_of_headers(strips[s], 0);
        all.append(strips[s], begin, strips[s].size() - 2 - begin);  // without the end marker
    }
    return all += {char(0xff), char(0xd9)};
}

}  // namespace ambilux
