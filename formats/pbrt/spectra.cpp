#include "formats/pbrt/spectra.h"

#include <algorithm>
#include <filesystem>

#include "core/text.h"
#include "formats/document/named_media.h"
#include "formats/document/spectrum.h"

namespace ambilux::pbrt {

using document::spectrum_to_rgb;
using document::SpectrumUse;

namespace {

/// To linear Rec.709 from primaries and white (x, y) of SMPTE RP 431-2, ITU-R BT.2020 and SMPTE ST 2065-1, whites of
/// the latter left as they are: red, green, blue, white.
struct Primaries {
    double xy[4][2];
};
constexpr Primaries kRec709 = {{{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}}};

const Primaries& primaries(ColorSpace space) {
    static constexpr Primaries rec2020 = {{{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, {0.3127, 0.3290}}},
                               p3 = {{{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}}},
                               aces = {{{0.7347, 0.2653}, {0.0, 1.0}, {0.0001, -0.077}, {0.32168, 0.33767}}};
    switch (space) {
        case ColorSpace::rec2020: return rec2020;
        case ColorSpace::dci_p3: return p3;
        case ColorSpace::aces2065_1: return aces;
        default: return kRec709;
    }
}

using document::Matrix;

/// From RGB of these primaries to XYZ, white having Y = 1.
Matrix to_xyz(const Primaries& p) {
    Matrix m;
    for (int j = 0; j < 3; ++j) {
        const double x = p.xy[j][0], y = p.xy[j][1];
        m.m[0][j] = x, m.m[1][j] = y, m.m[2][j] = 1 - x - y;
    }
    const double x = p.xy[3][0], y = p.xy[3][1], white[3] = {x / y, 1, (1 - x - y) / y};
    const Matrix inverse = document::affine_inverse(m);
    for (int j = 0; j < 3; ++j) {
        double scale = 0;
        for (int k = 0; k < 3; ++k) scale += inverse.m[j][k] * white[k];
        for (auto& row : {0, 1, 2}) m.m[row][j] *= scale;
    }
    return m;
}

/// Index at the Fraunhofer line d, 587.6 nm, by the data sheets of Schott. What pbrt calls F5, F10 and F11 is SF5, SF10
/// and SF11.
constexpr std::pair<const char*, double> kGlasses[] = {
    {"glass-BK7", 1.5168}, {"glass-BAF10", 1.6700}, {"glass-FK51A", 1.4866}, {"glass-LASF9", 1.8503},
    {"glass-F5", 1.6727},  {"glass-SF5", 1.6727},   {"glass-F10", 1.7283},   {"glass-SF10", 1.7283},
    {"glass-F11", 1.7847}, {"glass-SF11", 1.7847},
};

/// False if it is the name of no glass.
bool find_glass(const std::string& name, double& ior) {
    for (const auto& [glass, value] : kGlasses)
        if (name == glass) return ior = value, true;
    return false;
}

Rgb of_luminance_1(Rgb color, const Where& where) {
    const float y = luminance(color);
    if (!(y > 0 && y < kInfinity)) fail(where, "the spectrum of a light must have a positive luminance");
    return color / y;
}

/// Chromaticities (x, y) of lights that are known by name, for the observer of 2 degrees: CIE 15:2004, fluorescent
/// lamps F1 to F12 in table T.7; ACES as SMPTE ST 2065-1 has it.
struct Illuminant {
    const char* name;
    double x, y;
};
constexpr Illuminant kIlluminants[] = {
    {"stdillum-D50", 0.34567, 0.35850}, {"illum-acesD60", 0.32168, 0.33767}, {"stdillum-F1", 0.31310, 0.33727},
    {"stdillum-F2", 0.37208, 0.37529},  {"stdillum-F3", 0.40910, 0.39430},   {"stdillum-F4", 0.44018, 0.40329},
    {"stdillum-F5", 0.31379, 0.34531},  {"stdillum-F6", 0.37790, 0.38835},   {"stdillum-F7", 0.31292, 0.32933},
    {"stdillum-F8", 0.34588, 0.35875},  {"stdillum-F9", 0.37417, 0.37281},   {"stdillum-F10", 0.34609, 0.35986},
    {"stdillum-F11", 0.38052, 0.37713}, {"stdillum-F12", 0.43695, 0.40441},
};

Rgb named_illuminant(const std::string& name, const Where& where) {
    if (name == "stdillum-D65") return splat(1);
    if (name == "stdillum-A")
        return of_luminance_1(spectrum_to_rgb(document::planck(2856, 1), SpectrumUse::emission), where);
    Primaries white = kRec709;
    const auto white_of = [&](double x, double y) {
        const double xyz[3] = {x / y, 1, (1 - x - y) / y};
        const Matrix m = document::affine_inverse(to_xyz(white));
        Rgb rgb;
        for (int i = 0; i < 3; ++i)
            rgb[i] = float(std::max(0.0, m.m[i][0] * xyz[0] + m.m[i][1] * xyz[1] + m.m[i][2] * xyz[2]));
        return rgb;
    };
    for (const Illuminant& known : kIlluminants)
        if (name == known.name) return white_of(known.x, known.y);
    fail(where, "no spectrum of a light is known by the name '" + name +
                    "': stdillum-A, stdillum-D50, stdillum-D65, stdillum-F1 to F12 and illum-acesD60 are");
}

}  // namespace

ColorSpace color_space(const std::string& name, const Where& where) {
    if (name == "srgb") return ColorSpace::srgb;
    if (name == "rec2020") return ColorSpace::rec2020;
    if (name == "dci-p3") return ColorSpace::dci_p3;
    if (name == "aces2065-1") return ColorSpace::aces2065_1;
    fail(where, "unknown colour space '" + name + "': srgb, rec2020, dci-p3 and aces2065-1 are known");
}

std::string resolve(const std::string& folder, const std::string& name, const Where& where) {
    namespace fs = std::filesystem;
    std::error_code ignored;
    const fs::path path = fs::path(name).is_absolute() ? fs::path(name) : fs::absolute(folder, ignored) / name;
    if (name.empty() || !fs::exists(path, ignored)) fail(where, "file '" + name + "' does not exist");
    return path.lexically_normal().string();
}

std::vector<std::pair<double, double>> SpectrumReader::samples(const Parameter& p) const {
    std::vector<double> values = p.numbers;
    if (!p.strings.empty()) {
        const std::string path = resolve(folder, p.strings[0], p.where), bytes = read_input(path, document.limits);
        document.file_digests.push_back({path, sha256(bytes)});
        const std::string text = plain_text(path, bytes);
        Tokenizer tokens(path, text);
        FileBudget budget(path, document.limits);
        while (tokens.peek().kind != TokenKind::end) {
            values.push_back(tokens.number("every word of a spectrum"));
            budget.tick();
        }
    }
    if (values.size() < 4 || values.size() % 2)
        fail(p.where, "spectrum '" + p.name + "' must be at least two pairs of wavelength and value");
    std::vector<std::pair<double, double>> out;
    for (size_t i = 0; i < values.size(); i += 2) {
        if (i > 0 && !(values[i] > values[i - 2])) fail(p.where, "wavelengths of '" + p.name + "' must rise");
        out.push_back({values[i], values[i + 1]});
    }
    return out;
}

Rgb SpectrumReader::color(const Parameter& p, ColorUse use, ColorSpace space) const {
    const auto count = [&](size_t n) {
        if (p.numbers.size() != n || !p.strings.empty())
            fail(p.where, "'" + p.name + "' of type " + p.type + " must have " + std::to_string(n) + " numbers");
    };
    Rgb color{};
    if (p.type == "float") {
        count(1);
        color = splat(float(p.numbers[0]));
    } else if (p.type == "rgb") {
        count(3);
        const Matrix m =
            space == ColorSpace::srgb ? Matrix{} : document::affine_inverse(to_xyz(kRec709)) * to_xyz(primaries(space));
        bool clipped = false;
        for (int i = 0; i < 3; ++i) {
            const double c = m.m[i][0] * p.numbers[0] + m.m[i][1] * p.numbers[1] + m.m[i][2] * p.numbers[2];
            clipped |= c < 0 && space != ColorSpace::srgb;
            color[i] = float(clipped ? std::max(c, 0.0) : c);
            if (use == ColorUse::reflectance && color[i] > 1) clipped = true, color[i] = 1;
        }
        if (clipped)
            report.note(p.where, "colours outside of linear Rec.709 are clipped at 0, those of surfaces also at 1");
    } else if (p.type == "blackbody") {
        count(1);
        if (!(p.numbers[0] > 0)) fail(p.where, "the temperature of '" + p.name + "' must be positive");
        color = spectrum_to_rgb(document::planck(p.numbers[0], 1), SpectrumUse::emission);
        color = color / std::max(max_component(color), 1e-30f);
    } else if (p.type == "spectrum") {
        const std::string name = p.strings.size() == 1 && p.numbers.empty() ? p.strings[0] : "";
        Rgb eta, k;
        const size_t dash = name.rfind('-');
        if (name.starts_with("metal-") && dash > 6 && find_metal(name.substr(6, dash - 6), eta, k) &&
            (name.ends_with("-eta") || name.ends_with("-k")))
            return name.ends_with("-k") ? k : eta;
        if (name.starts_with("metal-"))
            fail(p.where, "no optical constants are known for '" + name + "' (known: " + metal_names() + ")");
        if (use == ColorUse::light && (name.starts_with("stdillum-") || name.starts_with("illum-")))
            return named_illuminant(name, p.where);
        color = spectrum_to_rgb(samples(p), use == ColorUse::reflectance ? SpectrumUse::reflectance
                                            : use == ColorUse::unbounded ? SpectrumUse::unbounded
                                                                         : SpectrumUse::emission);
    } else {
        fail(p.where, "'" + p.name + "' is of type " + p.type + ", no colour");
    }
    if (!is_finite(color)) fail(p.where, "'" + p.name + "' is not finite");
    if (min_component(color) < 0) fail(p.where, "'" + p.name + "' is negative");
    return use == ColorUse::light && p.type != "rgb" ? of_luminance_1(color, p.where) : color;
}

double SpectrumReader::ior(const Parameters& in, const std::string& name, double fallback) const {
    const Parameter* p = in.find(name);
    if (!p) return fallback;
    double ior = 0;
    if (p->type == "float" || p->type == "integer") {
        ior = in.number(name, fallback);
    } else if (p->type == "spectrum") {
        report.note(p->where, "dispersion is left out: glass has one index of refraction");
        if (!(p->strings.size() == 1 && find_glass(p->strings[0], ior)))
            ior = luminance(spectrum_to_rgb(samples(*p), SpectrumUse::emission));
    } else {
        fail(p->where, "'" + name + "' must be a number or a spectrum");
    }
    if (!(ior > 0)) fail(p->where, "index of refraction '" + name + "' must be positive");
    return ior;
}

}  // namespace ambilux::pbrt
