// Scenes: from files and texts, changed, and as files again.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <cstring>

#include "formats/images/image_io.h"
#include "formats/meshes/mesh.h"
#include "python/src/bindings.h"
#include "python/src/loaded_scene.h"
#include "scene/info.h"
#include "session/statistics.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace ambilux {
namespace {

template <class T, int Columns>
using Rows = nb::ndarray<const T, nb::shape<-1, Columns>, nb::c_contig, nb::device::cpu>;
template <class T>
using TexelsIn = nb::ndarray<const T, nb::shape<-1, -1, 4>, nb::c_contig, nb::device::cpu>;
using Size = std::pair<uint32_t, uint32_t>;

template <class To>
std::vector<To> copied(const auto& rows) {
    std::vector<To> out(rows.shape(0));
    if (!out.empty()) memcpy(out.data(), rows.data(), out.size() * sizeof(To));
    return out;
}

Edit mesh_edit(const std::string& name, const Rows<double, 3>& positions, const Rows<uint32_t, 3>& faces,
               std::optional<Rows<float, 3>> normals, std::optional<Rows<float, 2>> uvs) {
    Mesh mesh;
    set_positions(mesh, copied<std::array<double, 3>>(positions));
    mesh.faces = copied<std::array<uint32_t, 3>>(faces);
    if (normals) mesh.normals = copied<Vec3f>(*normals);
    if (uvs) mesh.uvs = copied<Vec2f>(*uvs);
    check_mesh(name, mesh);
    return {name, "", std::make_shared<const Mesh>(std::move(mesh)), nullptr};
}

template <class T>
Edit image_edit(const std::string& name, const TexelsIn<T>& texels) {
    Texels image;
    image.height = uint32_t(texels.shape(0)), image.width = uint32_t(texels.shape(1));
    image.is_8bit = sizeof(T) == 1;
    image.is_linear = !image.is_8bit;
    if constexpr (sizeof(T) == 1)
        image.bytes.assign(texels.data(), texels.data() + texels.size());
    else
        image.floats.assign(texels.data(), texels.data() + texels.size());
    return {name, "", nullptr, std::make_shared<const Texels>(std::move(image))};
}

nb::dict mesh_arrays(const LoadedScene& scene, const std::string& name) {
    const Mesh mesh = mesh_of(scene.editable, name);
    nb::dict out;
    out["vertex_positions"] = array_of<float>(mesh.positions, {mesh.positions.size(), 3});
    out["vertex_normals"] = array_of<float>(mesh.normals, {mesh.normals.size(), 3});
    out["vertex_texcoords"] = array_of<float>(mesh.uvs, {mesh.uvs.size(), 2});
    out["faces"] = array_of<uint32_t>(mesh.faces, {mesh.faces.size(), 3});
    out["origin"] = nb::make_tuple(mesh.origin[0], mesh.origin[1], mesh.origin[2]);
    return out;
}

/// RGBA, and how it is stored.
nb::tuple image_arrays(const LoadedScene& scene, const std::string& name) {
    const Texels image = image_of(scene.editable, name);
    const std::vector<size_t> shape = {image.height, image.width, 4};
    if (image.is_8bit) return nb::make_tuple(array_of<uint8_t>(image.bytes, shape), image.is_linear);
    return nb::make_tuple(array_of<float>(image.floats, shape), image.is_linear);
}

/// Makes the scene of `loaded` on another thread, and keeps what edits of it start from.
void make(LoadedScene& loaded, std::vector<Edit> edits, const std::function<Scene(const LoadOptions&)>& scene_of) {
    LoadOptions options = loaded.options;
    options.edits = std::move(edits);
    options.files = &loaded.files;
    options.editable = &loaded.editable;
    options.times = &loaded.times;
    run_unlocked([&](const volatile bool*) {
        const auto start = std::chrono::steady_clock::now();
        loaded.scene = scene_of(options);
        loaded.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    });
}

/// `text`, if given, is what a file at `path` would hold.
SharedScene load(const std::string& path, std::optional<std::string> text, const Assignments& parameters, Size size,
                 bool lenient, bool uniform_picking, const std::vector<std::string>& limits, std::vector<Edit> edits) {
    auto loaded = std::make_shared<LoadedScene>();
    LoadOptions& options = loaded->options;
    options.parameters = parameters;
    options.width = size.first;
    options.height = size.second;
    options.lenient = lenient;
    options.light_picking = uniform_picking ? LightPicking::uniform : LightPicking::power;
    for (const std::string& limit : limits) set_limit(options.limits, limit);
    make(*loaded, std::move(edits),
         [&](const LoadOptions& o) { return text ? load_mitsuba_text(*text, path, o) : load_scene_file(path, o); });
    return loaded;
}

SharedScene edited(const SharedScene& from, std::vector<Edit> edits, Size size) {
    auto loaded = std::make_shared<LoadedScene>();
    loaded->options = from->options;
    if (size.first) loaded->options.width = size.first, loaded->options.height = size.second;
    make(*loaded, std::move(edits),
         [&](const LoadOptions& o) { return edited_scene(from->scene.path, from->editable, o); });
    if (same_structure(from->scene, loaded->scene)) loaded->structures = from->structures;
    return loaded;
}

/// Bytes of the arrays that both have in the same memory.
uint64_t shared_bytes(const LoadedScene& a, const LoadedScene& b) {
    const auto shared = [](const auto& x, const auto& y) { return same_array(x, y) ? x.size() * sizeof x[0] : 0; };
    const Scene &s = a.scene, &t = b.scene;
    return shared(s.vertices, t.vertices) + shared(s.triangles, t.triangles) + shared(s.quadrics, t.quadrics) +
           shared(s.instances, t.instances) + shared(s.texels, t.texels) + shared(s.tables, t.tables) +
           shared(s.environment_cells, t.environment_cells);
}

}  // namespace

