// The weights of bidirectional path tracing in the slow and obvious way: the density of every strategy that can sample
// a given path, as a product of the densities of its steps in double precision. Nothing here is recursive and nothing
// comes from transport/mis/bidirectional.h but the names of masks; single densities of BSDFs, emitters and sensors are
// the project's, which have tests of their own. Definitions: docs/theory.md.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "transport/emitter/light_tree.h"
#include "transport/mis/bidirectional.h"
#include "transport/surface_scattering.h"

namespace ambilux::test {

constexpr Features kOracleFeatures = kAllFeatures;

/// Path x_0 ... x_k from the light to the camera: x_0 is on an emitter, x_1 ... x_(k-1) on surfaces, x_k on the camera.
struct OraclePath {
    struct Vertex {
        SurfacePoint point;
        bool delta;  ///< light goes on here by a delta lobe
        uint32_t prim;
        float u, v;
    };
    uint32_t k;  ///< segments
    uint32_t emitter;
    SurfacePoint light;            ///< x_0 of an area emitter
    Vec3f light_p;                 ///< x_0 of a point or spot emitter
    std::vector<Vertex> vertices;  ///< [i] is x_i; the first entry is not used
    std::vector<Vec3f> to_eye;     ///< [i]: unit direction from x_i to x_(i+1)
    Vec3f camera_p;                ///< x_k: pinhole or lens point
    Vec2f lens_u;
};

/// What subpaths of a side sample by instead of the BSDF: the density of `left` at a vertex that they reached from
/// `arrived`, where the BSDF has `bsdf`; of deltas the probability.
using SideDensity = std::function<double(const OraclePath::Vertex&, Vec3f arrived, Vec3f left, double bsdf)>;
struct SideDensities {
    SideDensity eye, light;
};

/// A local density, and how much rounding of its arguments may change it (relative).
struct OracleDensity {
    double value = 1, error = 0;
};

/// Densities of the steps of both subpaths over one path.
struct OracleSteps {
    std::vector<OracleDensity> light;  ///< [i]: of x_i by a light subpath that came through x_0 ... x_(i-1)
    std::vector<OracleDensity> eye;    ///< [i]: of x_i by an eye subpath that came through x_k ... x_(i+1)
    OracleDensity next_event;          ///< of x_0 by next event estimation at x_1
};

/// Strategies s = 0 ... k of one path: which of StrategyBits they belong to (0: does not exist) and the density to
/// sample the path.
struct OracleStrategies {
    std::vector<uint32_t> group;
    std::vector<double> density;
    std::vector<double> merges;  ///< [j]: of both subpaths ending at x_j; 0 where they cannot
    bool scaled = false;         ///< those of merges by what merges have in common
};

/// Merging of light and eye vertices: how many light subpaths a disk around a vertex expects at density 1, whether
/// eye subpaths merge at their first vertex, and whether merges leave to hits only what none of them finds.
struct OracleMerges {
    double eta = 0;
    bool first = true;
    bool alone = false;
    double largest_footprint =
        0;  ///< radius; 0: disks are the same for all paths. Else smaller pixels have smaller ones
    double least_area = 1;
    uint32_t scaled_up_to = 0;  ///< vertices of paths whose merges are scaled by what they have in common
    double least_factor = 0;
};

namespace oracle {

constexpr Features F = kOracleFeatures;
/// Rounding of a unit vector that went through a frame and back.
constexpr float kDirectionError = 0x1p-21f;

inline double dot64(Vec3f a, Vec3f b) { return double(a.x) * b.x + double(a.y) * b.y + double(a.z) * b.z; }

inline double distance2(Vec3f a, Vec3f b) {
    const double x = double(a.x) - b.x, y = double(a.y) - b.y, z = double(a.z) - b.z;
    return x * x + y * y + z * z;
}

/// A density of the vertex at `p` that a ray along `d` meets under normal `ng`, per area of the plane across the ray,
/// to one per area of the surface.
inline void times_cosine(OracleDensity& q, Vec3f ng, Vec3f d) {
    const double c = std::abs(dot64(ng, d));
    q.value *= c;
    q.error += double(kDirectionError) / c;
}
inline void over_distance(OracleDensity& q, double d2, Vec3f error_a, Vec3f error_b) {
    q.value /= d2;
    q.error +=
        4.0 * double(length(error_a) + length(error_b)) / std::sqrt(d2);  // rays start that far off their surfaces
}

/// f at (a,b), and how it changes when the unit vectors a and b are off by rounding.
template <class Function>
OracleDensity at_directions(Vec3f a, Vec3f b, bool conditioning, Function f) {
    OracleDensity q{double(f(a, b)), 0};
    if (!conditioning) return q;
    for (int which = 0; which < 2; ++which) {
        const Frame frame = frame_from_normal(which ? b : a);
        for (Vec3f step : {frame.s, frame.t}) {
            double worst = 0;
            for (float sign : {-1.0f, 1.0f}) {
                const Vec3f moved = normalize((which ? b : a) + step * (sign * kDirectionError));
                const double changed = double(which ? f(a, moved) : f(moved, b));
                worst = std::max(worst, std::abs(changed / q.value - 1));
            }
            q.error += worst;
        }
    }
    return q;
}

/// The delta lobe that sends `arrived` (pointing away from the surface) to `left`: its probability, and relative index
/// of the side of `left` to that of `arrived`.
struct DeltaLobe {
    double probability, eta, cos_arrived, cos_left;  ///< cosines to the shading normal
};
inline DeltaLobe delta_lobe(const SceneView& scene, const SurfacePoint& point, Vec3f arrived, Vec3f left) {
    const Scattering s = make_scattering<F>(scene, point, arrived);
    const Vec3f local = s.frame.to_local(left);
    const bool transmitted = s.wi.z * local.z < 0;
    BsdfSample sample;
    // Every BSDF draws its reflected delta for small numbers and its transmitted one for large ones.
    if (!bsdf_sample<F>(s.bsdf, s.wi, {transmitted ? kOneMinusEpsilon : 0.0f, 0.5f, 0.5f}, TransportMode::radiance,
                        sample))
        return {0, 1, 1, 1};
    const bool found = (sample.flags & kScatterDelta) && bool(sample.flags & kScatterTransmission) == transmitted;
    return {found ? double(sample.pdf_sa) : 0.0, double(sample.eta), std::abs(double(s.wi.z)),
            std::abs(double(local.z))};
}

/// Density per solid angle of `left` for a subpath that arrived from `arrived`. For a delta: the coefficient of
/// delta(left
/// - the direction that the light takes), a delta function over directions towards the eye. A subpath from the eye
/// draws directions towards the light; the change of variables is the ratio of solid angles, n_l² cos_l / (n_e² cos_e)
/// by Snell's law (Veach 1997, section 5.2).
inline OracleDensity scattering_step(const SceneView& scene, const OraclePath::Vertex& x, Vec3f arrived, Vec3f left,
                                     bool from_light, bool conditioning, const SideDensity& side = {}) {
    if (side)
        return at_directions(arrived, left, conditioning, [&](Vec3f a, Vec3f l) {
            return side(x, a, l, scattering_step(scene, x, a, l, from_light, false).value);
        });
    return at_directions(arrived, left, conditioning, [&](Vec3f a, Vec3f l) -> double {
        if (!x.delta) return scatter_pdf<F>(make_scattering<F>(scene, x.point, a), l);
        const DeltaLobe lobe = delta_lobe(scene, x.point, a, l);
        if (from_light) return lobe.probability;
        // Here `arrived` is towards the eye and `left` towards the light, eta = n_l / n_e.
        return lobe.probability * (lobe.eta == 1 ? 1.0 : lobe.eta * lobe.eta * lobe.cos_left / lobe.cos_arrived);
    });
}

}  // namespace oracle

/// Chance that a ray meets the emitter that `prim` belongs to, of one opacity everywhere. Weights know it in steps of
/// 1/255, upwards.
inline double emitter_opacity(const SceneView& scene, uint32_t prim) {
    return std::ceil(255 * double(scene.materials[scene.shapes[scene.shape_of(prim)].material].opacity.value)) / 255;
}

/// Densities of all steps. Measures: area; x_0 of an emitter at infinity: solid angle; the camera: 1 (both subpaths
/// take its lens point alike), and x_(k-1) by the camera at density 1 per pixel. `conditioning`: errors too.
inline OracleSteps oracle_steps(const SceneView& scene, const OraclePath& path, bool conditioning,
                                const SideDensities& sides = {}) {
    using namespace oracle;
    const uint32_t k = path.k;
    const Emitter& e = scene.emitters[path.emitter];
    const bool infinite = is_infinite(e.type), area = e.type == EmitterType::area;
    const Vec3f none = {0, 0, 0};
    const auto position = [&](uint32_t i) {
        return i == k ? path.camera_p : (i == 0 ? (area ? path.light.p : path.light_p) : path.vertices[i].point.p);
    };
    const auto error = [&](uint32_t i) {
        return i == k ? none : (i == 0 ? (area ? path.light.p_error : none) : path.vertices[i].point.p_error);
    };
    const auto normal = [&](uint32_t i) { return i == 0 ? path.light.ng : path.vertices[i].point.ng; };
    OracleSteps steps;
    steps.light.resize(k);
    steps.eye.resize(k);

    // Light subpath: a point or direction of the emitter, the other of the two, then BSDFs.
    const double pick = e.pick_probability;
    const OracleDensity emission = at_directions(path.to_eye[0], path.to_eye[0], conditioning, [&](Vec3f d, Vec3f) {
        return pdf_emission_direction<F>(scene, path.emitter, path.light.ng, d);
    });
    const double emission_position = pdf_emission_position<F>(scene, path.emitter, area ? path.light.prim : kNone);
    steps.light[0].value = pick;
    if (infinite) {
        steps.light[0].value *= emission.value;
        steps.light[0].error = emission.error;
    } else {
        steps.light[0].value *= emission_position;
    }
    for (uint32_t i = 1; i < k; ++i) {
        OracleDensity& q = steps.light[i];
        if (i == 1)
            q = infinite ? OracleDensity{emission_position, 0} : emission;
        else
            q = scattering_step(scene, path.vertices[i - 1], -path.to_eye[i - 2], path.to_eye[i - 1], true,
                                conditioning, sides.light);
        times_cosine(q, normal(i), path.to_eye[i - 1]);
        if (!(infinite && i == 1)) over_distance(q, distance2(position(i - 1), position(i)), error(i - 1), error(i));
    }

    // Next event estimation.
    if (k >= 2) {
        const Vec3f to_light = -path.to_eye[0];
        if (area) {
            const auto direct = [&](Vec3f from) {
                return pdf_emitter_direct<F>(scene, path.emitter, from, to_light, path.light);
            };
            OracleDensity& q = steps.next_event;
            q.value = direct(position(1));
            if (conditioning)
                for (int axis = 0; axis < 3; ++axis) {
                    Vec3f moved = position(1);
                    moved[axis] += 2 * error(1)[axis] + length(error(0));
                    q.error += std::abs(double(direct(moved)) / q.value - 1);
                }
            times_cosine(q, normal(0), to_light);
            over_distance(q, distance2(position(0), position(1)), error(0), error(1));
        } else if (is_delta(e.type)) {
            steps.next_event.value = is_beam(e.type) ? 0 : pick;
        } else {
            steps.next_event = at_directions(to_light, to_light, conditioning,
                                             [&](Vec3f d, Vec3f) { return pdf_environment_direct<F>(scene, d); });
        }
        if (scene.light_tree) {
            // Picked by the tree, for x_1. Rays know that place as well as they know where they began.
            const auto over_power = [&](Vec3f at) -> double {
                return LightsByTree::over_power(scene, {at, normal(1)}, path.emitter, path.light.prim);
            };
            OracleDensity& q = steps.next_event;
            const double here = over_power(position(1));
            q.value *= here;
            if (conditioning)
                for (int axis = 0; axis < 3; ++axis)
                    for (float sign : {-1.0f, 1.0f}) {
                        Vec3f moved = position(1);
                        moved[axis] += sign * 4 * error(1)[axis];
                        q.error += std::abs(over_power(moved) / here - 1);
                    }
        }
    }

    // Eye subpath.
    const Sensor& sensor = scene.sensor;
    const Vec3f towards = -path.to_eye[k - 1];
    const Vec3f axis = sensor.to_world.vector({0, 0, 1});
    for (uint32_t i = 0; i < k; ++i) {
        if (i == 0 && !area && !(infinite && !is_delta(e.type))) {
            steps.eye[0].value = 0;  // no ray meets it
            continue;
        }
        OracleDensity& q = steps.eye[i];
        if (i == k - 1) {
            const double cos_camera = is_latlong(sensor.type) ? double(camera_cosine<F>(sensor, towards))
                                                              : dot64(towards, axis) / std::sqrt(dot64(axis, axis));
            q.value = camera_delta_direction(sensor) ? camera_pdf_position(sensor)
                                                     : camera_pdf_direction_sa<F>(sensor, float(cos_camera));
            q.error = camera_delta_direction(sensor) ? 0 : 3 * double(kDirectionError) / cos_camera;
        } else {
            q = scattering_step(scene, path.vertices[i + 1], path.to_eye[i + 1], -path.to_eye[i], false, conditioning,
                                sides.eye);
        }
        if (i == 0 && infinite) continue;
        if (i == 0) q.value *= emitter_opacity(scene, path.light.prim);
        times_cosine(q, normal(i), path.to_eye[i]);
        if (!(i == k - 1 && camera_delta_direction(sensor)))
            over_distance(q, distance2(position(i), position(i + 1)), error(i), error(i + 1));
    }
    return steps;
}

/// The disk of merges over the largest one: as the pixel's footprint at the vertex that the camera sees.
inline double oracle_merge_area(const SceneView& scene, const OraclePath& path, const OracleMerges& merges) {
    if (!(merges.largest_footprint > 0)) return 1;
    const Sensor& sensor = scene.sensor;
    const Vec3f d = -path.to_eye[path.k - 1];
    double footprint = 0;
    if (camera_delta_direction(sensor))
        footprint = 1 / double(camera_pdf_position(sensor));
    else
        footprint = oracle::distance2(path.vertices[path.k - 1].point.p, path.camera_p) /
                    double(camera_pdf_direction_sa<oracle::F>(sensor, camera_cosine<oracle::F>(sensor, d)));
    return std::clamp(footprint / (double(kPi) * merges.largest_footprint * merges.largest_footprint),
                      merges.least_area, 1.0);
}

/// Factors of merges at x_j by the chance that another subpath of either side comes by nearby.
inline std::vector<double> oracle_merge_factors(const SceneView& scene, const OraclePath& path,
                                                const OracleSteps& steps, double least) {
    using namespace oracle;
    const uint32_t k = path.k;
    const EmitterType type = scene.emitters[path.emitter].type;
    const Sensor& sensor = scene.sensor;
    const Vec3f seen = path.vertices[k - 1].point.p;
    double distance = std::sqrt(distance2(seen, path.camera_p));
    if (camera_delta_direction(sensor)) {  // from where rays begin
        const Vec3f axis = sensor.to_world.vector({0, 0, 1});
        const double scale = std::sqrt(dot64(axis, axis));
        distance = dot64(seen - sensor.to_world.point({0, 0, 0}), axis) / scale - double(sensor.near_clip) * scale;
    }
    const double nearby = M_PI * std::pow(std::tan(M_PI / 180) * distance, 2);
    const auto chance = [&](const OracleDensity& q) { return std::min(1.0, q.value * nearby); };
    std::vector<double> light(k, 1.0), eye(k, 1.0), factor(k, 1.0);
    if (type == EmitterType::area) light[0] = chance(steps.light[0]);
    for (uint32_t j = 1; j < k; ++j) {
        const bool follows = j == 1 ? is_beam(type) : path.vertices[j - 1].delta;
        light[j] = light[j - 1] * (follows ? 1 : chance(steps.light[j]));
    }
    for (uint32_t j = k - 1; j > 0; --j)
        eye[j] =
            j == k - 1 ? chance(steps.eye[j]) : eye[j + 1] * (path.vertices[j + 1].delta ? 1 : chance(steps.eye[j]));
    for (uint32_t j = 1; j + 1 < k; ++j) {
        const double l = std::max(light[j], 1e-30), e = std::max(eye[j], 1e-30);
        factor[j] = std::max(e / (e + l - e * l), least);
    }
    return factor;
}

/// Densities of all strategies for a path. `light_subpaths`: light subpaths per eye subpath of a pixel; `connections`:
/// light subpaths that an eye vertex is connected with.
inline OracleStrategies oracle_strategies(const SceneView& scene, const OraclePath& path, const OracleSteps& steps,
                                          double light_subpaths, double connections, const OracleMerges& merges = {}) {
    const uint32_t k = path.k;
    const EmitterType type = scene.emitters[path.emitter].type;
    const auto delta = [&](uint32_t i) { return path.vertices[i].delta; };
    OracleStrategies r;
    r.group.assign(k + 1, 0);
    r.density.assign(k + 1, 0.0);
    for (uint32_t s = 0; s <= k; ++s) {
        double p = 1;
        for (uint32_t i = 0; i < k; ++i)
            p *= i >= s ? steps.eye[i].value
                        : (i == 0 && s == 1 && k > 1 ? steps.next_event.value : steps.light[i].value);
        uint32_t group = 0;
        if (s == 0) {
            if (!is_delta(type)) group = kHitStrategies;
        } else if (s == k) {
            // A light subpath to the vertex that the camera is connected with. Of one segment: a point of an area
            // emitter, which nothing else is connected with.
            if (k == 1 ? type == EmitterType::area : !delta(k - 1)) group = kLightStrategies;
            p *= light_subpaths;
        } else if (s == 1) {
            if (!delta(1) && !is_beam(type)) group = kNextEventStrategies;
        } else if (!delta(s - 1) && !delta(s)) {
            group = kConnectionStrategies;
            p *= connections;
        }
        r.group[s] = group;
        r.density[s] = group ? p : 0.0;
    }
    r.merges.assign(k, 0.0);
    for (uint32_t j = 1; j < k; ++j) {
        if (delta(j) || (j == k - 1 && !merges.first)) continue;
        double p = merges.eta * oracle_merge_area(scene, path, merges);
        for (uint32_t i = 0; i < k; ++i) p *= (i <= j ? steps.light[i].value : 1) * (i >= j ? steps.eye[i].value : 1);
        r.merges[j] = p;
        if (merges.alone) r.group[0] = 0, r.density[0] = 0;
    }
    r.scaled = k >= 2 && k - 1 <= merges.scaled_up_to;
    if (r.scaled) {
        const std::vector<double> factor = oracle_merge_factors(scene, path, steps, merges.least_factor);
        for (uint32_t j = 1; j < k; ++j) r.merges[j] *= factor[j];
    }
    // The environment that the camera sees belongs to both masks that could show it.
    if (k == 1 && is_infinite(type) && !is_delta(type)) r.group[0] = kHitStrategies | kLightStrategies;
    return r;
}

/// Weight of a strategy of density `own` when only the strategies of `mask` are used, and merges where there are any.
inline double oracle_weight_of(const OracleStrategies& all, double own, uint32_t mask, MisHeuristic heuristic) {
    double sum = 0;
    const auto add = [&](double density) {
        const double ratio = density / own;
        sum += heuristic == MisHeuristic::power ? ratio * ratio : ratio;
    };
    for (size_t i = 0; i < all.density.size(); ++i)
        if (all.group[i] & mask) add(all.density[i]);
    for (const double p : all.merges) add(p);
    return 1 / sum;
}
inline double oracle_weight(const OracleStrategies& all, uint32_t s, uint32_t mask, MisHeuristic heuristic) {
    return oracle_weight_of(all, all.density[s], mask, heuristic);
}
/// Weight of the merge at x_j.
inline double oracle_merge_weight(const OracleStrategies& all, uint32_t j, uint32_t mask, MisHeuristic heuristic) {
    return oracle_weight_of(all, all.merges[j], mask, heuristic);
}

/// How much rounding of directions and positions may change that weight, relative, to first order: densities i and s
/// differ in the steps between them.
inline double oracle_weight_error(const OracleStrategies& all, const OracleSteps& steps, uint32_t s, uint32_t mask,
                                  MisHeuristic heuristic) {
    const uint32_t k = uint32_t(all.density.size()) - 1;
    const auto step = [&](uint32_t strategy, uint32_t i) {
        return i >= strategy ? steps.eye[i].error
                             : (i == 0 && strategy == 1 && k > 1 ? steps.next_event.error : steps.light[i].error);
    };
    double sum = 0, error = 0;
    for (uint32_t other = 0; other <= k; ++other) {
        if (!(all.group[other] & mask) || !(all.density[other] > 0)) continue;
        const double ratio = all.density[other] / all.density[s],
                     term = heuristic == MisHeuristic::power ? ratio * ratio : ratio;
        double e = 0;
        for (uint32_t i = 0; i < std::max(other, s); ++i) {
            // Light steps below both are the same factor, except that of next event estimation.
            const bool differs = i >= std::min(other, s) || (i == 0 && (other == 1 || s == 1));
            if (differs && other != s) e += step(other, i) + step(s, i);
        }
        sum += term;
        error += term * e * (heuristic == MisHeuristic::power ? 2 : 1);
    }
    for (uint32_t j = 0; j < all.merges.size(); ++j) {
        const double ratio = all.merges[j] / all.density[s],
                     term = heuristic == MisHeuristic::power ? ratio * ratio : ratio;
        double e = s == 1 ? steps.next_event.error : 0;
        for (uint32_t i = 0; i < k; ++i) {
            if ((i <= j) != (i < s)) e += steps.light[i].error;
            if ((i >= j) != (i >= s)) e += steps.eye[i].error;
            if (all.scaled) e += steps.light[i].error + steps.eye[i].error;
        }
        sum += term;
        error += term * e * (heuristic == MisHeuristic::power ? 2 : 1);
    }
    return error / sum;
}

}  // namespace ambilux::test
