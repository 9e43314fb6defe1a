// Scenes lit by emitters that light subpaths alone carry: collimated and directionalarea.
#pragma once

#include <string>

#include "tests/support/small_room.h"

namespace ambilux {

inline std::string orthographic(double half_size, const std::string& origin, const std::string& target, uint32_t size) {
    return "<sensor type='orthographic'><transform name='to_world'><scale value='" + std::to_string(half_size) +
           "'/><lookat origin='" + origin + "' target='" + target + "' up='0,0,1'/></transform>" + square_film(size) +
           "</sensor>";
}

/// A beam along `towards`, in the direction of decreasing z.
inline std::string collimated(const std::string& origin, const std::string& target, Rgb power) {
    return "<emitter type='collimated'><transform name='to_world'><lookat origin='" + origin + "' target='" + target +
           "' up='1,0,0'/></transform>" + rgb("power", power) + "</emitter>";
}
inline std::string directional_area(Rgb radiance) {
    return "<emitter type='directionalarea'>" + rgb("radiance", radiance) + "</emitter>";
}

/// A closed room with a sheet and a dull mirror in it, under a beam, two lamps that shine along their normals and, if
/// `lamp`, an area emitter.
inline std::string beam_room(uint32_t size, int max_depth, bool lamp) {
    const std::string turned =
        "<transform name='to_world'><rotate x='1' angle='60'/><rotate z='1' angle='25'/>"
        "<scale value='0.5'/><translate x='-0.3' y='0.2' z='0.6'/></transform>";
    std::string s = room_in_view(size);
    s += "<shape type='rectangle'>" + turned +
         "<bsdf type='principledthin'><rgb name='base_color' value='0.8,0.5,0.3'/><float name='roughness' "
         "value='0.6'/><float name='spec_trans' value='0.5'/><float name='diff_trans' value='0.8'/></bsdf></shape>";
    s += dull_ball();
    s += collimated("0.5,0.5,1.9", "-0.3,0.2,0.6", {4, 3, 2});
    s += "<shape type='disk'><transform name='to_world'><scale value='0.3'/><rotate x='1' angle='180'/><translate "
         "x='0.7' y='0.5' z='1.8'/></transform>" +
         diffuse({0, 0, 0}) + directional_area({9, 9, 12}) + "</shape>";
    // Its normals point everywhere.
    s += "<shape type='sphere'><point name='center' x='-0.8' y='0.9' z='1.4'/><float name='radius' value='0.1'/>" +
         diffuse({0.5f, 0.5f, 0.5f}) + directional_area({20, 15, 10}) + "</shape>";
    if (lamp) s += ceiling_lamp();
    return scene_xml(max_depth, s);
}

}  // namespace ambilux
