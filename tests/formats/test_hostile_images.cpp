// libs: ambilux_formats ZLIB::ZLIB JPEG::JPEG OpenEXR::OpenEXR
// timeout: 120
// Image files that lie, end early, or ask for more than they hold.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <sys/resource.h>
#include <zlib.h>

#include <cstring>
#include <random>

#include "core/atomic_file.h"
#include "core/error.h"
#include "formats/images/image_io.h"
#include "tests/support/catch.h"
#include "tests/support/image_files.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;

namespace {

std::string error_of(std::string_view bytes, const Limits& limits = {}) {
    try {
        read_image("x", bytes, limits);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "no error";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::string big_endian(uint32_t value) { return {char(value >> 24), char(value >> 16), char(value >> 8), char(value)}; }

std::string png_chunk(const std::string& type, const std::string& data) {
    const std::string body = type + data;
    return big_endian(uint32_t(data.size())) + body +
           big_endian(uint32_t(crc32(0, reinterpret_cast<const Bytef*>(body.data()), uInt(body.size()))));
}

std::string png_header(uint32_t width, uint32_t height, char depth = 8, char color = 2) {
    return std::string("\x89PNG\r\n\x1a\n", 8) +
           png_chunk("IHDR", big_endian(width) + big_endian(height) + depth + color + std::string(3, '\0'));
}

/// An EXR file of half RGB, and its bytes.
std::string exr_file(int width, int height, Imf::Compression compression) {
    const test::TempFolder folder;
    const std::string path = folder / "a.exr";
    {
        Imf::Header header(width, height);
        header.compression() = compression;
        std::vector<float> row(size_t(width), 0.25f);
        Imf::FrameBuffer frame;
        for (const char* name : {"R", "G", "B"}) {
            header.channels().insert(name, Imf::Channel(Imf::FLOAT));
            frame.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(row.data()), sizeof(float), 0));
        }
        Imf::OutputFile file(path.c_str(), header);
        file.setFrameBuffer(frame);
        file.writePixels(height);
    }
    return read_file(path);
}

/// The data window of an EXR file, which OpenEXR writes as four integers behind its name, type and size.
void set_window(std::string& exr, int32_t width, int32_t height) {
    const std::string name("dataWindow\0box2i\0\x10\0\0\0", 21);
    const size_t at = exr.find(name);
    REQUIRE(at != std::string::npos);
    const int32_t window[4] = {0, 0, width - 1, height - 1};
    memcpy(exr.data() + at + name.size(), window, sizeof window);
}

std::string bmp_header(int32_t width, int32_t height, uint16_t bits) {
    std::string h(54, '\0');
    h[0] = 'B', h[1] = 'M', h[10] = 54, h[14] = 40, h[26] = 1, h[28] = char(bits);
    memcpy(&h[18], &width, 4), memcpy(&h[22], &height, 4);
    return h;
}

/// Peak of this process in bytes.
uint64_t peak_memory() {
    rusage usage;
    ::getrusage(RUSAGE_SELF, &usage);
    return uint64_t(usage.ru_maxrss) * 1024;
}

}  // namespace

TEST_CASE("a PNG whose chunk claims nearly 2^32 bytes is refused with words") {
    std::string png = png_header(4, 4) + big_endian(0xfffffff0u) + "IDAT" + "some data";
    CHECK(contains(error_of(png), "x: cannot read PNG image: "));
    png = png_header(4, 4) + big_endian(0x7fffffffu) + "IDAT" + "some data";
    CHECK(contains(error_of(png), "x: cannot read PNG image: "));
}

TEST_CASE("a JPEG with impossible Huffman counts is refused") {
    const std::string good = test::jpeg_file(16, 16, std::vector<uint8_t>(16 * 16 * 3, 90));
    const size_t table = good.find("\xff\xc4");
    REQUIRE(table != std::string::npos);
    for (int code = 0; code < 16; ++code) {
        std::string bad = good;
        bad[table + 5 + size_t(code)] = '\xff';
        CHECK(contains(error_of(bad), "x: cannot read JPEG image: "));
    }
}

