// Scenes that are changed by name: what a file names is changed in the tree of objects that it became, and the scene is
// built from that as from a file. Parts whose causes are the same are taken over.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "formats/load.h"

namespace ambilux {

/// Changes the document. `kept` is of the scene that was built from it, or null. Throws Error(bad_input) that begins
/// with the name of the edit.
void apply_edits(document::Document& document, const std::vector<Edit>& edits, const document::Kept* kept);

/// The scene that options.edits make of another one. It shares with that one what has not changed; options.editable, if
/// there is one, gets what it was made of. `path` is for messages. Throws Error(bad_input), of edits by their names.
Scene edited_scene(const std::string& path, const Editable& from, const LoadOptions& options);

/// All that can be changed, as an array of {name, object, tag, kind, value, given}: numbers, texts and transforms as
/// they are, `given` false where the file says nothing and a default holds; of kinds mesh and image the name of the
/// object.
nlohmann::json scene_parameters(const Editable& from);

/// The mesh or image of an object, or of an array, by name, as its file or array has it. Throws Error(bad_input).
Mesh mesh_of(const Editable& from, const std::string& object);
Texels image_of(const Editable& from, const std::string& object);

/// The scene as Mitsuba's XML, for a file at `path`; without one, files have whole names and arrays their own. Throws
/// Error(bad_input) if the scene came from no such file.
std::string scene_text(const Editable& from, const std::string& path);
/// Writes it, with its arrays as files.
void write_scene(const Editable& from, const std::string& path);

}  // namespace ambilux
