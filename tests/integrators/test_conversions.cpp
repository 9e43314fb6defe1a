// libs: ambilux_render ambilux_integrators ambilux_film ambilux_convert ambilux_formats ambilux_accel
// timeout: 300
// seconds: 12
// What is written reads the same: random small scenes, and their conversions, with the same random numbers.
#include <fmt/format.h>

#include <cstdlib>
#include <random>

#include "formats/convert/convert.h"
#include "formats/images/image_write.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/render_scene.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// Writes scenes of every plugin that the converter knows, with transforms that mirror every second time.
struct Generator {
    std::mt19937 random;

    int below(int n) { return int(random() % uint32_t(n)); }
    bool coin() { return below(2) == 1; }
    double number(double lower, double upper) { return lower + (upper - lower) * double(random()) / 4294967296.0; }
    std::string one_of(std::initializer_list<const char*> texts) { return texts.begin()[below(int(texts.size()))]; }

    static std::string value(const char* tag, const std::string& name, const std::string& text) {
        return fmt::format("<{} name='{}' value='{}'/>", tag, name, text);
    }
    std::string real(const std::string& name, double lower, double upper) {
        return value("float", name, fmt::format("{:.4f}", number(lower, upper)));
    }
    std::string flag(const std::string& name) {
        return coin() ? value("boolean", name, one_of({"true", "false"})) : "";
    }
    std::string rgb(const std::string& name, double lower, double upper) {
        return value(
            "rgb", name,
            fmt::format("{:.4f}, {:.4f}, {:.4f}", number(lower, upper), number(lower, upper), number(lower, upper)));
    }

    std::string texture(const std::string& name) {
        const std::string coordinates =
            coin() ? ""
                   : fmt::format(
                         "<transform name='to_uv'><scale x='{:.3f}' y='{:.3f}'/><rotate z='1' angle='{:.1f}'/>"
                         "<translate x='{:.3f}'/></transform>",
                         number(.5, 3), number(.5, 3), number(0, 90), number(0, 1));
        if (coin())
            return fmt::format("<texture type='checkerboard' name='{}'>{}{}{}</texture>", name, rgb("color0", .1, .4),
                               rgb("color1", .4, .9), coordinates);
        return fmt::format("<texture type='bitmap' name='{}'>{}{}{}{}{}</texture>", name,
                           value("string", "filename", one_of({"bytes.png", "floats.exr"})), flag("raw"),
                           value("string", "wrap_mode", one_of({"repeat", "mirror", "clamp"})),
                           value("string", "filter_type", one_of({"bilinear", "nearest"})), coordinates);
    }
    std::string color(const std::string& name) { return below(3) ? rgb(name, .1, .9) : texture(name); }
    std::string amount(const std::string& name, double lower, double upper) {
        return below(3) ? real(name, lower, upper) : texture(name);
    }

    std::string roughness() {
        const std::string both =
            value("string", "distribution", one_of({"ggx", "beckmann", "phong"})) + flag("sample_visible");
        return both + (coin() ? real("alpha", .1, .5) : amount("alpha_u", .1, .5) + real("alpha_v", .1, .5));
    }
    std::string index() { return real("int_ior", 1.2, 1.8) + (coin() ? real("ext_ior", 1, 1.1) : ""); }

