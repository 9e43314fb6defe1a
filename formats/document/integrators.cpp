#include <fmt/format.h>

#include <algorithm>

#include "formats/document/builder.h"
#include "formats/document/plugins.h"
#include "transport/subpath/subpath.h"

namespace ambilux::document {

namespace {

/// Adds something to the image of the integrator inside of it, or makes it in another way.
const Plugins kAdapters = {"moment", "aov", "multichannel", "adaptive", "irrcache"};

/// Solves the equation that the path tracer solves.
const Plugins kFullTransport = {
    "volpath",       "volpath_simple", "volpathmis", "pssmlt", "mlt",       "erpt",       "photonmapper",
    "ppm",           "sppm",           "vpl",        "prb",    "prb_basic", "prbvolpath", "path_projective",
    "prb_projective"};

const Plugins kOwn = {"direct", "path", "ptracer", "bdpt"};

/// Shows another quantity than light.
const Plugins kOtherQuantities = {"depth", "stokes", "field", "ao"};

/// What other integrators are steered by.
constexpr const char* kSteering[] = {"samples_per_pass", "block_size",  "timeout",     "light_image",
                                     "sample_direct",    "granularity", "brute_force", "sppm_radius"};

void read_lengths(Reader& in, IntegratorHint& hint) {
    hint.max_depth = int(std::clamp<int64_t>(in.integer("max_depth", -1), -2, 1 << 30));
    hint.rr_depth = int(std::clamp<int64_t>(in.integer("rr_depth", 5), 0, 1 << 30));
    if (hint.max_depth < -1) in.fail(in.where("max_depth"), "max_depth must be -1 or larger");
    if (hint.max_depth >= int(kMaxDepth))
        in.fail(in.where("max_depth"), fmt::format("max_depth may be {} at most, or -1 for no limit", kMaxDepth - 1));
}

/// One of another program: how it samples does not matter here, its path lengths do.
void build_foreign_integrator(Builder& builder, Reader& in) {
    const Object* nested = in.take("integrator");
    builder.note(in.where(), fmt::format("integrator '{}' is not known{}; {} is used", in.object().type,
                                         what_is_meant("integrator", in.object().type),
                                         nested ? "the one inside of it" : "path, with its max_depth,"));
    if (nested) return build_integrator(builder, *nested);
    builder.scene.integrator.type = "path";
    read_lengths(in, builder.scene.integrator);
    builder.scene.integrator.hide_emitters = in.boolean("hide_emitters", false);
}

/// The integrator inside of an adapter.
const Object& inner_integrator(Builder& builder, Reader& in) {
    const std::string& type = in.object().type;
    const Object* nested = in.take("integrator");
    if (!nested) in.fail(type + " has no nested integrator");
    if (type == "moment") {
        in.finish();
    } else {
        builder.note(in.where(), "of an integrator of type '" + type + "' the one inside of it is used");
        // Values steer it, or name further images.
        while (in.take("integrator")) {}
    }
    return *nested;
}

}  // namespace

void build_integrator(Builder& builder, const Object& object) {
    Reader in(builder, object);
    IntegratorHint& hint = builder.scene.integrator;
    const std::string& type = object.type;
    if (is_one_of(kAdapters, type)) return build_integrator(builder, inner_integrator(builder, in));
    const bool full = is_one_of(kFullTransport, type), other = is_one_of(kOtherQuantities, type);
    if (!full && !other && !is_one_of(kOwn, type)) return build_foreign_integrator(builder, in);
    if (type == "direct") {
        hint.type = "path";
        hint.max_depth = 2;
        in.leave(
            {{"shading_samples", "1"}, {"emitter_samples", "1"}, {"bsdf_samples", "1"}, {"luminaire_samples", "1"}},
            "paths take one sample of each");
    } else if (!other) {
        hint.type = type == "ptracer" ? "light" : (type == "bdpt" ? "bdpt" : "path");
        read_lengths(in, hint);
        if (full)
            builder.note(object.where,
                         "integrator '" + type + "' converges to the image of the path tracer, which is used");
    } else {
        builder.refuse(object.where, "integrator type '" + type + "' is not supported", "path is used");
        hint.type = "path";
        return;
    }
    hint.hide_emitters = in.boolean("hide_emitters", false);
    in.leave({{"strict_normals", "true"}}, "both normals always count");  // surface_scattering.h, sides_agree
    if (!full)
        for (const char* name : kSteering) in.leave({{name}}, "the command line says how much is rendered");
    // Of the others all values are about how they do it.
    if (!full) in.finish();
}

const Plugins& integrator_plugins() {
    static const Plugins known = [] {
        Plugins list = kOwn;
        for (const Plugins& more : {kAdapters, kFullTransport}) list.insert(list.end(), more.begin(), more.end());
        return list;
    }();
    return known;
}

}  // namespace ambilux::document
