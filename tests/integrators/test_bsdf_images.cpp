// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Images of phong, ward, difftrans, thin sheets, coatings and microfacets of phong in front of a constant environment,
// against integrals of the published formulas over the hemisphere.
#include <functional>

#include "tests/support/closed_forms.h"

using namespace ambilux;

namespace {

struct V {
    double x, y, z;
};
double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V direction(double cosine, double phi) {
    const double sine = std::sqrt(1 - cosine * cosine);
    return {sine * std::cos(phi), sine * std::sin(phi), cosine};
}

constexpr uint32_t kSize = 8;

// The camera's.
const double kCosine = std::cos(0.9), kPhi = 0.4;
const V kView = direction(kCosine, kPhi);

/// Integral of f(view, w)·cos over the hemisphere.
double albedo(const std::function<double(V)>& f) {
    const int n = 600;
    double sum = 0;
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < 2 * n; ++k) {
            const V w = direction((i + 0.5) / n, M_PI * (k + 0.5) / n);
            sum += f(w) * w.z;
        }
    return sum * M_PI / n / n;
}

/// A square of the BSDF, seen from the view, so narrowly that it is one direction.
Scene scene_of(const std::string& bsdf, const std::string& version) {
    const std::string at =
        std::to_string(5 * kView.x) + "," + std::to_string(5 * kView.y) + "," + std::to_string(5 * kView.z);
    std::string xml = "<scene version='" + version + "'><integrator type='path'><integer name='maxDepth' value='2'/>";
    xml += "</integrator><sensor type='perspective'><float name='fov' value='0.01'/><transform name='toWorld'><lookat ";
    xml += "origin='" + at + "' target='0,0,0' up='0,1,0'/></transform>" + square_film(kSize) + "</sensor>";
    xml += "<shape type='rectangle'>" + bsdf + "</shape><emitter type='constant'/></scene>";
    return scene_from_text(xml);
}

/// All pixels have the same expectation; what they scatter says how well their mean is known.
void check(const std::string& bsdf, double expected) {
    INFO(bsdf);
    const Scene scene = scene_of(bsdf, "0.6.0");
    for (Estimator e : {Estimator::mis, Estimator::naive}) {
        const RenderResult result = render_scene(scene, cpu_settings(scene, e), 4096);
        double sum = 0, squares = 0;
        const double n = kSize * kSize;
        for (size_t i = 0; i < kSize * kSize; ++i) {
            const double x = result.film.mean(3 * i);
            sum += x, squares += x * x;
        }
        const double mean = sum / n, error = std::sqrt(std::max(squares / n - mean * mean, 0.0) / (n - 1));
        INFO(mean << " +- " << error << " against " << expected);
        CHECK(std::fabs(mean - expected) < 4.2 * error + 2e-5 * expected);  // Student's t, 63 degrees of freedom: 1e-4
        CHECK(error < 0.003 * expected);
        CHECK(result.stats.invalid.total() == 0);
    }
}

std::string number(const std::string& name, double value) {
    return "<float name='" + name + "' value='" + std::to_string(value) + "'/>";
}
const std::string kColors = "<rgb name='diffuseReflectance' value='0.3'/><rgb name='specularReflectance' value='0.5'/>";

}  // namespace

TEST_CASE("phong: a diffuse part and a power of the cosine to the mirrored direction") {
    const V mirrored = {-kView.x, -kView.y, kView.z};
    for (double n : {5.0, 30.0})
        check("<bsdf type='phong'>" + kColors + number("exponent", n) + "</bsdf>", albedo([&](V w) {
                  const double cosine = std::max(dot(mirrored, w), 0.0);
                  return 0.3 / M_PI + 0.5 * (n + 2) / (2 * M_PI) * std::pow(cosine, n);
              }));
}

TEST_CASE("ward: three ways to divide a Gaussian of the half vector's slopes") {
    const double u = 0.2, v = 0.4;
    for (const std::string variant : {"ward", "ward-duer", "balanced"})
        check("<bsdf type='ward'>" + kColors + "<string name='variant' value='" + variant + "'/>" +
                  number("alphaU", u) + number("alphaV", v) + "</bsdf>",
              albedo([&](V w) {
                  const V h = {kView.x + w.x, kView.y + w.y, kView.z + w.z};
                  const double gauss =
                      std::exp(-(h.x * h.x / (u * u) + h.y * h.y / (v * v)) / (h.z * h.z)) / (M_PI * u * v);
                  const double lobe = variant == "ward"        ? 0.25 / std::sqrt(kView.z * w.z)
                                      : variant == "ward-duer" ? 0.25 / (kView.z * w.z)
                                                               : dot(h, h) / std::pow(h.z, 4);
                  return 0.3 / M_PI + 0.5 * gauss * lobe;
              }));
}

TEST_CASE("difftrans: what falls on the other side") {
    check("<bsdf type='difftrans'><rgb name='transmittance' value='0.6'/></bsdf>", 0.6);
}

