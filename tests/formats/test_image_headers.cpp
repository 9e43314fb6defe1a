// libs: ambilux_formats OpenEXR::OpenEXR
// timeout: 60
// What image files say of themselves.
#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfOutputFile.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "formats/images/image_io.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;

namespace {

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::string joined(const Texels& image) {
    std::string out;
    for (const std::string& note : image.notes) out += note + "\n";
    return out;
}

template <class F>
std::string error_of(const F& f) {
    try {
        f();
    } catch (const Error& e) {
        return e.what();
    }
    return "";
}

/// A file of floats, each channel of one value.
std::string exr_file(Imf::Header header, const std::vector<std::pair<std::string, float>>& channels) {
    const test::TempFolder folder;
    const std::string path = (folder.path / "made.exr").string();
    const Imath::Box2i& w = header.dataWindow();
    const size_t count = size_t(w.max.x - w.min.x + 1) * size_t(w.max.y - w.min.y + 1);
    std::vector<std::vector<float>> planes;
    Imf::FrameBuffer buffer;
    for (const auto& [name, value] : channels) {
        header.channels().insert(name, Imf::Channel(Imf::FLOAT));
        planes.emplace_back(count, value);
    }
    for (size_t i = 0; i < channels.size(); ++i)
        buffer.insert(channels[i].first, Imf::Slice::Make(Imf::FLOAT, planes[i].data(), w));
    {
        Imf::OutputFile file(path.c_str(), header);
        file.setFrameBuffer(buffer);
        file.writePixels(w.max.y - w.min.y + 1);
    }
    return read_file(path);
}

void check_texels(const Texels& image, Rgb expected, float alpha = 1, double margin = 1e-5) {
    REQUIRE(!image.floats.empty());
    for (size_t i = 0; i < image.floats.size(); i += 4) {
        for (int c = 0; c < 3; ++c) CHECK(image.floats[i + size_t(c)] == Approx(expected[c]).margin(margin));
        CHECK(image.floats[i + 3] == alpha);
    }
}

const Imf::Chromaticities kAces({0.7347f, 0.2653f}, {0.0f, 1.0f}, {0.0001f, -0.0770f}, {0.32168f, 0.33767f}),
    kXyz({1, 0}, {0, 1}, {0, 0}, {1 / 3.0f, 1 / 3.0f}),
    kRec2020({0.708f, 0.292f}, {0.170f, 0.797f}, {0.131f, 0.046f}, {0.3127f, 0.3290f});

}  // namespace

TEST_CASE("EXR: colours of other primaries become linear Rec.709 by a plain matrix") {
    const auto of = [](const Imf::Chromaticities& primaries, Rgb c) {
        Imf::Header header(3, 2);
        Imf::addChromaticities(header, primaries);
        return read_image("x", exr_file(header, {{"R", c.x}, {"G", c.y}, {"B", c.z}}));
    };
    // ITU-R BT.2407: Rec.2020 to Rec.709.
    check_texels(of(kRec2020, {0.5f, 0.4f, 0.2f}),
                 {1.6605f * 0.5f - 0.5876f * 0.4f - 0.0728f * 0.2f, -0.1246f * 0.5f + 1.1329f * 0.4f - 0.0083f * 0.2f,
                  -0.0182f * 0.5f - 0.1006f * 0.4f + 1.1187f * 0.2f},
                 1, 2e-4);
    // XYZ of white is what the white of Rec.709 has.
    check_texels(of(kXyz, {0.95046f, 1, 1.08906f}), {1, 1, 1}, 1, 1e-3);
    // Without adaptation: the white of ACES is not ours.
    const Texels white = of(kAces, {1, 1, 1});
    CHECK(white.floats[0] > 1.02f);
    CHECK(white.floats[2] < 0.95f);
    CHECK(joined(white).empty());
    const Texels ours = of(Imf::Chromaticities(), {0.1f, 0.2f, 0.3f});
    CHECK(ours.floats[0] == 0.1f);
    CHECK(joined(ours).empty());
    // Green of Rec.2020 is no colour of Rec.709.
    const Texels green = of(kRec2020, {0, 1, 0});
    check_texels(green, {0, 1.1329f, 0}, 1, 2e-4);
    CHECK(contains(joined(green), "colours of 6 texels lie outside of Rec.709"));
    CHECK(contains(error_of([&] { of(Imf::Chromaticities({0, 0}, {0, 0}, {0, 0}, {0, 0}), {1, 1, 1}); }),
                   "chromaticities"));
}

