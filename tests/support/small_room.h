// A closed room, and what stands in it.
#pragma once

#include <string>

#include "tests/support/closed_forms.h"

namespace ambilux {

/// A sensor in a room of 3 x 4 x 2 with diffuse walls.
inline std::string room_in_view(uint32_t size) {
    return "<sensor type='perspective'><float name='fov' value='60'/><transform name='to_world'><lookat "
           "origin='0.3,-1.7,1' target='0,1,0.9' up='0,0,1'/></transform>" +
           square_film(size) +
           "</sensor><shape type='cube'><boolean name='flip_normals' value='true'/><transform name='to_world'><scale "
           "x='1.5' y='2' z='1'/><translate z='1'/></transform>" +
           diffuse({0.6f, 0.5f, 0.4f}) + "</shape>";
}
inline std::string dull_ball() {
    return "<shape type='sphere'><point name='center' x='0.7' y='0.6' z='0.4'/><float name='radius' value='0.3'/><bsdf "
           "type='roughconductor'><string name='material' value='none'/><float name='alpha' "
           "value='0.4'/></bsdf></shape>";
}
inline std::string ceiling_lamp() {
    return "<shape type='rectangle'><transform name='to_world'><scale value='0.2'/><rotate x='1' "
           "angle='180'/><translate x='-0.5' z='1.9'/></transform>" +
           diffuse({0, 0, 0}) + area_light({6, 6, 6}) + "</shape>";
}

}  // namespace ambilux