    /// Of one side.
    std::string opaque() {
        switch (below(9)) {
            case 0: return "<bsdf type='diffuse'>" + color("reflectance") + "</bsdf>";
            case 1: return "<bsdf type='roughdiffuse'>" + color("reflectance") + amount("alpha", .1, .5) + "</bsdf>";
            case 2: return "<bsdf type='conductor'><string name='material' value='Au'/></bsdf>";
            case 3:
                return "<bsdf type='roughconductor'>" + rgb("eta", .2, 2) + rgb("k", 1, 4) + roughness() +
                       (coin() ? color("specular_reflectance") : "") + "</bsdf>";
            case 4:
                return "<bsdf type='plastic'>" + index() + color("diffuse_reflectance") + flag("nonlinear") + "</bsdf>";
            case 5:
                return "<bsdf type='roughplastic'>" + index() + color("diffuse_reflectance") + real("alpha", .1, .5) +
                       flag("nonlinear") + value("string", "distribution", one_of({"ggx", "beckmann", "phong"})) +
                       "</bsdf>";
            case 6:
                return "<bsdf type='phong'>" + rgb("diffuse_reflectance", 0, .4) + real("exponent", 5, 50) + "</bsdf>";
            case 7:
                return "<bsdf type='ward'>" + rgb("diffuse_reflectance", 0, .4) + real("alpha_u", .1, .4) +
                       value("string", "variant", one_of({"ward", "ward-duer", "balanced"})) + "</bsdf>";
            default:
                return "<bsdf type='principled'>" + color("base_color") + amount("roughness", .2, .9) +
                       amount("metallic", 0, 1) + real("specular", .1, .8) + real("anisotropic", 0, .8) +
                       amount("clearcoat", 0, 1) + real("clearcoat_gloss", 0, 1) + amount("sheen", 0, 1) +
                       amount("spec_tint", 0, 1) + real("flatness", 0, .8) + "</bsdf>";
        }
    }
    std::string bsdf() {
        switch (below(12)) {
            case 0: return "<bsdf type='twosided'>" + opaque() + (coin() ? opaque() : "") + "</bsdf>";
            case 1: return "<bsdf type='mask'>" + amount("opacity", .2, .9) + opaque() + "</bsdf>";
            case 2: return "<bsdf type='blendbsdf'>" + amount("weight", .2, .8) + opaque() + opaque() + "</bsdf>";
            case 3:
                return "<bsdf type='bumpmap'>" + texture("") + real("scale", .01, .1) + flag("flip_invalid_normals") +
                       flag("use_shadowing_function") + opaque() + "</bsdf>";
            case 4:
                return "<bsdf type='normalmap'><texture type='bitmap' name='normalmap'><string name='filename' "
                       "value='normals.png'/><boolean name='raw' value='true'/></texture>" +
                       opaque() + "</bsdf>";
            case 5: return "<bsdf type='" + one_of({"dielectric", "thindielectric"}) + "'>" + index() + "</bsdf>";
            case 6: return "<bsdf type='roughdielectric'>" + index() + roughness() + "</bsdf>";
            case 7: return "<bsdf type='difftrans'>" + color("transmittance") + "</bsdf>";
            case 8:
                return "<bsdf type='principledthin'>" + color("base_color") + real("roughness", .2, .9) +
                       real("spec_trans", 0, 1) + amount("diff_trans", 0, 2) + "</bsdf>";
            case 9:
                return "<bsdf type='" + one_of({"coating", "roughcoating"}) + "'>" + index() + rgb("sigma_a", 0, 1) +
                       "<bsdf type='diffuse'>" + color("reflectance") + "</bsdf></bsdf>";
            default: return opaque();
        }
    }

