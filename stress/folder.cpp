#include "stress/folder.h"

#include <fmt/format.h>

#include <filesystem>

#include "core/atomic_file.h"
#include "core/error.h"
#include "experiments/results.h"
#include "film/exr_io.h"

namespace ambilux::stress {
namespace {

namespace fs = std::filesystem;

std::string key_of(const std::string& cell, const std::string& method, const std::string& backend) {
    return cell + "," + method + "," + backend;
}

std::string made(const std::string& folder) {
    make_folders(folder);
    return folder;
}

}  // namespace

std::string write_scene(const std::string& folder, const Cell& cell) {
    const SceneFiles files = cell.scene();
    for (const Asset& asset : files.assets) {
        const std::string path = folder + "/" + asset.name;
        if (asset.image.rgb.empty())
            write_file_atomic(path, asset.text);
        else
            write_exr(path, asset.image);
    }
    const std::string path = fmt::format("{}/{}.xml", folder, cell.name());
    write_file_atomic(path, files.xml);
    return path;
}

void export_cells(const std::string& folder, const std::vector<std::pair<const Family*, const Cell*>>& cells) {
    make_folders(folder);
    std::string expected = std::string(kExpectedHeader) + "\n";
    for (const auto& [family, cell] : cells) {
        write_scene(folder, *cell);
        expected += expected_line(*family, *cell) + "\n";
    }
    write_file_atomic(folder + "/expected.csv", expected);
}

SweepFolder::SweepFolder(const std::string& path, const std::string& mode, bool resume)
    : path_(made(path)), csv_(path + "/stress.csv"), scenes_(path + "/scene-in-work"), lock_(path) {
    const std::string mode_file = path + "/sweep.txt";
    if (fs::exists(csv_) && !resume)
        throw Error(ExitCode::usage,
                    path + " holds a sweep already: continue it with --resume or choose another folder");
    if (fs::exists(mode_file) && read_file(mode_file) != mode + "\n")
        throw input_error(mode_file, 1,
                          "the sweep in this folder is another one, " + read_file(mode_file) + "not " + mode +
                              ": choose another folder");
    read();
    write_file_atomic(mode_file, mode + "\n");
    clear_scenes();
}

SweepFolder::~SweepFolder() {
    std::error_code ignored;
    fs::remove_all(scenes_, ignored);
}

void SweepFolder::read() {
    std::string text = row_header() + "\n";
    for (const std::string& line : read_results(csv_, row_header().c_str()))
        if (const std::optional<Row> row = parse_row(line)) {
            rows_[key_of(row->cell, row->method, row->backend)] = *row;
            text += line + "\n";
        }
    write_file_atomic(csv_, text);
}

const Row* SweepFolder::find(const std::string& cell, const std::string& method, const std::string& backend) const {
    const auto row = rows_.find(key_of(cell, method, backend));
    return row == rows_.end() ? nullptr : &row->second;
}

void SweepFolder::add(const Row& row) {
    append_file(csv_, row_line(row) + "\n");
    rows_[key_of(row.cell, row.method, row.backend)] = row;
}

void SweepFolder::clear_scenes() const {
    std::error_code ignored;
    fs::remove_all(scenes_, ignored);
    make_folders(scenes_);
}

}  // namespace ambilux::stress