TEST_CASE("headers alone are no images, and images of no pixels are none") {
    const std::string cases[] = {
        test::hdr_header(8, 8),
        test::hdr_header(0, 0),
        test::hdr_header(0, 8),
        test::tga_header(2, 8, 8, 24),
        test::tga_header(10, 8, 8, 24),
        "P6 8 8 255\n",
        "P5 8 8 65535\n",
        "P5 0 0 255\n",
        bmp_header(8, 8, 24),
        bmp_header(0, 0, 24),
        bmp_header(8, INT32_MIN, 24),
        png_header(8, 8),
    };
    for (const std::string& file : cases) {
        const std::string message = error_of(file);
        CAPTURE(file, message);
        CHECK(contains(message, "x: "));
        CHECK(message != "no error");
    }
    CHECK(contains(error_of(test::hdr_header(0, 0)), "the image has no pixels"));
    std::string palette_outside = bmp_header(2, 2, 4);
    palette_outside[14] = 113;
    CHECK(contains(error_of(palette_outside), "the file ends too early"));
    CHECK(contains(error_of(""), "cannot read image"));
}

TEST_CASE("runs of a HDR that ends early come to an end") {
    // A whole first row, then nothing; and rows whose runs are empty or too long.
    const std::string marker("\x02\x02\x00\x08", 4), row = marker + std::string("\x88\x40\x88\x40\x88\x40\x88\x80", 8);
    CHECK(contains(error_of(test::hdr_header(8, 4) + row), "ends too early"));
    CHECK(contains(error_of(test::hdr_header(8, 1) + marker + std::string(16, '\0')), "damaged run"));
    CHECK(contains(error_of(test::hdr_header(8, 1) + marker + std::string(16, '\xff')), "damaged run"));
    const Texels good = read_image("x", test::hdr_header(8, 2) + row + row);
    CHECK(good.floats[0] == 0.25f);
    CHECK(good.floats[4 * 15 + 2] == 0.25f);
}

TEST_CASE("small files that claim gigabytes are refused before the memory is taken") {
    std::string exr[] = {exr_file(4, 4, Imf::NO_COMPRESSION), exr_file(4, 4, Imf::ZIP_COMPRESSION),
                         exr_file(4, 4, Imf::PIZ_COMPRESSION), exr_file(4, 4, Imf::RLE_COMPRESSION)};
    for (std::string& file : exr) set_window(file, 16000, 16000);
    std::string tall = exr[1];
    set_window(tall, 1, INT32_MAX);
    std::string long_attribute = exr[0];
    const size_t at = long_attribute.find(std::string("box2i\0\x10\0\0\0", 10));
    long_attribute[at + 9] = '\x7f';
    // OpenEXR reads channels until an empty name, wherever the attribute ends, and takes what follows for attributes.
    std::string long_channels = exr[0];
    const std::string channels("channels\0chlist\0", 16);
    const std::string hidden("\0a\0string\0\0\0\0\x79", 14);
    const size_t list = long_channels.find(channels) + channels.size();
    uint32_t length = 0;
    memcpy(&length, long_channels.data() + list, sizeof length);
    long_channels.insert(list + sizeof length + length - 1, hidden);
    length += uint32_t(hidden.size());
    memcpy(long_channels.data() + list, &length, sizeof length);
    // Lengths inside of an attribute.
    std::string long_string = exr[0];
    const std::string strings("v\0stringvector\0\x04\0\0\0\0\0\0\x79", 23);
    long_string.insert(8, strings);
    const std::string jpeg = [] {
        std::string file = test::jpeg_file(16, 16, std::vector<uint8_t>(16 * 16 * 3, 90));
        const size_t frame = file.find("\xff\xc0");
        file.replace(frame + 5, 4, "\x3e\x80\x3e\x80");
        return file;
    }();
    const std::string small[] = {
        test::tga_header(2, 65535, 65535, 32),
        test::tga_header(10, 65535, 65535, 32) + std::string(1000, '\xff'),
        test::hdr_header(16000, 16000) + std::string("\x02\x02\x3e\x80", 4),
        test::hdr_header(UINT64_MAX, UINT64_MAX),
        "P6 16000 16000 255\n",
        bmp_header(16000, 16000, 32),
        png_header(16000, 16000, 16, 6) + png_chunk("IDAT", "x"),
        png_header(0x7fffffff, 0x7fffffff) + png_chunk("IDAT", "x"),
        jpeg,
        exr[0],
        exr[1],
        exr[3],
        tall,
        long_attribute,
        long_channels,
        long_string,
    };
    const uint64_t before = peak_memory();
    for (const std::string& file : small) {
        const std::string message = error_of(file);
        CAPTURE(message, file.substr(0, 20));
        CHECK(message != "no error");
    }
    CHECK(peak_memory() - before < (64u << 20));
    // PIZ has no bound on what a byte may become: the limits have the word.
    Limits limits;
    limits.pixels = 1 << 20;
    CHECK(contains(error_of(exr[2], limits), "an image of 16000x16000 pixels is larger than --limits pixels=1048576"));
}