TEST_CASE("principledthin: two specular lobes by Fresnel, the one that passes narrower, and two diffuse ones") {
    const double ior = 1.5, roughness = 0.8, base = 0.6, specular = 0.4, through = 0.3;
    const auto schlick = [](double c) { return std::pow(1 - c, 5); };
    const auto reflected = [&](double c) {
        const double t = std::sqrt(1 - (1 - c * c) / (ior * ior)), s = (c - ior * t) / (c + ior * t),
                     p = (ior * c - t) / (ior * c + t);
        return 0.5 * (s * s + p * p);
    };
    // GGX with shadowing and masking apart (Walter et al. 2007).
    const auto lobe = [&](V w, double rough, bool reflects) {
        V m = {kView.x + w.x, kView.y + w.y, kView.z + w.z};
        const double l = std::sqrt(dot(m, m)), a2 = std::pow(rough, 4), z = m.z / l, d = z * z * (a2 - 1) + 1;
        const double f = reflected(dot(kView, m) / l);
        const auto g1 = [&](double c) { return 2 / (1 + std::sqrt(1 + a2 * (1 - c * c) / (c * c))); };
        return (reflects ? f : base * (1 - f)) * a2 / (M_PI * d * d) * g1(kView.z) * g1(w.z) / (4 * kView.z * w.z);
    };
    const auto diffuse = [&](V w) {
        V m = {kView.x + w.x, kView.y + w.y, kView.z + w.z};
        const double c2 = dot(kView, m) * dot(kView, m) / dot(m, m), rr = 2 * roughness * c2;
        const double i = schlick(kView.z), o = schlick(w.z);
        return base / M_PI * ((1 - 0.5 * i) * (1 - 0.5 * o) + rr * (i + o + i * o * (rr - 1)));
    };
    check("<bsdf type='principledthin'><rgb name='base_color' value='0.6'/>" + number("roughness", roughness) +
              number("spec_trans", specular) + number("diff_trans", 2 * through) + "</bsdf>",
          albedo([&](V w) {
              return specular * (lobe(w, roughness, true) + lobe(w, roughness * (0.65 * ior - 0.35), false)) +
                     (1 - specular) * ((1 - through) * diffuse(w) + through * base / M_PI);
          }));
}

TEST_CASE("coating: a mirror's share, and the base's behind two boundaries and an absorbing layer") {
    const double ior = 1.5, absorption = 0.3, base = 0.8;
    const auto bent = [&](double c) { return std::sqrt(1 - (1 - c * c) / (ior * ior)); };
    const auto reflected = [&](double c) {
        const double t = bent(c), s = (c - ior * t) / (c + ior * t), p = (ior * c - t) / (ior * c + t);
        return 0.5 * (s * s + p * p);
    };
    const std::string layer =
        number("intIOR", ior) + number("extIOR", 1) + "<rgb name='sigmaA' value='0.15'/>" + number("thickness", 2);
    const auto passes = [&](double c) { return (1 - reflected(c)) * std::exp(-absorption / bent(c)); };
    check("<bsdf type='coating'>" + layer + "<bsdf type='diffuse'><rgb name='reflectance' value='0.8'/></bsdf></bsdf>",
          reflected(kCosine) + albedo([&](V w) { return base / M_PI * passes(kCosine) * passes(w.z) / (ior * ior); }));
    check(
        "<bsdf type='coating'>" + layer + "<bsdf type='conductor'><string name='material' value='none'/></bsdf></bsdf>",
        reflected(kCosine) + passes(kCosine) * passes(kCosine));
    // A boundary that is hardly rough is as good as a smooth one.
    check("<bsdf type='roughcoating'>" + layer + number("alpha", 0.002) +
              "<bsdf type='diffuse'><rgb name='reflectance' value='0.8'/></bsdf></bsdf>",
          reflected(kCosine) + albedo([&](V w) { return base / M_PI * passes(kCosine) * passes(w.z) / (ior * ior); }));
}

TEST_CASE("roughconductor of phong: powers of the cosine, shadowed as Beckmann's facets of equal alpha") {
    const double u = 0.5, v = 0.25, nu = 2 / (u * u) - 2, nv = 2 / (v * v) - 2;
    const auto g1 = [&](V w) {  // Walter et al. 2007, a rational fit of equation 27
        const double a = w.z / std::hypot(w.x * u, w.y * v);
        return a >= 1.6 ? 1 : (3.535 * a + 2.181 * a * a) / (1 + 2.276 * a + 2.577 * a * a);
    };
    check(
        "<bsdf type='roughconductor'><string name='material' value='none'/><string name='distribution' "
        "value='phong'/>" +
            number("alphaU", u) + number("alphaV", v) + "</bsdf>",
        albedo([&](V w) {
            const V h = {kView.x + w.x, kView.y + w.y, kView.z + w.z};
            const double l = std::sqrt(dot(h, h)), c = h.z / l,
                         n = (nu * h.x * h.x + nv * h.y * h.y) / (h.x * h.x + h.y * h.y);
            const double d = std::sqrt((nu + 2) * (nv + 2)) / (2 * M_PI) * std::pow(c, n);
            return d * g1(kView) * g1(w) / (4 * kView.z * w.z);
        }));
}
