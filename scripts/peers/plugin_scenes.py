"""Small scenes of format 3, one for each plugin, that Mitsuba 3 and this program both read; and the files that they name."""

import math
import struct
import zlib

# The ground, a light above and a dim surrounding: what scenes have unless they say otherwise. +z is up.
GROUND = """<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.45, 0.4"/></bsdf></shape>"""
LIGHT = """<shape type="rectangle"><transform name="to_world"><scale value="1.3"/><rotate x="1" angle="180"/><translate z="4"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"><rgb name="radiance" value="6, 5, 4"/></emitter></shape>"""
DIM = '<emitter type="constant"><rgb name="radiance" value="0.3, 0.35, 0.4"/></emitter>'
VIEW = '<transform name="to_world"><lookat origin="0.5, -6, 2.6" target="0, 0, 0.8" up="0, 0, 1"/></transform>'
GREY = '<bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>'
BOX = '<rfilter type="box"/>'
SIZE = 64


def scene(body, sensor="perspective", inside="", film="", rfilter=BOX, integrator="path", depth=5, view=VIEW):
    fov = "" if sensor == "orthographic" else '<float name="fov" value="34"/>'
    return f"""<scene version="3.0.0">
<integrator type="{integrator}">{f'<integer name="max_depth" value="{depth}"/>' if depth else ""}</integrator>
<sensor type="{sensor}">{fov}{view}{inside}
<film type="hdrfilm"><integer name="width" value="{SIZE}"/><integer name="height" value="{SIZE}"/>
<string name="component_format" value="float32"/><string name="pixel_format" value="rgb"/>{film}{rfilter}</film>
<sampler type="independent"/></sensor>
{body}
</scene>
"""


def sphere(bsdf, around=GROUND + LIGHT + DIM):
    return scene(f'<shape type="sphere"><point name="center" x="0" y="0" z="1"/>{bsdf}</shape>' + around)


def panel(bsdf, around=GROUND + LIGHT + DIM):
    """An upright square with coordinates from 0 to 1."""
    return scene(f"""<shape type="rectangle"><transform name="to_world"><scale value="1.1"/><rotate x="1" angle="70"/>
<translate z="1.2"/></transform>{bsdf}</shape>""" + around)


def shape(text, around=GROUND + LIGHT + DIM):
    return scene(text + around)


def lit(emitter, body=None):
    ball = f'<shape type="sphere"><point name="center" x="0" y="0" z="1"/>{GREY}</shape>'
    return scene((body or ball) + GROUND + emitter)


def bsdf(name, text=""):
    return f'<bsdf type="{name}">{text}</bsdf>'


def number(name, value):
    return f'<float name="{name}" value="{value}"/>'


def rgb(name, value):
    return f'<rgb name="{name}" value="{value}"/>'


def string(name, value):
    return f'<string name="{name}" value="{value}"/>'


def yes(name, value="true"):
    return f'<boolean name="{name}" value="{value}"/>'


def bitmap(name, file="tiles.png", more=""):
    return f'<texture type="bitmap" name="{name}">{string("filename", file)}{more}</texture>'


def checker(name, more=""):
    return f"""<texture type="checkerboard" name="{name}">{rgb("color0", "0.8, 0.7, 0.2")}{rgb("color1", "0.1, 0.2, 0.3")}{more}
<transform name="to_uv"><scale x="4" y="3"/></transform></texture>"""


def numbers_checker(name, a, b):
    return f"""<texture type="checkerboard" name="{name}">{rgb("color0", a)}{rgb("color1", b)}
<transform name="to_uv"><scale x="3" y="3"/></transform></texture>"""


def file(kind, name, more="", lift=1.0):
    return f'<shape type="{kind}">{string("filename", name)}{more}<transform name="to_world"><translate z="{lift}"/></transform>'


GGX = string("distribution", "ggx")
DIFFUSE_TILES = bsdf("diffuse", bitmap("reflectance"))
SUN = '<vector name="sun_direction" x="0.4" y="-0.5" z="0.7"/>'
# A metal that both know by numbers.
METAL = rgb("eta", "0.2, 0.92, 1.1") + rgb("k", "3.9, 2.45, 2.14")
BUMPY = number("scale", 0.2) + bsdf("roughplastic", number("alpha", 0.2))


