#include "formats/document/sky.h"

#include <algorithm>
#include <cmath>

namespace ambilux::document {
namespace {

/// Place and share of the next entry in a table of `count` entries.
struct Between {
    int index;
    double share;
};
Between between(double x, int count) {
    const double clamped = std::clamp(x, 0.0, double(count - 1));
    const int i = std::min(int(clamped), count - 2);
    return {i, clamped - i};
}

double mix(double a, double b, double share) { return a + (b - a) * share; }

/// Bezier curve of degree 5 over the cube root of the elevation (Hosek and Wilkie 2012, section 5.3).
template <class At>
double bezier(double elevation, At at) {
    constexpr double kBinomial[6] = {1, 5, 10, 10, 5, 1};
    const double t = std::cbrt(std::clamp(elevation / (M_PI / 2), 0.0, 1.0));
    double sum = 0;
    for (int i = 0; i < 6; ++i) sum += kBinomial[i] * std::pow(t, i) * std::pow(1 - t, 5 - i) * at(i);
    return sum;
}

}  // namespace

Sky::Sky(double turbidity, Rgb albedo, double elevation) {
    const Between t = between(turbidity - 1, 10);
    const auto blend = [&](double ground, auto at) {
        const auto of_turbidity = [&](int k) { return mix(at(k, 0), at(k, 1), ground); };
        return mix(of_turbidity(t.index), of_turbidity(t.index + 1), t.share);
    };
    for (int c = 0; c < 3; ++c) {
        const double ground = std::clamp(double(albedo[c]), 0.0, 1.0);
        radiance_[c] = blend(
            ground, [&](int k, int a) { return bezier(elevation, [&](int i) { return kSkyRadiance[k][a][i][c]; }); });
        for (int p = 0; p < 9; ++p)
            parameters_[c][p] = blend(ground, [&](int k, int a) {
                return bezier(elevation, [&](int i) { return kSkyParameters[k][a][i][c][p]; });
            });
    }
}

Rgb Sky::radiance(double cos_zenith, double angle) const {
    constexpr double kYIntegral = 106.7502593994140625;  // as in formats/document/spectrum.cpp
    const double cosine = std::cos(angle), cosine2 = cosine * cosine;
    Rgb out;
    for (int c = 0; c < 3; ++c) {
        // Equations 8 and 9, with Mitsuba's order of parameters.
        const double* p = parameters_[c];
        const double zenith = 1 + p[0] * std::exp(p[1] / (cos_zenith + 0.01));
        const double chi = (1 + cosine2) / std::pow(1 + p[8] * p[8] - 2 * p[8] * cosine, 1.5);
        const double sun = p[2] + p[3] * std::exp(p[4] * angle) + p[5] * cosine2 + p[6] * chi +
                           p[7] * std::sqrt(std::max(cos_zenith, 0.0));
        out[c] = float(std::max(zenith * sun * radiance_[c] / kYIntegral, 0.0));
    }
    return out;
}

Rgb sun_irradiance(double turbidity, double elevation) {
    const Between t = between(turbidity - 1, 10),
                  e = between((elevation * (180 / M_PI) - 2) / 86 * (kSunElevations - 1), kSunElevations);
    Rgb out;
    for (int c = 0; c < 3; ++c) {
        const auto at = [&](int k) {
            return mix(kSunIrradiance[k][e.index][c], kSunIrradiance[k][e.index + 1][c], e.share);
        };
        out[c] = float(std::max(mix(at(t.index), at(t.index + 1), t.share), 0.0));
    }
    return out;
}

SunAngles sun_position(const SunTime& time) {
    constexpr double kDegree = M_PI / 180, kEarthRadius = 6371.01, kAstronomicalUnit = 149597890;  // km
    const double hours = time.hour - time.timezone + (time.minute + time.second / 60) / 60;
    // Julian day from 1 January 2000 at noon, by divisions of integers.
    const int shift = (time.month - 14) / 12;
    const int day = (1461 * (time.year + 4800 + shift)) / 4 + (367 * (time.month - 2 - 12 * shift)) / 12 -
                    (3 * ((time.year + 4900 + shift) / 100)) / 4 + time.day - 32075;
    const double days = day - 0.5 + hours / 24 - 2451545.0;

    const double omega = 2.1429 - 0.0010394594 * days, mean_longitude = 4.8950630 + 0.017202791698 * days,
                 anomaly = 6.2400600 + 0.0172019699 * days;
    const double longitude = mean_longitude + 0.03341607 * std::sin(anomaly) + 0.00034894 * std::sin(2 * anomaly) -
                             0.0001134 - 0.0000203 * std::sin(omega);
    const double obliquity = 0.4090928 - 6.2140e-9 * days + 0.0000396 * std::cos(omega);

    const double ascension = std::atan2(std::cos(obliquity) * std::sin(longitude), std::cos(longitude));
    const double declination = std::asin(std::sin(obliquity) * std::sin(longitude));

    const double sidereal = 6.6974243242 + 0.0657098283 * days + hours;
    const double hour_angle = (sidereal * 15 + time.longitude) * kDegree - ascension,
                 latitude = time.latitude * kDegree;
    const double zenith = std::acos(std::cos(latitude) * std::cos(hour_angle) * std::cos(declination) +
                                    std::sin(declination) * std::sin(latitude));
    const double azimuth = std::atan2(
        -std::sin(hour_angle), std::tan(declination) * std::cos(latitude) - std::sin(latitude) * std::cos(hour_angle));
    return {zenith + kEarthRadius / kAstronomicalUnit * std::sin(zenith), azimuth};
}

}  // namespace ambilux::document
