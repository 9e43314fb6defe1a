// Truevision TGA 2.0: palettes, colours of 15 to 32 bits, grey; plain or in runs.
#include <array>

#include "formats/images/readers.h"

namespace ambilux {

namespace {

enum Kind : uint32_t { kPalette = 1, kColor = 2, kGrey = 3, kRuns = 8 };

using Pixel = std::array<uint8_t, 4>;

struct TgaHeader {
    uint32_t id_length, has_palette, type, palette_first, palette_length, palette_bits, width, height, bits, descriptor;

    uint32_t kind() const { return type & 7; }
    bool in_runs() const { return type & kRuns; }
};

TgaHeader take_tga_header(ByteReader& in) {
    TgaHeader h{};
    h.id_length = in.u8(), h.has_palette = in.u8(), h.type = in.u8();
    h.palette_first = in.u16(), h.palette_length = in.u16(), h.palette_bits = in.u8();
    in.take(4);  // where the image stands on a screen
    h.width = in.u16(), h.height = in.u16(), h.bits = in.u8(), h.descriptor = in.u8();
    return h;
}

bool is_color_depth(uint32_t bits) { return bits == 15 || bits == 16 || bits == 24 || bits == 32; }

bool is_sound(const TgaHeader& h) {
    if (h.type & ~uint32_t(kRuns | 3) || h.has_palette > 1 || h.descriptor & 0xc0 || h.width == 0 || h.height == 0)
        return false;
    switch (h.kind()) {
        case kPalette: return h.has_palette && (h.bits == 8 || h.bits == 16) && is_color_depth(h.palette_bits);
        case kColor: return is_color_depth(h.bits);
        case kGrey: return h.bits == 8 || h.bits == 16;
        default: return false;
    }
}

Pixel take_color(ByteReader& in, uint32_t bits) {
    if (bits <= 16) {
        const uint32_t p = in.u16();
        const auto wide = [&](int shift) { return uint8_t((p >> shift & 31) * 255 / 31); };
        return {wide(10), wide(5), wide(0), 255};
    }
    const uint8_t b = in.u8(), g = in.u8(), r = in.u8();
    return {r, g, b, bits == 32 ? in.u8() : uint8_t(255)};
}

struct PixelReader {
    const TgaHeader& header;
    ByteReader& in;
    std::vector<Pixel> palette;

    Pixel take() {
        if (header.kind() == kColor) return take_color(in, header.bits);
        if (header.kind() == kGrey) {
            const uint8_t grey = in.u8();
            return {grey, grey, grey, header.bits == 16 ? in.u8() : uint8_t(255)};
        }
        const uint32_t index = (header.bits == 16 ? in.u16() : in.u8()) - header.palette_first;
        if (index >= palette.size()) in.budget.fail("cannot read TGA image: a colour is not in the palette");
        return palette[index];
    }
};

}  // namespace

bool is_tga(std::string_view bytes) {
    if (bytes.size() < 18) return false;
    static const FileBudget none("");
    ByteReader in{bytes, none};
    return is_sound(take_tga_header(in));
}

Texels read_tga(std::string_view bytes, FileBudget& budget) {
    ByteReader in{bytes, budget};
    const TgaHeader h = take_tga_header(in);
    in.take(h.id_length);
    PixelReader pixels{h, in, {}};
    if (h.kind() == kPalette)
        for (uint32_t i = 0; i < h.palette_length; ++i) pixels.palette.push_back(take_color(in, h.palette_bits));
    else if (h.has_palette)
        in.take(uint64_t(h.palette_length) * ((h.palette_bits + 7) / 8));
    const uint64_t count = uint64_t(h.width) * h.height, pixel_bytes = (h.bits + 7) / 8;
    budget.pixels(h.width, h.height);
    // A run is at most 128 pixels long and takes one pixel and a byte.
    in.need(h.in_runs() ? (count + 127) / 128 * (1 + pixel_bytes) : count * pixel_bytes);
    Texels texels = make_texels(h.width, h.height, true, budget);
    const bool top_down = h.descriptor & 0x20, right_to_left = h.descriptor & 0x10;
    uint32_t left = 0;  // of the packet
    bool repeat = false;
    Pixel pixel{};
    for (uint64_t i = 0; i < count; ++i) {
        const bool begins = h.in_runs() && left == 0;
        if (begins) {
            const uint8_t packet = in.u8();
            left = 1u + (packet & 127);
            repeat = packet & 128;
        }
        if (begins || !repeat) pixel = pixels.take();
        if (left > 0) --left;
        const uint64_t row = i / h.width, column = i % h.width, y = top_down ? row : h.height - 1 - row,
                       x = right_to_left ? h.width - 1 - column : column;
        std::copy(pixel.begin(), pixel.end(), &texels.bytes[4 * (y * h.width + x)]);
        budget.tick();
    }
    return texels;
}

}  // namespace ambilux
