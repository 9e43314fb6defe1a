// Names of properties and extensions: the library leaves out what it does not know.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "formats/document/plugins.h"
#include "formats/gltf/model.h"

namespace ambilux::gltf {

namespace {

/// The properties of each kind of object, glTF's or an extension's, behind a colon what kind they hold.
const std::map<std::string, std::string> kNames = {
    {"glTF",
     "asset:asset accessors:accessor animations: buffers:buffer bufferViews:bufferView cameras:camera images:image "
     "materials:material meshes:mesh nodes:node samplers:sampler scene scenes:scene skins:skin textures:texture "
     "extensionsUsed extensionsRequired"},
    {"asset", "copyright generator version minVersion"},
    {"accessor", "bufferView byteOffset componentType normalized count type max min sparse:sparse"},
    {"sparse", "count indices:sparse values:sparse bufferView byteOffset componentType"},
    {"buffer", "uri byteLength"},
    {"bufferView", "buffer byteOffset byteLength byteStride target"},
    {"camera", "type perspective:perspective orthographic:orthographic"},
    {"perspective", "aspectRatio yfov zfar znear"},
    {"orthographic", "xmag ymag zfar znear"},
    {"image", "uri mimeType bufferView"},
    {"material",
     "pbrMetallicRoughness:pbrMetallicRoughness normalTexture:map occlusionTexture:map emissiveTexture:map "
     "emissiveFactor alphaMode alphaCutoff doubleSided"},
    {"pbrMetallicRoughness",
     "baseColorFactor baseColorTexture:map metallicFactor roughnessFactor metallicRoughnessTexture:map"},
    {"map", "index texCoord scale strength"},
    {"mesh", "primitives:primitive weights"},
    {"primitive", "attributes: indices material mode targets:"},
    {"node", "camera children skin matrix mesh rotation scale translation weights"},
    {"sampler", "magFilter minFilter wrapS wrapT"},
    {"scene", "nodes"},
    {"skin", "inverseBindMatrices skeleton joints"},
    {"texture", "sampler source"},
    {"light", "type color intensity range spot:spot"},
    {"spot", "innerConeAngle outerConeAngle"},
    {"EXT_mesh_gpu_instancing", "attributes:"},
    {"EXT_meshopt_compression", "buffer byteOffset byteLength byteStride count mode filter fallback"},
    {"KHR_lights_punctual", "lights:light light"},
    {"KHR_materials_anisotropy", "anisotropyStrength anisotropyRotation anisotropyTexture:map"},
    {"KHR_materials_clearcoat",
     "clearcoatFactor clearcoatTexture:map clearcoatRoughnessFactor clearcoatRoughnessTexture:map "
     "clearcoatNormalTexture:map"},
    {"KHR_materials_diffuse_transmission",
     "diffuseTransmissionFactor diffuseTransmissionTexture:map diffuseTransmissionColorFactor "
     "diffuseTransmissionColorTexture:map"},
    {"KHR_materials_emissive_strength", "emissiveStrength"},
    {"KHR_materials_ior", "ior"},
    {"KHR_materials_pbrSpecularGlossiness",
     "diffuseFactor diffuseTexture:map specularFactor glossinessFactor specularGlossinessTexture:map"},
    {"KHR_materials_sheen", "sheenColorFactor sheenColorTexture:map sheenRoughnessFactor sheenRoughnessTexture:map"},
    {"KHR_materials_specular", "specularFactor specularTexture:map specularColorFactor specularColorTexture:map"},
    {"KHR_materials_transmission", "transmissionFactor transmissionTexture:map"},
    {"KHR_materials_unlit", ""},
    {"KHR_materials_volume", "thicknessFactor thicknessTexture:map attenuationDistance attenuationColor"},
    {"KHR_mesh_quantization", ""},
    {"KHR_node_visibility", "visible"},
    {"KHR_texture_transform", "offset rotation scale texCoord"}};

/// Properties of kNames whose values are texts or lists of them.
const document::Plugins kTexts = {"copyright", "generator", "version",        "minVersion",
                                  "type",      "uri",       "mimeType",       "alphaMode",
                                  "mode",      "filter",    "extensionsUsed", "extensionsRequired"};

bool is_extension(std::string_view kind) { return kind.starts_with("KHR_") || kind.starts_with("EXT_"); }

struct Kind {
    std::string name;
    std::vector<std::pair<std::string, const Kind*>> properties;  ///< and what they hold; null: it is not looked into
};
const Kind kExtensions = {"extensions", {}};

/// Null for names of no kind.
const Kind* kind_named(const std::string& name) {
    static const std::map<std::string, Kind> kinds = [] {
        std::map<std::string, Kind> all;
        for (const auto& [kind, list] : kNames) all[kind].name = kind;
        for (const auto& [kind, list] : kNames) {
            std::istringstream words(list);
            for (std::string word; words >> word;) {
                const auto inside = all.find(word.substr(std::min(word.find(':'), word.size() - 1) + 1));
                all[kind].properties.emplace_back(word.substr(0, word.find(':')),
                                                  inside == all.end() ? nullptr : &inside->second);
            }
        }
        return all;
    }();
    const auto known = kinds.find(name);
    return known == kinds.end() ? nullptr : &known->second;
}

/// Looks at the keys of JSON that the library has found to be sound: a look at every character takes a twentieth of
/// loading, a second parse a half of it.
struct NameReader {
    Context& context;
    std::set<std::string>& extensions;
    std::vector<const Kind*> around = {};   ///< of the objects and arrays around a value
    const Kind* next = kind_named("glTF");  ///< of the next value

