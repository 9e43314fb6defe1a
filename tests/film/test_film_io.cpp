// libs: ambilux_film
// Moments, EXR and PNG files, metrics.
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/srgb.h"
#include "film/exr_io.h"
#include "film/metrics.h"
#include "film/png_io.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;
namespace fs = std::filesystem;

namespace {

Image noise(uint32_t width, uint32_t height, uint64_t seed) {
    std::mt19937_64 rng(seed);
    std::exponential_distribution<float> d;
    Image image{width, height, std::vector<float>(size_t(width) * height * 3)};
    for (float& v : image.rgb) v = d(rng);
    return image;
}

FilmMoments simulate(uint32_t width, uint32_t height, uint64_t n, uint64_t seed) {
    std::mt19937_64 rng(seed);
    std::exponential_distribution<double> d;
    FilmMoments m{width, height, n, std::vector<double>(size_t(width) * height * 3),
                  std::vector<double>(size_t(width) * height * 3)};
    for (size_t i = 0; i < m.sum.size(); ++i)
        for (uint64_t s = 0; s < n; ++s) {
            const double v = d(rng);
            m.sum[i] += v;
            m.sum_squares[i] += v * v;
        }
    return m;
}

ExitCode code_of(const std::function<void()>& f, std::string* message = nullptr) {
    try {
        f();
    } catch (const Error& e) {
        if (message) *message = e.what();
        return e.code;
    }
    return ExitCode::done;
}

}  // namespace

TEST_CASE("moments: mean, variance and standard error of known samples") {
    FilmMoments m{1, 1, 4, {10, 0, 8}, {30, 0, 16}};  // channel 0: 1 2 3 4; channel 2: 2 2 2 2
    CHECK(m.mean(0) == 2.5);
    CHECK(m.variance(0) == Approx(5.0 / 3));
    CHECK(m.standard_error(0) == Approx(std::sqrt(5.0 / 12)));
    CHECK(m.standard_error(2) == 0);
    FilmMoments one{1, 1, 1, {10, 0, 8}, {100, 0, 64}};
    CHECK(std::isinf(one.standard_error(0)));
    FilmMoments total;
    total.add(m);
    total.add(one);
    CHECK(total.samples == 5);
    CHECK(total.sum[0] == 20);
    CHECK(total.sum_squares[2] == 80);
    CHECK_THROWS_AS(total.add(FilmMoments{2, 1, 1, std::vector<double>(6), std::vector<double>(6)}), Error);
}

TEST_CASE("EXR: image and attributes come back unchanged") {
    const test::TempFolder folder;
    const Image image = noise(13, 7, 1);
    const Attributes attributes = {
        {"scene", "a b.xml"}, {"spp", 64}, {"seed", 1ull << 63}, {"seconds", 1.25}, {"negative", -3}};
    write_exr(folder / "a.exr", image, attributes);
    Attributes back;
    const Image read = read_exr(folder / "a.exr", &back);
    CHECK(read.width == 13);
    CHECK(read.height == 7);
    CHECK(read.rgb == image.rgb);
    CHECK(back["scene"] == "a b.xml");
    CHECK(back["spp"] == 64);
    CHECK(back["seed"] == "9223372036854775808");
    CHECK(back["seconds"] == 1.25);
    CHECK(back["negative"] == -3);
    CHECK(folder.files() == 1);
}

TEST_CASE("reference EXR: continued in two parts equals the whole") {
    const test::TempFolder folder;
    const FilmMoments first = simulate(9, 5, 40, 1), second = simulate(9, 5, 24, 2);
    write_reference_exr(folder / "r.exr", to_reference(first), {{"scene", "s"}});
    const Reference read = read_reference_exr(folder / "r.exr");
    CHECK(read.samples == 40);
    FilmMoments continued = to_moments(read), whole = first;
    continued.add(second);
    whole.add(second);
    CHECK(continued.samples == 64);
    for (size_t i = 0; i < whole.sum.size(); ++i) {
        REQUIRE(continued.mean(i) == Approx(whole.mean(i)).epsilon(1e-6));
        REQUIRE(continued.standard_error(i) == Approx(whole.standard_error(i)).epsilon(1e-5));
    }
    SECTION("an image without errors cannot be continued") {
        write_exr(folder / "i.exr", mean_image(first), {{"spp", 40}});
        const Reference plain = read_reference_exr(folder / "i.exr");
        CHECK(plain.standard_error.rgb.empty());
        CHECK_THROWS_AS(to_moments(plain), Error);
    }
}

