#include "render/twin/scene.h"

#include "render/twin/convert.h"
#include "scene/flatten.h"

namespace ambilux::twin {

// Records that hold arrays, have bases, or are one of several.

void convert(const ambilux::Affine& from, Affine& to) { convert(from.m, to.m); }

void convert(const ambilux::Texture& from, Texture& to) {
    const auto& [type, format, wrap, filter, width, height, offset, decode_table, to_uv, color0, color1] = from;
    convert(type, to.type);
    convert(format, to.format);
    convert(wrap, to.wrap);
    convert(filter, to.filter);
    to.width = width;
    to.height = height;
    to.offset = offset;
    to.decode_table = decode_table;
    convert(to_uv, to.to_uv);
    convert(color0, to.color0);
    convert(color1, to.color1);
}

/// Parameters of the model that has place I in both lists.
template <uint32_t I>
void convert_parameters(const ambilux::BsdfRecord& from, BsdfRecord& to) {
    using Single = ambilux::BsdfModels::At<I>;
    using Double = BsdfModels::At<I>;
    const ambilux::Textured<Single>& a = from.as<Single>();
    Textured<Double> b;
    const typename Single::template Inputs<ambilux::ParamRgb, ambilux::ParamFloat>& inputs = a;
    const typename Single::Constants& constants = a;
    convert(inputs, static_cast<typename Double::template Inputs<ParamRgb, ParamFloat>&>(b));
    convert(constants, static_cast<typename Double::Constants&>(b));
    to.parameters.set(b);
}
void convert(const ambilux::BsdfRecord& from, BsdfRecord& to) {
    convert(from.type, to.type);
    to.normal_map = from.normal_map;
    to.bump_map = from.bump_map;
    to.bump_scale = from.bump_scale;
    to.map_rules = from.map_rules;
    to.coat = from.coat;
    [&]<uint32_t... I>(std::integer_sequence<uint32_t, I...>) {
        ((uint32_t(from.type) == I ? convert_parameters<I>(from, to) : void()), ...);
    }(std::make_integer_sequence<uint32_t, BsdfModels::count>());
}

namespace {

template <class From, class To>
void convert_all(const From& from, std::vector<To>& to) {
    to.resize(from.size());
    for (size_t i = 0; i < from.size(); ++i) convert(from[i], to[i]);
}

Vec3f column(const Affine& a, int k) { return {a.m[0][k], a.m[1][k], a.m[2][k]}; }
void set_column(Affine& a, int k, Vec3f v) {
    for (int i = 0; i < 3; ++i) a.m[i][k] = v[i];
}

/// Axes at right angles, of the lengths that they have, the first two of length `xy` unless that is 0 (Gram-Schmidt).
/// Those of a float matrix are off by 2^-24.
void set_orthogonal(Affine& a, double xy = 0) {
    Vec3f unit[3];
    for (int k = 0; k < 3; ++k) {
        Vec3f v = column(a, k);
        const double l = xy > 0 && k < 2 ? xy : length(v);
        for (int twice = 0; twice < 2; ++twice)
            for (int j = 0; j < k; ++j) v = v - unit[j] * dot(unit[j], v);
        unit[k] = normalize(v);
        set_column(a, k, unit[k] * l);
    }
}

/// Of a map whose axes are at right angles.
Affine inverse_of_orthogonal(const Affine& a) {
    Affine inverse{};
    const Vec3f origin = column(a, 3);
    for (int i = 0; i < 3; ++i) {
        const Vec3f axis = column(a, i), row = axis / length_squared(axis);
        for (int j = 0; j < 3; ++j) inverse.m[i][j] = row[j];
        inverse.m[i][3] = -dot(row, origin);
    }
    return inverse;
}

/// Of any map that has one.
Affine inverse_of(const Affine& a) {
    Affine inverse{};
    const Vec3f axes[3] = {column(a, 0), column(a, 1), column(a, 2)}, origin = column(a, 3);
    const double volume = dot(axes[0], cross(axes[1], axes[2]));
    for (int i = 0; i < 3; ++i) {
        const Vec3f row = cross(axes[(i + 1) % 3], axes[(i + 2) % 3]) / volume;
        for (int j = 0; j < 3; ++j) inverse.m[i][j] = row[j];
        inverse.m[i][3] = -dot(row, origin);
    }
    return inverse;
}

void derive(Quadric& q) {
    if (q.type == PrimitiveType::disk) {  // any ellipse
        q.to_local = inverse_of(q.to_world);
        return;
    }
    set_orthogonal(q.to_world, q.radius);
    if (q.type == PrimitiveType::sphere) set_column(q.to_world, 2, normalize(column(q.to_world, 2)) * q.radius);
    q.to_local = inverse_of_orthogonal(q.to_world);
}

void derive(Emitter& e) {
    if (e.type == EmitterType::spot || has_delta_direction(e.type)) e.direction = normalize(e.direction);
    if (e.type != EmitterType::spot && e.type != EmitterType::projector && e.type != EmitterType::envmap) return;
    set_orthogonal(e.to_world);
    e.to_local = inverse_of_orthogonal(e.to_world);
}

}  // namespace

DoubleScene::DoubleScene(const ambilux::Scene& given)
    : flat_(given.instances.empty() ? nullptr : std::make_unique<ambilux::Scene>(flatten_instances(given))),
      scene_(flat_ ? *flat_ : given) {
    const ambilux::Scene& scene = scene_;
    convert_all(scene.vertices, vertices_);
    convert_all(scene.triangles, triangles_);
    convert_all(scene.quadrics, quadrics_);
    convert_all(scene.shapes, shapes_);
    convert_all(scene.materials, materials_);
    convert_all(scene.bsdfs, bsdfs_);
    convert_all(scene.textures, textures_);
    convert_all(scene.emitters, emitters_);
    convert(scene.sensor, sensor_);
    for (Quadric& q : quadrics_) derive(q);
    for (Emitter& e : emitters_) derive(e);
    set_orthogonal(sensor_.to_world);
}

SceneView DoubleScene::view() const {
    SceneView v{};
    v.vertices = vertices_.data();
    v.triangles = triangles_.data();
    v.quadrics = quadrics_.data();
    v.shapes = shapes_.data();
    v.materials = materials_.data();
    v.bsdfs = bsdfs_.data();
    v.textures = textures_.data();
    v.texels = scene_.texels.data();
    v.sort_keys = scene_.sort_keys.data();
    v.emitters = emitters_.data();
    v.emitter_cdf = scene_.emitter_cdf.data();
    v.tables = scene_.tables.data();
    v.environment_rows = reinterpret_cast<const AliasBucket*>(scene_.environment_rows.data());
    v.environment_cells = reinterpret_cast<const EnvironmentCell*>(scene_.environment_cells.data());
    v.vertex_count = uint32_t(vertices_.size());
    v.triangle_count = uint32_t(triangles_.size());
    v.quadric_count = uint32_t(quadrics_.size());
    v.shape_count = uint32_t(shapes_.size());
    v.material_count = uint32_t(materials_.size());
    v.bsdf_count = uint32_t(bsdfs_.size());
    v.texture_count = uint32_t(textures_.size());
    v.emitter_count = uint32_t(emitters_.size());
    v.environment = scene_.environment;
    convert(scene_.bounds_center, v.bounds_center);
    convert(scene_.bounds_radius, v.bounds_radius);
    v.sensor = sensor_;
    return v;
}

uint64_t DoubleScene::memory_bytes() const {
    const auto bytes = [](const auto&... arrays) { return (0 + ... + (arrays.size() * sizeof(arrays[0]))); };
    return bytes(vertices_, triangles_, quadrics_, shapes_, materials_, bsdfs_, textures_, emitters_);
}

}  // namespace ambilux::twin
