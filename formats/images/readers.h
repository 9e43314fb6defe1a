// The readers behind read_image(), one a format. Each is called with the whole file, and fails through the budget.
#pragma once

#include <string_view>

#include "formats/file_budget.h"
#include "formats/images/image_io.h"

namespace ambilux {

bool is_png(std::string_view bytes);
bool is_jpeg(std::string_view bytes);
bool is_exr(std::string_view bytes);
bool is_hdr(std::string_view bytes);
bool is_pnm(std::string_view bytes);
bool is_pfm(std::string_view bytes);
bool is_bmp(std::string_view bytes);
/// TGA has no magic number: true if all of its header makes sense.
bool is_tga(std::string_view bytes);

Texels read_png(std::string_view bytes, FileBudget& budget);
Texels read_jpeg(std::string_view bytes, FileBudget& budget);
Texels read_exr_texels(std::string_view bytes, FileBudget& budget);
Texels read_hdr(std::string_view bytes, FileBudget& budget);
Texels read_pnm(std::string_view bytes, FileBudget& budget);
Texels read_pfm(std::string_view bytes, FileBudget& budget);
Texels read_bmp(std::string_view bytes, FileBudget& budget);
Texels read_tga(std::string_view bytes, FileBudget& budget);

/// Texels of the size, opaque black, once the budget allows it.
Texels make_texels(uint64_t width, uint64_t height, bool is_8bit, const FileBudget& budget);

/// For an ICC profile of other colours than sRGB's, which nothing follows.
void note_profile(std::string_view profile, Texels& texels);
/// For EXIF data, as in TIFF, that ask for the image to be turned.
void note_orientation(std::string_view exif, Texels& texels);

/// Little-endian numbers one after the other; fails at the end of the file.
struct ByteReader {
    std::string_view bytes;
    const FileBudget& budget;
    size_t at = 0;

    size_t left() const { return bytes.size() - at; }
    void need(uint64_t count) const {
        if (count > left()) budget.fail("the file ends too early");
    }
    void seek(uint64_t place) {
        if (place > bytes.size()) budget.fail("the file ends too early");
        at = place;
    }
    uint8_t u8() {
        need(1);
        return uint8_t(bytes[at++]);
    }
    uint16_t u16() {
        const uint16_t low = u8();
        return uint16_t(low | u8() << 8);
    }
    uint32_t u32() {
        const uint32_t low = u16();
        return low | uint32_t(u16()) << 16;
    }
    std::string_view take(uint64_t count) {
        need(count);
        const std::string_view part = bytes.substr(at, count);
        at += count;
        return part;
    }
};

}  // namespace ambilux
