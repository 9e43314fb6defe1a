#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/huge_pages.h"
#include "formats/extent.h"
#include "formats/finalize.h"
#include "scene/pick_table.h"
#include "transport/sensor/filter.h"
#include "transport/texture.h"

namespace ambilux {

namespace {

/// The table by which light sampling picks one of entries with these weights. `what` says in plural what they are,
/// `advice` what to do when they are too many.
std::vector<float> checked_pick_table(const Scene& scene, const std::vector<double>& weights, const std::string& what,
                                      const std::string& advice) {
    const uint64_t count = count_picks(weights);
    if (count > kMostPicks)
        throw input_error(scene.path, 0,
                          std::to_string(count) + ' ' + what + "; light sampling tells " + std::to_string(kMostPicks) +
                              " apart: " + advice);
    return pick_table(weights);
}

double quadric_area(const Quadric& q) {
    const Vec3f x = column(q.to_world, 0), y = column(q.to_world, 1), z = column(q.to_world, 2);
    switch (q.type) {
        case PrimitiveType::sphere: return 4 * M_PI * double(q.radius) * q.radius;
        case PrimitiveType::disk: return M_PI * length(cross(x, y));
        case PrimitiveType::cylinder: return 2 * M_PI * q.radius * length(z);
        default: return 0;
    }
}

void fill_areas(Scene& scene, const Scene* before) {
    const bool same = before && same_geometry(scene, *before);  // whose shapes have their areas
    for (Shape& shape : scene.shapes) {
        if (same) break;
        double area = 0;
        for (uint32_t i = 0; i < shape.primitive_count; ++i) {
            const uint32_t prim = shape.first_primitive + i;
            area += prim < scene.triangles.size() ? triangle_area(scene, scene.triangles[prim])
                                                  : quadric_area(scene.quadrics[prim - scene.triangles.size()]);
        }
        shape.area = float(area);
    }
    for (Emitter& emitter : scene.emitters) {
        if (!is_on_surface(emitter.type)) continue;
        const Shape& shape = scene.shapes[emitter.shape];
        emitter.area_cdf = kNone;
        if (shape.primitive_count < 2) continue;
        emitter.area_cdf = uint32_t(scene.tables.size());
        std::vector<double> areas(shape.primitive_count);
        for (size_t i = 0; i < areas.size(); ++i)
            areas[i] = triangle_area(scene, scene.triangles[shape.first_primitive + i]);
        std::vector<float> cdf =
            checked_pick_table(scene, areas, "triangles in one light", "split the mesh into several shapes");
        // From the table, not 1/area of the shape: that is what sampling does, and in meshes of many triangles the two
        // differ.
        for (size_t i = 0; i < areas.size(); ++i)
            cdf.push_back(areas[i] > 0 ? float((double(cdf[i + 1]) - cdf[i]) / areas[i]) : 0.0f);
        scene.tables.append(cdf.data(), cdf.size());
    }
}

/// Mean luminance of a colour over its texture.
double mean_luminance(const Scene& scene, const ParamRgb& parameter) {
    if (parameter.texture < 0) return luminance(parameter.value);
    const Texture& t = scene.textures[size_t(parameter.texture)];
    if (t.type == TextureType::checkerboard) return luminance(parameter.value * (t.color0 + t.color1)) / 2;
    double sum = 0;
    const SceneView view = scene.view();
    for (uint32_t y = 0; y < t.height; ++y)
        for (uint32_t x = 0; x < t.width; ++x) sum += luminance(parameter.value * load_texel(view, t, x, y));
    return sum / (double(t.width) * t.height);
}

/// Integral of a hat function (1 at 0, 0 at -1 and 1) up to x.
double hat_integral(double x) {
    x = std::clamp(x, -1.0, 1.0);
    return x < 0 ? 0.5 * (1 + x) * (1 + x) : 1 - 0.5 * (1 - x) * (1 - x);
}

/// What an environment's radiance is multiplied by: its largest component, and the rest of it, which alone decides
/// where light comes from. Scales that differ by a grey factor have the same density to the bit.
struct EnvironmentScale {
    float factor;
    Rgb tint;

