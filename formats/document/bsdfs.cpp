#include "formats/document/baked_textures.h"
#include "formats/document/bsdf_plugins.h"
#include "formats/document/coatings.h"
#include "formats/document/numbers.h"
#include "formats/document/plugins.h"
#include "formats/document/principled.h"

namespace ambilux::document {

namespace {

/// What adapters add to the BSDF inside of them.
struct Adapters {
    ParamFloat opacity = {1, -1};
    int32_t normal_map = -1, bump_map = -1;
    float bump_scale = 1;
    uint32_t map_rules = 0;
    std::optional<CoatPlace> coat;

    bool has_map() const { return normal_map >= 0 || bump_map >= 0; }
};

/// What a BSDF is inside of.
enum class Place { outside, two_sided };

bool same(const ParamFloat& a, const ParamFloat& b) { return a.value == b.value && a.texture == b.texture; }

ParamFloat product(Builder& builder, const Reader& in, const ParamFloat& a, const ParamFloat& b) {
    if (is_constant(a) || is_constant(b)) return {a.value * b.value, std::max(a.texture, b.texture)};
    return baked_number(builder, in, {a, b}, [](const auto& v) { return v[0] * v[1]; });
}

const Object& nested_bsdf(Reader& in) {
    const Object* nested = in.take("bsdf");
    if (!nested) in.fail(in.object().type + " has no nested BSDF");
    return *nested;
}

/// Strips masks and maps off `object`; returns what is inside of them.
const Object* strip(Builder& builder, const Object* object, Adapters& adapters, Place place) {
    for (;;) {
        Reader in(builder, *object);
        if (is_coating(object->type)) {
            if (adapters.coat) in.fail("a coating inside of a coating is not supported");
            adapters.coat = read_coat(builder, in);
        } else if (object->type == "mask") {
            if (adapters.coat)
                in.fail("a mask inside of a coating is not supported: put the coating inside of the mask");
            if (place == Place::two_sided)
                builder.note(in.where(), "a mask inside of twosided, which Mitsuba refuses, is taken as one around it");
            const Value* opacity = object->find("opacity");
            ParamFloat own;
            if (opacity && (opacity->kind == ValueKind::rgb || opacity->kind == ValueKind::spectrum)) {
                const Rgb color = in.color("opacity", splat(0.5f), SpectrumUse::reflectance);
                if (max_component(color) - min_component(color) > 1e-3f)
                    builder.refuse(in.where("opacity"), "a mask of a coloured opacity is not supported",
                                   "its luminance is used");
                own = {luminance(color), -1};
            } else {
                own = in.textured_number("opacity", 0.5f);
            }
            if (own.value < 0 || own.value > 1) in.fail(in.where("opacity"), "opacity must lie between 0 and 1");
            adapters.opacity = product(builder, in, adapters.opacity, own);
        } else if (object->type == "bumpmap" || object->type == "normalmap") {
            if (adapters.coat)
                in.fail("a map inside of a coating is not supported: put the coating inside of the " + object->type);
            if (adapters.has_map()) in.fail("more than one bumpmap or normalmap on a surface is not supported");
            const bool bump = object->type == "bumpmap";
            const Object* texture = in.take("texture");
            if (!texture) in.fail(object->type + " has no texture");
            const ScaledTexture scaled = load_scaled_texture(builder, *texture, TextureUse::map);
            (bump ? adapters.bump_map : adapters.normal_map) = scaled.texture;
            if (bump) adapters.bump_scale = float(in.number("scale", 1)) * luminance(scaled.scale);
            const bool by_default = object->version >= 2;  // Mitsuba 3.7 and later, of files of Mitsuba 2 too
            if (in.boolean("flip_invalid_normals", by_default)) adapters.map_rules |= kTurnNormals;
            if (in.boolean("use_shadowing_function", by_default)) adapters.map_rules |= kShadowBumps;
            if (!bump && !(scaled.scale == splat(1))) in.fail("the texture of a normalmap must not be scaled");
        } else {
            return object;
        }
        object = &nested_bsdf(in);
        in.finish();
    }
}

uint32_t add_record(Builder& builder, BsdfRecord r, const Object& object, const Adapters& adapters, bool two_sided) {
    if (two_sided && bsdf_transmits(r.type))
        Reader(builder, object).fail("a BSDF that transmits light cannot be inside of twosided");
    if (adapters.coat && bsdf_transmits(r.type))
        Reader(builder, object).fail("a coating over a BSDF that transmits light is not supported");
    if (adapters.coat && adapters.coat->rough && !bsdf_is_smooth(r.type))
        Reader(builder, object).fail("a rough coating over a BSDF of deltas alone is not supported");
    if (adapters.coat) r.coat = adapters.coat->table;
    r.map_rules = adapters.map_rules;
    r.normal_map = adapters.normal_map;
    r.bump_map = adapters.bump_map;
    r.bump_scale = adapters.bump_scale;
    return builder.validate_only ? 0 : add_bsdf(builder, r);
}

/// Lets all light pass: a mask of opacity 0, which rays do not see. A shape that emits must be seen: there it is a pane
/// without a boundary.
uint32_t null_material(Builder& builder, const Object& object, bool emits) {
    Reader(builder, object).finish();
    uint32_t& known = builder.null_materials[emits];
    if (builder.validate_only || known != kNone) return known;
    const uint32_t record = add_bsdf(builder, emits ? clear_pane_record() : diffuse_record(0));
    return known = add_material(builder, {record, record, 0, {emits ? 1.0f : 0.0f, -1}});
}

struct MaterialBuilder {
    Builder& builder;

