// libs: ambilux_formats ambilux_accel
// seconds: 8
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>

#include "accel/shared_accels.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "formats/edits.h"
#include "formats/images/image_io.h"
#include "formats/meshes/mesh.h"
#include "tests/support/catch.h"
#include "tests/support/scene_contents.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

struct Loaded {
    Scene scene;
    Editable editable;
};

Loaded load(const std::string& path, std::vector<Edit> edits = {}) {
    Loaded out;
    LoadOptions options;
    options.edits = std::move(edits);
    options.editable = &out.editable;
    out.scene = load_scene_file(path, options);
    return out;
}

Loaded edit(const Loaded& from, const std::vector<Edit>& edits) {
    Loaded out;
    LoadOptions options;
    options.edits = edits;
    options.editable = &out.editable;
    out.scene = edited_scene(from.scene.path, from.editable, options);
    return out;
}

std::string of_project(const std::string& name) { return std::string(AMBILUX_SOURCE_DIR) + "/scenes/" + name + ".xml"; }

/// The message of what goes wrong; empty if nothing does.
std::string message_of(const Loaded& from, const Edit& change) {
    try {
        edit(from, {change});
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "";
}

/// Whether the scene is the one that its file has, once it is written.
bool equals_its_file(const Loaded& loaded, const TempFolder& folder) {
    const std::string path = folder / "edited.xml";
    write_scene(loaded.editable, path);
    return contents(loaded.scene) == contents(load(path).scene);
}

using Random = std::mt19937;

double factor(Random& random) { return std::uniform_real_distribution<>(0.6, 1.4)(random); }

/// Another value of the same kind, as text; empty if there is none.
std::string other_value(const nlohmann::json& parameter, Random& random) {
    const std::string kind = parameter["kind"];
    const nlohmann::json& value = parameter["value"];
    if (kind == "boolean") return value.get<bool>() ? "false" : "true";
    if (kind == "integer") return std::to_string(int64_t(value.get<double>() * factor(random)) + 1);
    if (kind == "number" || (kind == "spectrum" && value.is_number()))
        return fmt::format("{}", value.get<double>() * factor(random));
    if (kind == "rgb" || kind == "vector")
        return fmt::format("{} {} {}", value[0].get<double>() * factor(random), value[1].get<double>() * factor(random),
                           value[2].get<double>() * factor(random));
    if (kind != "transform") return "";
    std::string text;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            text += fmt::format("{} ", value[i][j].get<double>() + (j == 3 && i < 3 ? 0.1 * factor(random) : 0));
    return text;
}

}  // namespace

TEST_CASE("random sequences of edits are the file that is written with their result") {
    const TempFolder folder;
    for (const char* name : {"cornell", "materials", "textured", "lights"}) {
        Random random(7);
        Loaded now = load(of_project(name));
        int done = 0, refused = 0;
        for (int step = 0; step < 8; ++step) {
            const nlohmann::json all = scene_parameters(now.editable);
            std::vector<Edit> changes;
            for (int k = 0; k < 1 + step % 3; ++k) {
                const nlohmann::json& parameter = all[random() % all.size()];
                if (!parameter.contains("value")) continue;
                const std::string value = other_value(parameter, random), key = parameter["name"];
                if (!value.empty() && key.find("film") == std::string::npos) changes.push_back({key, value, {}, {}});
            }
            INFO(name << " step " << step
                      << (changes.empty() ? "" : ": " + changes.back().name + "=" + changes.back().text));
            try {
                now = edit(now, changes);
                ++done;
            } catch (const Error&) {
                ++refused;
                continue;
            }
            if (step % 4 == 3) REQUIRE(equals_its_file(now, folder));
        }
        INFO(name << ": " << done << " done, " << refused << " refused");
        CHECK(done >= 3);
        CHECK(equals_its_file(now, folder));
    }
}

TEST_CASE("every parameter of a scene, changed alone, is the file written so") {
    const TempFolder folder;
    Random random(3);
    const Loaded first = load(of_project("materials"));
    int done = 0, at = 0;
    for (const nlohmann::json& parameter : scene_parameters(first.editable)) {
        if (!parameter.contains("value") || ++at % 5 != 0) continue;
        const std::string value = other_value(parameter, random), name = parameter["name"];
        if (value.empty() || name.find("film") != std::string::npos) continue;
        INFO(name << "=" << value);
        try {
            const Loaded other = edit(first, {{name, value, {}, {}}});
            CHECK(equals_its_file(other, folder));
            ++done;
        } catch (const Error&) {}
    }
    CHECK(done > 10);
}

TEST_CASE("an edit shares what it leaves as it is") {
    const Loaded first = load(of_project("textured"));
    const nlohmann::json all = scene_parameters(first.editable);
    const Loaded moved = edit(first, {{"sensor.fov", "31", {}, {}}});
    CHECK(same_array(first.scene.vertices, moved.scene.vertices));
    CHECK(same_array(first.scene.texels, moved.scene.texels));
    CHECK(same_array(first.scene.tables, moved.scene.tables));
    CHECK(same_structure(first.scene, moved.scene));
    CHECK(moved.scene.sensor.tan_half_fov.x != first.scene.sensor.tan_half_fov.x);
    CHECK(moved.scene.content_hash != first.scene.content_hash);
    CHECK(edit(first, {{"sensor.fov", "31", {}, {}}}).scene.content_hash == moved.scene.content_hash);
}