TEST_CASE("a reference with any changed bit is refused; images by other programs need no checksum") {
    const test::TempFolder folder;
    write_reference_exr(folder / "r.exr", to_reference(simulate(9, 5, 40, 1)), {{"rr_depth", 5}});
    const std::string bytes = read_file(folder / "r.exr");
    const auto is_refused = [&](const std::string& content) {
        folder.write("bad.exr", content);
        return code_of([&] { read_reference_exr(folder / "bad.exr"); }) == ExitCode::bad_input;
    };
    for (size_t at = 0; at < bytes.size(); ++at) {
        std::string bad = bytes;
        bad[at] = char(bad[at] ^ (1 << at % 8));
        // In the words that announce the checksum: then there is none, and the image is whole.
        const size_t mark = bytes.rfind("ambilux sha256 ");
        if (at >= mark && at < mark + 15) continue;
        CAPTURE(at);
        REQUIRE(is_refused(bad));
    }
    CHECK_FALSE(is_refused(bytes));
    CHECK_FALSE(is_refused(bytes.substr(0, bytes.rfind("ambilux sha256 "))));
}

TEST_CASE("EXR: bad files are refused by name") {
    const test::TempFolder folder;
    std::string message;
    CHECK(code_of([&] { read_exr(folder / "missing.exr"); }, &message) == ExitCode::bad_input);
    CHECK(message.find("missing.exr: No such file") != std::string::npos);

    write_exr(folder / "whole.exr", noise(64, 64, 1));
    const std::string bytes = read_file(folder / "whole.exr");
    for (const size_t keep : {size_t(0), size_t(3), size_t(100), bytes.size() / 2, bytes.size() - 1}) {
        std::ofstream(folder / "cut.exr", std::ios::binary) << bytes.substr(0, keep);
        CHECK(code_of([&] { read_exr(folder / "cut.exr"); }, &message) == ExitCode::bad_input);
        CHECK(message.find("cut.exr") != std::string::npos);
    }
    std::ofstream(folder / "text.exr") << "this is not an image, whatever its name says";
    CHECK(code_of([&] { read_exr(folder / "text.exr"); }) == ExitCode::bad_input);
}

TEST_CASE("a failed write leaves the old file and nothing else") {
    const test::TempFolder folder;
    write_exr(folder / "a.exr", noise(4, 4, 1));
    const std::string before = read_file(folder / "a.exr");
    std::string message;
    CHECK(code_of([&] { write_exr(folder / "none/a.exr", noise(4, 4, 2)); }, &message) == ExitCode::device);
    CHECK(message.find("none/a.exr: No such file or directory") != std::string::npos);
    CHECK(code_of([&] { write_png(folder.path.string(), noise(4, 4, 2)); }) == ExitCode::device);
    CHECK(code_of([&] { check_writable(folder / "none/a.exr"); }) == ExitCode::device);
    CHECK(code_of([&] { write_exr(folder / "a.exr", Image{4, 4, {1, 2, 3}}); }) == ExitCode::device);
    CHECK(read_file(folder / "a.exr") == before);
    CHECK(folder.files() == 1);
    if (::geteuid() != 0) {
        ::chmod(folder.path.c_str(), 0500);
        CHECK(code_of([&] { write_exr(folder / "a.exr", noise(4, 4, 2)); }) == ExitCode::device);
        ::chmod(folder.path.c_str(), 0700);
    }
    if (fs::exists("/dev/full")) CHECK(code_of([&] { append_file("/dev/full", "x"); }) == ExitCode::device);
}

TEST_CASE("moments of two samples go on from a reference, those of one do not") {
    FilmMoments m{1, 1, 2, {2, 4, 6}, {3, 9, 20}};
    const FilmMoments back = to_moments(to_reference(m));
    for (size_t c = 0; c < 3; ++c) {
        CHECK(back.sum[c] == Approx(m.sum[c]));
        CHECK(back.sum_squares[c] == Approx(m.sum_squares[c]).epsilon(1e-6));
    }
    Reference one = to_reference(m);
    one.samples = 1;
    CHECK_THROWS_AS(to_moments(one), Error);
}

