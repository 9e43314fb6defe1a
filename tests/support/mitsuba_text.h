// Scenes written as text in a test.
#pragma once

#include <string>

#include "core/error.h"
#include "formats/load.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"

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

}  // namespace ambilux::test
