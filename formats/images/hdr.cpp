// Radiance's RGBE pictures (Ward, "Real Pixels", Graphics Gems II; the Radiance file formats, section "Picture files").
#include <charconv>
#include <cmath>

#include "core/text.h"
#include "formats/images/readers.h"

namespace ambilux {

namespace {

/// Widths of run-length encoded rows; others are stored as they are.
constexpr uint64_t kLeastPacked = 8, kMostPacked = 32767;

/// Without blanks at its end.
std::string_view take_line(ByteReader& in) {
    const std::string_view line_end = line_end_of(in.bytes);
    const size_t end = in.bytes.find(line_end, in.at);
    if (line_end.empty() || end == std::string_view::npos) in.budget.fail("the file ends within its header");
    const std::string_view line = in.take(end - in.at);
    in.take(line_end.size());
    return line.substr(0, line.find_last_not_of(" \t\r") + 1);
}

uint64_t take_size(std::string_view& line, std::string_view axis, const FileBudget& budget) {
    uint64_t size = 0;
    if (line.starts_with(axis)) {
        line.remove_prefix(axis.size());
        const auto result = std::from_chars(line.data(), line.data() + line.size(), size);
        line.remove_prefix(size_t(result.ptr - line.data()));
        if (result.ec == std::errc()) return size;
    }
    budget.fail("cannot read HDR image: its size must be written as '-Y HEIGHT +X WIDTH'");
}

void decode(const uint8_t* rgbe, float* out) {
    const float scale = rgbe[3] ? std::ldexp(1.0f, int(rgbe[3]) - (128 + 8)) : 0.0f;
    for (int c = 0; c < 3; ++c) out[c] = float(rgbe[c]) * scale;
    out[3] = 1;
}

/// One row: a marker with the width, then each of the four channels in runs.
void read_packed_row(ByteReader& in, uint64_t width, std::vector<uint8_t>& row) {
    in.take(4);
    for (size_t c = 0; c < 4; ++c)
        for (size_t x = 0; x < width;) {
            const uint8_t code = in.u8();
            const size_t count = code > 128 ? code - 128u : code;
            if (count == 0 || count > width - x) in.budget.fail("cannot read HDR image: damaged run of pixels");
            const std::string_view values = in.take(code > 128 ? 1 : count);
            for (size_t i = 0; i < count; ++i, ++x) row[4 * x + c] = uint8_t(values[code > 128 ? 0 : i]);
        }
}

}  // namespace

bool is_hdr(std::string_view bytes) { return bytes.starts_with("#?RADIANCE") || bytes.starts_with("#?RGBE"); }

Texels read_hdr(std::string_view bytes, FileBudget& budget) {
    ByteReader in{bytes, budget};
    bool is_rgbe = false;
    for (std::string_view line; !(line = take_line(in)).empty();) is_rgbe |= line == "FORMAT=32-bit_rle_rgbe";
    if (!is_rgbe) budget.fail("cannot read HDR image: its FORMAT is not 32-bit_rle_rgbe");
    std::string_view size = take_line(in);
    const uint64_t height = take_size(size, "-Y ", budget), width = take_size(size, " +X ", budget);
    budget.pixels(width, height);

    const auto marker = [&](size_t i) { return in.left() > i ? uint8_t(in.bytes[in.at + i]) : 0; };
    const auto is_packed = [&] {
        return marker(0) == 2 && marker(1) == 2 && (marker(2) << 8 | marker(3)) == int(width);
    };
    const bool packed = width >= kLeastPacked && width <= kMostPacked && is_packed();
    // A run is at most 127 pixels long and takes two bytes.
    in.need(packed ? height * (4 + 4 * 2 * ((width + 126) / 127)) : height * width * 4);
    Texels texels = make_texels(width, height, false, budget);
    texels.is_linear = true;
    std::vector<uint8_t> row(width * 4);
    for (uint64_t y = 0; y < height; ++y) {
        if (packed) {
            if (!is_packed()) budget.fail("cannot read HDR image: row " + std::to_string(y) + " has no marker");
            read_packed_row(in, width, row);
        } else {
            const std::string_view stored = in.take(width * 4);
            row.assign(stored.begin(), stored.end());
        }
        for (uint64_t x = 0; x < width; ++x) decode(&row[4 * x], &texels.floats[4 * (y * width + x)]);
        budget.tick();
    }
    return texels;
}

}  // namespace ambilux
