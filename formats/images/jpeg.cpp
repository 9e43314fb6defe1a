#include <csetjmp>
#include <cstdio>

#include <jpeglib.h>
// After jpeglib.h.
#include <jerror.h>

#include "formats/images/readers.h"

namespace ambilux {

namespace {

/// libjpeg's decompressor. Its errors come by longjmp, over C alone: call() holds no object that would have to be
/// destroyed.
class JpegReader {
public:
    JpegReader(std::string_view bytes, const FileBudget& budget) : budget_(budget) {
        info_.err = jpeg_std_error(&errors_);
        info_.client_data = this;
        errors_.error_exit = on_error;
        errors_.emit_message = on_message;
        errors_.output_message = [](j_common_ptr) {};
        progress_.progress_monitor = on_progress;
        call([&](j_decompress_ptr info) {
            jpeg_create_decompress(info);
            info->progress = &progress_;
            jpeg_mem_src(info, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
            for (const int marker : {1, 2}) jpeg_save_markers(info, JPEG_APP0 + marker, 0xffff);
            jpeg_read_header(info, TRUE);
        });
    }
    ~JpegReader() { jpeg_destroy_decompress(&info_); }
    JpegReader(const JpegReader&) = delete;

    /// Calls f(info) of libjpeg's functions alone. The decompressor is safe to destroy whatever happened.
    template <class F>
    void call(F f) {
        if (setjmp(jump_) == 0)
            f(&info_);
        else
            fail();
        if (damaged_) fail();
    }

private:
    [[noreturn]] void fail() {
        // A constructor that fails has no destructor.
        jpeg_destroy_decompress(&info_);
        budget_.fail(std::string("cannot read JPEG image: ") + message_);
    }
    static JpegReader& of(j_common_ptr info) { return *static_cast<JpegReader*>(info->client_data); }
    static void on_error(j_common_ptr info) {
        info->err->format_message(info, of(info).message_);
        longjmp(of(info).jump_, 1);
    }
    /// Warnings that a part of the image is made up; others are of no consequence.
    static void on_message(j_common_ptr info, int level) {
        if (level >= 0 || of(info).damaged_) return;
        const int code = info->err->msg_code;
        if (code != JWRN_JPEG_EOF && code != JWRN_HIT_MARKER && code != JWRN_HUFF_BAD_CODE &&
            code != JWRN_ARITH_BAD_CODE)
            return;
        of(info).damaged_ = true;
        info->err->format_message(info, of(info).message_);
    }
    /// Progressive files may have any number of scans.
    static void on_progress(j_common_ptr info) {
        JpegReader& reader = of(info);
        if (!reader.budget_.expired()) return;
        snprintf(reader.message_, sizeof reader.message_, "reading it takes longer than --limits seconds=%llu",
                 static_cast<unsigned long long>(reader.budget_.limits().seconds));
        longjmp(reader.jump_, 1);
    }

    const FileBudget& budget_;
    jpeg_decompress_struct info_{};
    jpeg_error_mgr errors_{};
    jpeg_progress_mgr progress_{};
    std::jmp_buf jump_;
    bool damaged_ = false;
    char message_[JMSG_LENGTH_MAX] = {};
};

void note_markers(jpeg_saved_marker_ptr list, Texels& texels) {
    std::string profile;
    for (const jpeg_marker_struct* m = list; m; m = m->next) {
        const std::string_view data(reinterpret_cast<const char*>(m->data), m->data_length);
        if (m->marker == JPEG_APP0 + 1 && data.starts_with({"Exif\0\0", 6})) note_orientation(data.substr(6), texels);
        if (m->marker == JPEG_APP0 + 2 && data.starts_with("ICC_PROFILE")) profile += data;
    }
    if (!profile.empty()) note_profile(profile, texels);
}

/// Inverted CMYK, as Adobe writes it, in place.
void cmyk_to_rgb(uint8_t* row, uint32_t width) {
    for (uint8_t* p = row; p < row + size_t(width) * 4; p += 4) {
        for (int c = 0; c < 3; ++c) p[c] = uint8_t((p[c] * p[3] + 127) / 255);
        p[3] = 255;
    }
}

}  // namespace

bool is_jpeg(std::string_view bytes) { return bytes.starts_with("\xff\xd8\xff"); }

Texels read_jpeg(std::string_view bytes, FileBudget& budget) {
    JpegReader reader(bytes, budget);
    uint32_t width = 0, height = 0;
    int components = 0;
    bool arithmetic = false;
    jpeg_saved_marker_ptr markers = nullptr;
    reader.call([&](j_decompress_ptr info) {
        markers = info->marker_list;
        width = info->image_width;
        height = info->image_height;
        components = info->num_components;
        arithmetic = info->arith_code;
    });
    budget.pixels(width, height);
    // A Huffman code takes a bit or more for each block of 8x8.
    if (!arithmetic && uint64_t(width) * height > (bytes.size() + 1) * 8 * 64)
        budget.fail("the image claims more pixels than the file holds");
    if (components != 1 && components != 3 && components != 4)
        budget.fail("cannot read JPEG image: it has " + std::to_string(components) + " components");
    Texels texels = make_texels(width, height, true, budget);
    note_markers(markers, texels);
    reader.call([&](j_decompress_ptr info) {
        info->out_color_space = components == 4 ? JCS_CMYK : JCS_EXT_RGBA;
        jpeg_start_decompress(info);
    });
    for (uint32_t y = 0; y < height; ++y) {
        uint8_t* row = texels.bytes.data() + size_t(y) * width * 4;
        reader.call([&](j_decompress_ptr info) { jpeg_read_scanlines(info, &row, 1); });
        if (components == 4) cmyk_to_rgb(row, width);
        budget.tick();
    }
    reader.call([](j_decompress_ptr info) { jpeg_finish_decompress(info); });
    return texels;
}

}  // namespace ambilux
