// Environment map: radiance by a latitude-longitude image, importance sampled by a piecewise-constant density over the
// image.
//
// Mapping (Mitsuba 3's envmap): u = atan2(x, -z) / 2pi runs to the right, v = theta / pi from the top (+y) down.
// Columns are periodic with centres at (i+0.5)/width; rows are spread from pole to pole, row j at v = j/(height-1).
// Density: cells of 1/width by 1/height in (u,v), drawn from alias tables: a row, then a column in it (one table over
// all cells would leave no bits of a random number for its threshold). That reads a few bytes that stay in the cache
// and 16 that do not; the density alone reads those 16. A cell's probability must be positive wherever the interpolated
// radiance in it is: envmap_cell_weight gives weights that guarantee it.
#pragma once

#include "core/sampling.h"
#include "scene/alias_table.h"
#include "transport/emitter/directional.h"
#include "transport/texture.h"

namespace ambilux {

/// Image coordinates of a direction in the map's own frame; precise at the poles too.
AMBILUX_HD Vec2f envmap_uv(Vec3f local) {
    const float u = atan2f(local.x, -local.z) * kInv2Pi;
    const float v = atan2f(sqrtf(local.x * local.x + local.z * local.z), local.y) * kInvPi;
    return {u < 0.0f ? u + 1.0f : u, v};
}

/// Unit direction in the map's own frame of image coordinates.
AMBILUX_HD Vec3f envmap_direction(Vec2f uv, float& sin_theta) {
    float cos_theta, sin_phi, cos_phi;
    sin_cos_turns(0.5f * uv.y, sin_theta, cos_theta);
    sin_cos_turns(uv.x, sin_phi, cos_phi);
    return {sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta};
}

/// Radiance at image coordinates, u periodic, v in [0,1].
AMBILUX_HD Rgb envmap_lookup(const SceneView& view, const Emitter& emitter, Vec2f uv) {
    const Texture& texture = view.textures[emitter.radiance.texture];
    const int32_t w = int32_t(texture.width), h = int32_t(texture.height);
    const float x = reduce_coordinate(uv.x, WrapMode::repeat) * float(w) - 0.5f;
    const float y = clamp(uv.y, 0.0f, 1.0f) * float(h - 1);
    const float fx = floorf(x), fy = floorf(y);
    const float wx = x - fx, wy = y - fy;
    const uint32_t x0 = wrap_texel(int32_t(fx), w, WrapMode::repeat),
                   x1 = wrap_texel(int32_t(fx) + 1, w, WrapMode::repeat);
    const uint32_t y0 = wrap_texel(int32_t(fy), h, WrapMode::clamp),
                   y1 = wrap_texel(int32_t(fy) + 1, h, WrapMode::clamp);
    const Rgb row0 = load_texel(view, texture, x0, y0) * (1.0f - wx) + load_texel(view, texture, x1, y0) * wx;
    const Rgb row1 = load_texel(view, texture, x0, y1) * (1.0f - wx) + load_texel(view, texture, x1, y1) * wx;
    return emitter.radiance.value * (row0 * (1.0f - wy) + row1 * wy);
}

/// Radiance that arrives from unit `wi`, world space.
AMBILUX_HD Rgb envmap_radiance(const SceneView& view, const Emitter& emitter, Vec3f wi) {
    return envmap_lookup(view, emitter, envmap_uv(emitter.to_local.vector(wi)));
}

/// Unnormalised probability of density cell (x,y): mean of luminance times sin(theta) over a 4x4 grid in the cell. The
/// grid includes the corners: a texel reaches a cell from one side, so that the weight is positive wherever the
/// interpolated radiance is.
AMBILUX_HD float envmap_cell_weight(const SceneView& view, const Emitter& emitter, uint32_t x, uint32_t y) {
    const Texture& texture = view.textures[emitter.radiance.texture];
    float sum = 0.0f;
    for (int j = 0; j < 4; ++j) {
        const float v = (float(y) + float(j) * (1.0f / 3.0f)) / float(texture.height);
        for (int i = 0; i < 4; ++i) {
            const float u = (float(x) + float(i) * (1.0f / 3.0f)) / float(texture.width);
            sum += max(luminance(envmap_lookup(view, emitter, {u, v})), 0.0f) * sinf(v * kPi);
        }
    }
    return sum * (1.0f / 16.0f);
}

/// Bucket of cell (x,y) in the alias tables.
AMBILUX_HD EnvironmentCell environment_cell(const SceneView& view, uint32_t width, uint32_t x, uint32_t y) {
    return view.environment_cells[uint64_t(y) * width + x];
}

/// Density per unit square of (u,v) to density per solid angle: dw = 2 pi² sin(theta) du dv.
AMBILUX_HD float envmap_pdf_to_sa(float pdf_uv, float sin_theta) {
    return sin_theta > 0.0f ? pdf_uv / (2.0f * kPi * kPi * sin_theta) : 0.0f;
}

/// Direction towards the map sampled by its density, and where in the image that is; the radiance is envmap_lookup
/// there. `wi` unit, world space. `u` in [0,1)^3: x picks the column, z the row (each spends all of its 24 bits, so
/// that density and sampling agree exactly), and the halves of y place the point in the cell, at one of 4096 by 4096
/// positions.
AMBILUX_HD void envmap_sample_direction(const SceneView& view, const Emitter& emitter, Vec3f u, Vec3f& wi, Vec2f& uv,
                                        float& pdf_sa) {
    const Texture& texture = view.textures[emitter.radiance.texture];
    const uint32_t row_ticket = ticket_of(u.z), ticket = ticket_of(u.x), place = ticket_of(u.y);
    uint32_t y = bucket_of(row_ticket, texture.height);
    const AliasBucket row = view.environment_rows[y];
    if (row_ticket >= row.threshold) y = row.alias;
    uint32_t x = bucket_of(ticket, texture.width);
    const EnvironmentCell cell = environment_cell(view, texture.width, x, y);
    const bool own = ticket < cell.threshold;
    if (!own) x = cell.alias;
    const float du = (float(place >> 12) + 0.5f) * 0x1p-12f, dv = (float(place & 4095u) + 0.5f) * 0x1p-12f;
    uv = {(float(x) + du) / float(texture.width), (float(y) + dv) / float(texture.height)};
    float sin_theta;
    wi = normalize(emitter.to_world.vector(envmap_direction(uv, sin_theta)));
    pdf_sa = envmap_pdf_to_sa(own ? cell.pdf : cell.alias_pdf, sin_theta);
}

/// Density per solid angle with which envmap_sample_direction returns unit `wi`.
AMBILUX_HD float envmap_pdf_direction(const SceneView& view, const Emitter& emitter, Vec3f wi) {
    const Texture& texture = view.textures[emitter.radiance.texture];
    const Vec3f local = emitter.to_local.vector(wi);
    const Vec2f uv = envmap_uv(local);
    const uint32_t x = wrap_texel(int32_t(uv.x * float(texture.width)), int32_t(texture.width), WrapMode::clamp);
    const uint32_t y = wrap_texel(int32_t(uv.y * float(texture.height)), int32_t(texture.height), WrapMode::clamp);
    const float sin_theta = sqrtf(local.x * local.x + local.z * local.z);
    return envmap_pdf_to_sa(environment_cell(view, texture.width, x, y).pdf, sin_theta);
}

/// Fills in all but the radiance, which is envmap_lookup at `s.env_uv`.
AMBILUX_HD bool envmap_sample_direct(const SceneView& view, const Emitter& emitter, Vec3f reference_p, Vec3f u,
                                     EmitterSample& s) {
    envmap_sample_direction(view, emitter, u, s.wi, s.env_uv, s.pdf_sa);
    s.pdf_sa *= emitter.pick_probability;
    place_at_infinity(view, reference_p, s);
    s.radiance = emitter.radiance.value;
    s.delta = false;
    return true;
}

template <>
struct EmitterFunctions<EnvmapEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView& view, const Emitter& e, Vec3f reference_p, Vec3f u,
                                         EmitterSample& s) {
        return envmap_sample_direct(view, e, reference_p, u, s);
    }
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView& view, const Emitter& e, Vec3f u, Vec2f u_direction,
                                           EmissionSample& s) {
        Vec2f uv;
        envmap_sample_direction(view, e, {u_direction.x, u_direction.y, u.z}, s.d, uv, s.pdf_dir);
        s.radiance = envmap_lookup(view, e, uv);
        s.d = -s.d;
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView& view, const Emitter& e, Vec3f, Vec3f d) {
        return envmap_pdf_direction(view, e, -d);
    }
};

}  // namespace ambilux
