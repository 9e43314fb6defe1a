// Scenes lit by hidden areas, which light what there is and which no ray meets.
#pragma once

#include <string>

#include "tests/support/closed_forms.h"

namespace ambilux {

/// What makes a shape a hidden light.
inline std::string hidden_light(const std::string& radiance) {
    return "<bsdf type='null'/><emitter type='hiddenarea'>" + radiance + "</emitter>";
}

/// A closed room with a dull mirror and a pane in it, under hidden lights: a textured rectangle, two spheres
/// in view, a cylinder, and, if `lamp`, an area emitter.
inline std::string hidden_room(uint32_t size, int max_depth, bool lamp) {
    std::string s =
        "<sensor type='perspective'><float name='fov' value='60'/><transform name='to_world'><lookat "
        "origin='0.3,-1.7,1' target='0,1,0.9' up='0,0,1'/></transform>" +
        square_film(size) + "</sensor>";
    s += "<shape type='cube'><boolean name='flip_normals' value='true'/><transform name='to_world'><scale x='1.5' "
         "y='2' z='1'/><translate z='1'/></transform>" +
         diffuse({0.6f, 0.5f, 0.4f}) + "</shape>";
    s += "<shape type='sphere'><point name='center' x='0.7' y='0.6' z='0.4'/><float name='radius' value='0.3'/><bsdf "
         "type='roughconductor'><string name='material' value='none'/><float name='alpha' "
         "value='0.4'/></bsdf></shape>";
    s += "<shape type='rectangle'><transform name='to_world'><scale value='0.4'/><rotate x='1' angle='80'/><translate "
         "x='-0.5' y='0.3' z='0.5'/></transform>" +
         diffuse({0.5f, 0.5f, 0.5f}) + "</shape>";
    s += "<shape type='rectangle'><transform name='to_world'><scale value='0.5'/><rotate x='1' angle='180'/><translate "
         "x='0.3' y='0.5' z='1.6'/></transform>" +
         hidden_light(
             "<texture name='radiance' type='checkerboard'><rgb name='color0' value='0.1,0.5,1'/><rgb "
             "name='color1' value='1,0.7,0.3'/></texture>") +
         "</shape>";
    for (const char* x : {"-0.8", "0.2"})
        s += std::string("<shape type='sphere'><point name='center' x='") + x +
             "' y='0.9' z='1'/><float name='radius' value='0.15'/>" + hidden_light(rgb("radiance", {6, 5, 4})) +
             "</shape>";
    s += "<shape type='cylinder'><point name='p0' x='-1' y='-0.5' z='0.3'/><point name='p1' x='-1' y='0.5' "
         "z='0.5'/><float name='radius' value='0.1'/>" +
         hidden_light(rgb("radiance", {2, 3, 5})) + "</shape>";
    if (lamp)
        s += "<shape type='rectangle'><transform name='to_world'><scale value='0.2'/><rotate x='1' "
             "angle='180'/><translate x='-0.5' z='1.9'/></transform>" +
             diffuse({0, 0, 0}) + area_light({6, 6, 6}) + "</shape>";
    return scene_xml(max_depth, s);
}

}  // namespace ambilux
