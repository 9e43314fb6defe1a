#include "formats/mitsuba/bsdf_plugins.h"

namespace ambilux::mitsuba {

namespace {

/// What adapters add to the BSDF inside of them.
struct Adapters {
    ParamFloat opacity = {1, -1};
    bool has_opacity = false;
    int32_t normal_map = -1, bump_map = -1;
    float bump_scale = 1;

    bool has_map() const { return normal_map >= 0 || bump_map >= 0; }
};

const Object& nested_bsdf(Reader& in) {
    const Object* nested = in.take("bsdf");
    if (!nested) in.fail(in.object().type + " has no nested BSDF");
    return *nested;
}

/// Strips masks and maps off `object`; returns what is inside of them.
const Object* strip(Builder& builder, const Object* object, Adapters& adapters, bool in_two_sided) {
    for (;;) {
        Reader in(builder, *object);
        if (object->type == "mask") {
            if (in_two_sided)
                in.fail("a mask inside of twosided is not supported: put the twosided inside of the mask");
            if (adapters.has_opacity) in.fail("a mask inside of a mask is not supported");
            adapters.has_opacity = true;
            const Value* opacity = object->find("opacity");
            if (opacity && (opacity->kind == ValueKind::rgb || opacity->kind == ValueKind::spectrum)) {
                adapters.opacity = {luminance(in.color("opacity", splat(0.5f), SpectrumUse::reflectance)), -1};
            } else {
                adapters.opacity = in.textured_number("opacity", 0.5f);
            }
            if (adapters.opacity.value < 0 || adapters.opacity.value > 1)
                in.fail(in.where("opacity"), "opacity must lie between 0 and 1");
        } else if (object->type == "bumpmap" || object->type == "normalmap") {
            if (adapters.has_map()) in.fail("more than one bumpmap or normalmap on a surface is not supported");
            const bool bump = object->type == "bumpmap";
            const Object* texture = in.take("texture");
            if (!texture) in.fail(object->type + " has no texture");
            const ScaledTexture scaled = load_scaled_texture(builder, *texture);
            (bump ? adapters.bump_map : adapters.normal_map) = scaled.texture;
            if (bump) adapters.bump_scale = float(in.number("scale", 1)) * luminance(scaled.scale);
            if (!bump && !(scaled.scale == splat(1))) in.fail("the texture of a normalmap must not be scaled");
        } else {
            return object;
        }
        object = &nested_bsdf(in);
        in.finish();
    }
}

uint32_t add_record(Builder& builder, const Object& object, const Adapters& adapters, bool two_sided) {
    BsdfRecord r = read_bsdf(builder, object);
    if (two_sided && bsdf_transmits(r.type))
        Reader(builder, object).fail("a BSDF that transmits light cannot be inside of twosided");
    r.normal_map = adapters.normal_map;
    r.bump_map = adapters.bump_map;
    r.bump_scale = adapters.bump_scale;
    if (builder.validate_only) return 0;
    builder.scene.bsdfs.push_back(r);
    return uint32_t(builder.scene.bsdfs.size() - 1);
}

/// Lets all light pass: a mask of opacity 0, which rays do not see. A shape that emits must be seen: there it is a pane
/// without a boundary.
uint32_t null_material(Builder& builder, const Object& object, bool emits) {
    Reader(builder, object).finish();
    uint32_t& known = builder.null_materials[emits];
    if (builder.validate_only || known != kNone) return known;
    builder.scene.bsdfs.push_back(emits ? clear_pane_record() : diffuse_record(0));
    const uint32_t record = uint32_t(builder.scene.bsdfs.size() - 1);
    builder.scene.materials.push_back({record, record, 0, {emits ? 1.0f : 0.0f, -1}});
    return known = uint32_t(builder.scene.materials.size() - 1);
}

}  // namespace

uint32_t build_material(Builder& builder, const Object& bsdf, bool emits) {
    if (bsdf.tag == "bsdf" && bsdf.type == "null") return null_material(builder, bsdf, emits);
    const auto known = builder.materials.find(&bsdf);
    if (known != builder.materials.end()) return known->second;
    if (bsdf.tag != "bsdf") Reader(builder, bsdf).fail("expected a bsdf, not a " + bsdf.tag);

    Adapters outer;
    const Object* inner = strip(builder, &bsdf, outer, false);
    Material material;
    material.opacity = outer.opacity;
    material.two_sided = inner->type == "twosided";
    if (material.two_sided) {
        Reader in(builder, *inner);
        const Object& first = nested_bsdf(in);
        const Object* second = in.take("bsdf");
        in.finish();
        const auto side = [&](const Object& object) {
            Adapters adapters = outer;
            const Object* leaf = strip(builder, &object, adapters, true);
            if (leaf->type == "twosided") Reader(builder, *leaf).fail("twosided inside of twosided");
            return add_record(builder, *leaf, adapters, true);
        };
        material.front = side(first);
        material.back = second ? side(*second) : material.front;
    } else {
        material.front = material.back = add_record(builder, *inner, outer, false);
    }
    if (builder.validate_only) return 0;
    builder.scene.materials.push_back(material);
    return builder.materials[&bsdf] = uint32_t(builder.scene.materials.size() - 1);
}

uint32_t default_material(Builder& builder, bool emitter) {
    uint32_t& known = builder.default_materials[emitter];
    if (known != kNone) return known;
    builder.scene.bsdfs.push_back(diffuse_record(emitter ? 0.0f : 0.5f));
    const uint32_t record = uint32_t(builder.scene.bsdfs.size() - 1);
    builder.scene.materials.push_back({record, record, 0, {1, -1}});
    return known = uint32_t(builder.scene.materials.size() - 1);
}

}  // namespace ambilux::mitsuba
