// Reads pbrt-v4 files: directives in their order, with includes.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "core/text.h"
#include "formats/document/plugins.h"
#include "formats/front_end.h"
#include "formats/gzip.h"
#include "formats/pbrt/names.h"
#include "formats/pbrt/scene.h"

namespace ambilux {
namespace pbrt {
namespace {

using namespace document;

class Parser {
public:
    Parser(SceneMaker& scene) : scene_(scene) {}

    void parse_file(const std::string& path, const Where& from, uint64_t depth);
    void finish();

private:
    struct Saved {
        State state;
        bool is_object;
        Where where;
    };

    void directive(const Token& word);
    bool transform(const std::string& name, const Where& at);
    bool attribute(const std::string& name, const Where& at);
    bool option(const std::string& name, const Where& at);
    bool world(const std::string& name, const Where& at);
    bool material(const std::string& name, const Where& at);
    void include(const Where& at, bool import);
    void object(const std::string& name, const Where& at);
    void texture(const Where& at);
    void attribute_values(const Where& at);
    void need_world(const std::string& name, const Where& at, bool inside) const;

    Matrix matrix(const Where& at);
    Matrix look_at_matrix(const Where& at);
    Matrix invert(const Matrix& m, const Where& at) const;
    Parameters parameters(const std::string& directive, const Where& at, const char* kind = nullptr);
    void read_list(Parameters& in, const char* kind);
    Shared described(const std::string& directive, const Where& at, const char* kind);
    void save(bool is_object, const Where& at);
    void restore(bool is_object, const Where& at);

