// Scenes written as text in a test.
#pragma once

#include <algorithm>
#include <string>

#include "core/error.h"
#include "formats/load.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"
#include "transport/texture.h"

namespace ambilux::test {

inline const std::string kSensor = "<sensor type='perspective'><float name='fov' value='90'/></sensor>";

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

inline std::string wrap(const std::string& body, const std::string& version) {
    return "<scene version='" + version + "'>\n" + body + "\n</scene>\n";
}

/// Loads a scene of the given content, with a sensor added unless it has one.
inline Scene load(const std::string& body, const LoadOptions& options = {}, const std::string& version = "3.0.0",
                  const TempFolder* folder = nullptr) {
    const TempFolder own;
    const std::string path =
        (folder ? *folder : own).write("scene.xml", wrap(contains(body, "<sensor") ? body : body + kSensor, version));
    return load_mitsuba(path, options);
}

inline std::string error_of(const std::string& body, const LoadOptions& options = {},
                            const std::string& version = "3.0.0", const TempFolder* folder = nullptr) {
    try {
        load(body, options, version, folder);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "no error";
}

inline bool has_note(const Scene& s, const std::string& part) {
    return std::any_of(s.notes.begin(), s.notes.end(), [&](const std::string& n) { return contains(n, part); });
}

inline Scene load_quietly(const std::string& body, const std::string& version = "3.0.0",
                          const TempFolder* folder = nullptr) {
    INFO(body);
    const Scene s = load(body, {}, version, folder);
    CHECK(s.warnings.empty());
    return s;
}

/// Parameters of a BSDF of that model.
template <class Model>
Textured<Model> parameters(const BsdfRecord& record) {
    REQUIRE(record.type == kBsdfType<Model>);
    return record.as<Model>();
}

/// Of the diffuse BSDF of a shape.
inline Rgb reflectance(const Scene& s, size_t shape, Vec2f uv) {
    const BsdfRecord& record = s.bsdfs[s.materials[s.shapes[shape].material].front];
    return eval_rgb<kAllFeatures>(s.view(), record.as<Diffuse>().reflectance, uv);
}

inline void check_rgb(Rgb a, Rgb b, double tolerance = 1e-5) {
    for (int i = 0; i < 3; ++i) CHECK(a[i] == Approx(b[i]).margin(tolerance));
}

}  // namespace ambilux::test