    void read(std::string_view json) {
        for (size_t at = 0; at < json.size(); ++at) {
            const char c = json[at];
            if (c == '"') {
                at = read_string(json, at);
            } else if (c == '{' || c == '[') {
                around.push_back(next);
            } else if ((c == '}' || c == ']') && !around.empty()) {
                next = around.back();  // of one more in an array
                around.pop_back();
            }
        }
    }

private:
    /// The place of the mark at its end.
    size_t read_string(std::string_view json, size_t begin) {
        size_t end = begin + 1;
        bool escapes = false;
        for (; end < json.size() && json[end] != '"'; ++end)
            if (json[end] == '\\') escapes = true, ++end;
        const size_t behind = json.find_first_not_of(" \t\r\n", end + 1);
        if (behind == std::string_view::npos || json[behind] != ':' || around.empty()) return end;
        std::string key(json.substr(begin + 1, end - begin - 1));
        if (escapes)
            if (const auto plain = nlohmann::json::parse('"' + key + '"', nullptr, false); plain.is_string())
                key = plain;
        const Kind* of = around.back();
        next = kind_inside(of, key);
        const size_t value = json.find_first_not_of(" \t\r\n[", behind + 1);
        if (of && of != &kExtensions && value != std::string_view::npos && json[value] == '"' && has(*of, key) &&
            !document::is_one_of(kTexts, key))
            context.fail(
                fmt::format("property '{}' of {} is a text, which glTF does not allow there", key, called(*of)));
        return end;
    }

    static std::string called(const Kind& kind) { return kind.name == "map" ? "a texture" : kind.name; }
    static bool has(const Kind& kind, const std::string& key) {
        return std::any_of(kind.properties.begin(), kind.properties.end(),
                           [&](const auto& p) { return p.first == key; });
    }

    const Kind* kind_inside(const Kind* of, const std::string& key) {
        if (!of) return nullptr;
        if (of == &kExtensions) {
            extensions.insert(key);
            return is_extension(key) ? kind_named(key) : nullptr;
        }
        for (const auto& [name, inside] : of->properties)
            if (name == key) return inside;
        if (key == "name" || key == "extras") return nullptr;
        if (key == "extensions") return &kExtensions;
        document::Plugins names;
        for (const auto& property : of->properties) names.push_back(property.first);
        context.note(
            fmt::format("property '{}' of {} is not known and left out{}", key, called(*of), suggestion(names, key)));
        return nullptr;
    }
};

}  // namespace

void check_names(Context& context, std::string_view json) {
    const auto& model = context.model;
    std::set<std::string> extensions(model.extensionsUsed.begin(), model.extensionsUsed.end());
    extensions.insert(model.extensionsRequired.begin(), model.extensionsRequired.end());
    NameReader{context, extensions}.read(json);
    document::Plugins known;
    for (const auto& [kind, names] : kNames)
        if (is_extension(kind)) known.push_back(kind);
    for (const std::string& name : extensions)
        if (!document::is_one_of(known, name))
            context.leave_out(name, "extension '" + name + "'", suggestion(known, name));
}

}  // namespace ambilux::gltf