def plain_bsdfs():
    """BSDFs that hold no other."""
    s = {}
    s["diffuse"] = sphere(bsdf("diffuse", rgb("reflectance", "0.8, 0.3, 0.1")))
    s["conductor"] = sphere(bsdf("conductor", METAL))
    s["conductor material"] = sphere(bsdf("conductor", string("material", "none")))
    s["roughconductor ggx"] = sphere(bsdf("roughconductor", GGX + METAL + number("alpha", 0.3)))
    s["roughconductor beckmann"] = sphere(bsdf("roughconductor", METAL + number("alpha_u", 0.1) + number("alpha_v", 0.4)))
    s["dielectric"] = sphere(bsdf("dielectric", string("int_ior", "bk7")))
    s["thindielectric"] = panel(bsdf("thindielectric", number("int_ior", 1.8)))
    s["roughdielectric"] = sphere(bsdf("roughdielectric", GGX + number("alpha", 0.3) + number("int_ior", 1.5)))
    s["plastic"] = sphere(bsdf("plastic", rgb("diffuse_reflectance", "0.8, 0.3, 0.1") + yes("nonlinear")))
    s["roughplastic"] = sphere(bsdf("roughplastic", rgb("diffuse_reflectance", "0.8, 0.3, 0.1") + number("alpha", 0.2)))
    s["roughplastic nonlinear"] = sphere(bsdf("roughplastic", rgb("diffuse_reflectance", "0.8, 0.3, 0.1") + yes("nonlinear") + GGX))
    base = rgb("base_color", "0.8, 0.4, 0.1")
    s["principled"] = sphere(bsdf("principled", base + number("roughness", 0.3) + number("metallic", 0.3)))
    s["principled all lobes"] = sphere(bsdf("principled", base + "".join(number(k, v) for k, v in {
        "roughness": 0.4, "metallic": 0.2, "anisotropic": 0.6, "spec_tint": 0.5, "sheen": 0.7, "sheen_tint": 0.4, "flatness": 0.4,
        "clearcoat": 0.8, "clearcoat_gloss": 0.3, "specular": 0.6}.items())))
    s["principled glass"] = sphere(bsdf("principled", base + number("roughness", 0.5) + number("spec_trans", 0.6) + number("eta", 1.4)))
    s["principled textures"] = panel(bsdf("principled", bitmap("base_color") + numbers_checker("roughness", 0.2, 0.7)))
    # Smooth, or Mitsuba loses light that passes at grazing angles.
    s["principledthin"] = panel(bsdf("principledthin", base + number("roughness", 0.25) + number("spec_trans", 0.5) + number("diff_trans", 0.8)))
    s["principledthin all lobes"] = panel(bsdf("principledthin", base + "".join(number(k, v) for k, v in {
        "roughness": 0.3, "spec_trans": 0.4, "diff_trans": 1.2, "eta": 1.3, "anisotropic": 0.6, "spec_tint": 0.5, "sheen": 0.7,
        "sheen_tint": 0.4, "flatness": 0.4}.items())))
    s["principledthin textures"] = panel(bsdf("principledthin", bitmap("base_color") + bitmap("spec_trans", "heights.png", yes("raw"))
                                              + number("roughness", 0.25) + number("diff_trans", 1.5)))
    return s


