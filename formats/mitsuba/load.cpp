#include "formats/load.h"

#include "formats/front_end.h"
#include "formats/mitsuba/xml.h"

namespace ambilux {

namespace {

/// Of a file or, if there is one, of a text.
Scene scene_of(const std::string& path, const LoadOptions& options, const std::string* text) {
    const auto document = std::make_shared<document::Document>();
    return load_through(document, path, options,
                        [&] { mitsuba::parse_document(*document, path, options.parameters, text); });
}

}  // namespace

Scene load_mitsuba(const std::string& path, const LoadOptions& options) { return scene_of(path, options, nullptr); }

Scene load_mitsuba_text(const std::string& text, const std::string& path, const LoadOptions& options) {
    return scene_of(path, options, &text);
}

}  // namespace ambilux