    explicit EnvironmentScale(Rgb radiance)
        : factor(max_component(radiance)), tint(factor > 0 ? radiance / factor : radiance) {
        if (!(factor > 0)) factor = 1;
    }
};

/// Makes the alias tables of an environment map whose rows, and cells within each row, get these tickets.
void make_environment_tables(Scene& scene, size_t width, const std::vector<uint32_t>& row_tickets,
                             const std::vector<uint32_t>& cell_tickets) {
    const size_t height = row_tickets.size();
    scene.environment_rows = make_alias_table(row_tickets);
    std::vector<EnvironmentCell> cells(width * height);
    for (size_t y = 0; y < height; ++y) {
        const uint32_t* tickets = cell_tickets.data() + y * width;
        const double scale = double(row_tickets[y]) / kTickets * double(height) / kTickets * double(width);
        const std::vector<AliasBucket> buckets = make_alias_table({tickets, tickets + width});
        for (size_t x = 0; x < width; ++x)
            cells[y * width + x] = {buckets[x].threshold, buckets[x].alias, float(scale * tickets[x]),
                                    float(scale * tickets[buckets[x].alias])};
    }
    scene.environment_cells = std::move(cells);
}

/// The tables of the same environment map in `before`, if it has that.
bool take_environment(Scene& scene, const Emitter& emitter, const Scene* before) {
    if (!before || before->environment == kNone) return false;
    const Emitter& old = before->emitters[before->environment];
    const EnvironmentScale scale(emitter.radiance.value), old_scale(old.radiance.value);
    if (old.type != emitter.type || !(old_scale.tint == scale.tint)) return false;
    const Texture &a = scene.textures[size_t(emitter.radiance.texture)],
                  &b = before->textures[size_t(old.radiance.texture)];
    const uint8_t *texels = scene.texels.data() + a.offset, *old_texels = before->texels.data() + b.offset;
    if (a.width != b.width || a.height != b.height || a.format != b.format) return false;
    if (texels != old_texels && memcmp(texels, old_texels, size_t(a.width) * a.height * bytes_of_texel(a.format)) != 0)
        return false;
    scene.environment_rows = before->environment_rows;
    scene.environment_cells = before->environment_cells;
    scene.environment_mean = before->environment_mean;
    return true;
}

/// Density of an environment map over the cells of 1/width by 1/height in (u,v) (transport/emitter/envmap.h): the
/// integral of the bilinear interpolant over the cell times the cell's solid angle. Along u, texel centres are cell
/// centres: weights 1, 6, 1 over 8. Along v, texel rows lie at j/(height-1), so that the weights change from row to
/// row; a row that barely reaches into a cell still gets 1/32, which bounds the ratio of radiance to density there. The
/// density is zero only where the radiance is.
void fill_environment(Scene& scene, const Emitter& emitter) {
    const Texture t = scene.textures[size_t(emitter.radiance.texture)];
    const EnvironmentScale scale(emitter.radiance.value);
    const int64_t w = t.width, h = t.height;
    if (w > (1 << 20) || h > (1 << 20))
        throw input_error(scene.path, 0, "environment maps are limited to 2^20 rows and columns");
    std::vector<float> lum;
    lum.reserve(size_t(w * h));
    const SceneView view = scene.view();
    for (uint32_t y = 0; y < t.height; ++y)
        for (uint32_t x = 0; x < t.width; ++x)
            lum.push_back(std::max(0.0f, luminance(scale.tint * load_texel(view, t, x, y))));

    std::vector<double> row_means(size_t(h), 0.0), row_sums(size_t(h), 0.0);
    for (size_t i = 0; i < lum.size(); ++i) row_means[i / size_t(w)] += lum[i] / double(w);
    std::vector<uint32_t> cell_tickets(size_t(w * h));
    std::vector<double> column_weights(static_cast<size_t>(w));
    double mean = 0;
    for (int64_t y = 0; y < h; ++y) {
        // The cell in units of rows.
        const double a = double(y) * double(h - 1) / double(h), b = double(y + 1) * double(h - 1) / double(h);
        std::fill(column_weights.begin(), column_weights.end(), 0.0);
        double exact_mean = 0;
        for (int64_t r = std::max<int64_t>(y - 1, 0); r <= std::min(y + 1, h - 1); ++r) {
            const double exact = h > 1 ? (hat_integral(b - double(r)) - hat_integral(a - double(r))) / (b - a) : 1.0;
            if (!(exact > 0)) continue;
            const double weight = std::max(exact, 1.0 / 32);
            const float* row = &lum[size_t(r * w)];
            exact_mean += exact * row_means[size_t(r)];
            for (int64_t x = 0; x < w; ++x)
                column_weights[size_t(x)] += weight * (row[(x + w - 1) % w] + 6.0 * row[x] + row[(x + 1) % w]) / 8;
        }
        const double solid_angle =
            2 * M_PI / double(w) *
            (std::cos(M_PI * double(y) / double(h)) - std::cos(M_PI * double(y + 1) / double(h)));
        for (double c : column_weights) row_sums[size_t(y)] += solid_angle * c;
        const std::vector<uint32_t> tickets = deal_tickets(column_weights);
        std::copy(tickets.begin(), tickets.end(), cell_tickets.begin() + y * w);
        mean += exact_mean * solid_angle * double(w) / (4 * M_PI);
    }
    make_environment_tables(scene, t.width, deal_tickets(row_sums), cell_tickets);
    scene.environment_mean = mean;
}

bool is_masked_out(const Scene& scene, const Emitter& e) {
    if (!is_on_surface(e.type) || has_delta_position(e.type)) return false;
    return scene.materials[scene.shapes[e.shape].material].unseen();
}

// Power of an emitter, luminance of watts, one function a model.

/// A mask takes nothing from an emitter, but where its opacity is 0 there is none (transport/emitter/area.h).
double power(ModelTag<AreaEmitter>, Scene& scene, Emitter& e, const Receivers&) {
    if (is_masked_out(scene, e)) return 0;
    return M_PI * scene.shapes[e.shape].area * mean_luminance(scene, e.radiance);
}
double power(ModelTag<PointEmitter>, Scene& scene, Emitter& e, const Receivers&) {
    return 4 * M_PI * mean_luminance(scene, e.radiance);
}
/// Exact for a constant profile up to the beam width and about right for the falloff.
double power(ModelTag<SpotEmitter>, Scene& scene, Emitter& e, const Receivers&) {
    const auto one_minus_cos = [](double angle) { return 2 * std::sin(angle / 2) * std::sin(angle / 2); };
    return M_PI * (one_minus_cos(e.cutoff) + one_minus_cos(e.beam_width)) * mean_luminance(scene, e.radiance);
}
/// Of the plane z = 1.
double power(ModelTag<ProjectorEmitter>, Scene& scene, Emitter& e, const Receivers&) {
    return 4.0 * e.cutoff * e.beam_width * mean_luminance(scene, e.radiance);
}
double power(ModelTag<DirectionalEmitter>, Scene& scene, Emitter& e, const Receivers& to) {
    return to.disk * mean_luminance(scene, e.radiance);
}
double power(ModelTag<ConstantEmitter>, Scene& scene, Emitter& e, const Receivers& to) {
    return M_PI * to.both_sides * mean_luminance(scene, e.radiance);
}
double power(ModelTag<EnvmapEmitter>, Scene& scene, Emitter& e, const Receivers& to) {
    return M_PI * to.both_sides * scene.environment_mean * EnvironmentScale(e.radiance.value).factor;
}

double power(ModelTag<CollimatedEmitter>, Scene& scene, Emitter& e, const Receivers&) {
    return mean_luminance(scene, e.radiance);
}
double power(ModelTag<DirectionalAreaEmitter>, Scene& scene, Emitter& e, const Receivers&) {
    if (is_masked_out(scene, e)) return 0;
    return scene.shapes[e.shape].area * mean_luminance(scene, e.radiance);
}

double power(ModelTag<HiddenAreaEmitter>, Scene& scene, Emitter& e, const Receivers&) {
    return M_PI * scene.shapes[e.shape].area * mean_luminance(scene, e.radiance);
}

void fill_emitters(Scene& scene, LightPicking picking, const Scene* before) {
    scene.light_picking = name_of(picking);
    scene.emitter_cdf = {0.0f};
    if (scene.emitters.empty()) return;
    const Receivers receivers = receivers_of(scene);
    std::vector<double> powers;
    std::vector<bool> infinite;
    for (Emitter& e : scene.emitters) {
        if (e.type == EmitterType::envmap && !take_environment(scene, e, before)) fill_environment(scene, e);
        const double p = EmitterModels::visit<EmitterModels::kAll>(
            uint32_t(e.type), 0.0, [&](auto model) { return power(model, scene, e, receivers); });
        if (!(p >= 0) || !std::isfinite(p))
            throw input_error(scene.path, 0,
                              "emitter " + std::to_string(powers.size()) + " has a power that is not finite");
        if (is_masked_out(scene, e))
            scene.warnings.push_back("emitter " + std::to_string(powers.size()) +
                                     " is behind a mask of opacity 0 and sends no light");
        powers.push_back(p);
        infinite.push_back(is_infinite(e.type));
    }
    if (*std::max_element(powers.begin(), powers.end()) == 0)
        scene.notes.push_back(scene.path + ": all its lights have zero radiance: its image is black");
    const std::vector<double> weights = picking_weights(std::move(powers), infinite, picking);
    scene.emitter_cdf =
        checked_pick_table(scene, weights, "emitters", "make one mesh light of emitters with the same radiance");
    for (size_t i = 0; i < weights.size(); ++i)
        scene.emitters[i].pick_probability = scene.emitter_cdf[i + 1] - scene.emitter_cdf[i];
}

/// Cumulative distribution of the Gaussian reconstruction filter of radius r, exp(-x²/2σ²) - exp(-r²/2σ²) with r = 4σ,
/// at x in [-r, r].
double filter_cdf(double r, double x) {
    const double sigma = r / 4, floor = std::exp(-r * r / (2 * sigma * sigma));
    const auto integral = [&](double a) {
        return sigma * std::sqrt(M_PI / 2) * std::erf(a / (sigma * std::sqrt(2.0))) - floor * a;
    };
    return 0.5 + 0.5 * integral(x) / integral(r);
}

void fill_filter_table(Scene& scene, const Scene* before) {
    Sensor& sensor = scene.sensor;
    if (sensor.filter != FilterType::gaussian) return;
    sensor.filter_table = uint32_t(scene.tables.size());
    const double r = sensor.filter_radius;
    constexpr size_t kSize = 2 * kFilterTableSize + 2;
    if (before && before->sensor.filter == sensor.filter && before->sensor.filter_radius == sensor.filter_radius)
        return scene.tables.append(before->tables.data() + before->sensor.filter_table, kSize);
    std::vector<float> table;
    for (uint32_t i = 0; i <= kFilterTableSize; ++i) {
        const double p = double(i) / kFilterTableSize;
        double lo = -r, hi = r;
        for (int k = 0; k < 100; ++k) {
            const double mid = 0.5 * (lo + hi);
            (filter_cdf(r, mid) < p ? lo : hi) = mid;
        }
        table.push_back(
            i == 0 ? float(-r)
                   : (i == kFilterTableSize ? float(r) : (2 * i == kFilterTableSize ? 0.0f : float(0.5 * (lo + hi)))));
    }
    append_filter_guide(table);
    scene.tables.append(table.data(), table.size());
}

Vec3f camera_position(const Scene& scene) { return column(scene.sensor.to_world, 3); }

void fill_sort_keys(Scene& scene, const Scene* before) {
    const auto has_material = [](const Shape& a, const Shape& b) { return a.material == b.material; };
    if (before && same_geometry(scene, *before) &&
        std::equal(scene.shapes.begin(), scene.shapes.end(), before->shapes.begin(), has_material)) {
        scene.sort_keys = before->sort_keys;
        return;
    }
    const SceneView view = scene.view();
    scene.sort_keys.resize(view.primitive_count());
    for (uint32_t prim = 0; prim < view.primitive_count(); ++prim)
        scene.sort_keys[prim] = uint16_t(std::min(scene.shapes[view.shape_of(prim)].material, kMostSortKeys - 1));
}

/// What a material needs, and all that it is blended of.
void add_features(const Scene& scene, const Material& m, Features& f) {
    for (uint32_t index : {m.front, m.back}) {
        const BsdfRecord& b = scene.bsdfs[index];
        f.bsdfs |= bit(b.type);
        f.textures |= is_textured(b);
        f.bumps |= b.normal_map >= 0 || b.bump_map >= 0;
        f.map_rules |= b.map_rules != 0;
        f.coats |= b.coat != kNone;
        f.phong_facets |= has_microfacets(b, Microfacets::phong);
    }
    if (m.first == kNone) return;
    f.blends = true;
    f.textures |= m.second_weight.texture >= 0;
    for (uint32_t part : {m.first, m.second}) add_features(scene, scene.materials[part], f);
}

void fill_features(Scene& scene) {
    Features f;
    const auto use = [&](int32_t texture) { f.textures |= texture >= 0; };
    for (const Shape& shape : scene.shapes) {
        if (shape.primitive_count == 0) continue;
        const Material& m = scene.materials[shape.material];
        use(m.opacity.texture);
        f.opacity |= m.lets_pass();
        add_features(scene, m, f);
        const uint32_t first = shape.first_primitive;
        f.primitives |= bit(first < scene.triangles.size() ? PrimitiveType::triangle
                                                           : scene.quadrics[first - scene.triangles.size()].type);
    }
    for (const Emitter& e : scene.emitters) {
        f.emitters |= bit(e.type);
        if (e.type != EmitterType::envmap) use(e.radiance.texture);  // an environment map has its own lookup
    }
    f.instances = !scene.instances.empty();
    f.latlong = is_latlong(scene.sensor.type);
    scene.features = f;
}

}  // namespace

void finalize_scene(Scene& scene, LightPicking light_picking, const Scene* before) {
    fill_areas(scene, before);
    if (before && same_geometry(scene, *before) && camera_position(scene) == camera_position(*before))
        scene.bounds_center = before->bounds_center, scene.bounds_radius = before->bounds_radius;
    else
        fill_bounds(scene);
    fill_emitters(scene, light_picking, before);
    fill_filter_table(scene, before);
    fill_features(scene);
    fill_sort_keys(scene, before);
    if (scene.tables.size() >= kNone) throw input_error(scene.path, 0, "the scene's tables are too large");
    // What rays read here and there.
    const auto large_pages = [](const auto& array) { use_huge_pages(array.data(), array.size() * sizeof array[0]); };
    large_pages(scene.texels), large_pages(scene.environment_cells), large_pages(scene.triangles);
    large_pages(scene.vertices);
}

}  // namespace ambilux