    uint32_t add(Material material, const Adapters& adapters) {
        material.opacity = adapters.opacity;
        return builder.validate_only ? 0 : add_material(builder, material);
    }

    /// Material of a BSDF that is inside of `outer`.
    uint32_t build(const Object& object, Adapters outer, Place place) {
        const Object& inner = *strip(builder, &object, outer, place);
        const bool two_sided = place == Place::two_sided;
        if (inner.type == "twosided") return build_two_sided(inner, outer, place);
        if (inner.type == "null") return build_null(inner, two_sided);
        if (inner.type == "blendbsdf") return build_blend(inner, outer, place);
        if (inner.type == "mixturebsdf") return build_mixture(inner, outer, place);
        if (inner.type == "principled") return build_principled(inner, outer, two_sided);
        const uint32_t record = add_record(builder, read_bsdf(builder, inner), inner, outer, two_sided);
        return add({record, record, two_sided, {}}, outer);
    }

    /// A part that is not there.
    uint32_t build_null(const Object& object, bool two_sided) {
        Reader in(builder, object);
        if (two_sided) in.fail("a BSDF that transmits light cannot be inside of twosided");
        in.finish();
        const uint32_t index = black();
        if (!builder.validate_only) builder.scene.materials[index].opacity = {0, -1};
        return index;
    }

    uint32_t build_two_sided(const Object& object, const Adapters& outer, Place place) {
        Reader in(builder, object);
        const Object& first = nested_bsdf(in);
        const Object* second = in.take("bsdf");
        in.finish();
        // One that is inside of another is met on its front only.
        if (!second || place == Place::two_sided) return build(first, outer, Place::two_sided);
        const uint32_t front = build(first, without_opacity(outer), Place::two_sided),
                       back = build(*second, without_opacity(outer), Place::two_sided);
        if (builder.validate_only) return 0;
        const ParamFloat opacity = opacity_of(front);
        if (!same(opacity, opacity_of(back))) in.fail("the two sides of a twosided must have the same opacity");
        const uint32_t index = both_sides(front, back);
        builder.scene.materials[index].opacity = product(builder, in, outer.opacity, opacity);
        return index;
    }

    /// What is met on one side and on the other, either of which may be a blend.
    uint32_t both_sides(uint32_t front, uint32_t back) {
        const Material f = builder.scene.materials[front], b = builder.scene.materials[back];
        if (f.first != kNone) return blend(both_sides(f.first, back), both_sides(f.second, back), f.second_weight, {});
        if (b.first != kNone)
            return blend(both_sides(front, b.first), both_sides(front, b.second), b.second_weight, {});
        return add({f.front, b.front, 1, {}}, {});
    }

    ParamFloat opacity_of(uint32_t material) const {
        return builder.validate_only ? ParamFloat{1, -1} : builder.scene.materials[material].opacity;
    }

