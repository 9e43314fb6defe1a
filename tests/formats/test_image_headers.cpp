// libs: ambilux_formats OpenEXR::OpenEXR ZLIB::ZLIB JPEG::JPEG
// timeout: 60
// What image files say of themselves.
#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfOutputFile.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <zlib.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "formats/images/image_io.h"
#include "tests/support/catch.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;
using test::contains;

namespace {

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
    CHECK(contains(joined(layer), "unused channels: depth.Z"));
    const Texels both = read({{"R", c.x}, {"G", c.y}, {"B", c.z}, {"albedo.R", 1}, {"albedo.G", 1}, {"albedo.B", 1}});
    check_texels(both, c);
    CHECK(contains(joined(both), "unused channels: albedo.B, albedo.G, albedo.R"));
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

TEST_CASE("EXR: windows that differ, faces of a cube and names of colour spaces are told") {
    const Imf::Header cropped(Imath::Box2i({0, 0}, {99, 49}), Imath::Box2i({10, 20}, {11, 22}));
    const Texels image = read_image("x", exr_file(cropped, {{"R", 1}, {"G", 1}, {"B", 1}}));
    CHECK(image.width == 2);
    CHECK(image.height == 3);
    CHECK(contains(joined(image), "its data window, 2x3 at (10, 20); its display window is another: 100x50 at (0, 0)"));
    const auto of_space = [](const char* name) {
        Imf::Header header(2, 2);
        header.insert("oiio:ColorSpace", Imf::StringAttribute(name));
        return joined(read_image("x", exr_file(header, {{"R", 1}, {"G", 1}, {"B", 1}})));
    };
    CHECK(contains(of_space("ACEScg"), "its oiio:ColorSpace is ignored: ACEScg"));
    CHECK(of_space("lin_rec709_scene").empty());
    Imf::Header cube(2, 12);
    Imf::addEnvmap(cube, Imf::ENVMAP_CUBE);
    CHECK(contains(joined(read_image("x", exr_file(cube, {{"Y", 1}}))), "faces of a cube"));
}

namespace {

/// Two rows of three pixels, red 1 to 6 as they are stored.
std::string hdr_file(const std::string& header, const std::string& size) {
    std::string out = "#?RADIANCE\n" + header + "FORMAT=32-bit_rle_rgbe\n\n" + size + "\n";
    for (int i = 1; i <= 6; ++i) out += test::rgbe(float(i), 16, 8);
    return out;
}

std::string big_endian(uint32_t v) { return {char(v >> 24), char(v >> 16), char(v >> 8), char(v)}; }

/// A PNG with one more chunk behind its first one.
std::string png_with(const std::string& type, const std::string& data) {
    std::string png = png_bytes(1, 1, {10, 20, 30});
    const size_t srgb = png.find("sRGB");  // which counts before others
    if (srgb != std::string::npos) png.erase(srgb - 4, 13);
    const std::string body = type + data;
    const uint32_t crc = uint32_t(crc32(0, reinterpret_cast<const Bytef*>(body.data()), uInt(body.size())));
    return png.insert(8 + 12 + 13, big_endian(uint32_t(data.size())) + body + big_endian(crc));
}

std::string exif(char value) {
    return std::string("MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", 19) + std::string({value, 0, 0});
}

/// A JPEG with one more segment at its begin.
std::string jpeg_with(char marker, const std::string& data) {
    std::string jpeg = test::jpeg_file(8, 8, std::vector<uint8_t>(192, 100));
    const size_t size = data.size() + 2;
    return jpeg.insert(2, std::string({'\xff', marker, char(size >> 8), char(size)}) + data);
}

}  // namespace

TEST_CASE("HDR: rows and pixels go where the header says") {
    const auto reds = [](const std::string& size) {
        const Texels image = read_image("x", hdr_file("", size));
        std::vector<float> out = {float(image.width), float(image.height)};
        for (size_t i = 0; i < image.floats.size(); i += 4) out.push_back(image.floats[i]);
        return out;
    };
    using List = std::vector<float>;
    CHECK(reds("-Y 2 +X 3") == List{3, 2, 1, 2, 3, 4, 5, 6});
    CHECK(reds("+Y 2 +X 3") == List{3, 2, 4, 5, 6, 1, 2, 3});
    CHECK(reds("-Y 2 -X 3") == List{3, 2, 3, 2, 1, 6, 5, 4});
    CHECK(reds("+Y 2 -X 3") == List{3, 2, 6, 5, 4, 3, 2, 1});
    // Stored by columns.
    CHECK(reds("+X 2 -Y 3") == List{2, 3, 1, 4, 2, 5, 3, 6});
    CHECK(reds("+X 2 +Y 3") == List{2, 3, 3, 6, 2, 5, 1, 4});
    CHECK(reds("-X 2 -Y 3") == List{2, 3, 4, 1, 5, 2, 6, 3});
    CHECK(reds("-X 2 +Y 3") == List{2, 3, 6, 3, 5, 2, 4, 1});
    for (const char* size : {"-Y 2 +Y 3", "2 3", "-Y", "-Y 2", "-Z 2 +X 3", "-Y 99999999999999999999 +X 3", ""})
        CHECK(contains(error_of([&] { reds(size); }), "its size"));
}

TEST_CASE("HDR: values are those before exposure and colour correction; other colours are told") {
    const auto read = [](const std::string& header) { return read_image("x", hdr_file(header, "-Y 2 +X 3")); };
    const Texels image = read("EXPOSURE=2\nSOFTWARE=none\nEXPOSURE= 4.0\nCOLORCORR= 1 2 0.5\r\n");
    CHECK(image.floats[0] == 1.0f / 8);
    CHECK(image.floats[1] == 1);
    CHECK(image.floats[2] == 2);
    CHECK(contains(joined(image), "divided as its header says: EXPOSURE=2\n"));
    CHECK(contains(joined(image), "COLORCORR= 1 2 0.5"));
    CHECK(joined(read("EXPOSURE=1.0000\nGAMMA=1\n")).empty());
    CHECK(contains(joined(read("GAMMA=2.2\n")), "ignored in its header: GAMMA=2.2"));
    CHECK(contains(joined(read("PRIMARIES= 0.7 0.3 0.2 0.7 0.1 0.1 0.33 0.33\n")), "PRIMARIES= 0.7"));
    for (const char* bad : {"EXPOSURE=0\n", "EXPOSURE=x\n", "EXPOSURE=nan\n", "EXPOSURE=\n", "COLORCORR=1 -1 1\n"})
        CHECK(contains(error_of([&] { read(bad); }), "cannot read HDR image: '"));
}

TEST_CASE("PNG, JPEG and BMP: colours and orientation that nobody follows are told") {
    const auto notes = [](const std::string& file) { return joined(read_image("x", file)); };
    CHECK(notes(png_bytes(1, 1, {1, 2, 3})).empty());
    CHECK(notes(png_with("gAMA", big_endian(45455))).empty());
    CHECK(contains(notes(png_with("gAMA", big_endian(100000))), "gAMA is ignored: 1.0"));
    std::string primaries;
    for (const uint32_t v : {31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000}) primaries += big_endian(v);
    CHECK(contains(notes(png_with("cHRM", primaries)), "cHRM"));
    CHECK(contains(notes(png_with("eXIf", exif(6))), "EXIF orientation is ignored: 6"));
    CHECK(notes(png_with("eXIf", exif(1))).empty());
    CHECK(read_image("x", png_with("gAMA", big_endian(100000))).bytes[1] == 20);

    const std::string head("Exif\0\0", 6);
    CHECK(contains(notes(jpeg_with('\xe1', head + exif(8))), "EXIF orientation is ignored: 8"));
    CHECK(notes(jpeg_with('\xe1', head + exif(1))).empty());
    CHECK(notes(jpeg_with('\xe1', "Exif")).empty());
    CHECK(notes(jpeg_with('\xe1', head + exif(8).substr(0, 12))).empty());
    const std::string icc("ICC_PROFILE\0\x01\x01", 14);
    CHECK(contains(notes(jpeg_with('\xe2', icc + "Adobe RGB (1998)")), "colour profile"));
    CHECK(notes(jpeg_with('\xe2', icc + "sRGB IEC61966-2.1")).empty());
}

TEST_CASE("notes of an image reach the scene once, whatever asks for it") {
    const test::TempFolder folder;
    const std::string path = folder.write("a.png", png_with("gAMA", big_endian(100000)));
    folder.write("b.hdr", hdr_file("EXPOSURE=2\n", "-Y 2 +X 3"));
    const auto count = [&](const Scene& s, const std::string& name) {
        return std::count_if(s.notes.begin(), s.notes.end(), [&](const std::string& note) {
            return note.starts_with((folder.path / name).string() + ": ");
        });
    };
    const std::string bitmap = "<string name='filename' value='a.png'/></texture></bsdf></shape>",
                      diffuse =
                          "<shape type='rectangle'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'>";
    const Scene s = test::load(diffuse + bitmap + diffuse + "<boolean name='raw' value='true'/>" + bitmap +
                                   "<emitter type='envmap'><string name='filename' value='b.hdr'/></emitter>",
                               {}, "3.0.0", &folder);
    CHECK(count(s, "a.png") == 1);
    CHECK(count(s, "b.hdr") == 1);
    const Scene p = test::load_pbrt_world(
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\"\n"
        "Texture \"f\" \"float\" \"imagemap\" \"string filename\" \"a.png\"\n"
        "Material \"coateddiffuse\" \"texture reflectance\" \"t\" \"texture roughness\" \"f\"\n" +
            test::kUnitTriangle,
        {}, &folder);
    CHECK(count(p, "a.png") == 1);
    const Scene field =
        test::load("<shape type='heightfield'><string name='filename' value='b.hdr'/></shape>", {}, "0.6.0", &folder);
    CHECK(count(field, "b.hdr") == 1);
}
