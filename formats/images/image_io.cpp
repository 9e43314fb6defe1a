#include "formats/images/image_io.h"

#include "core/srgb.h"
#include "formats/images/readers.h"

namespace ambilux {

double decoded(double value, double gamma) {
    return gamma == 1 ? value : gamma == -1 ? srgb_to_linear(value) : std::pow(value, gamma);
}

Rgb Texels::linear(size_t texel) const {
    const auto value = [&](size_t c) { return float(decoded(stored(4 * texel + c), is_linear ? 1 : -1)); };
    return {value(0), value(1), value(2)};
}

Texels make_texels(uint64_t width, uint64_t height, bool is_8bit, const FileBudget& budget) {
    budget.pixels(width, height);
    budget.bytes(width * height, is_8bit ? 4 : 4 * sizeof(float));
    if (width > UINT32_MAX || height > UINT32_MAX) budget.fail("the image is too long");
    Texels texels;
    texels.width = uint32_t(width);
    texels.height = uint32_t(height);
    texels.is_8bit = is_8bit;
    if (is_8bit)
        texels.bytes.resize(width * height * 4);
    else
        texels.floats.resize(width * height * 4);
    return texels;
}

void note_profile(std::string_view profile, Texels& texels) {
    if (profile.find("sRGB") != std::string_view::npos || profile.find({"s\0R\0G\0B", 7}) != std::string_view::npos)
        return;
    texels.notes.emplace_back("its colour profile (ICC), which is not sRGB, is left out");
}

void note_orientation(std::string_view exif, Texels& texels) {
    const bool little = exif.starts_with("II");
    const auto number = [&](size_t at, size_t bytes) {
        uint32_t v = 0;
        for (size_t i = 0; i < bytes; ++i)
            v = v << 8 | (at + bytes <= exif.size() ? uint8_t(exif[at + (little ? bytes - 1 - i : i)]) : 0u);
        return v;
    };
    const size_t list = number(4, 4), count = number(list, 2);
    for (size_t at = list + 2; at < list + 2 + 12 * count; at += 12)
        if (const uint32_t value = number(at + 8, 2); number(at, 2) == 0x112 && value > 1 && value <= 8)
            return texels.notes.push_back("its EXIF orientation is ignored: " + std::to_string(value));
}

Texels read_image(const std::string& path, std::string_view bytes, const Limits& limits) {
    FileBudget budget(path, limits);
    struct Format {
        bool (*is)(std::string_view);
        Texels (*read)(std::string_view, FileBudget&);
    };
    // TGA last, since anything might look like it.
    constexpr Format formats[] = {{is_png, read_png}, {is_jpeg, read_jpeg}, {is_exr, read_exr_texels},
                                  {is_hdr, read_hdr}, {is_pnm, read_pnm},   {is_pfm, read_pfm},
                                  {is_bmp, read_bmp}, {is_tga, read_tga}};
    for (const Format& format : formats)
        if (format.is(bytes)) return format.read(bytes, budget);
    budget.fail("cannot read image: it is none of PNG, JPEG, EXR, HDR, PNM (P5, P6, PF), BMP, TGA");
}

}  // namespace ambilux
