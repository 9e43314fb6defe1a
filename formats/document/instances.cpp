#include <algorithm>
#include <cmath>

#include "formats/document/shape_jobs.h"
#include "scene/primitive_bounds.h"

namespace ambilux::document {

namespace {

/// Scales that instances have; others are copied, since coordinates would leave the range of the tracers.
constexpr double kMostScale = 1e5;

uint64_t triangles_of(const GroupJobs& group, const std::vector<MeshSource>& sources) {
    uint64_t count = 0;
    for (const Job& job : group.jobs)
        if (job.source >= 0) count += sources[size_t(job.source)].content().faces.size();
    return count;
}

bool has_ordinary_scale(const Matrix& m) {
    double least = INFINITY, most = 0;
    const Matrix inverse = affine_inverse(m);
    for (int i = 0; i < 3; ++i) {
        most = std::max(most, length(column(m, i)));
        least = std::min(least, 1 / length(column(inverse, i)));
    }
    return least >= 1 / kMostScale && most <= kMostScale;
}

Job copy_of(const Job& job, const Matrix& placement) {
    Job copy = job;
    copy.to_world = placement * job.to_world;
    copy.reverse = job.reverse != (determinant(placement) < 0);
    return copy;
}

/// Moves the middle of the shared meshes to the origin, where floats have most digits.
void centre(GroupJobs& group, const std::vector<MeshSource>& sources, std::vector<Job*>& shared) {
    double lower[3] = {INFINITY, INFINITY, INFINITY}, upper[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (const Job* job : shared)
        for (const Vec3f& p : sources[size_t(job->source)].content().positions) {
            const Vec3d q = transformed(job->to_world, in_double(p));
            const double c[3] = {q.x, q.y, q.z};
            for (int i = 0; i < 3; ++i) lower[i] = std::min(lower[i], c[i]), upper[i] = std::max(upper[i], c[i]);
        }
    double c[3];
    for (int i = 0; i < 3; ++i) {
        c[i] = 0.5 * (lower[i] + upper[i]);
        if (!std::isfinite(c[i])) c[i] = 0;
    }
    for (Job* job : shared) job->to_world = translation(-c[0], -c[1], -c[2]) * job->to_world;
    for (Matrix& m : group.placements) m = m * translation(c[0], c[1], c[2]);
}

}  // namespace

void place_instances(const Builder& builder, std::vector<GroupJobs>& groups, const std::vector<MeshSource>& sources,
                     std::vector<Job>& jobs) {
    if (groups.empty()) return;
    std::vector<uint64_t> uses(groups.size());
    std::vector<bool> shared(groups.size(), true);
    for (const Job& job : jobs)
        if (job.group >= 0) ++uses[size_t(job.group)];
    for (size_t g = 0; g < groups.size(); ++g) {
        const uint64_t triangles = triangles_of(groups[g], sources);
        shared[g] = uses[g] > 1 && triangles > 0 && uses[g] > builder.options.limits.copies / triangles;
    }
    std::vector<Job> placed;
    size_t count = 0;
    for (Job& job : jobs) {
        if (job.group < 0) {
            check_shapes(builder.options.limits, ++count, job.where);
            placed.push_back(std::move(job));
            continue;
        }
        GroupJobs& group = groups[size_t(job.group)];
        const bool shares = shared[size_t(job.group)] && has_ordinary_scale(job.to_world);
        check_shapes(builder.options.limits, count += group.jobs.size(), job.where);
        for (const Job& part : group.jobs)
            if (!shares || part.source < 0) placed.push_back(copy_of(part, job.to_world));
        if (shares) group.where.push_back(job.where), group.placements.push_back(job.to_world);
    }
    for (size_t g = 0; g < groups.size(); ++g) {
        if (groups[g].placements.empty()) continue;
        std::vector<Job*> meshes;
        for (Job& job : groups[g].jobs)
            if (job.source >= 0) meshes.push_back(&job);
        centre(groups[g], sources, meshes);
        for (Job* job : meshes) {
            job->group = int(g);
            placed.push_back(*job);
        }
    }
    jobs = std::move(placed);
}

void add_instances(const Builder& builder, const std::vector<GroupJobs>& groups, const std::vector<uint32_t>& ends) {
    Scene& scene = builder.scene;
    uint64_t copies = 0, shared = 0, next = scene.triangles.size() + scene.quadrics.size();
    for (size_t g = 0; g < groups.size(); ++g) {
        if (groups[g].placements.empty()) continue;
        Group group = {};
        group.first_triangle = scene.groups.empty() ? ends.front() : ends[scene.groups.size()];
        group.triangle_count = ends[scene.groups.size() + 1] - group.first_triangle;
        const SceneView view = scene.view();
        Bounds3f box;
        for (uint32_t i = 0; i < group.triangle_count; ++i) box.extend(triangle_bounds(view, group.first_triangle + i));
        group.lower = box.lower, group.upper = box.upper;
        const uint32_t index = uint32_t(scene.groups.size());
        scene.groups.push_back(group);
        shared += group.triangle_count;
        const SceneView placed = scene.view();
        if (!group.triangle_count) continue;
        for (size_t i = 0; i < groups[g].placements.size(); ++i) {
            Instance instance = {};
            instance.to_world = to_affine(groups[g].placements[i]);
            // Of the matrix as it is rounded, so that rays meet what is seen.
            Matrix rounded;
            for (int r = 0; r < 3; ++r)
                for (int c = 0; c < 4; ++c) rounded.m[r][c] = instance.to_world.m[r][c];
            instance.to_group = to_affine(affine_inverse(rounded));
            instance.group = index;
            instance.first_triangle = group.first_triangle;
            instance.first_id = uint32_t(next);
            instance.mirrored = determinant(rounded) < 0;
            next += group.triangle_count;
            copies += group.triangle_count;
            if (next >= kNone / 2)
                fail(groups[g].where[i], "the scene has too many triangles, those of instances counted one by one");
            scene.instances.push_back(instance);
            const Bounds3f b = instance_bounds(placed, instance);
            builder.check_range(groups[g].where[i], "the instance",
                                {{b.lower.x, b.lower.y, b.lower.z}, {b.upper.x, b.upper.y, b.upper.z}});
        }
    }
    if (scene.instances.empty()) return;
    scene.notes.push_back(std::to_string(scene.instances.size()) + " instances share " + std::to_string(shared) +
                          " triangles; as copies they would be " + std::to_string(copies) +
                          " (--limits copies=N copies groups of fewer)");
}

}  // namespace ambilux::document
