#include "formats/front_end.h"

#include "core/scoped_seconds.h"

namespace ambilux {

Scene load_by(const std::string& path, const LoadOptions& options,
              const std::function<void(document::Document&, Report&)>& read) {
    document::Document document;
    document.limits = options.limits;
    document.smooth_normals = false;
    document.mirrors_turn_in = false;
    document.clips_reflectances = true;
    document.scene = &document::add_object(document, "scene", "", {path, 0});
    return naming_includes(document, [&] {
        {
            const ScopedSeconds clock(options.times ? &options.times->read : nullptr);
            Report report(options.lenient);
            read(document, report);
            report.write(document);
            document::check_references(document);
        }
        return document::load_document(path, document, options);
    });
}

}  // namespace ambilux