def nested_bsdfs():
    """BSDFs inside of BSDFs, masks and maps."""
    s = {}
    two = bsdf("diffuse", rgb("reflectance", "0.8, 0.1, 0.1")) + bsdf("roughconductor", METAL + number("alpha", 0.2))
    s["blendbsdf"] = sphere(bsdf("blendbsdf", number("weight", 0.3) + two))
    s["blendbsdf texture"] = panel(bsdf("blendbsdf", bitmap("weight", "heights.png", yes("raw")) + two))
    masked = bsdf("mask", number("opacity", 0.4) + bsdf("diffuse", rgb("reflectance", "0.8, 0.1, 0.1")))
    # Deep, because Mitsuba counts what paths pass through.
    def deep(text):
        return text.replace('name="max_depth" value="5"', 'name="max_depth" value="40"')

    s["blendbsdf mask"] = deep(sphere(bsdf("blendbsdf", number("weight", 0.3) + masked + GREY)))
    s["blendbsdf masks texture"] = deep(panel(
        bsdf("blendbsdf", bitmap("weight", "heights.png", yes("raw")) + masked + bsdf("mask", numbers_checker("opacity", 0.9, 0.1) + GREY))))
    s["blendbsdf null"] = deep(sphere(bsdf("mask", number("opacity", 0.8) + bsdf("blendbsdf", number("weight", 0.3) + bsdf("null") + GREY))))
    s["mask mask"] = panel(bsdf("mask", number("opacity", 0.7) + bsdf("mask", numbers_checker("opacity", 0.9, 0.1) + bsdf("twosided", GREY))))
    sides = bsdf("blendbsdf", number("weight", 0.3) + two) + bsdf("blendbsdf", number("weight", 0.6) + GREY + bsdf("diffuse", rgb("reflectance", "0.1, 0.2, 0.8")))
    turned = '<transform name="to_world"><rotate x="1" angle="60"/><rotate z="1" angle="50"/><translate z="1.2"/></transform>'
    for side in ("", yes("flip_normals")):
        name = "twosided blends" + (" turned" if side else "")
        s[name] = shape('<shape type="rectangle">' + turned + side + bsdf("twosided", sides) + "</shape>")
    s["principled glass textures"] = panel(
        bsdf("principled", bitmap("base_color") + bitmap("metallic", "heights.png", yes("raw")) + number("roughness", 0.4) + number("spec_trans", 0.6)))
    s["mask number"] = panel(bsdf("mask", number("opacity", 0.4) + GREY))
    s["mask bitmap"] = panel(bsdf("mask", bitmap("opacity", "heights.png", yes("raw")) + GREY))
    s["mask checkerboard"] = panel(bsdf("mask", numbers_checker("opacity", 0.9, 0.1) + bsdf("twosided", GREY)))
    s["twosided two"] = scene(f"""<shape type="cylinder"><point name="p0" x="0" y="-1" z="1"/><point name="p1" x="0" y="1" z="1"/>
{bsdf("twosided", two)}</shape>""" + GROUND + LIGHT + DIM)
    # Shadow rays of Mitsuba's path tracer stop at null, those of volpath do not.
    s["null"] = scene(f'<shape type="cube"><transform name="to_world"><translate z="1.1"/></transform>{bsdf("null")}</shape>' + GROUND + LIGHT + DIM, integrator="volpath")
    s["bumpmap"] = panel(bsdf("bumpmap", bitmap("arbitrary", "heights.png", yes("raw")) + BUMPY))
    s["bumpmap plain"] = panel(bsdf("bumpmap", bitmap("arbitrary", "heights.png", yes("raw")) + yes("flip_invalid_normals", "false")
                                    + yes("use_shadowing_function", "false") + BUMPY))
    s["normalmap"] = panel(bsdf("normalmap", bitmap("normalmap", "normals.png", yes("raw")) + bsdf("roughplastic", number("alpha", 0.2))))
    s["normalmap plain"] = panel(bsdf("normalmap", bitmap("normalmap", "normals.png", yes("raw")) + yes("flip_invalid_normals", "false")
                                      + yes("use_shadowing_function", "false") + bsdf("diffuse")))
    s["normalmap glass"] = panel(bsdf("normalmap", bitmap("normalmap", "normals.png", yes("raw")) + bsdf("roughdielectric", number("alpha", 0.2))))
    return s


def textures():
    s = {}
    s["bitmap"] = panel(DIFFUSE_TILES)
    s["bitmap nearest"] = panel(bsdf("diffuse", bitmap("reflectance", more=string("filter_type", "nearest"))))
    turned = '<transform name="to_uv"><rotate z="1" angle="20"/><scale x="2" y="2.5"/><translate x="0.3" y="-0.6"/></transform>'
    for mode in ("repeat", "mirror", "clamp"):
        s[f"bitmap {mode}"] = panel(bsdf("diffuse", bitmap("reflectance", more=turned + string("wrap_mode", mode))))
    s["checkerboard"] = panel(bsdf("diffuse", checker("reflectance")))
    s["checkerboard number"] = panel(bsdf("roughconductor", METAL + numbers_checker("alpha", 0.1, 0.5)))
    for kind in ("vertex", "face"):
        texture = f'<texture type="mesh_attribute" name="reflectance">{string("name", kind + "_color")}</texture>'
        s[f"mesh_attribute {kind}"] = shape(file("ply", f"{kind}.ply", yes("face_normals")) + bsdf("diffuse", texture) + "</shape>")
    return s


