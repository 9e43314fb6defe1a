// Paths that light and eye subpaths find in small scenes of everything, and the comparison of their recursive weights
// with tests/support/bidirectional_oracle.h.
#pragma once

#include <cstdio>
#include <map>
#include <string>

#include "accel/cwbvh.h"
#include "accel/light_tree.h"
#include "core/rng.h"
#include "formats/load.h"
#include "tests/support/bidirectional_oracle.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"
#include "transport/emitter/light_tree.h"
#include "transport/mis/bidirectional.h"
#include "transport/subpath/camera_connection.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/emission.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/scatter.h"
#include "transport/subpath/start.h"

namespace ambilux::test {

constexpr Features F = kOracleFeatures;
constexpr uint32_t kMaxVertices = 6;  ///< surfaces per subpath

/// Everything counts, and nothing ends a subpath.
template <class Mis>
Rules<Mis> all_rules(const Mis& mis) {
    Rules<Mis> r{};
    r.mis = mis;
    if constexpr (requires { directions_of(mis); }) r.directions = directions_of(mis);
    r.max_depth = kMaxDepth;
    r.rr_depth = ~0u;
    r.count_hits = r.count_environment = r.next_event = r.splat = r.connect = true;
    return r;
}

// ---- scenes ----

inline std::string bsdf_sphere(float x, float z, const std::string& bsdf) {
    return "<shape type='sphere'><point name='center' x='" + std::to_string(x) + "' y='0.36' z='" + std::to_string(z) +
           "'/><float name='radius' value='0.35'/>" + bsdf + "</shape>";
}

inline std::string asset(const std::string& name) {
    return std::string("<string name='filename' value='" AMBILUX_SOURCE_DIR "/scenes/assets/") + name + "'/>";
}

inline std::string rgb(const std::string& name, const std::string& value) {
    return "<rgb name='" + name + "' value='" + value + "'/>";
}

/// A floor with bodies of all BSDFs on it, within |x|, |z| < 2.
inline std::string bodies() {
    const std::string aniso =
        "<bsdf type='roughconductor'><string name='material' value='Cu'/><string name='distribution' "
        "value='ggx'/><float name='alpha_u' value='0.08'/><float name='alpha_v' value='0.35'/></bsdf>";
    const std::string glass = "<bsdf type='dielectric'><float name='int_ior' value='1.5'/></bsdf>";
    const std::string plain_map =
        "<boolean name='flip_invalid_normals' value='false'/><boolean name='use_shadowing_function' value='false'/>";
    std::string s;
    s += "<shape type='rectangle'><transform name='to_world'><scale value='2'/><rotate x='1' "
         "angle='-90'/></transform><bsdf type='diffuse'>" +
         rgb("reflectance", "0.6") + "</bsdf></shape>";
    s += bsdf_sphere(
        -1.5f, -1.0f,
        "<bsdf type='roughdiffuse'>" + rgb("reflectance", "0.6,0.3,0.2") + "<float name='alpha' value='0.5'/></bsdf>");
    s += bsdf_sphere(-0.7f, -1.0f, "<bsdf type='conductor'><string name='material' value='Au'/></bsdf>");
    s += bsdf_sphere(0.1f, -1.0f, aniso);
    s += bsdf_sphere(0.9f, -1.0f,
                     "<bsdf type='roughconductor'><string name='material' value='Al'/><string name='distribution' "
                     "value='beckmann'/><float name='alpha' value='0.15'/></bsdf>");
    s += bsdf_sphere(1.7f, -1.0f, "<bsdf type='plastic'>" + rgb("diffuse_reflectance", "0.2,0.4,0.6") + "</bsdf>");
    // Glass around something diffuse: paths with a single refraction at an end.
    s += bsdf_sphere(-1.5f, 0.0f, glass);
    s += "<shape type='sphere'><point name='center' x='-1.5' y='0.36' z='0'/><float name='radius' value='0.2'/><bsdf "
         "type='diffuse'>" +
         rgb("reflectance", "0.7") + "</bsdf></shape>";
    s += bsdf_sphere(-0.7f, 0.0f, glass);
    s += bsdf_sphere(0.1f, 0.0f,
                     "<bsdf type='roughdielectric'><string name='distribution' value='ggx'/><float name='alpha' "
                     "value='0.2'/><float name='int_ior' value='1.4'/></bsdf>");
    s += bsdf_sphere(0.9f, 0.0f,
                     "<bsdf type='roughdielectric'><string name='distribution' value='beckmann'/><float name='alpha' "
                     "value='0.1'/><float name='int_ior' value='1'/><float name='ext_ior' value='1.33'/></bsdf>");
    s += bsdf_sphere(1.7f, 0.0f,
                     "<bsdf type='roughplastic'>" + rgb("diffuse_reflectance", "0.5,0.4,0.1") +
                         "<float name='alpha' value='0.15'/><boolean name='nonlinear' value='true'/></bsdf>");
    s += bsdf_sphere(-1.5f, 1.0f,
                     "<bsdf type='bumpmap'>" + plain_map +
                         "<texture name='arbitrary' type='bitmap'><boolean name='raw' value='true'/>" +
                         asset("waves.png") + "</texture><float name='scale' value='0.2'/><bsdf type='diffuse'>" +
                         rgb("reflectance", "0.5,0.35,0.6") + "</bsdf></bsdf>");
    s += bsdf_sphere(
        -0.7f, 1.0f,
        "<bsdf type='normalmap'>" + plain_map +
            "<texture name='normalmap' type='bitmap'><boolean name='raw' value='true'/>" + asset("dimples.png") +
            "</texture><bsdf type='roughconductor'><string name='material' value='Ag'/><float name='alpha' "
            "value='0.2'/></bsdf></bsdf>");
    s += bsdf_sphere(0.1f, 1.0f,
                     "<bsdf type='bumpmap'>" + plain_map +
                         "<texture name='arbitrary' type='bitmap'><boolean name='raw' value='true'/>" +
                         asset("waves.png") + "</texture><float name='scale' value='0.1'/>" + glass + "</bsdf>");
    // Interpolated normals, from both sides.
    s += "<shape type='obj'>" + asset("torus.obj") +
         "<transform name='to_world'><scale value='0.4'/><rotate x='1' angle='40'/><translate x='1' y='0.4' "
         "z='1'/></transform><bsdf type='twosided'><bsdf type='roughplastic'>" +
         rgb("diffuse_reflectance", "0.3,0.4,0.5") + "<float name='alpha' value='0.3'/></bsdf></bsdf></shape>";
    s += "<shape type='cylinder'><float name='radius' value='0.2'/><point name='p0' x='1.7' y='0' z='1'/><point "
         "name='p1' x='1.7' y='0.6' z='1'/><bsdf type='twosided'><bsdf type='diffuse'>" +
         rgb("reflectance", "0.6") + "</bsdf></bsdf></shape>";
    s += "<shape type='rectangle'><transform name='to_world'><scale value='0.5'/><rotate y='1' angle='20'/><translate "
         "x='0' y='0.9' z='1.5'/></transform><bsdf type='thindielectric'/></shape>";
    return s;
}

inline std::string area_light(const std::string& shape, const std::string& radiance = "3") {
    return shape + "<bsdf type='diffuse'>" + rgb("reflectance", "0.4") + "</bsdf><emitter type='area'>" +
           rgb("radiance", radiance) + "</emitter></shape>";
}

inline std::string narrow_spot(double cutoff_degrees, const std::string& from, const std::string& to) {
    return "<emitter type='spot'>" + rgb("intensity", "1e6") + "<float name='cutoff_angle' value='" +
           std::to_string(cutoff_degrees) + "'/><transform name='to_world'><lookat origin='" + from + "' target='" +
           to + "' up='0,0,1'/></transform></emitter>";
}

inline std::string sensor(const std::string& type, const std::string& parameters, const std::string& scale = "") {
    return "<sensor type='" + type + "'>" + parameters + "<transform name='to_world'>" + scale +
           "<lookat origin='0.3,1.7,4.2' target='0,0.3,0' up='0,1,0'/></transform>" +
           "<film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='48'/><rfilter "
           "type='box'/></film></sensor>";
}

struct SceneCase {
    const char* name;
    uint32_t subpaths;  ///< for a few hundred thousand paths, or what the scene has of them
    std::string xml;
};

inline std::vector<SceneCase> scene_cases() {
    const auto whole = [](const std::string& s) { return "<scene version='3.0.0'>" + s + "</scene>"; };
    const std::string diffuse = "<bsdf type='diffuse'>" + rgb("reflectance", "0.7") + "</bsdf></shape>";
    const std::string walls =
        "<shape type='cube'><boolean name='flip_normals' value='true'/><transform name='to_world'><scale x='3' y='2' "
        "z='5'/><translate y='1.9'/></transform>" +
        diffuse;
    const std::string lamps =
        area_light(
            "<shape type='rectangle'><transform name='to_world'><scale x='0.5' y='0.4'/><rotate x='1' "
            "angle='90'/><translate y='3.5'/></transform>") +
        area_light(
            "<shape type='sphere'><point name='center' x='-1' y='1.6' z='0.5'/><float name='radius' value='0.2'/>") +
        area_light(
            "<shape type='disk'><transform name='to_world'><scale value='0.3'/><lookat origin='1.6,1,-1.6' "
            "target='0.3,1.7,4.2' up='0,1,0'/></transform>") +
        area_light(
            "<shape type='cylinder'><float name='radius' value='0.1'/><point name='p0' x='-0.8' y='1.2' "
            "z='-1.3'/><point name='p1' x='0.4' y='1.3' z='-1.5'/>") +
        area_light(
            "<shape type='cube'><transform name='to_world'><scale x='0.1' y='0.2' z='0.15'/><rotate x='1' y='1' "
            "angle='30'/><translate x='1.2' y='1.4' z='-0.4'/></transform>");
    const auto masked_lamp = [](const std::string& shape, const std::string& opacity) {
        return shape + "<bsdf type='mask'><float name='opacity' value='" + opacity + "'/><bsdf type='diffuse'>" +
               rgb("reflectance", "0.4") + "</bsdf></bsdf><emitter type='area'>" + rgb("radiance", "3") +
               "</emitter></shape>";
    };
    const std::string masked_lamps =
        masked_lamp(
            "<shape type='rectangle'><transform name='to_world'><scale x='0.5' y='0.4'/><rotate x='1' "
            "angle='90'/><translate y='3.5'/></transform>",
            "0.3") +
        masked_lamp(
            "<shape type='sphere'><point name='center' x='-1' y='1.6' z='0.5'/><float name='radius' "
            "value='0.3'/>",
            "0.75") +
        masked_lamp(
            "<shape type='disk'><transform name='to_world'><scale value='0.3'/><lookat origin='1.6,1,-1.6' "
            "target='0.3,1.7,4.2' up='0,1,0'/></transform>",
            "0.02");
    const std::string perspective = "<float name='fov' value='50'/><float name='near_clip' value='0.3'/>";
    const std::string deltas =
        "<emitter type='point'><point name='position' x='0.3' y='1.4' z='0.4'/>" + rgb("intensity", "2") +
        "</emitter>" + "<emitter type='spot'>" + rgb("intensity", "9") +
        "<float name='cutoff_angle' value='35'/><float name='beam_width' value='20'/><transform "
        "name='to_world'><lookat origin='-1,3,1' target='-0.3,0,0' up='0,0,1'/></transform></emitter>" +
        "<emitter type='directional'><vector name='direction' x='-0.8' y='-1.2' z='-0.6'/>" + rgb("irradiance", "1.5") +
        "</emitter>";
    // Of one on a sphere every normal is another one.
    const auto directional_area = [](const std::string& shape) {
        return shape + "<bsdf type='diffuse'/><emitter type='directionalarea'>" + rgb("radiance", "5") +
               "</emitter></shape>";
    };
    const std::string beams =
        "<emitter type='collimated'>" + rgb("power", "20") +
        "<transform name='to_world'><lookat origin='0.2,2.5,0.3' target='0.45,0,0.4' up='0,0,1'/></transform>"
        "</emitter>" +
        directional_area(
            "<shape type='cube'><transform name='to_world'><scale value='0.3'/><rotate x='1' y='1' "
            "angle='30'/><translate y='2.6'/></transform>") +
        directional_area(
            "<shape type='sphere'><point name='center' x='0.6' y='1.7' z='0.4'/><float name='radius' value='0.1'/>");
    return {
        {"room", 24000, whole(sensor("perspective", perspective) + walls + bodies() + lamps)},
        {"sky", 120000,
         whole(sensor("thinlens",
                      perspective +
                          "<float name='aperture_radius' value='0.15'/><float name='focus_distance' value='4'/>") +
               bodies() + deltas +
               area_light("<shape type='sphere'><point name='center' x='1' y='1.7' z='0.2'/><float name='radius' "
                          "value='0.3'/>") +
               "<emitter type='envmap'>" + asset("sky.exr") +
               "<transform name='to_world'><rotate y='1' angle='40'/></transform></emitter>")},
        {"orthographic", 120000,
         whole(sensor("orthographic", "<float name='near_clip' value='0.5'/>", "<scale x='2.2' y='2.2'/>") + bodies() +
               area_light("<shape type='cube'><transform name='to_world'><scale value='0.25'/><rotate x='1' y='1' "
                          "angle='30'/><translate x='0.5' y='1.6'/></transform>") +
               "<emitter type='constant'>" + rgb("radiance", "1") + "</emitter>")},
        {"constant", 60000,
         whole(sensor("perspective", perspective) + bodies() +
               area_light("<shape type='disk'><transform name='to_world'><scale value='0.4'/><rotate x='1' "
                          "angle='90'/><translate y='2'/></transform>") +
               "<emitter type='constant'>" + rgb("radiance", "1") + "</emitter>")},
        {"beams", 24000, whole(sensor("perspective", perspective) + walls + bodies() + beams + masked_lamps)},
        {"all around", 60000,
         whole(sensor("spherical", "") + bodies() + lamps +
               area_light("<shape type='rectangle'><transform name='to_world'><scale value='2'/><rotate y='1' "
                          "angle='180'/><translate y='1' z='6'/></transform>") +
               "<emitter type='constant'>" + rgb("radiance", "1") + "</emitter>")},
        {"masked lamps", 24000, whole(sensor("perspective", perspective) + walls + bodies() + masked_lamps)},
        // Next event estimation meets such spots on paths that light subpaths began.
        {"narrow spots", 24000,
         whole(sensor("perspective", perspective) + walls + bodies() + narrow_spot(0.1, "-1,3,1", "-0.3,0,0.2") +
               narrow_spot(0.02, "1,3,1", "0.3,0,0.6") + narrow_spot(0.01, "0.2,2.5,0.3", "0.45,0,0.4"))},
        {"shell", 24000,
         whole(sensor("perspective", perspective) +
               area_light(
                   "<shape type='sphere'><float name='radius' value='7'/><boolean name='flip_normals' value='true'/>") +
               bodies() + deltas)}};
}

inline Scene load(const SceneCase& c) {
    const TempFolder folder;
    return load_mitsuba(folder.write("scene.xml", c.xml));
}

// ---- subpaths ----

enum Kind : uint32_t { kHit, kEscape, kNextEvent, kConnect, kSplat, kVisible, kKinds };
const char* const kKindNames[] = {"hit", "escape", "next event", "connection", "light tracing", "visible light"};

/// What was compared, and the worst of it.
struct Tally {
    uint64_t paths = 0, ill = 0, unbounded = 0, summed = 0, merges = 0, overflows = 0;
    std::map<std::string, uint64_t>
        seen;  ///< paths by strategy and emitter, sensor or BSDF; a BSDF counts once per vertex
    double worst = 0, worst_of_bound = 0, worst_sum = 0;
};

/// Density of s.wi_world for a subpath that arrives from `wo_world`: directions exchanged.
inline float reverse_pdf(const Scattering& s, Vec3f wo_world) {
    return bsdf_pdf<F>(s.bsdf, s.frame.to_local(wo_world), s.wi, TransportMode::radiance);
}

/// What a model of weights knows of merges.
inline OracleMerges merges_of(const BidirectionalMis&) { return {}; }
/// How subpaths sample directions.
inline SideDensities densities_of(const SceneView&, const BidirectionalMis&) { return {}; }
/// Expected samples of each strategy of connections of a path.
inline double connections_of(const BidirectionalMis& mis, const SceneView&, const OraclePath&) {
    return double(mis.connections);
}

/// `Mis`: the model whose weights are compared. Merges have weights in sums only (sum_of_weights).
template <class Mis>
class Bench {
public:
    /// A vertex of a subpath and the ray that met it.
    struct Node {
        Vertex<Mis> vertex;
        Vec3f d;
        Hit hit;
        bool delta = false;  ///< the subpath left it by a delta lobe
    };

