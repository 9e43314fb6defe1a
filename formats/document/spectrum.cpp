#include "formats/document/spectrum.h"

#include <algorithm>
#include <cmath>

namespace ambilux::document {

namespace {

// CIE 1931 colour matching functions (2 degree observer) and illuminant D65, every 5 nm from 360 to 830 nm (CIE
// 015:2018).
constexpr int kCount = 95;
constexpr double kFirst = 360, kLast = 830, kStep = 5;
constexpr double kX[kCount] = {
    0.0001299,  0.0002321,  0.0004149,  0.0007416,  0.001368,   0.002236,   0.004243,  0.00765,    0.01431,
    0.02319,    0.04351,    0.07763,    0.13438,    0.21477,    0.2839,     0.3285,    0.34828,    0.34806,
    0.3362,     0.3187,     0.2908,     0.2511,     0.19536,    0.1421,     0.09564,   0.05795,    0.03201,
    0.0147,     0.0049,     0.0024,     0.0093,     0.0291,     0.06327,    0.1096,    0.1655,     0.22575,
    0.2904,     0.3597,     0.43345,    0.51205,    0.5945,     0.6784,     0.7621,    0.8425,     0.9163,
    0.9786,     1.0263,     1.0567,     1.0622,     1.0456,     1.0026,     0.9384,    0.85445,    0.7514,
    0.6424,     0.5419,     0.4479,     0.3608,     0.2835,     0.2187,     0.1649,    0.1212,     0.0874,
    0.0636,     0.04677,    0.0329,     0.0227,     0.01584,    0.011359,   0.0081109, 0.0057903,  0.0041095,
    0.0028993,  0.0020492,  0.00144,    0.00099995, 0.00069008, 0.00047602, 0.0003323, 0.00023483, 0.00016615,
    0.00011741, 8.3075e-05, 5.8707e-05, 4.151e-05,  2.9353e-05, 2.0674e-05, 1.456e-05, 1.0254e-05, 7.2215e-06,
    5.0859e-06, 3.5817e-06, 2.5225e-06, 1.7765e-06, 1.2511e-06,
};
constexpr double kY[kCount] = {
    3.917e-06,  6.965e-06,  1.239e-05,  2.202e-05,  3.9e-05,    6.4e-05,    0.00012,    0.000217,   0.000396,
    0.00064,    0.00121,    0.00218,    0.004,      0.0073,     0.0116,     0.01684,    0.023,      0.0298,
    0.038,      0.048,      0.06,       0.0739,     0.09098,    0.1126,     0.13902,    0.1693,     0.20802,
    0.2586,     0.323,      0.4073,     0.503,      0.6082,     0.71,       0.7932,     0.862,      0.91485,
    0.954,      0.9803,     0.99495,    1,          0.995,      0.9786,     0.952,      0.9154,     0.87,
    0.8163,     0.757,      0.6949,     0.631,      0.5668,     0.503,      0.4412,     0.381,      0.321,
    0.265,      0.217,      0.175,      0.1382,     0.107,      0.0816,     0.061,      0.04458,    0.032,
    0.0232,     0.017,      0.01192,    0.00821,    0.005723,   0.004102,   0.002929,   0.002091,   0.001484,
    0.001047,   0.00074,    0.00052,    0.0003611,  0.0002492,  0.0001719,  0.00012,    8.48e-05,   6e-05,
    4.24e-05,   3e-05,      2.12e-05,   1.499e-05,  1.06e-05,   7.4657e-06, 5.2578e-06, 3.7029e-06, 2.6078e-06,
    1.8366e-06, 1.2934e-06, 9.1093e-07, 6.4153e-07, 4.5181e-07,
};
constexpr double kZ[kCount] = {
    0.0006061, 0.001086, 0.001946, 0.003486, 0.00645, 0.01055, 0.02005, 0.03621, 0.06785, 0.1102,  0.2074,  0.3713,
    0.6456,    1.0391,   1.3856,   1.623,    1.7471,  1.7826,  1.7721,  1.7441,  1.6692,  1.5281,  1.2876,  1.0419,
    0.81295,   0.6162,   0.46518,  0.3533,   0.272,   0.2123,  0.1582,  0.1117,  0.07825, 0.05725, 0.04216, 0.02984,
    0.0203,    0.0134,   0.00875,  0.00575,  0.0039,  0.00275, 0.0021,  0.0018,  0.00165, 0.0014,  0.0011,  0.001,
    0.0008,    0.0006,   0.00034,  0.00024,  0.00019, 0.0001,  5e-05,   3e-05,   2e-05,   1e-05,   0,       0,
    0,         0,        0,        0,        0,       0,       0,       0,       0,       0,       0,       0,
    0,         0,        0,        0,        0,       0,       0,       0,       0,       0,       0,       0,
    0,         0,        0,        0,        0,       0,       0,       0,       0,       0,       0,
};
constexpr double kD65[kCount] = {
    46.6383, 49.3637, 52.0891, 51.0323, 49.9755, 52.3118, 54.6482, 68.7015, 82.7549, 87.1204, 91.486,  92.4589,
    93.4318, 90.057,  86.6823, 95.7736, 104.865, 110.936, 117.008, 117.41,  117.812, 116.336, 114.861, 115.392,
    115.923, 112.367, 108.811, 109.082, 109.354, 108.578, 107.802, 106.296, 104.79,  106.239, 107.689, 106.047,
    104.405, 104.225, 104.046, 102.023, 100,     98.1671, 96.3342, 96.0611, 95.788,  92.2368, 88.6856, 89.3459,
    90.0062, 89.8026, 89.5991, 88.6489, 87.6987, 85.4936, 83.2886, 83.4939, 83.6992, 81.863,  80.0268, 80.1207,
    80.2146, 81.2462, 82.2778, 80.281,  78.2842, 74.0027, 69.7213, 70.6652, 71.6091, 72.979,  74.349,  67.9765,
    61.604,  65.7448, 69.8856, 72.4863, 75.087,  69.3398, 63.5927, 55.0054, 46.4182, 56.6118, 66.8054, 65.0941,
    63.3828, 63.8434, 64.304,  61.8779, 59.4519, 55.7054, 51.959,  54.6998, 57.4406, 58.8765, 60.3125,
};

/// Linear interpolation at a wavelength in [kFirst, kLast].
double lookup(const double* table, double wavelength) {
    const double x = std::clamp((wavelength - kFirst) / kStep, 0.0, double(kCount - 1));
    const int i = std::min(int(x), kCount - 2);
    return table[i] + (table[i + 1] - table[i]) * (x - i);
}

double lookup(const std::vector<std::pair<double, double>>& samples, double wavelength) {
    const auto next = std::upper_bound(samples.begin(), samples.end(), wavelength,
                                       [](double w, const auto& s) { return w < s.first; });
    if (next == samples.end()) return samples.back().second;
    const auto previous = next - 1;
    return previous->second +
           (next->second - previous->second) * (wavelength - previous->first) / (next->first - previous->first);
}

}  // namespace

Rgb spectrum_to_rgb(const std::vector<std::pair<double, double>>& samples, SpectrumUse use) {
    // A Riemann sum over 1000 points, as Mitsuba's, so that colours agree with it to rounding.
    constexpr int steps = 1000;
    constexpr double y_integral = 106.7502593994140625;  // of kY over wavelength
    constexpr double d65_scale = 98.99741751876255;      // gives D65 the luminance of the equal-energy illuminant
    double xyz[3] = {0, 0, 0};
    for (int i = 0; i < steps; ++i) {
        const double w = kFirst + double(i) / (steps - 1) * (kLast - kFirst);
        if (w < samples.front().first || w > samples.back().first) continue;
        double value = lookup(samples, w);
        if (use != SpectrumUse::emission) value *= lookup(kD65, w) / d65_scale;
        xyz[0] += lookup(kX, w) * value, xyz[1] += lookup(kY, w) * value, xyz[2] += lookup(kZ, w) * value;
    }
    for (double& c : xyz) c *= (kLast - kFirst) / steps / y_integral;
    // ITU-R BT.709 primaries and D65 white.
    constexpr double m[3][3] = {
        {3.240479, -1.537150, -0.498535}, {-0.969256, 1.875991, 0.041556}, {0.055648, -0.204043, 1.057311}};
    Rgb rgb;
    for (int i = 0; i < 3; ++i) {
        const double c = std::max(0.0, m[i][0] * xyz[0] + m[i][1] * xyz[1] + m[i][2] * xyz[2]);
        rgb[i] = float(use == SpectrumUse::reflectance ? std::min(c, 1.0) : c);
    }
    return rgb;
}

std::vector<std::pair<double, double>> planck(double kelvin, double scale) {
    constexpr double c = 299792458, h = 6.62607015e-34, k = 1.380649e-23;
    std::vector<std::pair<double, double>> samples;
    for (double nm = 360; nm <= 830; nm += 5) {
        const double m = nm * 1e-9;
        samples.push_back({nm, scale * 1e-9 * 2 * h * c * c / (std::pow(m, 5) * std::expm1(h * c / (m * k * kelvin)))});
    }
    return samples;
}

}  // namespace ambilux::document
