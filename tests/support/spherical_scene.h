// Scenes seen by a camera of all directions.
#pragma once

#include <string>

#include "tests/support/small_room.h"

namespace ambilux {

/// A camera of all directions in the room of small_room.h; `crop`: elements of the film.
inline std::string spherical_camera(uint32_t width, uint32_t height, const std::string& filter,
                                    const std::string& crop = "") {
    return "<sensor type='spherical'><transform name='to_world'><lookat origin='0.3,-0.4,0.8' target='0.1,1,1.1' "
           "up='0.2,0,1'/></transform><film type='hdrfilm'><integer name='width' value='" +
           std::to_string(width) + "'/><integer name='height' value='" + std::to_string(height) + "'/>" + crop +
           "<rfilter type='" + filter + "'/></film></sensor>";
}

/// That room under a lamp, with a dull mirror.
inline std::string room_around(const std::string& camera, int max_depth) {
    const std::string room = room_in_view(8);
    return scene_xml(max_depth, camera + room.substr(room.find("<shape")) + dull_ball() + ceiling_lamp());
}

}  // namespace ambilux
