// Light subpaths of very different lengths.
#pragma once

#include "tests/support/render_scene.h"

namespace ambilux {

/// One light subpath of fifty is caught in a box and has as many vertices as it may: waves of some hundred subpaths
/// with far more vertices than the mean are not rare.
inline Scene scene_of_caught_subpaths(uint32_t height = 128) {
    return scene_from_text(R"(<scene version="3.0.0">
        <sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
        <lookat origin="0,3,9" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="128"/><integer name="height" value=")" +
                           std::to_string(height) + R"("/></film></sensor>
        <emitter type="point"><point name="position" x="0" y="-5" z="0"/><rgb name="intensity" value="1"/></emitter>
        <emitter type="point"><point name="position" x="0" y="2" z="0"/><rgb name="intensity" value="49"/></emitter>
        <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
        </shape>
        <shape type="cube"><transform name="to_world"><translate y="-5"/></transform><bsdf type="twosided">
        <bsdf type="diffuse"><rgb name="reflectance" value="0.99"/></bsdf></bsdf></shape></scene>)");
}

}  // namespace ambilux