TEST_CASE("EXR: channels of any spelling, and of one layer, are colours") {
    const auto read = [](const std::vector<std::pair<std::string, float>>& channels) {
        return read_image("x", exr_file(Imf::Header(2, 2), channels));
    };
    const Rgb c{0.2f, 0.4f, 0.8f};
    check_texels(read({{"r", c.x}, {"g", c.y}, {"b", c.z}, {"a", 0.25f}}), c, 0.25f);
    check_texels(read({{"Red", c.x}, {"Green", c.y}, {"Blue", c.z}}), c);
    check_texels(read({{"X", 0.95046f}, {"Y", 1}, {"Z", 1.08906f}}), {1, 1, 1}, 1, 1e-3);
    check_texels(read({{"y", 0.5f}}), splat(0.5f));
    const Texels layer = read({{"beauty.R", c.x}, {"beauty.G", c.y}, {"beauty.B", c.z}, {"depth.Z", 7}});
    check_texels(layer, c);
    CHECK(contains(joined(layer), "layer 'beauty'"));
    CHECK(contains(joined(layer), "not used: depth.Z"));
    const Texels both = read({{"R", c.x}, {"G", c.y}, {"B", c.z}, {"albedo.R", 1}, {"albedo.G", 1}, {"albedo.B", 1}});
    check_texels(both, c);
    CHECK(contains(joined(both), "not used: albedo.B, albedo.G, albedo.R"));
    const Texels height = read({{"height", 0.3f}});
    check_texels(height, splat(0.3f));
    CHECK(contains(joined(height), "'height' is taken as grey"));
}

TEST_CASE("EXR: a refusal names the channels of the file") {
    const auto error = [](const std::vector<std::pair<std::string, float>>& channels) {
        return error_of([&] { read_image("x", exr_file(Imf::Header(2, 2), channels)); });
    };
    CHECK(contains(error({{"normal.u", 1}, {"normal.v", 1}}), "its channels are normal.u, normal.v"));
    CHECK(contains(error({{"R", 1}, {"G", 1}}), "its channels are G, R"));
    CHECK(contains(error({{"a.Y", 1}, {"b.Y", 1}}), "several layers; its channels are a.Y, b.Y"));
}

TEST_CASE("EXR: luminance and chroma are colours in the primaries of the file") {
    const test::TempFolder folder;
    const std::string path = (folder.path / "made.exr").string();
    const auto write = [&](const Imf::Chromaticities& primaries, Imf::RgbaChannels channels) {
        Imf::Header header(8, 6);
        Imf::addChromaticities(header, primaries);
        const std::vector<Imf::Rgba> pixels(48, Imf::Rgba(0.5f, 0.25f, 0.125f, 0.5f));
        Imf::RgbaOutputFile file(path.c_str(), header, channels);
        file.setFrameBuffer(pixels.data(), 1, 8);
        file.writePixels(6);
    };
    write(Imf::Chromaticities(), Imf::WRITE_YCA);
    check_texels(read_image(path, read_file(path)), {0.5f, 0.25f, 0.125f}, 0.5f, 5e-3);
    write(kRec2020, Imf::WRITE_YC);
    check_texels(
        read_image(path, read_file(path)),
        {1.6605f * 0.5f - 0.5876f * 0.25f - 0.0728f * 0.125f, -0.1246f * 0.5f + 1.1329f * 0.25f - 0.0083f * 0.125f,
         -0.0182f * 0.5f - 0.1006f * 0.25f + 1.1187f * 0.125f},
        1, 6e-3);
    write(kRec2020, Imf::WRITE_Y);
    const Texels grey = read_image(path, read_file(path));
    CHECK(grey.floats[0] == grey.floats[1]);
}

TEST_CASE("EXR: windows that differ, and faces of a cube, are told") {
    const Imf::Header cropped(Imath::Box2i({0, 0}, {99, 49}), Imath::Box2i({10, 20}, {11, 22}));
    const Texels image = read_image("x", exr_file(cropped, {{"R", 1}, {"G", 1}, {"B", 1}}));
    CHECK(image.width == 2);
    CHECK(image.height == 3);
    CHECK(
        contains(joined(image), "its data window, 2x3 at (10, 20), whatever its display window is: 100x50 at (0, 0)"));
    Imf::Header cube(2, 12);
    Imf::addEnvmap(cube, Imf::ENVMAP_CUBE);
    CHECK(contains(joined(read_image("x", exr_file(cube, {{"Y", 1}}))), "faces of a cube"));
}
