#include "core/outputs.h"

#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"

namespace ambilux {

namespace fs = std::filesystem;

namespace {

bool is_file(const Output& output) { return !output.path.empty() && output.path != "-"; }

/// Of regular files, by whatever names and links; what does not exist yet by its name behind the links of its folders.
bool is_same(const std::string& a, const std::string& b) {
    std::error_code ignored;
    if (fs::exists(a, ignored) && fs::exists(b, ignored))
        return fs::is_regular_file(a, ignored) && fs::equivalent(a, b, ignored);
    return fs::weakly_canonical(a, ignored) == fs::weakly_canonical(b, ignored);
}

}  // namespace

void check_outputs(const std::vector<Output>& outputs) {
    for (size_t i = 0; i < outputs.size(); ++i) {
        if (!is_file(outputs[i])) continue;
        if (const fs::path folder = fs::path(outputs[i].path).parent_path(); !folder.empty())
            make_folders(folder.string());
        check_writable(outputs[i].path);
        for (size_t k = 0; k < i; ++k)
            if (is_file(outputs[k]) && is_same(outputs[i].path, outputs[k].path))
                throw Error(ExitCode::usage, outputs[k].option + " and " + outputs[i].option + " name the same file, " +
                                                 outputs[i].path);
    }
}

void check_not_inputs(const std::vector<Output>& outputs, const std::vector<std::string>& inputs) {
    for (const Output& output : outputs)
        for (const std::string& input : inputs)
            if (is_file(output) && is_same(output.path, input))
                throw Error(ExitCode::usage, output.option + " " + output.path + " would replace a file that is read" +
                                                 (output.path == input ? "" : ": " + input));
}

}  // namespace ambilux
