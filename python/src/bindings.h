// What the parts of the module share.
#pragma once

#include <nanobind/nanobind.h>

#include <exception>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

namespace ambilux {

void bind_images(nanobind::module_& m);
void bind_scenes(nanobind::module_& m);
void bind_renders(nanobind::module_& m);

/// Does the work on a thread of its own, without Python's lock, and looks at Python's signals meanwhile: one whose
/// handler throws (KeyboardInterrupt) sets the flag that `work` gets, and is thrown once that has returned.
void run_unlocked(const std::function<void(const volatile bool* interrupt)>& work);

/// Text from files need not be valid UTF-8.
inline std::string json_text(const nlohmann::json& json) {
    return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace ambilux
