// Netpbm's binary greymaps (P5) and pixmaps (P6), and maps of floats (Pf, PF).
#include <cmath>
#include <cstring>

#include "core/text.h"
#include "formats/images/readers.h"

namespace ambilux {

namespace {

bool is_space(uint8_t c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/// Next number of the header, behind blanks and comments, and the one character behind it.
uint64_t take_number(ByteReader& in) {
    uint8_t c = in.u8();
    while (is_space(c) || c == '#') {
        if (c == '#')
            while (c != '\n' && c != '\r') c = in.u8();
        c = in.u8();
    }
    uint64_t value = 0;
    int digits = 0;
    for (; c >= '0' && c <= '9' && digits < 10; c = in.u8(), ++digits) value = 10 * value + uint64_t(c - '0');
    if (digits == 0 || !is_space(c)) in.budget.fail("cannot read PNM image: damaged header");
    return value;
}

/// Behind the one blank that ends the header: in files whose lines end in CR LF, behind both.
void end_header(ByteReader& in) {
    const bool is_half = in.bytes[in.at - 1] == '\r' && line_end_of(in.bytes) == "\r\n";
    if (is_half && in.left() > 0 && in.bytes[in.at] == '\n') in.u8();
}

/// Next word of the header, up to the one blank behind it.
std::string take_word(ByteReader& in) {
    std::string word;
    uint8_t c = in.u8();
    while (is_space(c)) c = in.u8();
    for (; !is_space(c) && word.size() < 32; c = in.u8()) word += char(c);
    if (!is_space(c)) in.budget.fail("cannot read PFM image: damaged header");
    end_header(in);
    return word;
}

}  // namespace

bool is_pfm(std::string_view bytes) { return bytes.starts_with("PF") || bytes.starts_with("Pf"); }

/// Rows from bottom to top; a negative scale means little endian, its size the unit of the values.
Texels read_pfm(std::string_view bytes, FileBudget& budget) {
    ByteReader in{bytes, budget, 2};
    const uint64_t channels = bytes[1] == 'F' ? 3 : 1;
    const uint64_t width = take_number(in), height = take_number(in);
    char* end = nullptr;
    const std::string word = take_word(in);
    const float scale = std::strtof(word.c_str(), &end);
    if (*end || !std::isfinite(scale) || scale == 0) budget.fail("cannot read PFM image: its scale is no number");
    budget.pixels(width, height);
    in.need(width * height * channels * 4);
    Texels texels = make_texels(width, height, false, budget);
    texels.is_linear = true;
    for (uint64_t i = 0; i < width * height; ++i) {
        float* texel = &texels.floats[4 * ((height - 1 - i / width) * width + i % width)];
        for (uint64_t c = 0; c < channels; ++c) {
            uint32_t bits = 0;
            for (int k = 0; k < 4; ++k) bits |= uint32_t(in.u8()) << (scale < 0 ? 8 * k : 24 - 8 * k);
            memcpy(texel + c, &bits, 4);
            texel[c] *= std::fabs(scale);
        }
        if (channels == 1) texel[1] = texel[2] = texel[0];
        texel[3] = 1;
        budget.tick();
    }
    return texels;
}

bool is_pnm(std::string_view bytes) { return bytes.starts_with("P5") || bytes.starts_with("P6"); }

Texels read_pnm(std::string_view bytes, FileBudget& budget) {
    ByteReader in{bytes, budget, 2};
    const uint64_t channels = bytes[1] == '6' ? 3 : 1;
    const uint64_t width = take_number(in), height = take_number(in), highest = take_number(in);
    if (highest == 0 || highest > 65535)
        budget.fail("cannot read PNM image: its highest value is not within 1 to 65535");
    budget.pixels(width, height);
    end_header(in);
    const uint64_t size = highest > 255 ? 2 : 1;
    in.need(width * height * channels * size);
    // Bytes keep their values where 255 is the highest.
    const bool is_8bit = highest == 255;
    Texels texels = make_texels(width, height, is_8bit, budget);
    for (uint64_t i = 0; i < width * height; ++i) {
        for (uint64_t c = 0; c < 4; ++c) {
            if (c < channels) {
                const uint32_t value = size == 2 ? uint32_t(in.u8()) << 8 | in.u8() : in.u8();
                if (is_8bit)
                    texels.bytes[4 * i + c] = uint8_t(value);
                else
                    texels.floats[4 * i + c] = float(value) / float(highest);
            } else if (is_8bit) {
                texels.bytes[4 * i + c] = c == 3 ? 255 : texels.bytes[4 * i];
            } else {
                texels.floats[4 * i + c] = c == 3 ? 1 : texels.floats[4 * i];
            }
        }
        budget.tick();
    }
    return texels;
}

}  // namespace ambilux