    Bench(const Scene& scene, Tally& tally)
        : scene_(scene.view()), accel_(scene), tracer_(accel_.tracer()), tree_(scene), tally_(tally) {
        if (std::is_same_v<typename Mis::Lights, LightsByTree>) scene_.light_tree = tree_.view();
    }

    /// One light subpath and one eye subpath, and all paths that they make together.
    void run(const Mis& mis, uint32_t index) {
        mis_ = mis;
        rules_ = all_rules(mis);
        index_ = index;
        light_subpath();
        eye_subpath();
        for (uint32_t b = 1; b <= eye_.size(); ++b) {
            next_events(b);
            for (uint32_t a = 1; a <= light_.size(); ++a) connect(a, b);
        }
        for (uint32_t a = 1; a <= light_.size(); ++a) splat(a);
    }

private:
    Vec4f random(uint32_t block) const { return random_floats({0xb1d1, index_, 0, Stream::test}, block); }

    SurfacePoint point(const Hit& hit) const { return surface_at<F>(scene_, hit.prim, hit.u, hit.v); }

    void light_subpath() {
        light_.clear();
        const Vec4f d = random(1);
        lit_ = sample_emission<F>(scene_, random(0), {d.x, d.y}, emission_);
        if (!lit_) return;
        Subpath<Mis> path = start_light(mis_, emission_);
        if (mis_.has(kLightStrategies)) visible({d.z, d.w});
        while (light_.size() < kMaxVertices) {
            Hit hit;
            if (!tracer_.closest<F>(scene_, {path.origin, kInfinity, path.direction, 0}, hit)) return;
            light_.push_back({vertex_at<F>(scene_, rules_, Side::light, path, point(hit)), path.direction, hit});
            if (!scatter<F>(rules_, Side::light, light_.back().vertex, random(10 + path.depth), path)) return;
            light_.back().delta = path.delta;
        }
    }

