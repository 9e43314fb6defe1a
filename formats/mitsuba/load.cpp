#include "formats/load.h"

#include "core/scoped_seconds.h"
#include "formats/mitsuba/xml.h"

namespace ambilux {

namespace {

/// Of a file or, if there is one, of a text.
Scene scene_of(const std::string& path, const LoadOptions& options, const std::string* text) {
    const auto read = [&] {
        const ScopedSeconds clock(options.times ? &options.times->read : nullptr);
        return mitsuba::parse_document(path, options.parameters, options.limits, text);
    };
    return document::load_document(path, read(), options);
}

}  // namespace

Scene load_mitsuba(const std::string& path, const LoadOptions& options) { return scene_of(path, options, nullptr); }

Scene load_mitsuba_text(const std::string& text, const std::string& path, const LoadOptions& options) {
    return scene_of(path, options, &text);
}

}  // namespace ambilux