void bind_scenes(nb::module_& m) {
    nb::class_<Edit>(m, "Edit", "A change of a scene by name.")
        .def("__init__",
             [](Edit* e, const std::string& name, const std::string& text) { new (e) Edit{name, text, {}, {}}; })
        .def_static("mesh", &mesh_edit, "name"_a, "positions"_a, "faces"_a, "normals"_a.none(), "uvs"_a.none())
        .def_static("floats", &image_edit<float>, "name"_a, "texels"_a)
        .def_static("bytes", &image_edit<uint8_t>, "name"_a, "texels"_a);
    nb::class_<LoadedScene>(m, "Scene")
        .def_prop_ro("path", [](const LoadedScene& s) { return s.scene.path; })
        .def_prop_ro(
            "size",
            [](const LoadedScene& s) { return std::pair(s.scene.sensor.crop_width, s.scene.sensor.crop_height); })
        .def_prop_ro("warnings", [](const LoadedScene& s) { return s.scene.warnings; })
        .def_prop_ro("notes", [](const LoadedScene& s) { return s.scene.notes; })
        .def_prop_ro("hash", [](const LoadedScene& s) { return scene_hash(s.scene); })
        .def_ro("seconds", &LoadedScene::seconds)
        .def("info", [](const LoadedScene& s) { return json_text(scene_info(s.scene)); })
        .def("parameters", [](const LoadedScene& s) { return json_text(scene_parameters(s.editable)); })
        .def("mesh", &mesh_arrays, "object"_a)
        .def("image", &image_arrays, "object"_a)
        .def("edited", &edited, "edits"_a, "size"_a)
        .def("shared_bytes", &shared_bytes, "other"_a)
        .def("shares_structure",
             [](const LoadedScene& a, const LoadedScene& b) { return a.structures == b.structures; })
        .def("text", [](const LoadedScene& s, const std::string& path) { return scene_text(s.editable, path); })
        .def("write", [](const LoadedScene& s, const std::string& path) { write_scene(s.editable, path); });
    m.def("load", &load, "path"_a, "text"_a.none(), "parameters"_a, "size"_a, "lenient"_a, "uniform_picking"_a,
          "limits"_a, "edits"_a = std::vector<Edit>());
}

}  // namespace ambilux