    void eye_subpath() {
        eye_.clear();
        const Vec4f u = random(2);
        const Sensor& sensor = scene_.sensor;
        lens_u_ = {u.z, u.w};
        const CameraSample c =
            sample_camera_ray<F>(sensor, {u.x * float(sensor.film_width), u.y * float(sensor.film_height)}, lens_u_);
        camera_p_ = lens(lens_u_);
        Subpath<Mis> path = start_eye<F>(scene_, mis_, c);
        float tmax = c.tmax;
        while (eye_.size() < kMaxVertices) {
            Hit hit;
            if (!tracer_.closest<F>(scene_, {path.origin, tmax, path.direction, 0}, hit)) {
                escaped(path);
                return;
            }
            tmax = kInfinity;
            const Vertex<Mis> z = vertex_at<F>(scene_, rules_, Side::eye, path, point(hit));
            hit_emitter(path, z);
            eye_.push_back({z, path.direction, hit});
            if (!scatter<F>(rules_, Side::eye, z, random(30 + path.depth), path)) return;
            eye_.back().delta = path.delta;
        }
    }

    Vec3f lens(Vec2f u) const {
        const Vec2f l = lens_point(scene_.sensor, u);
        return scene_.sensor.to_world.point({l.x, l.y, 0.0f});
    }

