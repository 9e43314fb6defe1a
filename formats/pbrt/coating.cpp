#include "formats/pbrt/coating.h"

#include <algorithm>
#include <cmath>

namespace ambilux::pbrt {

namespace {

/// Share of light that the boundary of glass reflects back into it, at a cosine inside.
double reflected_inside(double eta, double cosine) {
    const double sine2 = eta * eta * (1 - cosine * cosine);
    if (sine2 >= 1) return 1;
    const double outside = std::sqrt(1 - sine2);
    const double s = (eta * cosine - outside) / (eta * cosine + outside);
    const double p = (cosine - eta * outside) / (cosine + eta * outside);
    return (s * s + p * p) / 2;
}

}  // namespace

Rgb Coating::diffuse_below(Rgb reflectance) const {
    // Of light from a diffuse surface: what the boundary sends back without losses and with them; what leaves with
    // them.
    constexpr int kSteps = 2000;
    double back = 0, back_dimmed = 0, out_dimmed = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double c = (i + 0.5) / kSteps, weight = 2 * c / kSteps, r = reflected_inside(eta, c);
        back += weight * r;
        back_dimmed += weight * r * std::exp(-2 * thickness / c);
        out_dimmed += weight * (1 - r) * std::exp(-thickness / c);
    }
    const double passed = back < 1 ? out_dimmed / (1 - back) : 0;
    const double bounces = double((depth + 1) / 2);
    Rgb out;
    for (int i = 0; i < 3; ++i) {
        const double r = double(reflectance[i]), again = std::min(r * back_dimmed, 1 - 1e-9);
        const double all = passed * passed * r * (1 - std::pow(again, bounces)) / (1 - again);
        out[i] = float(std::clamp(all / (1 + all * back), 0.0, 1.0));
    }
    return out;
}

}  // namespace ambilux::pbrt