def emitters():
    s = {}
    s["area"] = lit(LIGHT)
    s["area textured"] = lit(LIGHT.replace(rgb("radiance", "6, 5, 4"), bitmap("radiance", more=yes("raw"))))
    s["area sphere"] = lit(f"""<shape type="sphere"><point name="center" x="-1.5" y="-1" z="2.5"/><float name="radius" value="0.5"/>
<emitter type="area">{rgb("radiance", "9, 8, 7")}</emitter></shape>""")
    s["spectrum of one number"] = lit(DIM.replace(rgb("radiance", "0.3, 0.35, 0.4"), '<spectrum name="radiance" value="0.4"/>'))
    s["point"] = lit(f'<emitter type="point"><point name="position" x="1" y="-2" z="3"/>{rgb("intensity", "9, 8, 7")}</emitter>')
    aim = '<transform name="to_world"><lookat origin="1, -2, 4" target="0, 0, 0" up="0, 0, 1"/></transform>'
    s["spot"] = lit(f'<emitter type="spot">{aim}{rgb("intensity", "40, 30, 20")}{number("cutoff_angle", 30)}</emitter>')
    s["spot texture"] = lit(f'<emitter type="spot">{aim}{rgb("intensity", "40")}{number("cutoff_angle", 25)}{bitmap("texture")}</emitter>')
    s["projector"] = lit(f'<emitter type="projector">{aim}{number("fov", 40)}{bitmap("irradiance")}{number("scale", 10)}</emitter>')
    s["directional"] = lit(f'<emitter type="directional"><vector name="direction" x="0.3" y="0.5" z="-1"/>{rgb("irradiance", "3, 2, 1")}</emitter>')
    # Light subpaths alone carry it. On a sphere too, every normal of which is another one.
    lamp = '<transform name="to_world"><scale value="0.8"/><rotate x="1" angle="170"/><translate x="0.3" y="-0.4" z="3"/></transform>'
    black = bsdf("diffuse", rgb("reflectance", "0"))
    ball = f'<shape type="sphere"><point name="center" x="0" y="0" z="1"/>{GREY}</shape>'
    for kind, place in (("", lamp), (" sphere", '<point name="center" x="-1.5" y="-1" z="2"/><float name="radius" value="0.3"/>')):
        shaped = f'<shape type="{"sphere" if kind else "rectangle"}">{place}{black}<emitter type="directionalarea">{rgb("radiance", "9, 8, 7")}</emitter></shape>'
        s["directionalarea" + kind] = scene(ball + GROUND + shaped, integrator="ptracer")
    s["constant"] = lit(DIM)
    env = f'<emitter type="envmap">{string("filename", "env.exr")}{number("scale", 0.8)}'
    s["envmap"] = lit(env + "</emitter>")
    s["envmap rotated"] = lit(env + '<transform name="to_world"><rotate x="1" angle="90"/><rotate z="1" angle="30"/></transform></emitter>')
    s["sunsky"] = lit(f'<emitter type="sunsky">{SUN}{number("sun_scale", 0.05)}</emitter>')
    s["sky"] = lit(f'<emitter type="sunsky">{SUN}{number("sun_scale", 0)}</emitter>')
    s["sky turbid"] = lit(f'<emitter type="sunsky">{SUN}{number("sun_scale", 0)}{number("turbidity", 7.3)}{rgb("albedo", "0.5, 0.3, 0.8")}</emitter>')
    date = "".join(f'<integer name="{k}" value="{v}"/>' for k, v in {"year": 2020, "month": 6, "day": 21}.items())
    date += "".join(number(k, v) for k, v in {"hour": 9, "minute": 30, "latitude": 48.1, "longitude": 11.6, "timezone": 2}.items())
    s["sky date"] = lit(f'<emitter type="sunsky">{date}{number("sun_scale", 0)}</emitter>')
    s["sun"] = lit(f'<emitter type="sunsky">{SUN}{number("sky_scale", 0)}{number("sun_scale", 0.1)}</emitter>')
    return s


