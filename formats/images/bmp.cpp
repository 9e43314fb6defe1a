// Windows bitmaps without compression: palettes of 1, 4 and 8 bits, colours of 16, 24 and 32 bits, with or without
// masks.
#include <array>
#include <bit>

#include "formats/images/readers.h"

namespace ambilux {

namespace {

struct BmpHeader {
    uint32_t pixels_at, size;
    uint64_t width, height;
    bool top_down, has_profile;
    uint32_t bits, colors;
    std::array<uint32_t, 4> masks;  ///< of red, green, blue, alpha
};

BmpHeader take_bmp_header(ByteReader& in) {
    const FileBudget& budget = in.budget;
    BmpHeader h{};
    in.take(10);
    h.pixels_at = in.u32();
    h.size = in.u32();
    if (h.size != 12 && (h.size < 40 || h.size > 124)) budget.fail("cannot read BMP image: unknown size of its header");
    uint32_t planes = 0, compression = 0;
    if (h.size == 12) {
        h.width = in.u16(), h.height = in.u16(), planes = in.u16(), h.bits = in.u16();
    } else {
        const int32_t width = int32_t(in.u32()), height = int32_t(in.u32());
        h.width = width < 0 ? 0 : uint64_t(width);
        h.top_down = height < 0;
        h.height = uint64_t(std::abs(int64_t(height)));
        planes = in.u16(), h.bits = in.u16(), compression = in.u32();
        in.take(12);
        h.colors = in.u32();
        in.take(4);
    }
    if (planes != 1 || (compression != 0 && compression != 3)) budget.fail("cannot read BMP image: it is compressed");
    h.masks = h.bits == 16 ? std::array<uint32_t, 4>{0x7c00, 0x3e0, 0x1f, 0}
                           : std::array<uint32_t, 4>{0xff0000, 0xff00, 0xff, h.bits == 32 ? 0xff000000u : 0};
    if (compression == 3) {
        for (int c = 0; c < 3; ++c) h.masks[size_t(c)] = in.u32();
        h.masks[3] = h.size >= 56 ? in.u32() : 0;
    }
    if (h.size == 124) {
        in.seek(14 + 56);
        const std::string_view space = in.take(4);  // stored with its last letter first
        h.has_profile = space == "DEBM" || space == "KNIL";
    }
    return h;
}

/// The bits of `mask`, widened to 8.
uint8_t channel(uint32_t pixel, uint32_t mask) {
    if (mask == 0) return 0;
    const int shift = std::countr_zero(mask);
    const uint64_t most = mask >> shift;
    return uint8_t((uint64_t((pixel & mask) >> shift) * 255 + most / 2) / most);
}

}  // namespace

bool is_bmp(std::string_view bytes) { return bytes.starts_with("BM"); }

Texels read_bmp(std::string_view bytes, FileBudget& budget) {
    ByteReader in{bytes, budget};
    const BmpHeader h = take_bmp_header(in);
    budget.pixels(h.width, h.height);
    const bool indexed = h.bits == 1 || h.bits == 4 || h.bits == 8;
    if (!indexed && h.bits != 16 && h.bits != 24 && h.bits != 32)
        budget.fail("cannot read BMP image: " + std::to_string(h.bits) + " bits per pixel");
    std::array<std::array<uint8_t, 3>, 256> palette{};
    if (indexed) {
        in.seek(14 + uint64_t(h.size));
        const uint32_t entries = h.colors ? h.colors : 1u << h.bits;
        if (entries > 256) budget.fail("cannot read BMP image: its palette is too large");
        for (uint32_t i = 0; i < entries; ++i) {
            const std::string_view entry = in.take(h.size == 12 ? 3 : 4);
            palette[i] = {uint8_t(entry[2]), uint8_t(entry[1]), uint8_t(entry[0])};
        }
    }
    // Rows are padded to four bytes.
    const uint64_t row_bytes = (h.width * h.bits + 31) / 32 * 4;
    in.seek(h.pixels_at);
    in.need(row_bytes * h.height);
    Texels texels = make_texels(h.width, h.height, true, budget);
    if (h.has_profile) note_profile(bytes, texels);
    bool any_alpha = false;
    for (uint64_t y = 0; y < h.height; ++y) {
        ByteReader row{in.take(row_bytes), budget};
        uint8_t* out = &texels.bytes[4 * h.width * (h.top_down ? y : h.height - 1 - y)];
        for (uint64_t x = 0; x < h.width; ++x, out += 4) {
            if (indexed) {
                const uint64_t bit = x * h.bits;
                const uint32_t index = uint8_t(row.bytes[bit / 8]) >> (8 - h.bits - bit % 8) & ((1u << h.bits) - 1);
                for (size_t c = 0; c < 3; ++c) out[c] = palette[index][c];
                out[3] = 255;
                continue;
            }
            uint32_t pixel = row.u16();
            if (h.bits > 16) pixel |= uint32_t(row.u8()) << 16;
            if (h.bits > 24) pixel |= uint32_t(row.u8()) << 24;
            for (size_t c = 0; c < 4; ++c) out[c] = channel(pixel, h.masks[c]);
            any_alpha |= out[3] != 0;
        }
        budget.tick();
    }
    // Most writers leave the alpha of 32 bits at 0 and mean opaque.
    if (!indexed && !any_alpha)
        for (size_t i = 3; i < texels.bytes.size(); i += 4) texels.bytes[i] = 255;
    return texels;
}

}  // namespace ambilux
