#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "formats/document/builder.h"
#include "formats/document/plugins.h"
#include "transport/emitter/spot.h"

namespace ambilux::document {

void place(Emitter& e, const Matrix& to_world) {
    e.to_world = to_affine(to_world);
    e.to_local = to_affine(affine_inverse(to_world));
}

namespace {

/// Weights that only steer another renderer's sampling: ours has its own rule.
void check_sampling_weight(Builder& builder, Reader& in) {
    const double weight = in.number("sampling_weight", 1);
    if (weight == 0)
        builder.refuse(in.where("sampling_weight"), "an emitter with a sampling weight of 0 is not supported",
                       "it is sampled");
    else if (weight != 1)
        builder.note(in.where("sampling_weight"), "sampling weights of emitters are left to --light-picking");
}

/// Where it stands and how it is turned. `scale`, of all axes alike, means nothing to a light that spreads from a point
/// or comes from afar.
Matrix rigid_transform(Builder& builder, Reader& in, double* scale = nullptr) {
    Matrix m = builder.to_scene * in.transform("to_world");
    const double l = length(column(m, 2)), s = std::fabs(l - 1) < 1e-3 ? 1 : l;
    if (!(std::fabs(determinant(m)) > 0)) in.fail(in.where("to_world"), "the emitter's transform is singular");
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.m[i][j] /= s;
    if (scale) *scale = s;
    bool problem = false;
    m = rigid_part(m, problem);
    if (problem)
        builder.refuse(in.where("to_world"),
                       "the transform of an emitter of type '" + in.object().type +
                           "' must not shear, or scale one axis more than another",
                       "scale and shear are left out");
    return m;
}

/// Where it stands and what it points at.
void place_beam(Builder& builder, Reader& in, Emitter& e, const Matrix& m) {
    builder.check_range(in.where(), "the emitter of type '" + in.object().type + "'", {column(m, 3)});
    e.position = rounded(column(m, 3));
    e.direction = rounded(column(m, 2));
}

// One plugin a model: what its XML says.

/// All that are on shapes; `hiddenarea` is of pbrt, for scenes that are converted.
template <class Model>
    requires(Model::surface)
void read_plugin(ModelTag<Model>, Builder&, Reader& in, Emitter& e) {
    e.radiance = in.textured_color("radiance", {1, 1, 1}, SpectrumUse::emission);
}

void read_plugin(ModelTag<PointEmitter>, Builder& builder, Reader& in, Emitter& e) {
    if (in.has("position") && in.has("to_world"))
        in.fail(in.where("to_world"), "both 'position' and 'to_world' are given");
    const Vec3d p = in.vector("position", {});
    const Matrix to_world = in.has("position") ? translation(p.x, p.y, p.z) : in.transform("to_world");
    const Vec3d at = column(builder.to_scene * to_world, 3);
    builder.check_range(in.where(), "the emitter of type 'point'", {at});
    e.position = rounded(at);
    e.radiance = {in.color("intensity", {1, 1, 1}, SpectrumUse::emission), -1};
}

void read_plugin(ModelTag<SpotEmitter>, Builder& builder, Reader& in, Emitter& e) {
    const Matrix m = rigid_transform(builder, in);
    place_beam(builder, in, e, m);
    place(e, m);
    const double cutoff = in.number("cutoff_angle", 20), beam = in.number("beam_width", cutoff * 0.75);
    if (!(cutoff > 0 && cutoff < 90))
        in.fail(in.where("cutoff_angle"), "cutoff_angle must lie between 0 and 90 degrees");
    if (!(beam >= 0 && beam <= cutoff))
        in.fail(in.where("beam_width"), "beam_width must lie between 0 and cutoff_angle");
    set_spot_angles(e, cutoff * (M_PI / 180), beam * (M_PI / 180));
    e.radiance = {in.color("intensity", {1, 1, 1}, SpectrumUse::emission), -1};
    if (const Object* texture = in.take_named("texture"))
        e.radiance.texture = load_texture(builder, *texture, TextureUse::light);
}

void read_plugin(ModelTag<ProjectorEmitter>, Builder& builder, Reader& in, Emitter& e) {
    double enlarged = 1;
    const Matrix m = rigid_transform(builder, in, &enlarged);
    place_beam(builder, in, e, m);
    place(e, m);
    e.radiance = in.textured_color("irradiance", {1, 1, 1}, SpectrumUse::emission);
    e.radiance.value = e.radiance.value * float(M_PI * in.number("scale", 1) * enlarged);  // as in Mitsuba
    double aspect = 1;
    if (e.radiance.texture >= 0 && !builder.validate_only) {
        const Texture& t = builder.scene.textures[size_t(e.radiance.texture)];
        if (t.type == TextureType::bitmap) aspect = double(t.width) / t.height;
    }
    const Vec2f tangents = field_of_view(in, aspect);
    e.cutoff = tangents.x;
    e.beam_width = tangents.y;
}

void read_plugin(ModelTag<DirectionalEmitter>, Builder&, Reader& in, Emitter& e) {
    if (in.has("direction") && in.has("to_world"))
        in.fail(in.where("to_world"), "both 'direction' and 'to_world' are given");
    Vec3d d = column(in.transform("to_world"), 2);
    if (in.has("direction")) d = in.vector("direction", {0, 0, 1});
    if (!(length(d) > 0)) in.fail(in.where("direction"), "the direction of the emitter is zero");
    e.direction = rounded(unit(d));
    e.radiance = {in.color("irradiance", {1, 1, 1}, SpectrumUse::emission), -1};
}

void read_plugin(ModelTag<ConstantEmitter>, Builder&, Reader& in, Emitter& e) {
    in.ignore({"to_world"});  // the same from everywhere
    e.radiance = {in.color("radiance", {1, 1, 1}, SpectrumUse::emission), -1};
}

void read_plugin(ModelTag<CollimatedEmitter>, Builder& builder, Reader& in, Emitter& e) {
    place_beam(builder, in, e, rigid_transform(builder, in));
    e.radiance = {in.color("power", {1, 1, 1}, SpectrumUse::emission), -1};
}

void read_plugin(ModelTag<EnvmapEmitter>, Builder& builder, Reader& in, Emitter& e) {
    place(e, without_place(rigid_transform(builder, in)));
    const Texels* given = given_image(builder, in);
    const std::string name = in.text(given ? "image" : "filename", "");
    if (name.empty()) in.fail_without("filename", "envmap has no filename");
    const double scale = in.number("scale", 1);
    if (!(scale >= 0)) in.fail(in.where("scale"), "scale must not be negative");
    in.leave({{"cache"}, {"mis_compensation", "false"}}, "it is sampled in our own way");
    float largest = 0;
    const std::string path = given ? name : builder.file(name, in.where("filename"));
    const int32_t texture = load_environment_image(builder, in, path, largest, given);
    e.radiance = {splat(float(scale)), texture};
    const double most = std::numeric_limits<float>::max();
    if (!(scale <= most && scale * largest <= most))
        in.fail(in.where("scale"),
                fmt::format("scale {:g} makes a radiance of {:g} of the brightest texel; floats end at "
                            "{:g}",
                            scale, scale * largest, most));
}

}  // namespace

Emitter read_emitter(Builder& builder, const Object& object, bool on_shape) {
    Emitter e{};
    e.type = EmitterType::count;
    e.shape = e.area_cdf = kNone;
    e.to_world = e.to_local = to_affine(Matrix{});
    if (!on_shape && is_sky(object.type)) {
        Reader in(builder, object);
        read_sky(builder, in, without_place(rigid_transform(builder, in)), e);
        check_sampling_weight(builder, in);
        in.finish();
        return e;
    }
    EmitterModels::for_each([&](auto model) {
        using Model = typename decltype(model)::type;
        if (object.type != Model::plugin || Model::surface != on_shape) return;
        Reader in(builder, object);
        e.type = kEmitterType<Model>;
        read_plugin(model, builder, in, e);
        check_sampling_weight(builder, in);
        in.finish();
    });
    return e;
}

void build_emitter(Builder& builder, const Object& object) {
    const Emitter e = read_emitter(builder, object, false);
    if (e.type == EmitterType::count) {
        const bool misplaced = is_one_of(emitter_plugins(), object.type);
        builder.refuse(object.where,
                       "emitter type '" + object.type + "' is not supported" +
                           (misplaced ? " here: it belongs in a shape" : what_is_meant("emitter", object.type)),
                       "it is left out");
        return;
    }
    if (is_environment(e.type)) {
        if (builder.scene.environment != kNone)
            Reader(builder, object).fail("only one constant, envmap or sky emitter is possible");
        builder.scene.environment = uint32_t(builder.scene.emitters.size());
    }
    builder.scene.emitters.push_back(e);
}

const Plugins& emitter_plugins() {
    static const Plugins known = with_plugins_of<EmitterModels>({"sky", "sun", "sunsky"});
    return known;
}

}  // namespace ambilux::document
