#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <mutex>

#include "accel/range.h"
#include "core/error.h"
#include "formats/document/baked_textures.h"
#include "formats/document/named_media.h"
#include "formats/document/plugins.h"

namespace ambilux::document {

/// Marks of objects for manifold sampling (Zeltner et al. 2020) and what came after it: they choose samples only.
static const Plugins kMarks = {"caustic_caster_single", "caustic_caster_multi",   "caustic_receiver",
                               "caustic_bouncer",       "caustic_emitter_single", "caustic_emitter_multi"};

void Builder::refuse(const Where& where, const std::string& problem, const std::string& instead) {
    if (!options.lenient) fail(where, problem);
    warn(where, problem + "; " + instead);
}

void Builder::warn(const Where& where, const std::string& text) {
    const std::string message = where.text() + ": " + text;
    if (reported.insert(message).second) scene.warnings.push_back(message);
}

void Builder::note(const Where& where, const std::string& text) {
    if (reported.insert(text).second) scene.notes.push_back(where.text() + ": " + text);
}

std::string Builder::file(const std::string& name, const Where& where) {
    namespace fs = std::filesystem;
    const std::string path = document.resolve(name, where);
    std::error_code ignored;
    const fs::path beside = fs::path(where.file).parent_path() / name;
    if (where.file != scene.path && beside != path && fs::exists(beside, ignored) &&
        !fs::equivalent(beside, path, ignored))
        note(where, fmt::format("'{}' is read from '{}', as in Mitsuba, not from the file of that name beside this one",
                                name, path));
    return path;
}

void Builder::take_memory(uint64_t bytes, const std::string& path) {
    memory += std::min(bytes, UINT64_MAX - memory);
    if (memory > options.limits.total_bytes)
        throw input_error(path, 0,
                          "with it, meshes and textures take more memory than --limits total_bytes=" +
                              std::to_string(options.limits.total_bytes));
}

uint32_t Builder::add_table(const std::string& name, size_t size, const std::function<void(float*)>& make) {
    const auto [it, added] = table_pool.try_emplace(name, uint32_t(scene.tables.size()));
    if (!added) return it->second;
    if (before)
        if (const auto same = before->table_pool.find(name); same != before->table_pool.end()) {
            scene.tables.append(before->scene.tables.data() + same->second, size);
            return it->second;
        }
    std::vector<float> table(size);
    make(table.data());
    scene.tables.append(table.data(), size);
    return it->second;
}

void Builder::fail_unless_moved(const Error& error) const {
    if (!outside) throw error;
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    if (!*outside) outside->emplace(error);
}

void Builder::check_range(const Where& where, const std::string& what, std::initializer_list<Vec3d> points) const {
    for (const Vec3d& p : points)
        for (const double c : {p.x, p.y, p.z}) {
            if (std::fabs(c) <= double(kMostCoordinate)) continue;
            const Error error = input_error(where.file, where.line,
                                            fmt::format("{} reaches to {:g}; rays are traced between -{:g} and {:g}",
                                                        what, c, kMostCoordinate, kMostCoordinate));
            // What is no float cannot be moved either.
            if (!(std::fabs(c) <= double(std::numeric_limits<float>::max()))) throw error;
            return fail_unless_moved(error);
        }
}

void Reader::fail(const std::string& message) const { fail(object_.where, message); }
void Reader::fail(const Where& where, const std::string& message) const { document::fail(where, message); }

const Value* Reader::find(const std::string& name) const {
    const Value* v = object_.find(name);
    if (!v) absent_.push_back(name);
    return v;
}

const Child* Reader::child_named(const std::string& name) const {
    for (const Child& child : object_.children)
        if (child.name == name) return &child;
    return nullptr;
}

const Value* Reader::value(const std::string& name, std::initializer_list<ValueKind> kinds, const char* expected) {
    const Value* v = find(name);
    if (!v) {
        if (const Child* child = child_named(name))
            fail(child->where, "parameter '" + name + "' of " + object_.type + " must be " + expected + ", not a " +
                                   child->object->tag);
        return nullptr;
    }
    if (std::find(kinds.begin(), kinds.end(), v->kind) == kinds.end())
        fail(v->where, "parameter '" + name + "' of " + object_.type + " must be " + expected);
    used_values_.insert(v);
    return v;
}

void Reader::keep(const std::string& name, ValueKind kind, const std::function<void(Value&)>& set) const {
    if (!builder_.asked) return;
    std::vector<Value>& known = (*builder_.asked)[&object_];
    if (std::any_of(known.begin(), known.end(), [&](const Value& v) { return v.name == name; })) return;
    Value& value = known.emplace_back();
    value.name = name;
    value.kind = kind;
    set(value);
}

bool Reader::boolean(const std::string& name, bool fallback) {
    keep(name, ValueKind::boolean, [&](Value& v) { v.number = fallback; });
    const Value* v = value(name, {ValueKind::boolean}, "a boolean");
    return v ? v->number != 0 : fallback;
}

int64_t Reader::integer(const std::string& name, int64_t fallback) {
    keep(name, ValueKind::integer, [&](Value& v) { v.number = double(fallback); });
    const Value* v = value(name, {ValueKind::integer}, "an integer");
    return v ? int64_t(v->number) : fallback;
}

double Reader::number(const std::string& name, double fallback) {
    keep(name, ValueKind::number, [&](Value& v) { v.number = fallback; });
    const Value* v = value(name, {ValueKind::number, ValueKind::integer}, "a number");
    return v ? v->number : fallback;
}

std::string Reader::text(const std::string& name, const std::string& fallback) {
    keep(name, ValueKind::text, [&](Value& v) { v.text = fallback; });
    const Value* v = value(name, {ValueKind::text}, "a string");
    return v ? v->text : fallback;
}

Vec3d Reader::vector(const std::string& name, Vec3d fallback) {
    keep(name, ValueKind::vector, [&](Value& v) { v.vector = fallback; });
    const Value* v = value(name, {ValueKind::vector}, "a point or vector");
    return v ? v->vector : fallback;
}

Matrix Reader::transform(const std::string& name) {
    keep(name, ValueKind::transform, [](Value&) {});
    const Value* v = value(name, {ValueKind::transform}, "a transform");
    return v ? v->transform : Matrix{};
}

float Reader::ior(const std::string& name, const std::string& fallback) {
    const Value* v =
        value(name, {ValueKind::number, ValueKind::integer, ValueKind::text}, "a number or the name of a material");
    float result = 1;
    find_ior(fallback, result);
    keep(name, ValueKind::number, [&](Value& kept) { kept.number = double(result); });
    if (v && v->kind != ValueKind::text) {
        result = float(v->number);
    } else if (!find_ior(v ? v->text : fallback, result)) {
        builder_.refuse(v->where, "no index of refraction is known for '" + v->text + "' (known: " + ior_names() + ")",
                        "bk7 is used");
        find_ior("bk7", result);
    }
    if (!(result > 0)) fail(v->where, "index of refraction '" + name + "' must be positive");
    return result;
}

Where Reader::where(const std::string& name) const {
    if (const Value* v = find(name)) return v->where;
    if (const Child* child = child_named(name)) return child->where;
    return object_.where;
}

Rgb Reader::color(const std::string& name, Rgb fallback, SpectrumUse use) {
    const Value* v =
        value(name, {ValueKind::rgb, ValueKind::spectrum, ValueKind::number, ValueKind::integer}, "a colour");
    keep(name, ValueKind::rgb, [&](Value& kept) { kept.rgb = fallback; });
    if (!v) return fallback;
    Rgb rgb = splat(float(v->number));
    if (v->kind == ValueKind::rgb)
        rgb = v->rgb;
    else if (!v->samples.empty())
        rgb = spectrum_to_rgb(v->samples, use);
    else if (v->equal_energy && use == SpectrumUse::emission)
        rgb *= kEqualEnergy;  // as Mitsuba 3; its D65 is white
    if (!is_finite(rgb)) fail(v->where, "'" + name + "' is not finite");
    if (min_component(rgb) < 0) fail(v->where, "'" + name + "' is negative");
    if (use != SpectrumUse::reflectance) return rgb;
    if (max_component(rgb) > kRoundedOne)
        builder_.refuse(v->where, "'" + name + "' is larger than 1, the surface would create energy",
                        "it is clipped at 1");
    return min(rgb, splat(1));
}

ParamRgb Reader::textured_color(const std::string& name, Rgb fallback, SpectrumUse use) {
    if (const Object* texture = take_named(name)) {
        if (texture->tag != "texture")
            fail(where(name), "'" + name + "' must be a colour or a texture, not a " + texture->tag);
        const ScaledTexture scaled = load_scaled_texture(
            builder_, *texture, use == SpectrumUse::emission ? TextureUse::light : TextureUse::color);
        const ParamRgb out{scaled.scale, scaled.texture};
        return use == SpectrumUse::reflectance ? checked_reflectance(name, *texture, out) : out;
    }
    return {color(name, fallback, use), -1};
}

/// A texture that is more than 1 somewhere.
ParamRgb Reader::checked_reflectance(const std::string& name, const Object& texture, const ParamRgb& parameter) {
    if (builder_.validate_only) return parameter;
    const TextureFacts& facts = builder_.texture_facts[size_t(parameter.texture)];
    const float largest = max_component(parameter.value * facts.largest);
    if (!(largest > kRoundedOne)) return parameter;
    const std::string problem = fmt::format("'{}' is up to {:.4g}, by {}", name, largest, facts.file);
    if (!builder_.document.clips_reflectances) {
        builder_.warn(texture.where, problem + ": what reflects more than 1 creates energy");
        return parameter;
    }
    builder_.note(texture.where, problem + ", and is clipped at 1");
    return baked_color(builder_, *this, {parameter}, [](const std::vector<Rgb>& v) { return min(v[0], splat(1)); });
}

ParamFloat Reader::textured_number(const std::string& name, float fallback) {
    if (const Object* texture = take_named(name)) {
        if (texture->tag != "texture")
            fail(where(name), "'" + name + "' must be a number or a texture, not a " + texture->tag);
        const ScaledTexture scaled = load_scaled_texture(builder_, *texture, TextureUse::number);
        if (scaled.scale.x != scaled.scale.y || scaled.scale.x != scaled.scale.z)
            fail(texture->where, "a number cannot come from a texture that is scaled by a colour");
        return {without_rounding(scaled.scale.x), scaled.texture};
    }
    const Value* v = find(name);
    // A colour is the mean of its channels, as in Mitsuba 3.
    const bool colored = v && (v->kind == ValueKind::rgb || (v->kind == ValueKind::spectrum && v->samples.empty()));
    if (colored) used_values_.insert(v);
    const Rgb rgb = colored && v->kind == ValueKind::rgb ? v->rgb : splat(colored ? float(v->number) : 0);
    const float value = without_rounding(colored ? (rgb.x + rgb.y + rgb.z) / 3 : float(number(name, fallback)));
    if (!std::isfinite(value)) fail(where(name), "'" + name + "' is too large for a float");
    return {value, -1};
}

const Object* Reader::take(const std::string& tag) {
    // From where the last one of this tag was found: scenes may have a million emitters.
    for (size_t& i = next_child_[tag]; i < object_.children.size();) {
        const Child& child = object_.children[i++];
        if (child.object->tag == tag && used_children_.insert(&child).second) return child.object;
    }
    return nullptr;
}

const Object* Reader::take_named(const std::string& name) {
    const Child* child = child_named(name);
    if (!child) return nullptr;
    used_children_.insert(child);
    return child->object;
}

void Reader::ignore(std::initializer_list<const char*> names) {
    for (const char* name : names) {
        if (const Value* v = find(name)) used_values_.insert(v);
        if (const Child* child = child_named(name)) used_children_.insert(child);
    }
}

void Reader::leave(std::initializer_list<LeftOut> parameters, const std::string& why) {
    for (const auto& [name, done] : parameters) {
        const Value* v = find(name);
        if (!v || !used_values_.insert(v).second) continue;
        const bool is_text = v->kind == ValueKind::text, is_flag = v->kind == ValueKind::boolean;
        const std::string given = is_text   ? v->text
                                  : is_flag ? (v->number ? "true" : "false")
                                            : fmt::format("{}", v->number);
        if (fmt::format("|{}|", done).find("|" + given + "|") != std::string::npos) continue;
        builder_.note(v->where,
                      fmt::format("'{}' of {} '{}' is not followed: {}", name, object_.tag, object_.type, why));
    }
}

std::string Reader::unknown(const Value& value, const Plugins& known) const {
    return fmt::format("unknown parameter '{}' of {} '{}'{}", value.name, object_.tag, object_.type,
                       suggestion(known, value.name));
}

void Reader::fail_without(const std::string& name, const std::string& message) const {
    for (const Value& v : object_.values)
        if (!used_values_.contains(&v) && nearest_name({name}, v.name) == name) fail(v.where, unknown(v, {name}));
    fail(message);
}

void Reader::finish() {
    Plugins known = absent_;
    for (const Value* v : used_values_) known.push_back(v->name);
    for (const Value& v : object_.values)
        if (used_values_.count(&v))
            continue;
        else if ((object_.version < 2 && !builder_.document.edits.contains(v.where.file)) || is_one_of(kMarks, v.name))
            builder_.note(v.where,
                          fmt::format("parameter '{}' of {}{} is not known and left out{}{}", v.name, object_.tag,
                                      object_.type.empty() ? "" : " '" + object_.type + "'",
                                      object_.version < 2 ? ", as Mitsuba 0.6 does" : "", suggestion(known, v.name)));
        else
            builder_.refuse(v.where, unknown(v, known), "it is ignored");
    for (const Child& child : object_.children)
        if (!used_children_.count(&child))
            builder_.refuse(
                child.where,
                (is_one_of({"medium", "phase", "subsurface", "volume"}, child.object->tag) ? "not supported: "
                                                                                           : "unexpected ") +
                    child.object->tag + " '" + child.object->type + "'" +
                    (child.name.empty() ? "" : " (name '" + child.name + "')") + " in " + object_.tag + " '" +
                    object_.type + "'",
                "it is ignored");
}

Matrix rigid_part(const Matrix& m, bool& problem) {
    const Vec3d x = column(m, 0), y = column(m, 1), z = column(m, 2);
    // Published matrices have six digits.
    problem = !is_orthogonal(m, 1e-3);
    for (const Vec3d& c : {x, y, z}) problem |= !(std::abs(length(c) - 1) < 1e-3);
    // Gram-Schmidt from z, the view direction; a reflection stays one.
    const Vec3d uz = z * (1 / length(z));
    const Vec3d py = y - uz * dot(y, uz), uy = py * (1 / length(py)), right = cross(uy, uz);
    return from_columns(right * (dot(right, x) < 0 ? -1 : 1), uy, uz, column(m, 3));
}

}  // namespace ambilux::document
