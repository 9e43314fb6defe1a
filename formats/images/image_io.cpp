#include "formats/images/image_io.h"

#include "formats/images/readers.h"

namespace ambilux {

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
