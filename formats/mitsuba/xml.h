// Mitsuba's XML as a tree of objects: includes, parameters, search folders, aliases and references are resolved.
#pragma once

#include "formats/document/document.h"

namespace ambilux::mitsuba {

using namespace document;

/// The text of the file at `path` with its `&name;` replaced: by the texts that its DOCTYPE declares or, with SYSTEM,
/// by files, which become files of the document. Lines keep their numbers. Throws Error(bad_input) with file and line.
std::string expand_entities(Document& document, const std::string& path, const std::string& text);

/// Parses the file, or `text` as if the file held it, into a document that has its limits. `parameters` replace
/// <default>s; one that the file does not use is an error. Throws Error(bad_input) with file and line.
void parse_document(Document& document, const std::string& path,
                    const std::vector<std::pair<std::string, std::string>>& parameters, const std::string* text);

/// Parses elements that stand in no file into the children and values of a new object, which belongs to nothing. `name`
/// stands for the file in messages, `version` is that of the elements.
Object& parse_elements(Document& document, const std::string& name, const std::string& elements, int version);

}  // namespace ambilux::mitsuba