    /// Path over the first `a` vertices of the light subpath and the first `b` of the eye subpath; `across`: from the
    /// last of the former to the last of the latter.
    OraclePath join(uint32_t a, uint32_t b, Vec3f across, bool left_eye = false) const {
        OraclePath p{};
        p.k = a + b + 1;
        p.vertices.resize(p.k);
        p.to_eye.resize(p.k);
        p.camera_p = camera_p_;
        p.lens_u = lens_u_;
        const auto vertex = [](const Node& n, bool delta) {
            return OraclePath::Vertex{n.vertex.point, delta, n.hit.prim, n.hit.u, n.hit.v};
        };
        for (uint32_t i = 0; i < a; ++i) {
            p.vertices[i + 1] = vertex(light_[i], i + 1 < a && light_[i].delta);
            p.to_eye[i] = light_[i].d;
        }
        p.to_eye[a] = across;
        for (uint32_t j = 0; j < b; ++j) {
            p.vertices[p.k - 1 - j] = vertex(eye_[j], (j + 1 < b || left_eye) && eye_[j].delta);
            p.to_eye[p.k - 1 - j] = -eye_[j].d;
        }
        if (a > 0) {
            p.emitter = emission_.emitter;
            p.light_p = emission_.p;
            p.light = emission_point();
        }
        return p;
    }

