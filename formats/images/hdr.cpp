// Radiance's RGBE pictures (Ward, "Real Pixels", Graphics Gems II; the Radiance file formats, section "Picture files").
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>

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

/// Factors that the values have got, which are taken away, and what the header says beside.
struct HdrHeader {
    bool is_rgbe = false;
    double applied[3] = {1, 1, 1};
    std::vector<std::string> notes;

    void take(const std::string& line, const FileBudget& budget) {
        is_rgbe |= line == "FORMAT=32-bit_rle_rgbe";
        double by[3] = {1, 1, 1};
        if (line.starts_with("EXPOSURE=")) {
            if (sscanf(line.c_str(), "EXPOSURE=%lf", by) != 1) by[0] = 0;
            by[1] = by[2] = by[0];
        } else if (line.starts_with("COLORCORR=")) {
            if (sscanf(line.c_str(), "COLORCORR=%lf %lf %lf", by, by + 1, by + 2) != 3) by[0] = 0;
        } else if (line.starts_with("PRIMARIES=") ||
                   (line.starts_with("GAMMA=") && std::strtod(&line[6], nullptr) != 1)) {
            notes.push_back("colours are read as linear Rec.709; ignored in its header: " + line);
        }
        for (size_t c = 0; c < 3; ++c) {
            if (!(by[c] > 0 && by[c] < 1e30)) budget.fail("cannot read HDR image: '" + line + "' is not positive");
            applied[c] *= by[c];
        }
        if (by[0] != 1 || by[1] != 1 || by[2] != 1) notes.push_back("values are divided as its header says: " + line);
    }
};

/// One of the two axes that pixels follow: rows are stored along the first one, pixels of a row along the second.
struct Axis {
    bool is_x, reversed;  ///< from the right to the left, or from the bottom to the top
    uint64_t size;

    uint64_t place(uint64_t i) const { return reversed ? size - 1 - i : i; }
};

Axis take_axis(std::string_view& line, const FileBudget& budget) {
    const std::string_view known = "+X -X -Y +Y ";
    const size_t kind = line.size() < 3 ? std::string_view::npos : known.find(line.substr(0, 3));
    uint64_t size = 0;
    if (kind != std::string_view::npos && kind % 3 == 0) {
        line.remove_prefix(3);
        const auto result = std::from_chars(line.data(), line.data() + line.size(), size);
        line.remove_prefix(std::min(size_t(result.ptr - line.data()) + 1, line.size()));
        if (result.ec == std::errc()) return {kind < 6, kind % 6 == 3, size};
    }
    budget.fail("cannot read HDR image: its size must be written as '-Y HEIGHT +X WIDTH', with other signs or order");
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
    HdrHeader header;
    for (std::string_view line; !(line = take_line(in)).empty();) header.take(std::string(line), budget);
    if (!header.is_rgbe) budget.fail("cannot read HDR image: its FORMAT is not 32-bit_rle_rgbe");
    std::string_view size = take_line(in);
    const Axis rows = take_axis(size, budget), pixels = take_axis(size, budget);
    if (rows.is_x == pixels.is_x) budget.fail("cannot read HDR image: its size has one axis twice");
    const uint64_t width = pixels.size, height = rows.size;
    budget.pixels(width, height);

    const auto marker = [&](size_t i) { return in.left() > i ? uint8_t(in.bytes[in.at + i]) : 0; };
    const auto is_packed = [&] {
        return marker(0) == 2 && marker(1) == 2 && (marker(2) << 8 | marker(3)) == int(width);
    };
    const bool packed = width >= kLeastPacked && width <= kMostPacked && is_packed();
    // A run is at most 127 pixels long and takes two bytes.
    in.need(packed ? height * (4 + 4 * 2 * ((width + 126) / 127)) : height * width * 4);
    Texels texels = rows.is_x ? make_texels(height, width, false, budget) : make_texels(width, height, false, budget);
    texels.is_linear = true;
    texels.notes = std::move(header.notes);
    std::vector<uint8_t> row(width * 4);
    for (uint64_t y = 0; y < height; ++y) {
        if (packed) {
            if (!is_packed()) budget.fail("cannot read HDR image: row " + std::to_string(y) + " has no marker");
            read_packed_row(in, width, row);
        } else {
            const std::string_view stored = in.take(width * 4);
            row.assign(stored.begin(), stored.end());
        }
        for (uint64_t x = 0; x < width; ++x) {
            const uint64_t along = pixels.place(x), across = rows.place(y);
            float* texel = &texels.floats[4 * (rows.is_x ? along * height + across : across * width + along)];
            decode(&row[4 * x], texel);
            for (size_t c = 0; c < 3; ++c) texel[c] = float(texel[c] / header.applied[c]);
        }
        budget.tick();
    }
    return texels;
}

}  // namespace ambilux
