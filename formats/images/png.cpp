#include <png.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <csetjmp>
#include <cstring>

#include "formats/images/readers.h"

namespace ambilux {

static_assert(std::endian::native == std::endian::little, "16-bit samples are swapped to little-endian ones");

namespace {

/// Deflate packs at most this many bytes into one.
constexpr uint64_t kMostDeflated = 1032;

/// libpng's reader. Its errors come by longjmp, over C alone: call() holds no object that would have to be destroyed.
class PngReader {
public:
    PngReader(std::string_view bytes, const FileBudget& budget) : in_{bytes, budget}, budget_(budget) {
        png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
        info_ = png_ ? png_create_info_struct(png_) : nullptr;
        if (!info_) {
            png_destroy_read_struct(&png_, nullptr, nullptr);
            throw std::bad_alloc();
        }
        png_set_read_fn(png_, this, on_read);
        png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);  // the budget decides
        png_set_chunk_malloc_max(png_, 16 << 20);
    }
    ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
    PngReader(const PngReader&) = delete;

    /// Calls f(png, info) of libpng's functions alone.
    template <class F>
    void call(F f) {
        if (setjmp(png_jmpbuf(png_)) == 0)
            f(png_, info_);
        else
            budget_.fail(std::string("cannot read PNG image: ") + message_);
    }

private:
    static void on_error(png_structp png, png_const_charp message) {
        auto* self = static_cast<PngReader*>(png_get_error_ptr(png));
        strncpy(self->message_, message ? message : "unknown error", sizeof self->message_ - 1);
        png_longjmp(png, 1);
    }
    static void on_warning(png_structp, png_const_charp) {}
    static void on_read(png_structp png, png_bytep data, size_t count) {
        ByteReader& in = static_cast<PngReader*>(png_get_io_ptr(png))->in_;
        if (count > in.left()) png_error(png, "the file ends too early");
        memcpy(data, in.bytes.data() + in.at, count);
        in.at += count;
    }

    ByteReader in_;
    const FileBudget& budget_;
    png_structp png_ = nullptr;
    png_infop info_ = nullptr;
    char message_[256] = {};
};

/// All rows of all passes into `pixels`.
void read_rows(PngReader& reader, int passes, uint32_t height, uint8_t* pixels, size_t row_bytes, FileBudget& budget) {
    for (int pass = 0; pass < passes; ++pass)
        for (uint32_t y = 0; y < height; ++y) {
            reader.call([&](png_structp png, png_infop) { png_read_row(png, pixels + y * row_bytes, nullptr); });
            budget.tick();
        }
    reader.call([](png_structp png, png_infop) { png_read_end(png, nullptr); });
}

/// What the chunks say of colours and rows, which nobody follows: Mitsuba and pbrt take all as sRGB, as glTF wants it.
void note_chunks(PngReader& reader, Texels& texels) {
    constexpr double kSrgb[8] = {0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
    double gamma = 0, xy[8] = {};
    png_bytep profile = nullptr, exif = nullptr;
    png_uint_32 profile_size = 0, exif_size = 0;
    bool is_srgb = false, has_primaries = false;
    reader.call([&](png_structp png, png_infop info) {
        int n = 0;
        char* name = nullptr;
        is_srgb = png_get_sRGB(png, info, &n);
        png_get_gAMA(png, info, &gamma);
        has_primaries = png_get_cHRM(png, info, xy, xy + 1, xy + 2, xy + 3, xy + 4, xy + 5, xy + 6, xy + 7);
        png_get_iCCP(png, info, &name, &n, &profile, &profile_size);
        png_get_eXIf_1(png, info, &exif_size, &exif);
    });
    if (exif) note_orientation({reinterpret_cast<const char*>(exif), exif_size}, texels);
    if (is_srgb) return;
    if (profile) return note_profile({reinterpret_cast<const char*>(profile), profile_size}, texels);
    if (gamma > 0 && std::fabs(gamma - 1 / 2.2) > 0.02)
        texels.notes.push_back("the gamma of its gAMA is ignored: " + std::to_string(gamma));
    if (has_primaries && !std::equal(xy, xy + 8, kSrgb, [](double a, double b) { return std::fabs(a - b) <= 0.01; }))
        texels.notes.emplace_back("its cHRM, primaries other than sRGB's, is ignored");
}

}  // namespace

bool is_png(std::string_view bytes) { return bytes.starts_with("\x89PNG\r\n\x1a\n"); }

Texels read_png(std::string_view bytes, FileBudget& budget) {
    PngReader reader(bytes, budget);
    uint32_t width = 0, height = 0;
    size_t stored_row = 0, row = 0;
    int depth = 0, passes = 1;
    reader.call([&](png_structp png, png_infop info) {
        png_read_info(png, info);
        width = png_get_image_width(png, info);
        height = png_get_image_height(png, info);
        depth = png_get_bit_depth(png, info);
        stored_row = png_get_rowbytes(png, info);
    });
    budget.pixels(width, height);
    if (stored_row > bytes.size() * kMostDeflated / height)
        budget.fail("the image claims more pixels than the file holds");
    reader.call([&](png_structp png, png_infop info) {
        png_set_expand(png);
        if (depth == 16) png_set_swap(png);
        png_set_gray_to_rgb(png);
        png_set_add_alpha(png, 0xffff, PNG_FILLER_AFTER);
        passes = png_set_interlace_handling(png);
        png_read_update_info(png, info);
        row = png_get_rowbytes(png, info);
    });
    const bool is_8bit = depth != 16;
    if (row != size_t(width) * 4 * (is_8bit ? 1 : 2))
        budget.fail("cannot read PNG image: unexpected layout of its rows");
    Texels texels = make_texels(width, height, is_8bit, budget);
    note_chunks(reader, texels);
    if (is_8bit) {
        read_rows(reader, passes, height, texels.bytes.data(), row, budget);
        return texels;
    }
    std::vector<uint16_t> wide(texels.floats.size());
    read_rows(reader, passes, height, reinterpret_cast<uint8_t*>(wide.data()), row, budget);
    for (size_t i = 0; i < wide.size(); ++i) texels.floats[i] = float(wide[i]) / 65535.0f;
    return texels;
}

}  // namespace ambilux