    std::string turn() {
        return fmt::format("<rotate x='{:.3f}' y='{:.3f}' z='{:.3f}' angle='{:.2f}'/>", number(-1, 1), number(-1, 1),
                           number(.1, 1), number(0, 360));
    }
    /// In front of the camera, mirrored every second time; scaled alike along all axes or not.
    std::string placed(bool alike, bool is_unit = false) {
        const double s = is_unit ? 1 : number(.3, .9);
        const double mirror = coin() ? -1 : 1;
        return fmt::format(
            "<transform name='to_world'><scale x='{:.4f}' y='{:.4f}' z='{:.4f}'/>{}<translate x='{:.3f}' "
            "y='{:.3f}' z='{:.3f}'/></transform>",
            s * mirror, s * (alike ? 1 : number(.5, 1.5)), s, turn(), number(-1.5, 1.5), number(-.5, 1.5),
            number(-1.5, 1));
    }
    std::string shape(bool shines) {
        const std::string type = one_of({"sphere", "disk", "cylinder", "rectangle", "cube", "obj", "ply"});
        const bool file = type == "obj" || type == "ply";
        std::string text = "<shape type='" + type + "'>";
        if (file) text += value("string", "filename", type == "obj" ? one_of({"smooth.obj", "flat.obj"}) : "mesh.ply");
        if (file) text += flag("face_normals") + flag("flip_tex_coords");
        text += placed(type == "sphere" || type == "cylinder") + flag("flip_normals") + bsdf();
        if (shines)
            text += "<emitter type='area'>" +
                    (type == "rectangle" && coin() ? texture("radiance") : rgb("radiance", 1, 5)) + "</emitter>";
        return text + "</shape>";
    }
    std::string light() {
        switch (below(6)) {
            case 0:
                return "<emitter type='point'><point name='position' x='1' y='3' z='2'/>" + rgb("intensity", 5, 20) +
                       "</emitter>";
            case 1:
                return "<emitter type='spot'>" + placed(true, coin()) + rgb("intensity", 5, 20) +
                       real("cutoff_angle", 30, 80) + (coin() ? texture("texture") : "") + "</emitter>";
            case 2:
                return "<emitter type='projector'>" + placed(true, coin()) + color("irradiance") +
                       real("fov", 30, 100) + "</emitter>";
            case 3: return "<emitter type='directional'><vector name='direction' x='.3' y='-1' z='-.4'/></emitter>";
            case 4: return "<emitter type='constant'>" + rgb("radiance", .2, 1) + "</emitter>";
            default:
                return "<emitter type='envmap'>" + value("string", "filename", one_of({"bytes.png", "floats.exr"})) +
                       real("scale", .5, 2) + placed(true, coin()) + "</emitter>";
        }
    }
    std::string sensor() {
        const std::string type = one_of({"perspective", "perspective", "thinlens", "orthographic", "spherical"});
        const double mirror = coin() ? -1 : 1;
        std::string text = "<sensor type='" + type + "'>" +
                           fmt::format(
                               "<transform name='to_world'><scale x='{}'/><lookat origin='0.3,1,4' target='0,0.5,0' "
                               "up='0,1,0'/></transform>",
                               type == "orthographic" ? 2 * mirror : mirror);
        if (type == "perspective" || type == "thinlens")
            text += real("fov", 40, 70) + value("string", "fov_axis", one_of({"x", "y", "smaller", "diagonal"})) +
                    real("principal_point_offset_x", -.1, .1);
        if (type == "thinlens") text += real("aperture_radius", .02, .1) + real("focus_distance", 3, 5);
        text += "<film type='hdrfilm'><integer name='width' value='14'/><integer name='height' value='10'/>";
        if (coin())
            text +=
                "<integer name='crop_offset_x' value='2'/><integer name='crop_width' value='9'/><integer "
                "name='crop_offset_y' value='1'/><integer name='crop_height' value='8'/>";
        text += "<rfilter type='" + one_of({"box", "tent", "gaussian"}) + "'/></film></sensor>";
        return text;
    }
    std::string scene() {
        std::string text = fmt::format("<integrator type='path'><integer name='max_depth' value='4'/>{}</integrator>",
                                       flag("hide_emitters")) +
                           sensor() +
                           "<shape type='rectangle'><transform name='to_world'><scale value='4'/><rotate x='1' "
                           "angle='-90'/><translate y='-1'/></transform>" +
                           bsdf() + "</shape>";
        text += light() + "<emitter type='point'><point name='position' x='-1' y='2' z='3'/></emitter>";
        for (int i = 0; i < 3; ++i) text += shape(below(3) == 0);
        if (coin())
            text += "<shape type='shapegroup' id='g'>" + shape(false) + shape(false) +
                    "</shape><shape type='instance'>" + placed(true) + "<ref id='g'/></shape><shape type='instance'>" +
                    placed(true) + "<ref id='g'/></shape>";
        return text;
    }
};

const std::string kCorners = "v -1 -1 0\nv 1 -1 0\nv 1 1 .2\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

