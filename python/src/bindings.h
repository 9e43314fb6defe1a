// What the parts of the module share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <exception>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/log.h"

namespace ambilux {

void bind_images(nanobind::module_& m);
void bind_scenes(nanobind::module_& m);
void bind_renders(nanobind::module_& m);
void bind_replays(nanobind::module_& m);
void bind_commands(nanobind::module_& m);

/// Does the work on a thread of its own, without Python's lock, and looks at Python's signals meanwhile: one whose
/// handler throws (KeyboardInterrupt) sets the flag that `work` gets, and is thrown once that has returned. So does an
/// exception of `meanwhile`, which is called with Python's lock now and then, and after the work.
void run_unlocked(const std::function<void(const volatile bool* interrupt)>& work,
                  const std::function<void()>& meanwhile = {});

/// As long as it lives, nothing but errors is printed.
class QuietFor {
public:
    explicit QuietFor(bool quiet) : before_(is_quiet()) { set_quiet(quiet); }
    ~QuietFor() { set_quiet(before_); }
    QuietFor(const QuietFor&) = delete;

private:
    bool before_;
};

/// An array that owns a copy of the values.
template <class T, class From>
nanobind::ndarray<nanobind::numpy, T, nanobind::c_contig> array_of(const std::vector<From>& values,
                                                                   std::vector<size_t> shape) {
    auto* held = new std::vector<From>(values);
    const nanobind::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<From>*>(p); });
    return {reinterpret_cast<T*>(held->data()), shape.size(), shape.data(), owner};
}

/// Text from files need not be valid UTF-8.
inline std::string json_text(const nlohmann::json& json) {
    return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace ambilux