    SurfacePoint emission_point() const {
        SurfacePoint s{};
        s.p = emission_.p;
        s.p_error = emission_.p_error;
        s.ng = emission_.ng;
        s.prim = emission_.prim;
        return s;
    }

    void escaped(Subpath<Mis> path) {
        if (scene_.environment == kNone || is_zero(environment_radiance<F>(scene_, path.direction))) return;
        OraclePath p = join(0, uint32_t(eye_.size()), -path.direction, true);
        p.emitter = scene_.environment;
        path.throughput = {1, 1, 1};
        Candidate<Mis> c{};
        const bool counts = escape<F>(scene_, rules_, path, c);
        // The rules and the ratio agree on that.
        float ratio;
        CHECK(mis_.template escape_ratio<F>(scene_, rules_.lights, path, path.sums, ratio) == counts);
        compare(kEscape, 0, c, p, counts);
    }

    void hit_emitter(Subpath<Mis> path, const Vertex<Mis>& z) {
        const uint32_t emitter = scene_.shapes[z.point.shape].emitter;
        if (emitter == kNone || is_zero(emitted_radiance<F>(scene_, emitter, z.point, -path.direction))) return;
        OraclePath p = join(0, uint32_t(eye_.size()), -path.direction, true);
        p.emitter = emitter;
        p.light = z.point;
        path.throughput = {1, 1, 1};
        Candidate<Mis> c{};
        const bool counts = emission<F>(scene_, rules_, path, z.point, c);
        compare(kHit, 0, c, p, counts);
    }

    void next_events(uint32_t b) {
        const Vertex<Mis>& z = eye_[b - 1].vertex;
        const Vec4f u = random(50 + b);
        Candidate<Mis> c;
        if (!next_event<F>(scene_, rules_, z, {1, 1, 1}, b, u, c)) return;
        EmitterSample light;
        typename Mis::Lights::Pick pick;
        REQUIRE(sample_emitter_deferred<F>(scene_, rules_.lights, {z.point.p, z.point.ng}, u, light, pick));
        OraclePath p = join(0, b, -light.wi);
        p.emitter = light.emitter;
        p.light_p = light.p;
        if (scene_.emitters[light.emitter].type == EmitterType::area) {
            p.light.p = light.p;
            p.light.p_error = light.p_error;
            p.light.ng = light.ng;
            p.light.prim = light.prim;
        }
        compare(kNextEvent, 1, c, p);
    }

    void connect(uint32_t a, uint32_t b) {
        const Vertex<Mis>&y = light_[a - 1].vertex, &z = eye_[b - 1].vertex;
        Candidate<Mis> c;
        if (!connection<F>(rules_, {z, {1, 1, 1}, b}, {y, {1, 1, 1}, a}, c)) return;
        const Vec3f to_y = y.point.p - z.point.p;
        const OraclePath p = join(a, b, to_y * (-1.0f / sqrtf(length_squared(to_y))));
        if (mis_.has(kConnectionStrategies) && connections_of(mis_, scene_, p) == 0) return;  // there is no such sample
        compare(kConnect, a + 1, c, p);
    }

    void splat(uint32_t a) {
        const Vec4f u = random(70 + a);
        Candidate<Mis> c;
        if (!camera_connection<F>(scene_, rules_, light_[a - 1].vertex, {1, 1, 1}, a, {u.x, u.y}, c)) return;
        OraclePath p = join(a, 0, c.direction);
        p.lens_u = {u.x, u.y};
        p.camera_p = lens(p.lens_u);
        compare(kSplat, a + 1, c, p);
    }

    void visible(Vec2f lens_u) {
        Candidate<Mis> c;
        if (!visible_emitter<F>(scene_, rules_, emission_, lens_u, c)) return;
        OraclePath p = join(0, 0, c.direction);
        p.emitter = emission_.emitter;
        p.light = emission_point();
        p.lens_u = lens_u;
        p.camera_p = lens(lens_u);
        compare(kVisible, 1, c, p);
    }

