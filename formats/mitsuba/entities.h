// Entities that an XML file declares itself (<!DOCTYPE scene [<!ENTITY name "text"> ...]>), put in before it is parsed.
#pragma once

#include <string>

#include "formats/document/document.h"

namespace ambilux::mitsuba {

using namespace document;

/// The text of the file at `path` with its `&name;` replaced: by the texts that its DOCTYPE declares or, with SYSTEM,
/// by files, which become files of the document. Lines keep their numbers. Throws Error(bad_input) with file and line.
std::string expand_entities(Document& document, const std::string& path, const std::string& text);

}  // namespace ambilux::mitsuba
