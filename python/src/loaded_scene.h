// A scene as the package holds it.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "accel/shared_accels.h"
#include "formats/edits.h"

namespace ambilux {

using Assignments = std::vector<std::pair<std::string, std::string>>;

struct LoadedScene {
    Scene scene;
    Editable editable;
    LoadOptions options;  ///< that it was loaded with, without edits
    std::shared_ptr<Structures> structures =
        std::make_shared<Structures>();  ///< shared with scenes that they serve too
    std::vector<std::string> files;
    double seconds = 0;
};
using SharedScene = std::shared_ptr<LoadedScene>;

}  // namespace ambilux
