// Readers of other formats: they make the tree of objects that a Mitsuba file has.
#pragma once

#include <functional>

#include "formats/report.h"

namespace ambilux {

/// The scene of the document that `read` fills, which has the limits of the options, and what its edits make of it.
Scene load_through(const std::shared_ptr<document::Document>& document, const std::string& path,
                   const LoadOptions& options, const std::function<void()>& read);

/// The scene of the document that `read` fills, for a file at `path`. Meshes without normals stay flat. What is thrown
/// by `read` and load_document passes through.
Scene load_by(const std::string& path, const LoadOptions& options,
              const std::function<void(document::Document&, Report&)>& read);

}  // namespace ambilux
