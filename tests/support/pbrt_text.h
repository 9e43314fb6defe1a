// pbrt scenes written as text in a test.
#pragma once

#include <string>

#include "core/error.h"
#include "formats/load.h"
#include "tests/support/catch.h"
#include "tests/support/temp_folder.h"

namespace ambilux::test {

inline const std::string kUnitTriangle =
    "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0] \"integer indices\" [0 1 2]\n";
inline const std::string kUnitSphere = "Shape \"sphere\"\n";

inline Scene load_pbrt_text(const std::string& text, const LoadOptions& options = {},
                            const TempFolder* folder = nullptr) {
    const TempFolder own;
    return load_pbrt((folder ? *folder : own).write("scene.pbrt", text), options);
}

/// Of the world behind default options.
inline Scene load_pbrt_world(const std::string& world, const LoadOptions& options = {},
                             const TempFolder* folder = nullptr) {
    return load_pbrt_text("WorldBegin\n" + world + "\n", options, folder);
}

inline std::string pbrt_error(const std::string& text, const LoadOptions& options = {},
                              const TempFolder* folder = nullptr) {
    try {
        load_pbrt_text(text, options, folder);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "no error";
}

inline std::string world_error(const std::string& world, const LoadOptions& options = {}) {
    return pbrt_error("WorldBegin\n" + world + "\n", options);
}

}  // namespace ambilux::test
