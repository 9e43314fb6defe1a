#include <algorithm>

#include "core/error.h"
#include "core/scoped_seconds.h"
#include "formats/document/builder.h"
#include "formats/document/origin.h"
#include "formats/document/transform.h"

namespace ambilux {

namespace {

using namespace document;

/// Fingerprint of all inputs: what the files hold, not where they lie.
std::array<uint8_t, 32> content_hash(const Builder& builder) {
    Sha256 hash;
    const auto add = [&](const std::string& text) {
        hash.update(std::to_string(text.size()) + ":");
        hash.update(text);
    };
    for (const auto& [path, text] : builder.document.files) add(*text);
    for (const auto& [path, digest] : builder.file_digests) hash.update(digest.data(), digest.size());
    const LoadOptions& o = builder.options;
    add(std::to_string(o.width) + " " + std::to_string(o.height) + " " + std::to_string(o.lenient) + " " +
        std::to_string(o.light_picking == LightPicking::uniform));
    for (const auto& [name, value] : o.parameters) {
        add(name);
        add(value);
    }
    for (const auto& [name, value] : builder.document.edits) {
        add(name);
        add(value);
    }
    return hash.digest();
}

/// Looks at what no shape uses, so that mistakes there are found too.
void validate_unused(Builder& builder) {
    builder.validate_only = true;
    for (const Child& child : builder.document.scene->children) {
        if (child.object->tag == "bsdf") build_material(builder, *child.object);
        if (child.object->tag == "texture") load_scaled_texture(builder, *child.object, TextureUse::light);
    }
    builder.validate_only = false;
}

/// Emitters of shapes that stand elsewhere; it may be beside them.
std::set<const Object*> referenced_emitters(const Document& document) {
    std::set<const Object*> emitters;
    for (const Child& shape : document.scene->children) {
        if (shape.object->tag != "shape") continue;
        for (const Child& child : shape.object->children)
            if (child.object->tag == "emitter" && !child.object->id.empty()) emitters.insert(child.object);
    }
    return emitters;
}

/// Mitsuba 0.x lights a scene without any emitter with one of type sunsky (Scene::initialize()); 2 and 3 do not.
void build_default_light(Builder& builder, const Document& document) {
    if (std::any_of(document.storage.begin(), document.storage.end(),
                    [](const auto& o) { return o->tag == "emitter"; }))
        return;
    const Where& at = document.scene->where;
    if (document.scene->version >= 2) return builder.note(at, "the scene has no emitter: its image is black");
    builder.note(at, "the scene has no emitter; as in Mitsuba 0.6 one of type sunsky lights it");
    Object emitter = make_object("emitter", "sunsky", at, document.scene->version);
    set_number(emitter, "scale", 2);
    set_boolean(emitter, "extend", true);
    set_number(emitter, "sun_radius_scale", 15);
    set_transform(emitter, "to_world", rotation(0, 1, 0, -120));
    build_emitter(builder, emitter);
}

/// All but what finalize_scene() adds, in coordinates about `origin`. `outside`: Builder::outside. `kept`, if it is not
/// null, has what was kept of the scene before, if there was one, and gets what is kept of this one but the scene.
Scene build_scene(const std::string& path, const Document& document, const LoadOptions& options, Vec3d origin,
                  std::optional<Error>* outside, const Kept* before, Kept* kept) {
    Scene scene;
    scene.path = path;
    scene.origin = {origin.x, origin.y, origin.z};
    Builder builder(document, options, origin, scene);
    builder.outside = outside;
    builder.before = before;
    if (before) scene.texels = before->scene.texels.emptied(), scene.tables = before->scene.tables.emptied();
    if (kept) builder.asked = &kept->asked;
    scene.warnings = document.warnings;
    scene.notes = document.notes;
    builder.file_digests = document.file_digests;

    Reader root(builder, *document.scene);
    const Object* sensor = root.take("sensor");
    const Object* integrator = root.take("integrator");
    if (sensor) build_sensors(builder, *sensor);
    if (integrator) build_integrator(builder, *integrator);
    if (const Object* other = root.take("sensor")) builder.note(other->where, "the first of several sensors is used");
    // What others refer to, used or not.
    for (const char* tag : {"sensor", "bsdf", "texture", "shape", "film", "sampler", "rfilter"})
        while (root.take(tag)) {}
    // Exporters write media that nothing is made of; what refers to one is refused there.
    while (const Object* medium = root.take("medium"))
        builder.note(medium->where, "media are not supported; this one is left out, since nothing refers to it");
    const std::set<const Object*> of_shapes = referenced_emitters(document);
    while (const Object* emitter = root.take("emitter"))
        if (!of_shapes.contains(emitter)) build_emitter(builder, *emitter);
    root.finish();
    build_default_light(builder, document);
    build_shapes(builder, *document.scene);
    if (integrator && document.scene->version >= 2 && scene.integrator.hide_emitters &&
        std::any_of(scene.emitters.begin(), scene.emitters.end(),
                    [](const Emitter& e) { return e.type == EmitterType::area; }))
        builder.note(
            integrator->where,
            "hide_emitters hides the light of lamps; their surfaces stay visible, in Mitsuba 3.9 rays pass them");
    if (!sensor) build_default_sensor(builder, *document.scene);
    validate_unused(builder);
    scene.content_hash = content_hash(builder);
    if (options.files) {
        for (const auto& [file, text] : document.files) options.files->push_back(file);
        for (const auto& [file, digest] : builder.file_digests) options.files->push_back(file);
    }
    if (kept) {
        kept->images = std::move(builder.images);
        kept->table_pool = std::move(builder.table_pool);
        kept->reflectance_pool = std::move(builder.rough_reflectance_pool);
        kept->geometry = std::move(builder.geometry);
    }
    return scene;
}

Scene place_scene(const std::string& path, const Document& document, const LoadOptions& options, const Kept* before,
                  Kept* kept) {
    std::optional<Error> outside;
    Scene scene = build_scene(path, document, options, {}, &outside, before, kept);
    // Far from the origin floats have rounded it already: it is made again, about its centre in double precision.
    const Bounds3f surfaces =
        before && same_geometry(scene, before->scene) ? before->geometry.surfaces : surface_bounds(scene);
    if (kept) kept->geometry.surfaces = surfaces;
    if (const Vec3d c = far_center(scene, surfaces); c.x != 0 || c.y != 0 || c.z != 0) {
        if (kept) kept->asked.clear();
        scene = build_scene(path, document, options, c, nullptr, before, kept);
        if (kept) kept->geometry.surfaces = surface_bounds(scene);
    } else if (outside) {
        throw Error(*outside);
    }
    return scene;
}

}  // namespace

Scene document::load_document(const std::string& path, const std::shared_ptr<const Document>& document,
                              const LoadOptions& options) {
    LoadTimes times;
    LoadOptions timed_options = options;
    timed_options.times = &times;
    const std::shared_ptr<const Kept> before = options.editable ? options.editable->kept : nullptr;
    const std::shared_ptr<Kept> kept = options.editable ? std::make_shared<Kept>() : nullptr;
    const auto placed = [&] {
        const ScopedSeconds clock(&times.place);
        return place_scene(path, *document, timed_options, before.get(), kept.get());
    };
    Scene scene = placed();
    times.place -= times.read;
    {
        const ScopedSeconds clock(&times.finish);
        finalize_scene(scene, options.light_picking, before ? &before->scene : nullptr);
    }
    if (kept) {
        kept->scene = scene;
        *options.editable = {document, kept};
    }
    if (options.times) {
        options.times->read += times.read;
        options.times->place += times.place;
        options.times->finish += times.finish;
    }
    return scene;
}

}  // namespace ambilux