TEST_CASE("PNG: the sRGB curve, clamping and NaN") {
    CHECK(linear_to_srgb(0.0f) == 0.0f);
    CHECK(linear_to_srgb(-1.0f) == 0.0f);
    CHECK(linear_to_srgb(std::nanf("")) == 0.0f);
    CHECK(linear_to_srgb(2.0f) == 1.0f);
    CHECK(linear_to_srgb(0.002f) == Approx(0.02584));
    CHECK(linear_to_srgb(0.5f) == Approx(0.735357).epsilon(1e-5));
    const test::TempFolder folder;
    write_png(folder / "a.png", noise(5, 3, 1), 1.0f);
    CHECK(read_file(folder / "a.png").substr(0, 8) == "\x89PNG\r\n\x1a\n");
    // A stop of exposure is twice the light.
    Image twice = noise(5, 3, 1);
    for (float& v : twice.rgb) v *= 2;
    write_png(folder / "b.png", twice, 0.0f);
    CHECK(read_file(folder / "a.png") == read_file(folder / "b.png"));
}

TEST_CASE("metrics: relMSE without the worst pixels") {
    // 3000 pixels of error 0.1 in one channel, of which two are fireflies: three are left out, the third an ordinary
    // one.
    Reference r{{60, 50, std::vector<float>(9000, 1.0f)}, {60, 50, std::vector<float>(9000, 0.02f)}, 16};
    Image x = r.mean;
    for (size_t p = 0; p < 3000; ++p) x.rgb[3 * p] += 0.1f;
    x.rgb[3 * 17 + 1] = 1e4f;
    x.rgb[3 * 2011 + 2] = 500.0f;
    const Metrics m = compare_images(x, r);
    CHECK(m.relmse > 1e4);
    CHECK(m.relmse_trimmed == Approx(0.01 / 1.01 / 3).epsilon(1e-4));
    CHECK(m.relmse_trimmed_corrected == Approx((0.01 / 3 - 0.0004) / 1.01).epsilon(1e-4));
    // What is no number is not forgiven.
    x.rgb[5] = std::nanf("");
    CHECK(std::isnan(compare_images(x, r).relmse_trimmed));
    CHECK(std::isnan(compare_images(x, r).relmse_trimmed_corrected));
    x.rgb[5] = INFINITY;
    CHECK(std::isnan(compare_images(x, r).relmse_trimmed));
    r.standard_error = {};
    x.rgb[5] = 1;
    CHECK(std::isnan(compare_images(x, r).relmse_trimmed_corrected));
    CHECK(compare_images(x, r).relmse_trimmed < 0.01);
    // With Gaussian noise of known variance, little is lost: the trimmed part holds 0.1 % of pixels and about 0.5 % of
    // their squares.
    std::mt19937_64 random(3);
    std::normal_distribution<float> normal(0.0f, 0.1f);
    Reference zero{{200, 200, std::vector<float>(120000, 0.0f)}, {200, 200, std::vector<float>(120000, 0.0f)}, 16};
    Image noisy = zero.mean;
    for (float& v : noisy.rgb) v = normal(random);
    const Metrics g = compare_images(noisy, zero);
    CHECK(g.relmse == Approx(1).epsilon(0.02));
    CHECK(g.relmse_trimmed < g.relmse);
    CHECK(g.relmse_trimmed == Approx(g.relmse).epsilon(0.01));
}

