// Names of properties and extensions: the library leaves out what it does not know.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "formats/document/plugins.h"
#include "formats/gltf/model.h"

namespace ambilux::gltf {

namespace {

/// The properties of each kind of object, glTF's or an extension's, behind a colon what kind they hold.
const std::map<std::string, std::string> kKinds = {
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

bool is_extension(const std::string& kind) { return kind.starts_with("KHR_") || kind.starts_with("EXT_"); }

/// The kind of what `key` of an object of that kind holds, or "": nothing that is looked into.
std::string kind_inside(Context& context, const std::string& kind, const std::string& key,
                        std::set<std::string>& extensions) {
    if (kind == "extensions") {
        extensions.insert(key);
        return is_extension(key) && kKinds.contains(key) ? key : "";
    }
    const auto known = kKinds.find(kind);
    if (known == kKinds.end() || key == "name" || key == "extras") return "";
    if (key == "extensions") return key;
    document::Plugins names;
    std::istringstream words(known->second);
    for (std::string word; words >> word; names.push_back(word.substr(0, word.find(':'))))
        if (word.starts_with(key + ":")) return word.substr(key.size() + 1);
    if (!document::is_one_of(names, key))
        context.note(fmt::format("property '{}' of {} is not known and left out{}", key,
                                 kind == "map" ? "a texture" : kind, document::nearly(names, key)));
    return "";
}

}  // namespace

void check_names(Context& context, std::string_view json) {
    const auto& model = context.model;
    std::set<std::string> extensions(model.extensionsUsed.begin(), model.extensionsUsed.end());
    extensions.insert(model.extensionsRequired.begin(), model.extensionsRequired.end());
    // Of the objects around a key, by depth: those in arrays lie one deeper.
    std::vector<std::string> kinds = {"", "glTF"};
    const auto look_at = [&](int depth, nlohmann::json::parse_event_t event, const nlohmann::json& parsed) {
        if (event != nlohmann::json::parse_event_t::key) return false;
        const size_t at = size_t(depth);
        kinds.resize(std::max(kinds.size(), at + 3));
        kinds[at + 1] = kinds[at + 2] = kind_inside(context, kinds[at], parsed.get<std::string>(), extensions);
        return false;  // nothing is kept
    };
    (void)nlohmann::json::parse(json.begin(), json.end(), look_at, false);
    document::Plugins known;
    for (const auto& [kind, names] : kKinds)
        if (is_extension(kind)) known.push_back(kind);
    for (const std::string& name : extensions)
        if (!document::is_one_of(known, name))
            context.leave_out(name, "extension '" + name + "'", document::nearly(known, name));
}

}  // namespace ambilux::gltf