TEST_CASE(
    "an edit of an environment's scale, or of a table of a BSDF, leaves the density of the environment where it is") {
    const TempFolder folder;
    const Loaded first = load(of_project("materials"));
    for (const nlohmann::json& parameter : scene_parameters(first.editable)) {
        const std::string name = parameter["name"];
        const bool scale = name.ends_with(".scale"), alpha = name.ends_with(".alpha");
        if (!scale && !alpha) continue;
        INFO(name);
        const Loaded other = edit(first, {{name, "0.37", {}, {}}});
        CHECK(contents(other.scene) != contents(first.scene));
        CHECK(same_array(first.scene.environment_rows, other.scene.environment_rows));
        CHECK(same_array(first.scene.environment_cells, other.scene.environment_cells));
        CHECK(equals_its_file(other, folder));
    }
}

TEST_CASE("a shape that moves gives the scene another structure and the same textures") {
    const Loaded first = load(of_project("cornell"));
    const Loaded moved = edit(first, {{"floor.to_world", "1 0 0 0 0 1 0 0.1 0 0 1 0 0 0 0 1", {}, {}}});
    CHECK_FALSE(same_structure(first.scene, moved.scene));
    CHECK(contents(moved.scene) != contents(first.scene));
    const Loaded hidden = edit(first, {{"red",
                                        "<bsdf type='mask'><float name='opacity' value='0.5'/>"
                                        "<bsdf type='diffuse'/></bsdf>",
                                        {},
                                        {}}});
    CHECK(same_array(first.scene.triangles, hidden.scene.triangles));
    CHECK_FALSE(same_structure(first.scene, hidden.scene));
}

TEST_CASE("edits on the way into a scene are those of a loaded one") {
    const Edit change{"red.reflectance", "0.1 0.2 0.3", {}, {}};
    const Loaded at_once = load(of_project("cornell"), {change}), later = edit(load(of_project("cornell")), {change});
    CHECK(contents(at_once.scene) == contents(later.scene));
    CHECK(at_once.scene.content_hash == later.scene.content_hash);
    CHECK(contents(at_once.scene) != contents(load(of_project("cornell")).scene));
}

TEST_CASE("meshes and images from arrays are those of files that hold them") {
    const TempFolder folder;
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0.5f}};
    mesh.faces = {{0, 1, 2}, {1, 3, 2}};
    mesh.uvs = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
    Texels image;
    image.width = 2, image.height = 2, image.is_linear = true;
    image.floats = {0.1f, 0.2f, 0.3f, 1, 0.5f, 0.5f, 0.5f, 1, 0.9f, 0.1f, 0.1f, 1, 0, 0, 0, 1};
    const auto shared_mesh = std::make_shared<const Mesh>(mesh);
    const auto shared_image = std::make_shared<const Texels>(image);
    const Loaded first = load(of_project("cornell"));
    const Loaded other = edit(first, {{"leaf", "<shape type='ply'><ref id='red'/></shape>", {}, {}},
                                      {"leaf", "", shared_mesh, {}},
                                      {"red.reflectance", "<texture type='bitmap'/>", {}, {}},
                                      {"red.reflectance", "", {}, shared_image},
                                      {"sky", "<emitter type='envmap'/>", {}, {}},
                                      {"sky", "", {}, shared_image}});
    CHECK(other.scene.triangles.size() == first.scene.triangles.size() + 2);
    CHECK(other.scene.environment != kNone);
    CHECK(equals_its_file(other, folder));
    CHECK(mesh_of(other.editable, "leaf").positions.size() == 4);
    CHECK(image_of(other.editable, "sky").floats == image.floats);
    // Another edit keeps them.
    CHECK(equals_its_file(edit(other, {{"sky.scale", "2", {}, {}}}), folder));
}

TEST_CASE("an object or a value that is taken away leaves what holds without it") {
    const Loaded first = load(of_project("cornell"));
    CHECK(edit(first, {{"red.reflectance", "", {}, {}}}).scene.bsdfs.size() == first.scene.bsdfs.size());
    const std::string message = message_of(first, {"red", "", {}, {}});
    CHECK(message.empty());
}

TEST_CASE("edits that mean nothing are refused by name, with what may be meant") {
    const Loaded first = load(of_project("cornell"));
    const auto says = [&](const Edit& change, const std::string& text) {
        const std::string message = message_of(first, change);
        INFO(message);
        CHECK(message.find(text) != std::string::npos);
        CHECK(message.starts_with(change.name + ": "));
    };
    says({"redd.reflectance", "1", {}, {}}, "is 'red.reflectance' meant?");
    says({"red.albedo", "1", {}, {}}, "'reflectance' is known");
    says({"red.reflectance", "2", {}, {}}, "larger than 1");
    says({"red.reflectance", "a b", {}, {}}, "'a' is not a number");
    says({"sensor.fov", "190", {}, {}}, "between 0 and 180 degrees");
    says({"floor", "", std::make_shared<const Mesh>(), {}}, "no arrays of vertices");
    says({"floor.to_world", "1 2 3", {}, {}}, "needs 16 or 9 numbers");
}

TEST_CASE("files of the older generation are edited and written as such") {
    const TempFolder folder;
    const std::string path = folder / "old.xml";
    write_file_atomic(path, R"(<scene version="0.6.0">
        <sensor type="perspective"><float name="fov" value="40"/>
            <transform name="toWorld"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
            <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
        <bsdf type="roughplastic" id="mat"><float name="alpha" value="0.2"/><float name="intIOR" value="1.4"/></bsdf>
        <shape type="sphere"><ref id="mat"/></shape>
        <emitter type="constant"><spectrum name="radiance" value="0.7"/></emitter></scene>)");
    const Loaded first = load(path);
    CHECK(equals_its_file(first, folder));
    const Loaded other = edit(first, {{"mat.alpha", "0.4", {}, {}}, {"emitter.radiance", "0.9", {}, {}}});
    CHECK(equals_its_file(other, folder));
    CHECK(message_of(first, {"mat.albedo", "1", {}, {}}).starts_with("mat.albedo: "));
}
