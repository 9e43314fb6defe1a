#include <png.h>

#include <bit>
#include <cmath>
#include <csetjmp>
#include <cstring>

#include "formats/images/readers.h"

namespace ambilux {

static_assert(std::endian::native == std::endian::little, "16-bit samples are swapped to little-endian ones");

namespace {

/// Deflate packs at most this many bytes into one.
constexpr uint64_t kMostPacked = 1032;

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

/// What the chunks of a PNG say of its colours and rows. The pointers are libpng's.
struct Said {
    int intent = 0;
    double gamma = 0, xy[8] = {};
    png_bytep profile = nullptr, exif = nullptr;
    png_uint_32 profile_size = 0, exif_size = 0;
    bool is_srgb = false;
};

Said ask(PngReader& reader) {
    Said out;
    reader.call([&](png_structp png, png_infop info) {
        int method = 0;
        png_charp name = nullptr;
        double* v = out.xy;
        out.is_srgb = png_get_sRGB(png, info, &out.intent);
        png_get_gAMA(png, info, &out.gamma);
        png_get_cHRM(png, info, v, v + 1, v + 2, v + 3, v + 4, v + 5, v + 6, v + 7);
        png_get_iCCP(png, info, &name, &method, &out.profile, &out.profile_size);
        png_get_eXIf_1(png, info, &out.exif_size, &out.exif);
    });
    return out;
}

/// Nobody follows them: Mitsuba and pbrt take all as sRGB, and glTF asks for it.
void note_chunks(const Said& said, Texels& texels) {
    const auto bytes = [](png_bytep at, size_t size) {
        return std::string_view(reinterpret_cast<const char*>(at), at ? size : 0);
    };
    if (said.exif) note_orientation(bytes(said.exif, said.exif_size), texels);
    if (said.is_srgb) return;
    if (said.profile) return note_profile(bytes(said.profile, said.profile_size), texels);
    if (said.gamma > 0 && std::fabs(said.gamma - 1 / 2.2) > 0.02)
        texels.notes.push_back(
            "values are as the scene has them, sRGB unless it says else; the gamma of its gAMA is "
            "left out: " +
            std::to_string(said.gamma));
    constexpr double kSrgb[8] = {0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
    for (int i = 0; i < 8; ++i)
        if (said.xy[3] > 0 && std::fabs(said.xy[i] - kSrgb[i]) > 0.01)
            return texels.notes.emplace_back("its cHRM, other primaries than sRGB's, are left out"), void();
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
    const Said said = ask(reader);
    budget.pixels(width, height);
    if (stored_row > bytes.size() * kMostPacked / height)
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
    note_chunks(said, texels);
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