def shapes():
    s = {}
    up = '<transform name="to_world"><rotate z="1" angle="30"/><rotate x="1" angle="50"/><translate z="1.3"/></transform>'
    mirror = '<transform name="to_world"><scale x="-1"/><rotate x="1" angle="60"/><translate z="1.3"/></transform>'
    for kind in ("rectangle", "cube", "disk", "sphere"):
        s[f"{kind} mirrored"] = shape(f'<shape type="{kind}">{mirror}{DIFFUSE_TILES}</shape>')
    s["obj mirrored"] = shape(f'<shape type="obj">{string("filename", "mesh.obj")}{mirror}{DIFFUSE_TILES}</shape>')
    for kind in ("rectangle", "cube", "disk", "cylinder"):
        s[kind] = shape(f'<shape type="{kind}">{up}{bsdf("twosided", DIFFUSE_TILES)}</shape>')
    s["sphere"] = shape(f'<shape type="sphere">{up}{DIFFUSE_TILES}</shape>')
    for kind in ("obj", "ply", "serialized"):
        s[kind] = shape(file(kind, f"mesh.{kind}") + DIFFUSE_TILES + "</shape>")
    s["obj face_normals"] = shape(file("obj", "mesh.obj", yes("face_normals")) + DIFFUSE_TILES + "</shape>")
    group = f'<shape type="shapegroup" id="g">{file("obj", "mesh.obj", lift=0)}{GREY}</shape><shape type="cube">{GREY}</shape></shape>'
    s["instance"] = shape(group + "".join(
        f'<shape type="instance"><ref id="g"/><transform name="to_world"><scale value="0.4"/><rotate z="1" angle="{40 * i}"/>'
        f'<translate x="{i}" z="1"/></transform></shape>' for i in (-1, 0, 1)))
    s["merge"] = shape(f'<shape type="merge">{file("obj", "mesh.obj")}{GREY}</shape></shape>')
    # Mitsuba loses parts of a grid that its own transform turns, and says so.
    for kind in ("smooth", "analytic"):
        grid = f'<shape type="sdfgrid">{string("filename", "torus.vol")}{string("normals", kind)}{GREY}</shape>'
        s[f"sdfgrid {kind}"] = shape(f"""<shape type="shapegroup" id="g">{grid}</shape><shape type="instance"><ref id="g"/>
<transform name="to_world"><translate x="-0.5" y="-0.5" z="-0.5"/><scale value="2.4"/><rotate x="1" angle="50"/><translate z="1.1"/></transform></shape>""")
    for kind in ("bsplinecurve", "linearcurve"):
        s[kind] = shape(f'<shape type="{kind}">{string("filename", "curves.txt")}{bsdf("twosided", GREY)}</shape>')
    return s


def sensors():
    """Sensors, films and integrators."""
    s = {}
    ball = f'<shape type="sphere"><point name="center" x="0" y="0" z="1"/>{DIFFUSE_TILES}</shape>' + GROUND + LIGHT + DIM
    s["thinlens"] = scene(ball, "thinlens", number("aperture_radius", 0.2) + number("focus_distance", 5))
    s["orthographic"] = scene(ball, "orthographic", view=VIEW.replace("<lookat", '<scale value="2.2"/><lookat'))
    s["principal point"] = scene(ball, inside=number("principal_point_offset_x", 0.2) + number("principal_point_offset_y", -0.1))
    s["crop"] = scene(ball, film="".join(f'<integer name="crop_{k}" value="{v}"/>' for k, v in {
        "offset_x": 24, "offset_y": 16, "width": 32, "height": 40}.items()))
    s["rfilter tent"] = scene(ball, rfilter='<rfilter type="tent"/>')
    s["rfilter gaussian"] = scene(ball, rfilter='<rfilter type="gaussian"/>')
    s["direct"] = scene(ball, integrator="direct", depth=0)
    s["volpath"] = scene(ball, integrator="volpath")
    return s


def catalogue():
    """Scenes by name."""
    return {**plain_bsdfs(), **nested_bsdfs(), **textures(), **emitters(), **shapes(), **sensors()}


def torus(across=14, along=22):
    """Vertices (x, y, z, u, v) and triangles of a torus that is open at its seams, as (u, v) are."""
    vertices, triangles = [], []
    for i in range(along + 1):
        for k in range(across + 1):
            a, b = 2 * math.pi * i / along, 2 * math.pi * k / across
            r = 0.75 + 0.3 * math.cos(b)
            vertices.append((r * math.cos(a), 0.3 * math.sin(b), r * math.sin(a), i / along, k / across))
    for i in range(along):
        for k in range(across):
            p = i * (across + 1) + k
            q = p + across + 1
            triangles += [(p, p + 1, q + 1), (p, q + 1, q)]
    return vertices, triangles


def hash01(*n):
    return zlib.crc32(struct.pack(f"<{len(n)}i", *n)) / 2**32