TEST_CASE("metrics: values by hand") {
    Reference r{{2, 1, {1, 1, 1, 0, 0, 2}}, {2, 1, {0.1f, 0.1f, 0.1f, 0.1f, 0.1f, 0.1f}}, 16};
    const Image x{2, 1, {1.5f, 1, 1, 0, 0.1f, 2}};
    const Metrics m = compare_images(x, r);
    CHECK(m.rmse == Approx(std::sqrt((0.25 + 0.01) / 6)));
    CHECK(m.relmse == Approx((0.25 / 1.01 + 0.01 / 0.01) / 6));
    CHECK(m.mape == Approx((0.5 / 1.01 + 0.1 / 0.01) / 6));
    CHECK(m.reference_noise == Approx(0.1));
    CHECK(m.rmse_corrected == Approx(std::sqrt((0.26 - 0.06) / 6)));
    CHECK(m.relmse_corrected == 0);  // less than the noise of the reference: nothing is left
    Reference quiet = r;
    for (float& se : quiet.standard_error.rgb) se = 0.01f;
    CHECK(compare_images(x, quiet).relmse_corrected ==
          Approx((0.2499 / 1.01 - 2e-4 / 1.01 - 1e-4 / 0.01 + 0.0099 / 0.01 - 1e-4 / 4.01) / 6).epsilon(1e-5));
    CHECK(m.bias == Approx(0.1));
    CHECK(m.relative_bias == Approx(0.6 / 5));
    CHECK(m.bias_z == Approx((0.5 / 3 + 0.1 / 3) / std::sqrt(0.26 / 9)));

    CHECK(m.relmse_trimmed == m.relmse);  // a thousandth of two pixels is none
    CHECK(compare_images(x, quiet).relmse_trimmed_corrected == Approx(compare_images(x, quiet).relmse_corrected));

    const Metrics same = compare_images(r.mean, r);
    CHECK(same.rmse == 0);
    CHECK(same.rmse_corrected == 0);
    CHECK(same.bias_z == 0);
    r.standard_error = {};
    const Metrics unknown = compare_images(x, r);
    CHECK(unknown.rmse == m.rmse);
    CHECK(std::isnan(unknown.rmse_corrected));
    CHECK(to_json(unknown)["rmse_corrected"].is_null());
    Image broken = x;
    broken.rgb[0] = std::nanf("");
    CHECK(compare_images(broken, r).non_finite == 1);
    CHECK(std::isnan(compare_images(broken, r).rmse));
    CHECK_THROWS_AS(compare_images(Image{1, 2, x.rgb}, r), Error);
}

TEST_CASE("block agreement with a published image") {
    Image r{20, 18, std::vector<float>(20 * 18 * 3, 1.0f)}, x = r;
    CHECK(block_agreement(x, r).within == 1);
    for (uint32_t row = 16; row < 18; ++row)
        for (uint32_t i = 0; i < 16 * 3; ++i) x.rgb[row * 60 + i] = 1.05f;  // lower left block of four
    const BlockAgreement a = block_agreement(x, r);
    CHECK(a.within == 0.75);
    CHECK(a.worst == Approx(0.05).epsilon(1e-5));
    CHECK(a.worst_x == 0);
    CHECK(a.worst_y == 16);
    CHECK(a.relative_mean == Approx(0.05 * 32 / 360).epsilon(1e-5));
    x.rgb[0] = std::nanf("");
    CHECK(block_agreement(x, r).within == 0.5);
    CHECK_THROWS_AS(block_agreement(Image{1, 1, {1, 1, 1}}, r), Error);
}

TEST_CASE("metrics: the reference's noise is taken out, and the bias z-score is standard normal without bias") {
    // Truth 1, deviation of one sample 1: error against the truth is 1/sqrt(n).
    const uint64_t n = 16, n_ref = 64;
    double corrected = 0, raw = 0, z2 = 0;
    const int runs = 40;
    for (uint64_t i = 0; i < runs; ++i) {
        const Metrics m = compare_images(simulate(32, 32, n, 2 * i), to_reference(simulate(32, 32, n_ref, 2 * i + 1)));
        corrected += m.rmse_corrected * m.rmse_corrected / runs;
        raw += m.rmse * m.rmse / runs;
        z2 += m.bias_z * m.bias_z;
    }
    // Relative deviation of a mean square over N values of kurtosis about 3.5: sqrt(2.5/N); four deviations.
    const double tolerance = 4 * std::sqrt(2.5 / (runs * 32 * 32 * 3)) * 1.3;
    CHECK(corrected == Approx(1.0 / n).epsilon(tolerance));
    CHECK(raw == Approx(1.0 / n + 1.0 / n_ref).epsilon(tolerance));
    CHECK(z2 / runs == Approx(1.0).margin(4 * std::sqrt(2.0 / runs)));

    FilmMoments brighter = simulate(32, 32, n, 1);
    for (double& s : brighter.sum) s *= 1.05;
    CHECK(compare_images(brighter, to_reference(simulate(32, 32, 1024, 2))).bias_z > 4);
}
