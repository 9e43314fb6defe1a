// Scenes lit by hidden areas, which light what there is and which no ray meets.
#pragma once

#include <string>

#include "tests/support/small_room.h"

namespace ambilux {

/// What makes a shape a hidden light.
inline std::string hidden_light(const std::string& radiance) {
    return "<bsdf type='null'/><emitter type='hiddenarea'>" + radiance + "</emitter>";
}

/// A closed room with a dull mirror and a pane in it, under hidden lights: a textured rectangle, two spheres
/// in view, a cylinder, and, if `lamp`, an area emitter.
inline std::string hidden_room(uint32_t size, int max_depth, bool lamp) {
    std::string s = room_in_view(size);
    s += dull_ball();
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
    if (lamp) s += ceiling_lamp();
    return scene_xml(max_depth, s);
}

}  // namespace ambilux
