// libs: ambilux_formats ambilux_accel JPEG::JPEG
// timeout: 120
// Whole scenes in the manner of those who write them: a collection in format 0.5, an old one in 0.4, an exporter's in
// 3, and one with variables and fragments.
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n";

struct Folder : TempFolder {
    Folder() {
        write("m.obj", kTriangle);
        write("t.png", png_bytes(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 90, 90, 90}));
    }
};

}  // namespace

TEST_CASE("a collection in format 0.5") {
    const Folder folder;
    const Scene s = load_quietly(R"(
<integrator type="path"><integer name="maxDepth" value="65"/><boolean name="strictNormals" value="true"/></integrator>
<sensor type="perspective">
  <float name="fov" value="35"/>
  <transform name="toWorld"><matrix value="-1 0 0 0 0 1 0 1 0 0 -1 6.8 0 0 0 1"/></transform>
  <sampler type="sobol"><integer name="sampleCount" value="64"/></sampler>
  <film type="ldrfilm">
    <integer name="width" value="64"/><integer name="height" value="36"/><string name="fileFormat" value="png"/>
    <string name="pixelFormat" value="rgb"/><float name="gamma" value="2.2"/><boolean name="banner" value="false"/>
    <rfilter type="tent"/>
  </film>
</sensor>
<bsdf type="twosided" id="Wall"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">
  <string name="filename" value="t.png"/><string name="filterType" value="trilinear"/></texture></bsdf></bsdf>
<bsdf type="twosided" id="Steel"><bsdf type="roughconductor"><float name="alpha" value="0.1"/>
  <string name="distribution" value="ggx"/><rgb name="specularReflectance" value="0.9"/>
  <spectrum name="eta" value="1.65 0.88 0.52"/><spectrum name="k" value="9.2 6.2 4.8"/></bsdf></bsdf>
<bsdf type="thindielectric" id="Pane"><float name="intIOR" value="1.5"/><float name="extIOR" value="1"/></bsdf>
<bsdf type="mask" id="Leaf"><texture name="opacity" type="bitmap"><string name="filename" value="t.png"/></texture>
  <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf>
<bsdf type="bumpmap" id="Stone"><texture name="map" type="scale"><float name="scale" value="0.03"/>
  <texture type="bitmap"><string name="filename" value="t.png"/></texture></texture><bsdf type="plastic"/></bsdf>
<shape type="obj"><string name="filename" value="m.obj"/><transform name="toWorld"><matrix
  value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform><ref id="Wall"/></shape>
<shape type="rectangle"><ref id="Steel"/></shape><shape type="cube"><ref id="Pane"/></shape>
<shape type="obj"><string name="filename" value="m.obj"/><boolean name="faceNormals" value="true"/><ref id="Leaf"/></shape>
<shape type="obj"><string name="filename" value="m.obj"/><float name="maxSmoothAngle" value="30"/><ref id="Stone"/></shape>
<shape type="sphere"><float name="radius" value="0.5"/><point name="center" x="0" y="2" z="0"/>
  <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
  <emitter type="area"><rgb name="radiance" value="17, 12, 4"/></emitter></shape>
<emitter type="sunsky"><float name="turbidity" value="3"/><vector name="sunDirection" x="0.3" y="0.8" z="0.2"/>
  <float name="sunRadiusScale" value="2"/><float name="skyScale" value="10"/></emitter>)",
                                 "0.5.0", &folder);
    CHECK(s.integrator.max_depth == 65);
    CHECK(s.integrator.spp == 64);
    CHECK(s.shapes.size() == 6);
    CHECK(s.emitters.size() == 2);
    CHECK(s.features.bumps);
    CHECK(s.features.opacity);
    for (const BsdfRecord& b : s.bsdfs)
        if (b.bump_map >= 0) CHECK(b.bump_scale == Approx(0.03));
}

