#include "formats/pbrt/names.h"

#include <map>
#include <sstream>

#include "formats/document/plugins.h"

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
    {"shape", "sphere disk cylinder trianglemesh plymesh bilinearmesh loopsubdiv curve"},
    {"material",
     "interface diffuse coateddiffuse conductor coatedconductor dielectric thindielectric diffusetransmission mix"},
    {"light", "point spot distant infinite projection goniometric"},
    {"texture type", "constant scale mix directionmix bilerp imagemap checkerboard dots fbm wrinkled windy marble"}};

}  // namespace

std::string quoted(const std::string& kind, const std::string& name) {
    document::Plugins known;
    std::istringstream words(kNames.at(kind));
    for (std::string word; words >> word;) known.push_back(word);
    const std::string near = document::nearest_name(known, name);
    return kind + " '" + name + "'" + (near.empty() || near == name ? "" : " (" + near + "?)");
}

}  // namespace ambilux::pbrt
