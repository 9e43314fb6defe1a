#include "formats/front_end.h"

#include "core/scoped_seconds.h"
#include "formats/edits.h"

namespace ambilux {

Scene load_through(const std::shared_ptr<document::Document>& document, const std::string& path,
                   const LoadOptions& options, const std::function<void()>& read) {
    document->limits = options.limits;
    return naming_includes(*document, [&] {
        {
            const ScopedSeconds clock(options.times ? &options.times->read : nullptr);
            read();
            apply_edits(*document, options.edits, nullptr);
        }
        return document::load_document(path, document, options);
    });
}

Scene load_by(const std::string& path, const LoadOptions& options,
              const std::function<void(document::Document&, Report&)>& read) {
    const auto document = std::make_shared<document::Document>();
    document->smooth_normals = false;
    document->mirrors_turn_in = false;
    document->clips_reflectances = true;
    document->scene = &document::add_object(*document, "scene", "", {path, 0});
    return load_through(document, path, options, [&] {
        Report report(options.lenient);
        read(*document, report);
        report.write(*document);
        document::check_references(*document);
    });
}

}  // namespace ambilux
