// The files of meshes.
#include "core/parallel.h"
#include "core/scoped_seconds.h"
#include "formats/document/shape_jobs.h"
#include "formats/file_budget.h"
#include "formats/gzip.h"

namespace ambilux::document {

namespace {

/// Reads the file and its digest on two threads.
void load_source(MeshSource& s, const Limits& limits) {
    const std::string bytes = gunzip_if_packed(s.path, read_input(s.path, limits), limits);
    s.lacks_materials = s.lacks_materials && bytes.find("mtllib ") != std::string::npos;
    const auto read = [&] {
        if (s.type == "obj") return read_obj(s.path, bytes, s.flip_v, limits);
        if (s.type == "ply") return read_ply(s.path, bytes, s.flip_v, limits);
        return read_serialized(s.path, bytes, s.shape_index, s.flip_v, limits);
    };
    parallel_for(2, [&](int task) {
        if (task == 0)
            s.digest = sha256(bytes);
        else
            s.mesh = read();
    });
}

}  // namespace

void load_sources(Builder& builder, std::vector<MeshSource>& sources, std::vector<Job>& placed,
                  std::vector<GroupJobs>& groups) {
    const ScopedSeconds clock(&builder.options.times->read);
    std::vector<Job*> jobs;
    const auto collect = [&](std::vector<Job>& all) {
        for (Job& job : all)
            if (job.source >= 0) jobs.push_back(&job);
    };
    collect(placed);
    for (GroupJobs& group : groups) collect(group.jobs);
    std::vector<bool> used(sources.size());
    for (const Job* job : jobs) used[size_t(job->source)] = true;
    parallel_for(sources.size(), [&](size_t i) {
        MeshSource& s = sources[i];
        if (used[i] && !s.path.empty()) load_source(s, builder.options.limits);
    });
    for (size_t i = 0; i < used.size(); ++i) {
        const MeshSource& s = sources[i];
        for (const std::string& note : s.mesh.notes) builder.note({s.path, 0}, note);
        if (s.path.empty() || !used[i]) continue;
        builder.file_digests.push_back({s.path, s.digest});
        if (s.lacks_materials)
            builder.note({s.path, 0}, "materials of obj files are not read; such shapes without a BSDF are diffuse");
    }
    for (Job* job : jobs) {
        const auto& o = sources[size_t(job->source)].content().origin;
        job->to_world = job->to_world * translation(o[0], o[1], o[2]);
    }
}

}  // namespace ambilux::document