    /// `counts`: strategy s has a candidate, which is `c`.
    void compare(Kind kind, uint32_t s, const Candidate<Mis>& c, const OraclePath& path, bool counts = true) {
        const OracleSteps steps = steps_of(path, false);
        const OracleStrategies all = oracle_strategies(scene_, path, steps, double(mis_.light_subpaths),
                                                       connections_of(mis_, scene_, path), merges_of(mis_));
        INFO(kKindNames[kind] << " s " << s << " k " << path.k << " index " << index_ << " mask " << mis_.strategies
                              << " heuristic " << int(mis_.heuristic) << " emitter type "
                              << int(scene_.emitters[path.emitter].type) << " vertices " << describe(path));
        if (!(all.group[s] & mis_.strategies)) {
            // Eye subpaths meet the environment for light tracing too: beyond what the camera sees, that must not
            // count.
            if (kind == kEscape && path.k > 1) CHECK_FALSE(counts);
            if (merges_of(mis_).alone && index_ % 4 == 0) sum_of_weights(path);
            return;
        }
        CHECK(counts);
        CHECK((c.strategy.s() == s && c.strategy.segments() == path.k));
        const float ratio = c.ratio;
        const double expected = oracle_weight(all, s, mis_.strategies, mis_.heuristic),
                     weight = 1.0 / (1.0 + double(ratio));
        const double error = std::abs(weight / expected - 1);
        ++tally_.paths;
        if (error <= 1e-4) {
            tally_.worst = std::max(tally_.worst, error);
        } else {
            const double bound = oracle_weight_error(all, steps_of(path, true), s, mis_.strategies, mis_.heuristic);
            ++tally_.ill;
            if (!(bound < 0.1)) {
                ++tally_.unbounded;
            } else {
                INFO("weight " << weight << " expected " << expected << " error " << error << " bound " << bound);
                CHECK(error <= 1e-4 + bound);
                tally_.worst_of_bound = std::max(tally_.worst_of_bound, error / bound);
            }
        }
        count(kind, path);
        if (index_ % 4 == 0) sum_of_weights(path);
    }

    OracleSteps steps_of(const OraclePath& path, bool conditioning) const {
        return oracle_steps(scene_, path, conditioning, densities_of(scene_, mis_));
    }
    /// Of the direction `wo` and of the way back.
    BsdfValue densities(const Vertex<Mis>& v, Vec3f wo, Side side) const {
        const BsdfValue f = {{1, 1, 1}, scatter_pdf<F>(v.scattering, wo), reverse_pdf(v.scattering, wo)};
        if constexpr (requires { rules_.directions.template densities<F>(v, wo, transport_mode(side), f); })
            return rules_.directions.template densities<F>(v, wo, transport_mode(side), f);
        return f;
    }

    std::string describe(const OraclePath& path) const {
        std::string s;
        for (uint32_t i = 1; i < path.k; ++i) s += bsdf_name(path, i) + (path.vertices[i].delta ? "* " : " ");
        return s;
    }
    std::string bsdf_name(const OraclePath& path, uint32_t i) const {
        const SurfacePoint& x = path.vertices[i].point;
        const Material& m = scene_.materials[scene_.shapes[x.shape].material];
        const bool back = m.two_sided && dot(x.ng, path.to_eye[i]) < 0;
        static const char* const names[] = {"diffuse",         "roughdiffuse", "conductor",
                                            "roughconductor",  "dielectric",   "thindielectric",
                                            "roughdielectric", "plastic",      "roughplastic"};
        return names[int(scene_.bsdfs[back ? m.back : m.front].type)];
    }
    void count(Kind kind, const OraclePath& path) {
        static const char* const shapes[] = {"mesh", "sphere", "disk", "cylinder"};
        const Emitter& e = scene_.emitters[path.emitter];
        std::string light = name_of(e.type);
        if (e.type == EmitterType::area)
            light = scene_.is_triangle(path.light.prim) ? shapes[0] : shapes[int(scene_.quadric(path.light.prim).type)];
        const std::string name = kKindNames[kind];
        ++tally_.seen[name + ", " + light];
        ++tally_.seen[name + ", " + plugin_of(scene_.sensor.type)];
        for (uint32_t i = 1; i < path.k; ++i)
            ++tally_.seen[name + ", " + bsdf_name(path, i) + (path.vertices[i].delta ? ", delta" : "")];
    }

    void sum_of_weights(const OraclePath& sampled);

    /// The weight of a subpath that would have to draw what it all but never draws: the inverse of a density is no
    /// float. No such subpath exists, and its weight, which is `expected`, would be nothing.
    double overflowed(double expected) {
        ++tally_.overflows;
        CHECK(expected < 1e-7);
        return expected;
    }