    /// Points are of `second` with a chance of `weight`.
    uint32_t blend(uint32_t first, uint32_t second, ParamFloat weight, const Adapters& outer) {
        if (builder.validate_only) return 0;
        const auto& all = builder.scene.materials;
        const auto transmits = [&](uint32_t m) { return bsdf_transmits(builder.scene.bsdfs[all[m].front].type); };
        const uint32_t most = all[transmits(first) ? first : second].front;
        Material material{most, most, 0, {}};
        material.first = first;
        material.second = second;
        material.second_weight = weight;
        return add(material, outer);
    }

    /// The same of parts behind masks: the whole has an opacity, and of what is met other weights.
    uint32_t masked_blend(const Reader& in, uint32_t first, uint32_t second, ParamFloat weight, const Adapters& outer) {
        const ParamFloat a = opacity_of(first), b = opacity_of(second);
        const ParamFloat full{1, -1};
        if (same(a, full) && same(b, full)) return blend(first, second, weight, outer);
        if (builder.validate_only) return 0;
        Adapters mask = outer;
        const auto masked = [&](const ParamFloat& whole) {
            mask.opacity = product(builder, in, outer.opacity, whole);
            for (uint32_t part : {first, second}) builder.scene.materials[part].opacity = full;
        };
        const auto seen = [](const std::vector<float>& v) { return (1 - v[2]) * v[0] + v[2] * v[1]; };
        const auto of_second = [&](const std::vector<float>& v) { return seen(v) > 0 ? v[2] * v[1] / seen(v) : v[2]; };
        if (same(a, b)) {
            masked(a);
            return blend(first, second, weight, mask);
        }
        masked(baked_number(builder, in, {a, b, weight}, seen));
        for (const auto& [gone, left] : {std::pair{a, second}, {b, first}})
            if (is_constant(gone) && gone.value == 0) {
                builder.scene.materials[left].opacity = mask.opacity;
                return left;
            }
        const ParamFloat of_seen = baked_number(builder, in, {a, b, weight}, of_second);
        if (of_seen.texture >= 0)
            builder.note(in.where(), "weights and opacities of masks inside of a blend are combined texel by texel");
        return blend(first, second, of_seen, mask);
    }

    static Adapters without_opacity(Adapters adapters) {
        adapters.opacity = {1, -1};
        return adapters;
    }

    uint32_t build_blend(const Object& object, const Adapters& outer, Place place) {
        Reader in(builder, object);
        const ParamFloat weight = in.textured_number("weight", 0.5f);
        if (is_constant(weight) && !(weight.value >= 0 && weight.value <= 1))
            in.fail(in.where("weight"), "the weight of a blend must lie between 0 and 1");
        const Object& first = nested_bsdf(in);
        const Object* second = in.take("bsdf");
        if (!second) in.fail("blendbsdf needs two nested BSDFs");
        in.finish();
        const uint32_t a = build(first, without_opacity(outer), place),
                       b = build(*second, without_opacity(outer), place);
        return masked_blend(in, a, b, weight, outer);
    }

    uint32_t build_mixture(const Object& object, const Adapters& outer, Place place) {
        Reader in(builder, object);
        const std::string text = in.text("weights", "");
        const std::vector<double> weights = parse_list(text, in.where("weights"), "weights");
        std::vector<uint32_t> parts;
        while (const Object* nested = in.take("bsdf")) parts.push_back(build(*nested, without_opacity(outer), place));
        in.finish();
        if (parts.empty() || parts.size() != weights.size())
            in.fail(in.where("weights"), "mixturebsdf has " + std::to_string(parts.size()) + " BSDFs and " +
                                             std::to_string(weights.size()) + " weights");
        double sum = 0;
        for (double w : weights) {
            if (!(w >= 0)) in.fail(in.where("weights"), "weights must not be negative");
            sum += w;
        }
        if (!(sum > 0 && sum <= double(kRoundedOne)))
            in.fail(in.where("weights"), "the weights must be positive and sum to 1 at most");
        // From the last one on; what is missing to 1 is black.
        uint32_t rest = sum < 1 - 1e-6 ? black() : parts.back();
        double rest_weight = sum < 1 - 1e-6 ? 1 - sum : weights.back();
        for (size_t i = sum < 1 - 1e-6 ? parts.size() : parts.size() - 1; i-- > 0;) {
            const double both = rest_weight + weights[i];
            rest = masked_blend(in, parts[i], rest, {float(both > 0 ? rest_weight / both : 0), -1},
                                i == 0 ? outer : without_opacity(outer));
            rest_weight = both;
        }
        if (parts.size() == 1 && rest == parts.back() && !builder.validate_only)
            builder.scene.materials[rest].opacity = product(builder, in, outer.opacity, opacity_of(rest));
        return rest;
    }

