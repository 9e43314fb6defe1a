#include "formats/pbrt/names.h"

#include <sstream>

namespace ambilux::pbrt {
namespace {

const std::map<std::string, std::string> kNames = {
    {"directive",
     "Accelerator ActiveTransform AreaLightSource Attribute AttributeBegin AttributeEnd Camera ColorSpace "
     "ConcatTransform CoordSysTransform CoordinateSystem Film Identity Import Include Integrator LightSource LookAt "
     "MakeNamedMaterial MakeNamedMedium Material MediumInterface NamedMaterial ObjectBegin ObjectEnd ObjectInstance "
     "Option PixelFilter ReverseOrientation Rotate Sampler Scale Shape Texture Transform TransformBegin TransformEnd "
     "TransformTimes Translate WorldBegin"},
    {"camera", "perspective orthographic spherical"},
    {"filter", "box gaussian mitchell sinc triangle"},
    {"film", "rgb gbuffer spectral"},
    {"integrator", "path volpath simplepath simplevolpath bdpt lightpath mlt sppm randomwalk"},
    {"sampler", "halton independent paddedsobol pmj02bn sobol stratified zsobol"},
    {"shape", "sphere disk cylinder trianglemesh plymesh bilinearmesh loopsubdiv curve"},
    {"material",
     "interface diffuse coateddiffuse conductor coatedconductor dielectric thindielectric diffusetransmission mix"},
    {"light", "point spot distant infinite projection goniometric"},
    {"texture type", "constant scale mix directionmix bilerp imagemap checkerboard dots fbm wrinkled windy marble"}};

document::Plugins all_of(const std::string& kind) {
    document::Plugins known;
    std::istringstream words(kNames.at(kind));
    for (std::string word; words >> word;) known.push_back(word);
    return known;
}

}  // namespace

bool is_known(const std::string& kind, const std::string& name) { return document::is_one_of(all_of(kind), name); }

std::string nearly_known(const std::string& kind, const std::string& name) {
    return is_known(kind, name) ? "" : suggestion(all_of(kind), name);
}

std::string not_supported(const std::string& kind, const std::string& name) {
    return kind + " '" + name + "' is not supported" + nearly_known(kind, name);
}

}  // namespace ambilux::pbrt