TEST_CASE("an old scene in format 0.4") {
    const Folder folder;
    const Scene s = load_quietly(R"(
<integrator type="volpath_simple"><integer name="maxDepth" value="-1"/><integer name="rrDepth" value="10"/></integrator>
<sensor type="thinlens">
  <string name="focalLength" value="50mm"/><string name="fovAxis" value="smaller"/>
  <float name="apertureRadius" value="0.01"/><float name="focusDistance" value="3"/>
  <transform name="toWorld"><scale x="-1"/><lookAt origin="0, -4, 1" target="0, 0, 0" up="0, 0, 1"/></transform>
  <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/>
    <integer name="cropOffsetX" value="8"/><integer name="cropWidth" value="16"/><boolean name="highQualityEdges"
    value="true"/><rfilter type="mitchell"><float name="B" value="0.33"/><float name="C" value="0.33"/></rfilter></film>
  <sampler type="ldsampler"><integer name="sampleCount" value="16"/></sampler>
</sensor>
<bsdf type="mixturebsdf" id="mix"><string name="weights" value="0.3, 0.7"/><bsdf type="phong"><float name="exponent"
  value="80"/></bsdf><bsdf type="ward"><string name="variant" value="ward-duer"/><float name="alphaU" value="0.2"/>
  <float name="alphaV" value="0.05"/></bsdf></bsdf>
<texture type="checkerboard" id="check"><rgb name="color0" value="#ff8000"/><srgb name="color1" value="0.2 0.2 0.2"/>
  <float name="uscale" value="10"/><float name="vscale" value="10"/></texture>
<shape type="shapegroup" id="group"><shape type="obj"><string name="filename" value="m.obj"/><ref id="mix"/></shape></shape>
<shape type="instance"><ref id="group"/><transform name="toWorld"><translate z="1"/></transform></shape>
<shape type="instance"><ref id="group"/><transform name="toWorld"><rotate z="1" angle="90"/></transform></shape>
<shape type="rectangle"><bsdf type="diffuse"><ref name="reflectance" id="check"/></bsdf></shape>
<shape type="disk"><bsdf type="difftrans"><rgb name="transmittance" value="0.4"/></bsdf></shape>
<emitter type="directional"><vector name="direction" x="0" y="0" z="-1"/><blackbody name="irradiance"
  temperature="5500K" scale="1e-4"/></emitter>)",
                                 "0.4.0", &folder);
    CHECK(s.integrator.type == "path");
    CHECK(s.sensor.crop_width == 16);
    CHECK(s.shapes.size() == 4);
    CHECK(s.features.blends);
}

TEST_CASE("what an exporter writes in format 3") {
    const Folder folder;
    const Scene s = load_quietly(R"(
<default name="spp" value="32"/><default name="resx" value="64"/><default name="resy" value="48"/>
<integrator type="path"><integer name="max_depth" value="17"/></integrator>
<sensor type="perspective" id="Camera">
  <string name="fov_axis" value="x"/><float name="fov" value="39.6"/><float name="principal_point_offset_x" value="0"/>
  <float name="near_clip" value="0.1"/><float name="far_clip" value="100"/>
  <transform name="to_world"><rotate x="1" angle="90"/><rotate value="0 0 1" angle="30"/><translate value="7 -6 5"/>
  </transform>
  <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
  <film type="hdrfilm"><integer name="width" value="$resx"/><integer name="height" value="$resy"/>
    <string name="file_format" value="openexr"/><string name="pixel_format" value="rgba"/>
    <string name="component_format" value="float16"/></film>
</sensor>
<sensor type="perspective" id="Camera.001"/>
<bsdf type="twosided" id="mat-Material"><bsdf type="principled"><rgb name="base_color" value="0.8 0.7 0.1"/>
  <float name="roughness" value="0"/><float name="specular" value="0.5"/><float name="spec_tint" value="0"/>
  <float name="spec_trans" value="0"/><float name="metallic" value="0"/><float name="anisotropic" value="0"/>
  <float name="sheen" value="0"/><float name="sheen_tint" value="0.5"/><float name="clearcoat" value="0.2"/>
  <float name="clearcoat_gloss" value="0.97"/></bsdf></bsdf>
<bsdf type="principled" id="mat-Glass"><float name="spec_trans" value="1"/><float name="eta" value="1.45"/>
  <float name="roughness" value="0.1"/></bsdf>
<bsdf type="normalmap" id="mat-Bump"><texture type="bitmap" name="normalmap"><string name="filename" value="t.png"/>
  <boolean name="raw" value="true"/></texture><bsdf type="roughplastic"><texture type="bitmap" name="diffuse_reflectance">
  <string name="filename" value="t.png"/><transform name="to_uv"><scale x="2" y="-2"/></transform></texture></bsdf></bsdf>
<shape type="obj"><string name="filename" value="m.obj"/><ref id="mat-Material" name="bsdf"/></shape>
<shape type="obj"><string name="filename" value="m.obj"/><ref id="mat-Glass" name="bsdf"/></shape>
<shape type="obj"><string name="filename" value="m.obj"/><boolean name="face_normals" value="true"/>
  <ref id="mat-Bump" name="bsdf"/></shape>
<shape type="merge"><shape type="cube"><ref id="mat-Material"/></shape></shape>
<emitter type="point"><transform name="to_world"><translate value="4 1 6"/></transform><rgb name="intensity"
  value="79 79 79"/></emitter>
<emitter type="envmap"><string name="filename" value="t.png"/><float name="scale" value="0.5"/><transform
  name="to_world"><rotate x="1" angle="90"/></transform></emitter>)",
                                 "3.0.0", &folder);
    CHECK(s.integrator.spp == 32);
    CHECK(s.sensor.film_width == 64);
    CHECK(s.shapes.size() == 4);
    CHECK(has_note(s, "the first of several sensors"));
}