    uint32_t black() {
        if (builder.validate_only) return 0;
        const uint32_t record = add_bsdf(builder, diffuse_record(0));
        return add({record, record, 0, {}}, {});
    }

    uint32_t build_principled(const Object& object, const Adapters& outer, bool two_sided) {
        Reader in(builder, object);
        const PrincipledParts parts = read_principled(builder, in);
        in.finish();
        const ParamFloat& glass = parts.glass_weight;
        const bool transmits = !is_constant(glass) || glass.value > 0;
        if (transmits && two_sided) in.fail("a BSDF that transmits light cannot be inside of twosided");
        const auto leaf = [&](const BsdfRecord& record, const Adapters& adapters) {
            const uint32_t index = add_record(builder, record, object, adapters, two_sided);
            return add({index, index, two_sided, {}}, adapters);
        };
        if (!transmits) return leaf(bsdf_record(parts.opaque), outer);
        if (is_constant(glass) && glass.value == 1) return leaf(bsdf_record(parts.glass), outer);
        return blend(leaf(bsdf_record(parts.opaque), without_opacity(outer)),
                     leaf(bsdf_record(parts.glass), without_opacity(outer)), glass, outer);
    }
};

}  // namespace

uint32_t add_bsdf(Builder& builder, const BsdfRecord& bsdf) {
    builder.scene.bsdfs.push_back(bsdf);
    return uint32_t(builder.scene.bsdfs.size() - 1);
}

uint32_t add_material(Builder& builder, const Material& material) {
    builder.scene.materials.push_back(material);
    return uint32_t(builder.scene.materials.size() - 1);
}

uint32_t build_material(Builder& builder, const Object& bsdf, bool emits) {
    if (bsdf.tag == "bsdf" && bsdf.type == "null") return null_material(builder, bsdf, emits);
    const auto known = builder.materials.find(&bsdf);
    if (known != builder.materials.end()) return known->second;
    if (bsdf.tag != "bsdf") Reader(builder, bsdf).fail("expected a bsdf, not a " + bsdf.tag);
    const uint32_t index = MaterialBuilder{builder}.build(bsdf, {}, Place::outside);
    return builder.validate_only ? 0 : builder.materials[&bsdf] = index;
}

uint32_t build_own_material(Builder& builder, const Object& bsdf) {
    return MaterialBuilder{builder}.build(bsdf, {}, Place::outside);
}

uint32_t shape_material(Builder& builder, const Object* bsdf, const Object* emitter, const Where& where) {
    if (emitter && emitter->type == HiddenAreaEmitter::plugin) {
        const uint32_t index = bsdf ? build_material(builder, *bsdf) : kNone;
        const bool unseen = bsdf && (builder.validate_only || builder.scene.materials[index].unseen());
        if (!unseen) fail(where, "a shape with emitter 'hiddenarea' needs bsdf 'null'");
        return index;
    }
    if (bsdf) return build_material(builder, *bsdf, emitter != nullptr);
    uint32_t& known = builder.default_materials[emitter != nullptr];
    if (known != kNone) return known;
    const uint32_t record = add_bsdf(builder, diffuse_record(emitter ? 0.0f : 0.5f));
    return known = add_material(builder, {record, record, 0, {1, -1}});
}

const Plugins& bsdf_plugins() {
    static const Plugins known = with_plugins_of<BsdfModels>(
        {"twosided", "mask", "bumpmap", "normalmap", "blendbsdf", "mixturebsdf", "coating", "roughcoating", "null"});
    return known;
}

}  // namespace ambilux::document