TEST_CASE("what is beyond the limits is refused by the name of the limit") {
    const std::string png = png_bytes(64, 64, std::vector<uint8_t>(64 * 64 * 3, 1));
    Limits limits;
    limits.pixels = 64 * 64;
    CHECK(error_of(png, limits) == "no error");
    limits.pixels = 64 * 64 - 1;
    CHECK(contains(error_of(png, limits), "--limits pixels=4095"));
    limits = {};
    limits.bytes = 64 * 64 * 4 - 1;
    CHECK(contains(error_of(png, limits), "--limits bytes=16383"));
    set_limit(limits, "bytes=2G");
    CHECK(limits.bytes == 2ull << 30);
    CHECK_THROWS_WITH(set_limit(limits, "bytes=0"), ContainsSubstring("write it as bytes=N"));
    CHECK_THROWS_WITH(set_limit(limits, "bytes=-1"), ContainsSubstring("write it as bytes=N"));
    CHECK_THROWS_WITH(set_limit(limits, "bites=1"), ContainsSubstring("known are pixels="));
    CHECK_THROWS_WITH(set_limit(limits, "nesting=1G"), ContainsSubstring("at most"));
}

TEST_CASE("every cut and every changed byte of every format is an image or an error") {
    std::vector<std::string> files = {
        png_bytes(9, 5, std::vector<uint8_t>(9 * 5 * 3, 77)),
        test::jpeg_file(17, 9, std::vector<uint8_t>(17 * 9 * 3, 77)),
        test::jpeg_file(17, 9, std::vector<uint8_t>(17 * 9 * 3, 77), true),
        exr_file(9, 5, Imf::ZIP_COMPRESSION),
        exr_file(9, 5, Imf::PIZ_COMPRESSION),
        exr_file(9, 5, Imf::DWAA_COMPRESSION),
        test::hdr_header(9, 1) + std::string("\x02\x02\x00\x09\x89\x40\x89\x40\x89\x40\x89\x80", 12),
        test::tga_header(10, 9, 5, 32) + std::string("\x9f\x01\x02\x03\x04\x8c\x01\x02\x03\x04", 10),
        bmp_header(9, 5, 24) + std::string(28 * 5, '\x33'),
        "P6 9 5 255\n" + std::string(9 * 5 * 3, '\x33'),
    };
    std::string indexed = bmp_header(9, 5, 4);
    indexed[10] = 118;
    files.push_back(indexed + std::string(64 + 8 * 5, '\x12'));
    for (const std::string& file : files) {
        CHECK(error_of(file) == "no error");
        for (size_t cut = 0; cut < file.size(); cut += 1 + file.size() / 200) error_of(file.substr(0, cut));
        std::mt19937 random(1);
        Limits limits;
        limits.pixels = 1 << 16;
        for (int i = 0; i < 400; ++i) {
            std::string bad = file;
            for (uint32_t k = 0; k <= random() % 3; ++k)
                bad[random() % std::min<size_t>(bad.size(), 400)] = char(random());
            error_of(bad, limits);
        }
    }
}
