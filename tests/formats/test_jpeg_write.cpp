// libs: ambilux_images
#include <tbb/task_arena.h>

#include <cmath>

#include "core/error.h"
#include "formats/images/image_io.h"
#include "formats/images/jpeg_write.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// Slow waves of colour, which a JPEG of some quality keeps.
std::vector<uint8_t> waves(uint32_t width, uint32_t height) {
    std::vector<uint8_t> rgb;
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x)
            for (const double k : {0.02, 0.03, 0.05})
                rgb.push_back(uint8_t(std::lround(127.5 + 120 * std::sin(k * (x + 2.0 * y)))));
    return rgb;
}

std::string with_threads(int threads, uint32_t width, uint32_t height, const std::vector<uint8_t>& rgb, int quality) {
    tbb::task_arena arena(threads);
    return arena.execute([&] { return jpeg_bytes(width, height, rgb.data(), quality); });
}

std::vector<uint8_t> decoded_bytes(const std::string& jpeg, uint32_t width, uint32_t height) {
    const Texels read = read_image("waves.jpg", jpeg);
    REQUIRE(read.width == width);
    REQUIRE(read.height == height);
    REQUIRE(read.is_8bit);
    std::vector<uint8_t> rgb;
    for (size_t i = 0; i < read.bytes.size(); ++i)
        if (i % 4 != 3) rgb.push_back(read.bytes[i]);
    return rgb;
}

}  // namespace

TEST_CASE("a JPEG shows the picture, and the same whatever number of threads codes it") {
    for (const auto& [width, height] : {std::pair(200u, 310u), {16u, 16u}, {1u, 1u}, {7u, 1000u}, {1000u, 17u}}) {
        INFO(width << "x" << height);
        const std::vector<uint8_t> rgb = waves(width, height);
        const std::vector<uint8_t> alone = decoded_bytes(with_threads(1, width, height, rgb, 95), width, height);
        double worst = 0;
        for (size_t i = 0; i < rgb.size(); ++i) worst = std::max(worst, std::abs(double(rgb[i]) - double(alone[i])));
        CHECK(worst < 16);
        for (const int threads : {2, 3, 8, 31})
            CHECK(decoded_bytes(with_threads(threads, width, height, rgb, 95), width, height) == alone);
    }
}

TEST_CASE("a lower quality takes fewer bytes") {
    const std::vector<uint8_t> rgb = waves(256, 256);
    CHECK(2 * jpeg_bytes(256, 256, rgb.data(), 30).size() < jpeg_bytes(256, 256, rgb.data(), 95).size());
    CHECK(jpeg_bytes(256, 256, rgb.data(), 1000) == jpeg_bytes(256, 256, rgb.data(), 100));
}

TEST_CASE("sides that a JPEG cannot have are refused") {
    const std::vector<uint8_t> rgb(3 * (kLargestJpeg + 1));
    CHECK_THROWS_AS(jpeg_bytes(kLargestJpeg + 1, 1, rgb.data(), 90), Error);
    CHECK_THROWS_AS(jpeg_bytes(0, 1, rgb.data(), 90), Error);
    CHECK(decoded_bytes(jpeg_bytes(kLargestJpeg, 1, rgb.data(), 90), kLargestJpeg, 1)[0] == 0);
}
