#include "render/twin/twin.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "core/flag.h"
#include "core/parallel.h"
#include "integrators/bdpt/shared/policy.h"
#include "integrators/path/policy.h"
#include "integrators/registry.h"
#include "render/statistics.h"
#include "render/twin/convert.h"
#include "render/twin/path_sample.h"
#include "render/twin/scene.h"
#include "scene/info.h"

namespace ambilux {
namespace twin {

void convert(const ambilux::SingleStrategies& from, SingleStrategies& to) {
    to.on = from.on;
    std::copy(std::begin(from.s), std::end(from.s), std::begin(to.s));
}

namespace {

template <class Mis>
class Twin final : public Renderer {
public:
    template <class SingleRules>
    Twin(const ambilux::Scene& scene, const RenderSettings& settings, const SingleRules& rules)
        : Twin(Clock::now(), scene, settings) {
        convert(rules, rules_);
    }

    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const auto start = Clock::now();
        uint32_t done = 0;
        for (; done < count && !is_set(interrupt); ++done) {
            const auto sample_start = Clock::now();
            render_sample(first + done);
            measured_seconds_ = seconds_since(sample_start);
        }
        film_.samples += done;
        samples_ += done;
        render_seconds_ += seconds_since(start);
        return done;
    }

    FilmMoments film() override { return film_; }

    void clear_film() override {
        std::fill(film_.sum.begin(), film_.sum.end(), 0.0);
        std::fill(film_.sum_squares.begin(), film_.sum_squares.end(), 0.0);
        film_.samples = 0;
    }

    RenderStats stats() override {
        RenderStats s;
        s.backend = "cpu";
        s.device = fmt::format("CPU, {} threads, double precision", tbb::this_task_arena::max_concurrency());
        s.accel = "median_bvh";
        s.settings = settings_;
        s.build_seconds = build_seconds_;
        s.render_seconds = render_seconds_;
        s.samples = samples_;
        s.rays_extend = counts_.rays_extend;
        s.rays_occlude = counts_.rays_occlude;
        s.invalid = counts_.invalid;
        s.memory_bytes = s.memory_bytes_predicted = s.memory_bytes_peak =
            scene_.memory_bytes() + tracer_.memory_bytes() + 3 * sizeof(double) * film_.sum.size();
        s.features = feature_names(ambilux::kAllFeatures);
        return s;
    }

    uint32_t preferred_batch() const override { return batch_of(measured_seconds_, samples_ > 0); }

private:
    Twin(Clock::time_point start, const ambilux::Scene& scene, const RenderSettings& settings)
        : settings_(settings), scene_(scene), view_(scene_.view()), tracer_(view_) {
        film_.width = view_.sensor.crop_width;
        film_.height = view_.sensor.crop_height;
        const size_t values = size_t(film_.width) * film_.height * 3;
        film_.sum.resize(values);
        film_.sum_squares.resize(values);
        sample_.resize(values / 3);
        rows_.resize(film_.height);
        build_seconds_ = seconds_since(start);
    }

    /// What the pixels of one row brought.
    struct Row {
        std::vector<Splat> splats;
        Counts counts;
    };

    /// Rows are summed in their order, whichever thread they were on.
    void render_sample(uint32_t index) {
        parallel_for(film_.height, [&](uint32_t y) {
            Row& row = rows_[y];
            row.splats.clear();
            row.counts = {};
            PathSample<Mis> sample(view_, tracer_, rules_, row.counts, row.splats);
            for (uint32_t x = 0; x < film_.width; ++x)
                sample_[size_t(y) * film_.width + x] = sample(settings_.seed, x, y, index);
        });
        for (const Row& row : rows_) {
            counts_.add(row.counts);
            for (const Splat& s : row.splats) add(s);
        }
        for (size_t i = 0; i < sample_.size(); ++i)
            for (int c = 0; c < 3; ++c) {
                const double value = sample_[i][c];
                film_.sum[3 * i + size_t(c)] += value;
                film_.sum_squares[3 * i + size_t(c)] += value * value;
            }
    }

    /// To the pixels whose filters reach it.
    void add(const Splat& s) {
        const Sensor& sensor = view_.sensor;
        const double r = sensor.filter_radius;
        for_each_film_position<kAllFeatures>(sensor, s.film, [&](Vec2f film) {
            const double x = film.x - sensor.crop_x, y = film.y - sensor.crop_y;
            const int x0 = std::max(int(std::ceil(x - r - 0.5)), 0), y0 = std::max(int(std::ceil(y - r - 0.5)), 0);
            const int x1 = std::min(int(std::floor(x + r - 0.5)), int(film_.width) - 1);
            const int y1 = std::min(int(std::floor(y + r - 0.5)), int(film_.height) - 1);
            for (int py = y0; py <= y1; ++py)
                for (int px = x0; px <= x1; ++px)
                    sample_[size_t(py) * film_.width + size_t(px)] +=
                        s.value * filter_value(view_, {x - (px + 0.5), y - (py + 0.5)});
        });
    }

    RenderSettings settings_;
    DoubleScene scene_;
    SceneView view_;
    Tracer tracer_;
    Rules<Mis> rules_{};
    FilmMoments film_;
    std::vector<Rgb> sample_;  ///< of every pixel
    std::vector<Row> rows_;
    Counts counts_;
    uint64_t samples_ = 0;
    double build_seconds_ = 0, render_seconds_ = 0, measured_seconds_ = 0;
};

/// Settings of which the twin has but one value.
void check(const RenderSettings& settings) {
    for (const char* key : {"cull", "technique_depth", "light_paths", "bdpt.auto", "memory"}) {
        const Setting& s = *find_general_setting(key);
        if (!s.is_default(settings))
            throw Error(ExitCode::usage, fmt::format("{}={}: precision=double is a plain loop and does without; leave "
                                                     "one of the two out",
                                                     key, s.text(settings)));
    }
}

}  // namespace
}  // namespace twin

std::unique_ptr<Renderer> make_twin(const Scene& scene, const RenderSettings& settings) {
    twin::check(settings);
    if (variant_of(settings).traits.light_subpaths)
        return std::make_unique<twin::Twin<twin::BidirectionalMis>>(scene, settings, plan_bdpt(scene, settings).rules);
    return std::make_unique<twin::Twin<twin::UnidirectionalMis>>(scene, settings, plan_path(scene, settings).rules);
}

}  // namespace ambilux