def ply(path, vertices, triangles, vertex_colors, face_colors):
    color = "property float r\nproperty float g\nproperty float b\n"
    uv = "property float u\nproperty float v\n"
    with open(path, "w", encoding="ascii") as out:
        out.write(f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n{uv}"
                  f"{color if vertex_colors else ''}element face {len(triangles)}\nproperty list uchar int vertex_indices\n"
                  f"{color if face_colors else ''}end_header\n")
        for i, v in enumerate(vertices):
            out.write(" ".join(f"{x:.7g}" for x in (*v, *(hash01(i, c) for c in range(3 if vertex_colors else 0)))) + "\n")
        for i, t in enumerate(triangles):
            out.write(" ".join(str(x) for x in (3, *t, *(f"{hash01(i, c):.6f}" for c in range(3 if face_colors else 0)))) + "\n")


def write_files(folder, write_image):
    """`write_image(path, rows of pixels of 3 floats, as 8 bit)`."""
    vertices, triangles = torus()
    ply(folder / "mesh.ply", vertices, triangles, False, False)
    ply(folder / "vertex.ply", vertices, triangles, True, False)
    ply(folder / "face.ply", vertices, triangles, False, True)
    with open(folder / "mesh.obj", "w", encoding="ascii") as out:
        out.writelines(f"v {v[0]:.7g} {v[1]:.7g} {v[2]:.7g}\nvt {v[3]:.7g} {v[4]:.7g}\n" for v in vertices)
        out.writelines("f " + " ".join(f"{i + 1}/{i + 1}" for i in t) + "\n" for t in triangles)
    data = struct.pack("<I", 0x1000 | 0x0002) + b"torus\0" + struct.pack("<QQ", len(vertices), len(triangles))
    data += b"".join(struct.pack("<3f", *v[:3]) for v in vertices) + b"".join(struct.pack("<2f", *v[3:]) for v in vertices)
    data += b"".join(struct.pack("<3I", *t) for t in triangles)
    head = struct.pack("<HH", 0x041C, 4)
    (folder / "mesh.serialized").write_bytes(head + zlib.compress(data) + struct.pack("<QI", 0, 1))

    write_image(folder / "tiles.png", [[[hash01(x, y, c) for c in range(3)] for x in range(8)] for y in range(6)], True)
    wave = [[0.5 + 0.25 * math.sin(0.6 * x) + 0.25 * math.cos(0.5 * y) for x in range(24)] for y in range(20)]
    write_image(folder / "heights.png", [[[h, h, h] for h in row] for row in wave], True)
    tilt = [[(0.55 * math.sin(0.7 * x), 0.5 * math.cos(0.9 * y)) for x in range(16)] for y in range(16)]
    write_image(folder / "normals.png", [[[0.5 + a / 2, 0.5 + b / 2, 0.5 + math.sqrt(1 - a * a - b * b) / 2] for a, b in row] for row in tilt], True)
    # Values that halves hold exactly: ours keeps environment maps as halves, which rounds others by up to 2^-12.
    sky = [[[round((4.0 if 5 <= x <= 7 and 3 <= y <= 4 else 0.3) * (0.5 + hash01(x, y, c)) * 256) / 256 for c in range(3)] for x in range(24)] for y in range(12)]
    write_image(folder / "env.exr", sky, False)

    n = 24
    grid = []
    for z in range(n):
        for y in range(n):
            for x in range(n):
                p = [i / (n - 1) - 0.5 for i in (x, y, z)]
                grid.append(math.hypot(math.hypot(p[0], p[1]) - 0.3, p[2]) - 0.12)
    (folder / "torus.vol").write_bytes(b"VOL" + struct.pack("<BiiiiI6f", 3, 1, n, n, n, 1, 0, 0, 0, 1, 1, 1) + struct.pack(f"<{n ** 3}f", *grid))
    with open(folder / "curves.txt", "w", encoding="ascii") as out:
        for i in range(7):
            # Ends are narrow: into open ones Mitsuba looks as if there were nothing.
            points = [(i / 3 - 1, 0.4 * math.sin(2.0 * k + i), 0.1 + 0.3 * k, 0.003 + 0.14 * max(0, math.sin(math.pi * (k - 1) / 6))**2) for k in range(9)]
            out.write("".join(" ".join(f"{x:.6f}" for x in p) + "\n" for p in points) + "\n")