    SceneMaker& scene_;
    Options options_;
    Tokenizer* tokens_ = nullptr;
    FileBudget* budget_ = nullptr;
    uint64_t depth_ = 0, file_count_ = 0;
    std::vector<std::string> open_files_;
    std::vector<Saved> saved_;
    std::map<std::string, Matrix> coordinate_systems_;
    bool in_world_ = false;
};

void Parser::parse_file(const std::string& path, const Where& from, uint64_t depth) {
    const Limits& limits = scene_.document.limits;
    check_nesting(limits, depth, from, "files");
    if (++file_count_ > limits.includes)
        fail(from, "more files than --limits includes=" + std::to_string(limits.includes));
    if (std::find(open_files_.begin(), open_files_.end(), path) != open_files_.end())
        fail(from, "circular include of '" + path + "'");
    open_files_.push_back(path);
    if (depth > 1) scene_.document.included_from.try_emplace(path, from);
    const std::string bytes = gunzip_if_packed(path, read_input(path, limits), limits);
    scene_.document.file_digests.push_back({path, sha256(bytes)});
    const std::string text = plain_text(path, bytes);
    Tokenizer tokens(path, text);
    FileBudget budget(path, limits);
    Tokenizer* const outer_tokens = std::exchange(tokens_, &tokens);
    FileBudget* const outer_budget = std::exchange(budget_, &budget);
    const uint64_t outer_depth = std::exchange(depth_, depth);
    while (tokens.peek().kind != TokenKind::end) {
        const Token word = tokens.next();
        if (word.kind != TokenKind::word) fail(tokens.where(word), "a directive is expected, not '" + word.text + "'");
        directive(word);
        budget.tick();
    }
    tokens_ = outer_tokens, budget_ = outer_budget, depth_ = outer_depth;
    open_files_.pop_back();
}

void Parser::finish() {
    if (!saved_.empty())
        fail(saved_.back().where, std::string(saved_.back().is_object ? "Object" : "Attribute") + "Begin has no end");
    if (!in_world_) fail(scene_.document.scene->where, "the scene has no WorldBegin");
    finish_shapes(scene_);
    finish_instances(scene_);
}

void Parser::directive(const Token& word) {
    const std::string& name = word.text;
    const Where at = tokens_->where(word);
    if (name == "Include" || name == "Import") return include(at, name == "Import");
    if (transform(name, at) || attribute(name, at) || option(name, at) || material(name, at) || world(name, at)) return;
    // pbrt-v4 has none; files that once were older end with it.
    if (name == "WorldEnd" && in_world_ && open_files_.size() == 1 && tokens_->peek().kind == TokenKind::end)
        return scene_.report.note(at, "WorldEnd is of older versions; the file is read as one of pbrt-v4");
    fail(at, "unknown directive '" + name + "'" + nearly_known("directive", name));
}

void Parser::need_world(const std::string& name, const Where& at, bool inside) const {
    if (in_world_ != inside)
        fail(at, name + (inside ? " must stand behind WorldBegin" : " must stand before WorldBegin"));
}

Parameters Parser::parameters(const std::string& directive, const Where& at, const char* kind) {
    Parameters in{directive, tokens_->quoted("the type of " + directive), at, {}};
    read_list(in, kind);
    return in;
}

/// The parameters, and what attributes of that kind, if any, say of the others.
void Parser::read_list(Parameters& in, const char* kind) {
    in.list = read_parameters(*tokens_, *budget_);
    if (!kind) return;
    const auto defaults = scene_.state.attributes.find(kind);
    if (defaults == scene_.state.attributes.end()) return;
    for (const Parameter& p : defaults->second)
        if (std::none_of(in.list.begin(), in.list.end(), [&](const Parameter& q) { return q.name == p.name; })) {
            in.list.push_back(p);
            in.list.back().used = true;  // it may be for others
        }
}

Shared Parser::described(const std::string& directive, const Where& at, const char* kind) {
    return std::make_shared<Described>(Described{parameters(directive, at, kind), scene_.state.space});
}

Matrix Parser::matrix(const Where& at) {
    const bool open = tokens_->peek().kind == TokenKind::open;
    if (open) tokens_->next();
    Matrix m;
    // Column by column.
    for (int i = 0; i < 16; ++i) m.m[i % 4][i / 4] = tokens_->number("an entry of a matrix");
    if (open && tokens_->next().kind != TokenKind::close) fail(at, "a matrix has 16 entries");
    for (double& v : m.m[3]) v /= m.m[3][3] != 0 ? m.m[3][3] : 1;
    if (!is_affine(m)) fail(at, "the matrix is not affine: its last row must be 0 0 0 1");
    return m;
}

Matrix Parser::invert(const Matrix& m, const Where& at) const {
    if (!(std::fabs(determinant(m)) > 0)) fail(at, "the transform is singular");
    return affine_inverse(m);
}

Matrix Parser::look_at_matrix(const Where& at) {
    double v[9];
    for (double& x : v) x = tokens_->number("a value of LookAt");
    bool valid = true;
    // Columns left, up, direction, origin there; pbrt calls the first one right.
    const Matrix m = look_at({v[0], v[1], v[2]}, {v[3], v[4], v[5]}, {v[6], v[7], v[8]}, valid);
    if (!valid) fail(at, "LookAt has no direction, or it is that of up");
    return affine_inverse(m);
}

bool Parser::transform(const std::string& name, const Where& at) {
    Matrix& ctm = scene_.state.ctm;
    const auto number = [&] { return tokens_->number("a value of " + name); };
    const auto triple = [&] {
        Vec3d v;
        v.x = number(), v.y = number(), v.z = number();
        return v;
    };
    if (name == "Identity") {
        ctm = {};
    } else if (name == "Translate") {
        const Vec3d v = triple();
        ctm = ctm * translation(v.x, v.y, v.z);
    } else if (name == "Scale") {
        const Vec3d v = triple();
        ctm = ctm * scaling(v.x, v.y, v.z);
    } else if (name == "Rotate") {
        const double angle = number();
        const Vec3d axis = triple();
        if (!(length(axis) > 0)) fail(at, "the axis of Rotate is zero");
        ctm = ctm * rotation(axis.x, axis.y, axis.z, angle);
    } else if (name == "LookAt") {
        ctm = ctm * look_at_matrix(at);
    } else if (name == "Transform") {
        ctm = matrix(at);
    } else if (name == "ConcatTransform") {
        ctm = ctm * matrix(at);
    } else if (name == "CoordinateSystem") {
        coordinate_systems_[tokens_->quoted("the name of a CoordinateSystem")] = ctm;
    } else if (name == "CoordSysTransform") {
        const std::string system = tokens_->quoted("the name of a coordinate system");
        ctm = known_as(coordinate_systems_, system, at, "coordinate system");
    } else if (name == "ActiveTransform") {
        const Token which = tokens_->next();
        if (which.text != "All")
            scene_.report.refuse(at, "ActiveTransform " + which.text + ": what moves is not supported", "all is used");
    } else if (name == "TransformTimes") {
        number(), number();
    } else {
        return false;
    }
    if (!is_affine(ctm)) fail(at, "the transform is not finite");
    return true;
}

void Parser::save(bool is_object, const Where& at) {
    check_nesting(scene_.document.limits, saved_.size() + 1, at, "attributes");
    saved_.push_back({scene_.state, is_object, at});
}

void Parser::restore(bool is_object, const Where& at) {
    if (saved_.empty() || saved_.back().is_object != is_object)
        fail(at, std::string(is_object ? "ObjectEnd without ObjectBegin" : "AttributeEnd without AttributeBegin"));
    scene_.state = std::move(saved_.back().state);
    saved_.pop_back();
}

bool Parser::attribute(const std::string& name, const Where& at) {
    if (name == "AttributeBegin" || name == "TransformBegin") {
        save(false, at);
    } else if (name == "AttributeEnd" || name == "TransformEnd") {
        restore(false, at);
    } else if (name == "ReverseOrientation") {
        scene_.state.reverse_orientation = !scene_.state.reverse_orientation;
    } else if (name == "ColorSpace") {
        scene_.state.space = color_space(tokens_->quoted("a colour space"), at);
    } else if (name == "Attribute") {
        attribute_values(at);
    } else {
        return false;
    }
    return true;
}

void Parser::attribute_values(const Where& at) {
    static const std::set<std::string> known = {"shape", "light", "material", "medium", "texture"};
    const std::string kind = tokens_->quoted("what attributes are for");
    if (!known.contains(kind)) fail(at, "there are no attributes for '" + kind + "'");
    std::vector<Parameter>& all = scene_.state.attributes[kind];
    for (Parameter& p : read_parameters(*tokens_, *budget_)) {
        std::erase_if(all, [&](const Parameter& q) { return q.name == p.name; });
        all.push_back(std::move(p));
    }
}

bool Parser::option(const std::string& name, const Where& at) {
    std::optional<Parameters>* kept = name == "Camera"        ? &options_.camera
                                      : name == "Film"        ? &options_.film
                                      : name == "PixelFilter" ? &options_.filter
                                      : name == "Sampler"     ? &options_.sampler
                                      : name == "Integrator"  ? &options_.integrator
                                                              : nullptr;
    if (kept) {
        need_world(name, at, false);
        *kept = parameters(name, at);
        if (name == "Camera") {
            options_.camera_to_world = invert(scene_.state.ctm, at);
            coordinate_systems_["camera"] = options_.camera_to_world;
        }
    } else if (name == "Accelerator") {
        parameters(name, at);  // how pbrt finds hits
    } else if (name == "Option") {
        static const std::set<std::string> changing = {"disablepixeljitter", "forcediffuse"};
        const Parameter p = read_option(*tokens_);
        if (changing.contains(p.name) && p.strings == std::vector<std::string>{"true"})
            scene_.report.refuse(at, "option '" + p.name + "' is not supported", "it is left out");
    } else if (name == "WorldBegin") {
        need_world(name, at, false);
        in_world_ = true;
        scene_.state.ctm = {};
        coordinate_systems_["world"] = {};
        add_options(scene_, options_);
    } else {
        return false;
    }
    return true;
}

bool Parser::material(const std::string& name, const Where& at) {
    if (name == "Material") {
        scene_.state.material = described(name, at, "material");
    } else if (name == "MakeNamedMaterial") {
        const std::string id = tokens_->quoted("the name of a material");
        if (scene_.named_materials.contains(id)) fail(at, "material '" + id + "' is defined twice");
        Parameters in{name, "", at, {}};
        read_list(in, "material");
        in.type = in.text("type", "");
        if (in.type.empty()) fail(at, "material '" + id + "' has no type");
        scene_.named_materials[id] = std::make_shared<Described>(Described{std::move(in), scene_.state.space});
    } else if (name == "NamedMaterial") {
        scene_.state.material = named_material(scene_, tokens_->quoted("the name of a material"), at);
    } else if (name == "Texture") {
        texture(at);
    } else if (name == "MakeNamedMedium") {
        tokens_->quoted("the name of a medium");
        read_parameters(*tokens_, *budget_);
        scene_.report.refuse(at, "media are not supported", "it is left out");
    } else if (name == "MediumInterface") {
        std::string inside = tokens_->quoted("a medium"), outside;
        if (tokens_->peek().kind == TokenKind::quoted) outside = tokens_->next().text;
        if (!inside.empty() || !outside.empty()) scene_.report.refuse(at, "media are not supported", "it is left out");
    } else {
        return false;
    }
    return true;
}

void Parser::texture(const Where& at) {
    const std::string id = tokens_->quoted("the name of a texture"), kind = tokens_->quoted("the kind of a texture");
    if (kind != "float" && kind != "spectrum")
        fail(at, "texture '" + id + "' is of kind '" + kind + "', neither float nor spectrum");
    scene_.textures.define(id, kind == "float", parameters("Texture", at, "texture"), scene_.state.space,
                           scene_.state.ctm);
}

bool Parser::world(const std::string& name, const Where& at) {
    if (name == "Shape") {
        need_world(name, at, true);
        add_shape_when_known(scene_, parameters(name, at, "shape"));
    } else if (name == "LightSource") {
        need_world(name, at, true);
        add_light(scene_, *described(name, at, "light"));
    } else if (name == "AreaLightSource") {
        need_world(name, at, true);
        scene_.state.area_light = described(name, at, "light");
    } else if (name == "ObjectBegin" || name == "ObjectEnd" || name == "ObjectInstance") {
        need_world(name, at, true);
        object(name, at);
    } else {
        return false;
    }
    return true;
}

void Parser::object(const std::string& name, const Where& at) {
    if (name == "ObjectEnd") {
        restore(true, at);
        scene_.open_object = nullptr;
        return;
    }
    const std::string id = tokens_->quoted("the name of an object");
    if (scene_.open_object) fail(at, name + " inside of an object is not possible");
    if (name == "ObjectBegin") {
        if (scene_.objects.contains(id)) fail(at, "object '" + id + "' is defined twice");
        save(true, at);
        scene_.objects[id] = scene_.open_object = &add_object(scene_.document, "shape", "shapegroup", at);
        return;
    }
    add_instance(scene_, *known_as(scene_.objects, id, at, "object"), at);
}

void Parser::include(const Where& at, bool import) {
    const std::string path = resolve(scene_.folder, tokens_->quoted("the name of a file"), at);
    const State state = scene_.state;
    const size_t depth = saved_.size();
    parse_file(path, at, depth_ + 1);
    if (saved_.size() != depth) fail(at, "'" + path + "' does not end what it begins, or ends more");
    if (import) scene_.state = state;
}

}  // namespace
}  // namespace pbrt

Scene load_pbrt(const std::string& path, const LoadOptions& options) {
    return load_by(path, options, [&](document::Document& document, Report& report) {
        pbrt::SceneMaker scene(document, report, std::filesystem::path(path).parent_path().string());
        pbrt::Parser parser(scene);
        parser.parse_file(path, {path, 0}, 1);
        parser.finish();
        pbrt::finish_curves(scene);
    });
}

}  // namespace ambilux