    SceneView scene_;
    CwbvhAccel accel_;
    CwbvhTracer tracer_;
    LightTree tree_;
    Tally& tally_;
    Mis mis_{};
    Rules<Mis> rules_{};
    uint32_t index_ = 0;
    EmissionSample emission_{};
    bool lit_ = false;
    std::vector<Node> light_, eye_;
    Vec3f camera_p_{};
    Vec2f lens_u_{};
};

/// Every strategy's weight by the recursion, each along its own subpaths over the vertices of one path. Directions are
/// those between the vertices as they are stored, so that all subpaths agree on them to the bit and the sum tells of
/// the recursion alone.
template <class Mis>
void Bench<Mis>::sum_of_weights(const OraclePath& sampled) {
    OraclePath path = sampled;
    const uint32_t k = path.k;
    const Emitter& e = scene_.emitters[path.emitter];
    const bool area = e.type == EmitterType::area, infinite = is_infinite(e.type);
    const auto position = [&](uint32_t i) {
        return i == 0 ? (area ? path.light.p : path.light_p) : path.vertices[i].point.p;
    };
    for (uint32_t i = infinite ? 1 : 0; i + 1 < k; ++i) {
        const Vec3f back = position(i) - position(i + 1);
        const float d2 = length_squared(back);
        if (!(d2 > 0.0f)) return;
        path.to_eye[i] = -(back * (1.0f / sqrtf(d2)));
    }
    CameraConnection camera{};
    if (!(infinite && k == 1)) {
        if (!connect_to_camera<F>(scene_.sensor, position(k - 1), path.lens_u, camera)) return;
        path.to_eye[k - 1] = camera.wi;
    }
    const auto go_on = [&](Side side, const Vertex<Mis>& vertex, const OraclePath::Vertex& x, Vec3f wo,
                           Subpath<Mis>& w) {
        float forward = 1.0f, reverse = 1.0f;
        if (x.delta) {
            const Scattering& s = vertex.scattering;
            const bool transmitted = s.wi.z * s.frame.to_local(wo).z < 0.0f;
            BsdfSample sample;
            if (!bsdf_sample<F>(s.bsdf, s.wi, {transmitted ? kOneMinusEpsilon : 0.0f, 0.5f, 0.5f},
                                TransportMode::radiance, sample))
                return false;
            reverse = delta_reverse_pdf(s, wo, sample.eta);
        } else {
            const BsdfValue f = densities(vertex, wo, side);
            forward = f.pdf_sa;
            reverse = f.pdf_reverse_sa;
            if (!(forward > 0.0f)) return false;
        }
        w.sums = mis_.sums_after_scatter(vertex.sums, vertex.first, x.delta, forward, reverse,
                                         fabsf(dot(vertex.point.ng, wo)));
        w.origin = vertex.point.p;
        w.direction = wo;
        w.delta = x.delta;
        ++w.depth;
        if constexpr (requires { rules_.directions.template complete<F>(side, vertex, w.throughput, w); })
            rules_.directions.template complete<F>(side, vertex, w.throughput, w);
        return true;
    };

    const auto meet = [&](Side side, const Subpath<Mis>& w, const OraclePath::Vertex& x) {
        return vertex_at<F>(scene_, rules_, side, w, surface_at<F>(scene_, x.prim, x.u, x.v));
    };

    // Light subpath over x_1 ... x_(k-1).
    std::vector<Vertex<Mis>> y(k), z(k);
    EmissionSample start{};
    start.p = infinite ? position(1 < k ? 1 : 0) - path.to_eye[0] * (2.0f * scene_.bounds_radius) : position(0);
    start.ng = area ? path.light.ng : path.to_eye[0];
    start.d = path.to_eye[0];
    start.radiance = {1, 1, 1};
    start.pdf_pos = pdf_emission_position<F>(scene_, path.emitter, area ? path.light.prim : kNone);
    start.pdf_dir = pdf_emission_direction<F>(scene_, path.emitter, start.ng, start.d);
    start.cos_theta = area ? dot(start.ng, start.d) : 1.0f;
    start.pick = e.pick_probability;
    start.emitter = path.emitter;
    start.infinite = infinite;
    start.prim = area ? path.light.prim : kNone;
    start.opacity =
        area ? scene_.materials[scene_.shapes[scene_.shape_of(path.light.prim)].material].opacity.value : 1.0f;
    if (!(start.pdf_dir > 0.0f)) return;
    Subpath<Mis> w = start_light(mis_, start);
    w.origin = start.p;
    for (uint32_t i = 1; i < k; ++i) {
        y[i] = meet(Side::light, w, path.vertices[i]);
        if (i + 1 < k && !go_on(Side::light, y[i], path.vertices[i], path.to_eye[i], w)) return;
    }
    // Eye subpath over x_(k-1) ... x_1, and its ray to x_0.
    const Vec3f axis = scene_.sensor.to_world.vector({0, 0, 1});
    const float axis_length = length(axis), cos_camera = -dot(path.to_eye[k - 1], axis) / axis_length;
    CameraSample c{};
    c.d = -path.to_eye[k - 1];
    c.o = path.camera_p;
    if (camera_delta_direction(scene_.sensor))
        c.o = position(k - 1) - c.d * camera.distance;
    else if (!is_latlong(scene_.sensor.type))
        c.o = c.o + c.d * (scene_.sensor.near_clip * axis_length / cos_camera);
    w = start_eye<F>(scene_, mis_, c);
    for (uint32_t i = k - 1; i > 0; --i) {
        z[i] = meet(Side::eye, w, path.vertices[i]);
        if (i == 1 && path.vertices[1].delta && is_delta(e.type)) break;
        if (!go_on(Side::eye, z[i], path.vertices[i], -path.to_eye[i - 1], w)) {
            if (i > 1 || !is_delta(e.type)) return;
        }
    }

    const OracleStrategies all = oracle_strategies(scene_, path, steps_of(path, false), double(mis_.light_subpaths),
                                                   connections_of(mis_, scene_, path), merges_of(mis_));
    double sum = 0;
    std::string weights;
    for (uint32_t s = 0; s <= k; ++s) {
        if (!(all.group[s] & mis_.strategies)) continue;
        float ratio = 0;
        Candidate<Mis> candidate;
        if (s == 0) {
            CHECK((infinite ? mis_.template escape_ratio<F>(scene_, rules_.lights, w, w.sums, ratio)
                            : mis_.template hit_ratio<F>(scene_, rules_.lights, w, w.sums, path.emitter, path.light,
                                                         ratio)));
        } else if (s == k) {
            if (k == 1 ? !visible_emitter<F>(scene_, rules_, start, path.lens_u, candidate)
                       : !camera_connection<F>(scene_, rules_, y[k - 1], {1, 1, 1}, k - 1, path.lens_u, candidate))
                return;
            ratio = candidate.ratio;
        } else if (s == 1) {
            EmitterSample light{};
            light.emitter = path.emitter;
            light.wi = -path.to_eye[0];
            light.ng = area ? path.light.ng : path.to_eye[0];
            light.prim = start.prim;
            light.opacity = start.opacity;
            light.delta = is_delta(e.type);
            light.distance = infinite ? kInfinity : sqrtf(length_squared(position(0) - position(1)));
            light.pdf_sa = area ? pdf_emitter_direct<F>(scene_, path.emitter, position(1), light.wi, path.light)
                                : (light.delta ? e.pick_probability : pdf_environment_direct<F>(scene_, light.wi));
            const float over_power =
                rules_.lights.over_power(scene_, Receiver{z[1].point.p, z[1].point.ng}, path.emitter, path.light.prim);
            light.pdf_sa *= over_power;
            const BsdfValue f = densities(z[1], light.wi, Side::eye);
            ratio = mis_.template next_event_ratio<F>(scene_, over_power, z[1].sums, z[1].first, light, f,
                                                      fabsf(dot(z[1].point.ng, light.wi)));
        } else {
            if (!connection<F>(rules_, {z[s], {1, 1, 1}, k - s}, {y[s - 1], {1, 1, 1}, s - 1}, candidate)) return;
            ratio = candidate.ratio;
        }
        const double weight = std::isnan(ratio) ? overflowed(oracle_weight(all, s, mis_.strategies, mis_.heuristic))
                                                : 1.0 / (1.0 + double(ratio));
        sum += weight;
        weights += " s" + std::to_string(s) + ":" + std::to_string(weight);
    }
    if constexpr (requires { mis_.merge_ratio(y[0].sums, true, z[0].sums, true, BsdfValue{}); })
        for (uint32_t j = 1; j < k; ++j) {
            if (!(all.merges[j] > 0)) continue;
            const BsdfValue f = densities(z[j], -path.to_eye[j - 1], Side::eye);
            const float ratio = mis_.merge_ratio(y[j].sums, y[j].first, z[j].sums, z[j].first, f);
            const double weight = std::isnan(ratio)
                                      ? overflowed(oracle_merge_weight(all, j, mis_.strategies, mis_.heuristic))
                                      : 1 / (1.0 + ratio);
            sum += weight;
            ++tally_.merges;
            weights += " merge " + std::to_string(j) + ":" + std::to_string(weight);
        }
    ++tally_.summed;
    tally_.worst_sum = std::max(tally_.worst_sum, std::abs(sum - 1));
    INFO("weights" << weights);
    CHECK(std::abs(sum - 1) < 1e-5);
}

/// The i-th of the settings that tests go through: all masks, both heuristics, several numbers of light subpaths and
/// connections.
inline BidirectionalMis settings(uint32_t i) {
    const float light_subpaths[] = {64 * 48, 1, 0.1f, 1e6f};
    return {i / 16 % 2 ? MisHeuristic::power : MisHeuristic::balance, i % 16 ? i % 16 : uint32_t(kAllStrategies),
            light_subpaths[i / 32 % 4], i / 128 % 2 ? 3.0f : 1.0f};
}

/// Compares `times` as many subpaths as each scene asks for, and reports what was seen. `model(i)`: the i-th of the
/// settings, as a model of weights.
template <class Model>
std::map<std::string, uint64_t> compare_weights(double times, Model model) {
    std::map<std::string, uint64_t> seen;
    for (const SceneCase& c : scene_cases()) {
        Tally tally;
        {
            INFO(c.name);
            const Scene scene = load(c);
            Bench<decltype(model(0u))> bench(scene, tally);
            for (uint32_t i = 0; i < uint32_t(c.subpaths * times); ++i) bench.run(model(i / 4), i);
            CHECK(tally.unbounded < 1e-5 * double(tally.paths) + 1);
            CHECK(tally.ill <= 1e-3 * double(tally.paths));
        }
        std::printf(
            "%s: %llu paths, worst error %.2g; %llu ill-conditioned, at most %.2g of their bound, %llu without a "
            "bound; %llu sums, worst |sum - 1| %.2g, %llu overflows\n",
            c.name, (unsigned long long)tally.paths, tally.worst, (unsigned long long)tally.ill, tally.worst_of_bound,
            (unsigned long long)tally.unbounded, (unsigned long long)tally.summed, tally.worst_sum,
            (unsigned long long)tally.overflows);
        for (const auto& [name, n] : tally.seen) seen[name] += n;
        seen["merges"] += tally.merges;
    }
    return seen;
}

}  // namespace ambilux::test