void write_files(const TempFolder& folder) {
    folder.write("flat.obj", kCorners + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
    folder.write("smooth.obj",
                 kCorners + "vn .1 0 1\nvn -.1 .1 1\nvn 0 .2 1\nvn 0 0 1\nf 1/1/1 2/2/2 3/3/3\nf 1/1/1 3/3/3 4/4/4\n");
    folder.write(
        "mesh.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face "
        "2\nproperty list uchar int vertex_indices\nend_header\n-1 -1 0\n1 -1 .3\n1 1 0\n-1 1 0\n3 0 1 2\n3 0 2 3\n");
    std::vector<uint8_t> bytes, normals;
    std::vector<float> floats;
    for (int i = 0; i < 3 * 8 * 6; ++i)
        bytes.push_back(uint8_t(40 + 37 * i % 180)), floats.push_back(0.05f * float(1 + i % 17));
    for (int i = 0; i < 8 * 6; ++i)
        for (const int c : {110 + 40 * (i % 2), 128, 240}) normals.push_back(uint8_t(c));
    write_byte_image(folder / "bytes.png", 8, 6, bytes);
    write_byte_image(folder / "normals.png", 8, 6, normals);
    write_float_image(folder / "floats.exr", 8, 6, floats);
}

/// The two images differ by 2e-3 of their light at most, for the paths that rounding sends elsewhere; with other random
/// numbers they have the same mean.
void check_same(const FilmMoments& a, const FilmMoments& b, bool other_numbers) {
    double apart = 0, sum = 1e-6, drift = 0, variance = 0;
    for (size_t i = 0; i < a.sum.size(); ++i) {
        const double d = a.mean(i) - b.mean(i), ea = a.standard_error(i), eb = b.standard_error(i);
        apart += std::abs(d), drift += d, sum += a.mean(i), variance += 3 * (ea * ea + eb * eb);  // colours vary as one
    }
    if (other_numbers)
        CHECK(std::abs(drift) < 1e-3 * sum + 5 * std::sqrt(variance));
    else
        CHECK(apart < 2e-3 * sum);
}

}  // namespace

TEST_CASE("random scenes and their conversions have the same image") {
    const TempFolder folder;
    write_files(folder);
    // More of them: AMBILUX_SCENES_TO_CONVERT=3000 test_conversions.
    const char* more = std::getenv("AMBILUX_SCENES_TO_CONVERT");
    const int count = more ? std::atoi(more) : 60;
    int loaded = 0;
    for (int i = 0; i < count; ++i) {
        Generator generator{std::mt19937(uint32_t(i))};
        const std::string text = wrap(generator.scene(), i % 3 ? "3.0.0" : "0.6.0");
        const Scene before = [&] {
            try {
                return load_mitsuba(folder.write("scene.xml", text));
            } catch (const Error& e) {
                UNSCOPED_INFO(e.what());
                return Scene{};
            }
        }();
        if (before.shapes.empty()) continue;
        ++loaded;
        INFO("scene " << i << ": " << text);
        write_mitsuba(before, folder / "again.xml");
        const Scene after = load_mitsuba(folder / "again.xml");
        CHECK(after.warnings.empty());
        // Materials are chosen by a hash of coordinates, which are rounded once more.
        const bool blends = before.features.blends;
        const auto film = [&](const Scene& scene) {
            return render_scene(scene, cpu_settings(scene, Estimator::mis), blends ? 16 : 4).film;
        };
        check_same(film(before), film(after), blends);
    }
    CHECK(loaded > count / 2);
}

TEST_CASE("a sphere that its transform or its instance mirrors keeps its outside when it is converted") {
    const TempFolder folder;
    for (const char* flipped : {"false", "true"})
        for (const char* version : {"0.6.0", "3.0.0"}) {
            const std::string mirror = "<transform name='to_world'><scale x='-1'/></transform>",
                              side = std::string("<boolean name='flip_normals' value='") + flipped + "'/>";
            const Scene before = load("<shape type='sphere'>" + mirror + side +
                                          "</shape><shape type='shapegroup' id='g'><shape type='sphere'>" + side +
                                          "</shape><shape type='sphere'>" + mirror +
                                          "</shape></shape><shape type='instance'>" + mirror + "<ref id='g'/></shape>",
                                      {}, version);
            write_mitsuba(before, folder / "again.xml");
            const Scene after = load_mitsuba(folder / "again.xml");
            REQUIRE(after.quadrics.size() == 3);
            for (size_t i = 0; i < 3; ++i) CHECK(after.quadrics[i].flip == before.quadrics[i].flip);
        }
}
