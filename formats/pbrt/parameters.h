// Parameters of pbrt's directives: "type name" and values.
#pragma once

#include <string>
#include <vector>

#include "formats/file_budget.h"
#include "formats/pbrt/tokens.h"
#include "formats/report.h"

namespace ambilux::pbrt {

struct Parameter {
    std::string type, name;
    Where where;
    std::vector<double> numbers;
    std::vector<std::string> strings;  ///< booleans too: "true", "false"
    mutable bool used = false;

    bool is_texture() const { return type == "texture"; }
};

/// A directive with its parameters. Getters fail with file and line if a parameter is of another type.
class Parameters {
public:
    std::string directive;  ///< "Shape"
    std::string type;       ///< "sphere"
    Where where;
    std::vector<Parameter> list;
    mutable std::vector<std::string> absent =
        {};  ///< names that were asked for: a misspelled one is nearly one of these

    /// The parameter, which then counts as used, or null.
    const Parameter* find(const std::string& name) const;
    Where where_of(const std::string& name) const;

    double number(const std::string& name, double fallback) const;
    int64_t integer(const std::string& name, int64_t fallback) const;
    bool boolean(const std::string& name, bool fallback) const;
    std::string text(const std::string& name, const std::string& fallback) const;
    Vec3d point(const std::string& name, Vec3d fallback) const;
    /// All values of a list; `size` divides their number.
    const std::vector<double>& numbers(const std::string& name, size_t size = 1) const;

    void ignore(std::initializer_list<const char*> names) const;
    /// Parameters that ask for what is not done: a note says why.
    void leave(Report& report, std::initializer_list<const char*> names, const std::string& why) const;
    /// The name of a file, which must be there.
    std::string filename() const;
    /// Refuses what nobody asked for.
    void finish(Report& report) const;

private:
    std::string unknown(const Parameter& p, const std::vector<std::string>& known) const;
    const Parameter* typed(const std::string& name, std::initializer_list<const char*> types) const;
};

/// Reads them up to the next directive.
std::vector<Parameter> read_parameters(Tokenizer& tokens, FileBudget& budget);

/// Name and value of directive Option, which have no type: one string, or one word. A type before the name is left out.
Parameter read_option(Tokenizer& tokens);

}  // namespace ambilux::pbrt
