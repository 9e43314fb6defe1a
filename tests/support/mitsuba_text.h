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

/// `body` with a sensor unless it has one, and in format 0.x with an emitter unless it has one: such a scene would be
/// lit by a sky of 2048x2048 pixels.
inline std::string completed(const std::string& body, const std::string& version) {
    std::string all = body;
    if (!contains(all, "<sensor")) all += kSensor;
    if (version[0] == '0' && !contains(all, "<emitter") && !contains(all, "<luminaire"))
        all += "<emitter type='constant'/>";
    return all;
}

/// Loads a scene of the given content and what it lacks.
inline Scene load(const std::string& body, const LoadOptions& options = {}, const std::string& version = "3.0.0",
                  const TempFolder* folder = nullptr) {
    const TempFolder own;
    return load_mitsuba((folder ? *folder : own).write("scene.xml", wrap(completed(body, version), version)), options);
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
