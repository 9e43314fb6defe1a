// The folder of a sweep: rows that are done, and the files of the scene in work.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "experiments/experiment_folder.h"
#include "stress/rows.h"

namespace ambilux::stress {

/// Writes a scene and what it refers to into a folder; returns the path of the scene.
std::string write_scene(const std::string& folder, const Cell& cell);

/// Writes scenes and expected.csv, for other renderers.
void export_cells(const std::string& folder, const std::vector<std::pair<const Family*, const Cell*>>& cells);

class SweepFolder {
public:
    /// Makes the folder or, with `resume`, continues it. `mode`: what all rows in it have in common. Throws Error:
    /// usage if it holds a sweep and `resume` is not set, bad_input if that is of another mode.
    SweepFolder(const std::string& path, const std::string& mode, bool resume);
    ~SweepFolder();
    SweepFolder(const SweepFolder&) = delete;

    const Row* find(const std::string& cell, const std::string& method, const std::string& backend) const;
    void add(const Row& row);

    /// Where the scene in work lies; emptied by clear_scenes.
    const std::string& scenes() const { return scenes_; }
    void clear_scenes() const;

private:
    void read();

    const std::string path_, csv_, scenes_;
    const FolderLock lock_;
    std::map<std::string, Row> rows_;
};

}  // namespace ambilux::stress
