// What a front end says about a scene beside errors.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "formats/document/document.h"

namespace ambilux {

/// Notes and refusals, each text once with the place of the first and how often it held.
class Report {
public:
    explicit Report(bool lenient) : lenient_(lenient) {}

    /// Something done in our own way.
    void note(const document::Where& where, const std::string& text);
    /// Something we cannot do: an error, or with --lenient a warning that says what is done instead.
    void refuse(const document::Where& where, const std::string& problem, const std::string& instead);
    /// Hands all over.
    void write(document::Document& document) const;

private:
    struct Entry {
        std::string text;
        document::Where where;
        uint64_t count = 0;
    };
    struct List {
        std::vector<Entry> entries;
        std::map<std::string, size_t> places;

        void add(const document::Where& where, const std::string& text);
        std::vector<std::string> lines() const;
    };

    bool lenient_;
    List notes_, warnings_;
};

}  // namespace ambilux
