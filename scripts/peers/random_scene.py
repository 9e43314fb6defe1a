"""Random small scenes of format 3: every shape, BSDF, texture, emitter and sensor, in nestings and under transforms that nobody would write."""

import math
import random

METALS = (("0.2, 0.92, 1.1", "3.9, 2.45, 2.14"), ("1.5, 0.9, 0.6", "7.6, 6.4, 5.3"))


def tag(kind, name, value):
    return f'<{kind} name="{name}" value="{value}"/>'


def num(name, value):
    return tag("float", name, f"{value:.6g}")


def rgb(name, values):
    return tag("rgb", name, ", ".join(f"{v:.5g}" for v in values))


def flag(name, value=True):
    return tag("boolean", name, "true" if value else "false")


def string(name, value):
    return tag("string", name, value)


def point(kind, name, at):
    return f'<{kind} name="{name}" x="{at[0]:.4f}" y="{at[1]:.4f}" z="{at[2]:.4f}"/>'


class RandomScene:
    """A scene for a seed. `has` holds what decides which methods share an image: delta (BSDFs), delta_light, beam, null, ours, env, sun, hidden.

    With `mitsuba` it holds only what Mitsuba 3 has too and, by docs/scenes.md and docs/validation.md, renders alike.
    """

    SMOOTH = ("diffuse", "roughconductor", "roughplastic", "principled")
    DELTA = ("conductor", "plastic")
    THROUGH = ("roughdielectric", "glass", "principledthin")
    DELTA_THROUGH = ("dielectric", "thindielectric")
    OURS = ("roughdiffuse", "phong", "ward")

    def __init__(self, seed, mitsuba):
        self.r, self.mitsuba, self.has, self.tags = random.Random(seed), mitsuba, set(), set()
        self.no_delta = self.p(0.45)  # light tracing and path tracing then see the same light
        self.text = self.scene()

    def p(self, chance):
        return self.r.random() < chance

    def u(self, a, b):
        return self.r.uniform(a, b)

    def one(self, *choices):
        return self.r.choice(choices)

    def some(self, text, chance=0.4):
        return text if self.p(chance) else ""

    def colour(self, a=0.05, b=0.9):
        return [self.u(a, b) for _ in range(3)]

    def axis(self):
        z, a = self.u(-1, 1), self.u(0, 2 * math.pi)
        s = math.sqrt(1 - z * z)
        return s * math.cos(a), s * math.sin(a), z

    def above(self, distance, lift=0.3):
        x, y, z = self.axis()
        return distance * x, distance * y, distance * abs(z) + lift

    def rotation(self):
        return '<rotate x="%.5f" y="%.5f" z="%.5f" ' % self.axis() + f'angle="{self.u(-180, 180):.4f}"/>'

    def place(self, size, at, affine, mirrors=True):
        t = f'<scale value="{size:.4f}"/>'
        if affine and self.p(0.5):
            t = '<scale x="%.4f" y="%.4f" z="%.4f"/>' % tuple(size * self.u(0.4, 1.3) for _ in range(3))
        mirror = self.some(f'<scale {self.one("x", "y", "z")}="-1"/>', 0.2)
        t += mirror if mirrors else ""
        if affine and self.p(0.25):
            t += f'<matrix value="1 {self.u(-0.6, 0.6):.4f} 0 0 0 1 {self.u(-0.6, 0.6):.4f} 0 0 0 1 0 0 0 0 1"/>'
        return f'<transform name="to_world">{t}{self.rotation()}<translate x="{at[0]:.4f}" y="{at[1]:.4f}" z="{at[2]:.4f}"/></transform>'

    def to_uv(self, turns=True):
        turn = self.some(f'<rotate z="1" angle="{self.u(0, 360):.3f}"/>')
        t = (turn if turns else "") + f'<scale x="{self.u(-4, 4):.4f}" y="{self.u(0.3, 4):.4f}"/>'
        t += self.some(f'<translate x="{self.u(-2, 2):.4f}" y="{self.u(-2, 2):.4f}"/>')
        return self.some(f'<transform name="to_uv">{t}</transform>', 0.6)

    def bitmap(self, name, file, raw=False, turns=True):
        wrap, sampled = self.one("repeat", "mirror", "clamp"), self.one("nearest", "bilinear")
        t = string("filename", file) + string("wrap_mode", wrap) + string("filter_type", sampled if turns else "bilinear")
        return f'<texture type="bitmap" name="{name}">{t}{flag("raw") if raw or self.p(0.3) else ""}{self.to_uv(turns)}</texture>'

    def checker(self, name, a, b):
        return f'<texture type="checkerboard" name="{name}">{rgb("color0", a)}{rgb("color1", b)}{self.to_uv()}</texture>'

    def spectrum(self, name):
        if self.p(0.25):
            return self.bitmap(name, "tiles.png")
        return self.checker(name, self.colour(), self.colour()) if self.p(0.15) else rgb(name, self.colour())

    def number(self, name, a, b):
        if not self.p(0.25):
            return num(name, self.u(a, b))
        if self.p(0.5) and a < 0.1 and b > 0.9:
            return self.bitmap(name, "heights.png", True)
        return self.checker(name, [self.u(a, b)] * 3, [self.u(a, b)] * 3)

    def alpha(self, name="alpha"):
        return num(name, self.one(self.u(0.02, 1), self.u(0.05, 0.5), 10 ** self.u(-3, -1), 1))

    def boundary(self):
        return self.one(string("int_ior", "bk7"), num("int_ior", self.u(1.2, 2.8)) + num("ext_ior", 1), num("int_ior", 1) + num("ext_ior", self.u(1.2, 1.8)),
                        num("int_ior", self.u(1.01, 1.1)) + num("ext_ior", 1))

    def roughness(self):
        t = string("distribution", self.one("ggx", "beckmann")) + self.some(flag("sample_visible", self.p(0.5)))
        return t + self.one(self.alpha("alpha_u") + self.alpha("alpha_v"), self.number("alpha", 0.05, 0.6), self.alpha(), self.alpha())

    def leaf(self, kinds):
        k = self.one(*kinds)
        self.tags.add(k)
        self.has |= {"delta"} if k in self.DELTA + self.DELTA_THROUGH else {"ours"} if k in (*self.OURS, "difftrans") else set()
        some, s, rest = self.some, self.spectrum, ("anisotropic", "sheen", "sheen_tint", "flatness", "spec_tint")
        shares = "".join(some(num(n, self.one(self.u(0, 1), 1))) for n in rest)
        if k in ("diffuse", "roughdiffuse", "difftrans"):
            t = s("transmittance" if k == "difftrans" else "reflectance") + (num("alpha", self.u(0, 1)) if k == "roughdiffuse" else "")
        elif k in ("conductor", "roughconductor"):
            eta, absorption = self.one(*METALS)
            t = self.one(string("material", "none"), tag("rgb", "eta", eta) + tag("rgb", "k", absorption), rgb("eta", self.colour(0.1, 3)) + rgb("k", self.colour(0.5, 5)))
            t += some(s("specular_reflectance")) + (self.roughness() if k != "conductor" else "")
        elif k in ("dielectric", "thindielectric", "roughdielectric"):
            t = self.boundary() + some(s("specular_reflectance")) + some(s("specular_transmittance")) + (self.roughness() if k[0] == "r" else "")
        elif k in ("plastic", "roughplastic"):
            t = some(num("int_ior", self.u(1.05, 1.9 if self.mitsuba else 2.2))) + s("diffuse_reflectance") + some(s("specular_reflectance")) + some(flag("nonlinear"))
            t += string("distribution", self.one("ggx", "beckmann")) + self.alpha() if k == "roughplastic" else ""
        elif k == "principled":
            t = s("base_color") + self.number("roughness", 0.1, 1) + some(self.number("metallic", 0, 1)) + shares
            t += some(num("clearcoat", self.u(0, 1)) + num("clearcoat_gloss", self.u(0, 1))) + self.one(num("specular", self.u(0.1, 1)), num("eta", self.u(1.2, 2)))
        elif k == "glass":
            k, t = "principled", rgb("base_color", self.colour()) + num("roughness", self.u(0.1, 1)) + num("spec_trans", self.one(self.u(0.1, 1), 1))
            t += num("eta", self.u(1.2, 2)) + some(num("anisotropic", self.u(0, 1))) + some(num("flatness", self.u(0, 1)))
        elif k == "principledthin":  # Mitsuba loses some specular transmission
            t = s("base_color") + num("roughness", self.u(0.1, 1)) + num("spec_trans", 0 if self.mitsuba else self.u(0, 1)) + num("diff_trans", self.u(0, 2))
            t += num("eta", self.u(1.1, 2)) + shares
        else:  # phong and ward
            t = rgb("diffuse_reflectance", self.colour(0, 0.5)) + rgb("specular_reflectance", self.colour(0, 0.5))
            t += num("exponent", 10 ** self.u(0, 3)) if k == "phong" else string("variant", self.one("ward", "ward-duer", "balanced")) + "".join(
                num(n, self.u(0.05, 0.5)) for n in ("alpha_u", "alpha_v"))
        return f'<bsdf type="{k}">{t}</bsdf>'

    def wrap(self, kind, inside):
        self.tags.add(kind)
        return f'<bsdf type="{kind}">{inside}</bsdf>'

    def opaque(self, level, smooth=False):
        """Reflects only; with `smooth` without delta lobes, as parts of blends have to be for Mitsuba."""
        kinds = self.SMOOTH * 2 + (() if self.mitsuba else self.OURS) + (() if smooth or self.no_delta else self.DELTA)
        if level <= 0 or self.p(0.5):
            return self.leaf(kinds)
        k = self.one("blendbsdf", "map", "map", "twosided", *(() if self.mitsuba else ("mixturebsdf", "coating", "roughcoating")))
        if k == "twosided":
            return self.twosided(level - 1, smooth)
        if k == "blendbsdf":
            return self.wrap(k, self.number("weight", 0, 1) + self.opaque(level - 1, True) + self.opaque(level - 1, True))
        if k == "map":
            return self.map(self.leaf(kinds))
        if k == "coating" and (smooth or self.no_delta):
            return self.leaf(kinds)
        self.has |= {"ours", "delta"} if k == "coating" else {"ours"}
        if k == "mixturebsdf":
            a = self.u(0, 1)
            return self.wrap(k, string("weights", f"{a:.4f}, {self.u(0, 1 - a):.4f}") + self.opaque(level - 1, smooth) + self.opaque(level - 1, smooth))
        t = num("int_ior", self.u(1.1, 1.9)) + rgb("sigma_a", self.colour(0, 1)) + num("thickness", self.u(0, 2))
        t += string("distribution", self.one("ggx", "beckmann")) + num("alpha", self.u(0.05, 0.5)) if k == "roughcoating" else ""
        return self.wrap(k, t + self.leaf(("diffuse", "roughconductor", "roughplastic")))

    def map(self, inner, transmits=False):
        kind = self.one("bumpmap", "normalmap")
        if self.mitsuba and ("anisotropic" in inner or "alpha_u" in inner):
            kind = "normalmap"  # Mitsuba's bump maps turn tangents
        if kind == "bumpmap":  # Mitsuba's derivatives of turned bitmaps are wrong, and it loses light of bounces without interpolation
            t = self.bitmap("arbitrary", "heights.png", True, not self.mitsuba) + num("scale", self.u(-0.4, 0.4))
        else:
            t = self.bitmap("normalmap", "normals.png", True)
        turn = "" if transmits and self.mitsuba else flag("flip_invalid_normals", self.p(0.5))  # docs/scenes.md
        return self.wrap(kind, t + self.some(turn + flag("use_shadowing_function", self.p(0.5))) + inner)

    def twosided(self, level, smooth=False):
        while True:
            inside = self.opaque(level, smooth) + self.some(self.opaque(level, smooth))
            if not self.mitsuba or not ("bumpmap" in inside or "normalmap" in inside):  # Mitsuba mirrors maps on the back
                return self.wrap("twosided", inside)

    def material(self, level=2):
        k = self.r.random()
        if k < 0.5:
            return self.opaque(level) if k < 0.35 else self.twosided(level - 1)
        if k < 0.75:
            inner = self.leaf(self.THROUGH + (() if self.no_delta else self.DELTA_THROUGH * 2) + (() if self.mitsuba else ("difftrans",)))
            return self.map(inner, True) if self.p(0.2) and "thin" not in inner else inner
        if k < 0.87:
            self.has.add("null")
            return self.wrap("mask", self.number("opacity", 0.05, 1) + (self.material(level - 1) if level > 0 else self.opaque(0)))
        return self.wrap("blendbsdf", self.number("weight", 0, 1) + self.opaque(0, True) + self.leaf(self.one(self.THROUGH, self.SMOOTH)))

    def shape(self, size, at, emits="", quadrics=True):
        k = self.one("rectangle", "cube", "obj", "ply", "serialized", *(("sphere", "sphere", "sphere", "disk", "cylinder") if quadrics else ()))
        self.tags.add(k)
        t = self.some(flag("flip_normals"), 0.2)
        turns_dark = emits and k not in ("rectangle", "disk", "cylinder")  # a closed lamp that shines inwards
        t = "" if turns_dark else t
        if k in ("obj", "ply", "serialized"):  # Mitsuba shines along vertex normals
            t += string("filename", f"mesh.{k}") + (flag("face_normals") if emits and self.mitsuba or self.p(0.3) else "")
        if k == "cylinder":
            t += point("point", "p0", (0, 0, self.u(-1, 0))) + point("point", "p1", (self.u(-0.5, 0.5), 0, 1)) + num("radius", self.u(0.2, 0.7))
        if k == "sphere" and self.p(0.4):
            t += point("point", "center", at) + num("radius", 0.7 * size)
        else:
            mirrors = not (turns_dark or emits and self.mitsuba and k == "cylinder")  # Mitsuba samples normals of mirrored cylinders wrongly
            t += self.place(size, at, k not in ("sphere", "cylinder"), mirrors)
        if emits:
            self.has.add("area")
            self.tags.add(emits)
            light = rgb("radiance", self.colour(1, 10))
            if self.p(0.25) and k == "rectangle":  # Mitsuba samples textured lights as if each of their coordinates stood once
                light = f'<texture type="bitmap" name="radiance">{string("filename", "tiles.png")}{flag("raw")}</texture>'
            elif self.p(0.25) and not self.mitsuba:
                light = self.one(self.bitmap("radiance", "tiles.png", True), self.checker("radiance", self.colour(0, 1), self.colour(0, 1)))
            return f'<shape type="{k}">{t}{self.opaque(0)}<emitter type="{emits}">{light}</emitter></shape>\n'
        material = self.material(2 if quadrics else 1)
        if self.mitsuba and k in ("rectangle", "cube", "obj", "ply", "serialized") and '="-1"/>' in t:  # Mitsuba turns bump maps round there
            material = self.without_bumps(material, lambda: self.material(2 if quadrics else 1))
        if self.mitsuba and k in ("obj", "ply", "serialized") and "mask" in material and "face_normals" not in t:
            t += flag("face_normals")  # Mitsuba's vertex normals scatter light from behind the surface
        return f'<shape type="{k}">{t}{material}</shape>\n'

    def without_bumps(self, material, again):
        while "bumpmap" in material:
            material = again()
        return material

    def instances(self):
        self.tags.add("instance")
        text = "".join(self.shape(self.u(0.4, 0.8), self.colour(-0.5, 0.5), quadrics=False) for _ in range(self.r.randint(1, 2)))
        places = [self.place(self.u(0.4, 0.8), self.colour(-1.2, 1.2), True) for _ in range(self.r.randint(1, 3))]
        return f'<shape type="shapegroup" id="g">\n{text}</shape>\n' + "".join(f'<shape type="instance"><ref id="g"/>{t}</shape>\n' for t in places)

    def light(self, kind):
        self.tags.add(kind)
        if kind in ("area", "directionalarea"):
            self.has |= {"beam"} if kind != "area" else set()
            return self.shape(self.u(0.2, 0.8), self.above(self.u(2, 3.5)), kind)
        self.has |= {"delta_light"} | ({"beam"} if kind == "collimated" else set())
        origin, target, (x, y, z) = self.above(self.u(2.5, 4), 0.5), self.colour(-0.5, 0.5), self.axis()
        t = '<transform name="to_world"><lookat origin="%.4f, %.4f, %.4f" target="%.3f, %.3f, %.3f" up="%.3f, %.3f, %.3f"/></transform>' % (*origin, *target, x, y, z)
        if kind == "point":
            t = point("point", "position", origin) + rgb("intensity", self.colour(3, 20))
        elif kind == "spot":
            c = self.one(self.u(5, 60), self.u(1, 10), self.u(60, 89))
            t += rgb("intensity", self.colour(10, 60)) + num("cutoff_angle", c) + self.some(num("beam_width", c * self.u(0, 0.98)), 0.6)
            t += self.some(self.bitmap("texture", "tiles.png"), 0.3) if c < 80 else ""
        elif kind == "projector":
            t += num("fov", self.u(5, 90)) + self.bitmap("irradiance", "tiles.png") + num("scale", self.u(3, 20))
        elif kind == "collimated":
            t += rgb("power", self.colour(1, 9))
        else:
            t = self.one(point("vector", "direction", (x, y, -abs(z) - 0.01)), f'<transform name="to_world">{self.rotation()}</transform>') + rgb("irradiance", self.colour(0.5, 4))
        return f'<emitter type="{kind}">{t}</emitter>\n'

    def environment(self):
        k = self.one("constant", "envmap", "envmap", "sunsky", "sky")
        self.tags.add(k)
        self.has |= {"env", "sun"} if k == "sunsky" else {"env"}
        mirror = self.some(f'<scale {self.one("x", "y", "z")}="-1"/>', 0.3)
        turn = self.some(f'<transform name="to_world">{self.rotation()}{mirror}</transform>', 0.7)
        if k == "constant":
            return f'<emitter type="constant">{rgb("radiance", self.colour(0.05, 1))}</emitter>\n'
        if k == "envmap":
            return f'<emitter type="envmap">{string("filename", "env.exr")}{num("scale", self.one(0.25, 0.5, 1, 2))}{turn}</emitter>\n'
        t = point("vector", "sun_direction", self.above(1, 0.1)) + num("turbidity", self.u(1, 10)) + rgb("albedo", self.colour(0, 1))
        return f'<emitter type="sunsky">{t}{num("sun_scale", 0.05 if k == "sunsky" else 0)}{num("sky_scale", self.u(3, 20))}</emitter>\n'

    def sensor(self):
        k = self.one("perspective", "perspective", "perspective", "thinlens", "orthographic")
        self.tags.add(k)
        a, e, d = self.u(0, 2 * math.pi), self.u(0.1, 1.1), self.u(4.5, 7)
        origin = (d * math.cos(e) * math.cos(a), d * math.cos(e) * math.sin(a), d * math.sin(e) - 0.2)
        first = self.some('<scale x="-1"/>', 0.15)
        t = ""
        if k == "orthographic":
            first = f'<scale x="{self.u(1.5, 2.5):.4f}" y="{self.u(1.5, 2.5):.4f}"/>'
        else:
            t = self.one(num("fov", self.u(20, 50)) + self.some(string("fov_axis", self.one("x", "y", "diagonal", "smaller", "larger"))),
                         string("focal_length", f"{self.u(40, 90):.3f}mm"))
        t += num("aperture_radius", self.u(0.01, 0.4)) + num("focus_distance", self.u(3, 8)) if k == "thinlens" else ""
        t += self.some("".join(num("principal_point_offset_" + axis, self.u(-0.3, 0.3)) for axis in "xy"), 0.25) if k == "perspective" else ""
        w, h = self.one((32, 32), (32, 32), (32, 32), (64, 48), (40, 72))
        crop = {"width": w, "height": h, "crop_offset_x": self.r.randint(0, w - 32), "crop_offset_y": self.r.randint(0, h - 32), "crop_width": 32, "crop_height": 32}
        film = "".join(tag("integer", n, v) for n, v in crop.items()) + string("component_format", "float32") + string("pixel_format", "rgb")
        rfilter = self.one("box", "box", "tent", "gaussian") if not self.mitsuba else "box"
        return f"""<sensor type="{k}"><transform name="to_world">{first}<lookat origin="%.4f, %.4f, %.4f" target="%.3f, %.3f, %.3f" up="0, 0, 1"/></transform>{t}
<film type="hdrfilm">{film}<rfilter type="{rfilter}"/></film><sampler type="independent"/></sensor>
""" % (*origin, *self.colour(-0.3, 0.3))

    def room(self, closed):
        """A floor, or a box of six walls."""
        away = 8 if closed else self.u(1.3, 2)
        turns = ["", *(f'<rotate x="1" angle="{90 * i}"/>' for i in (1, 2, 3)), '<rotate y="1" angle="90"/>', '<rotate y="1" angle="-90"/>']
        text = ""
        for t in turns[:6 if closed else 1]:
            bsdf = self.opaque(1)
            if self.mitsuba and 'y="1"' in t:  # Mitsuba's bump maps have no tangent there
                bsdf = self.without_bumps(bsdf, lambda: self.opaque(1))
            text += f'<shape type="rectangle"><transform name="to_world"><scale value="8"/><translate z="{-away:.3f}"/>{t}</transform>{bsdf}</shape>\n'
        return text

    def scene(self):
        closed, kinds = self.p(0.15), ["area"] * 4
        if self.p(0.5):
            kinds += ["point", "spot", "projector", "directional"] + (["collimated", "directionalarea"] if self.p(0.3) and not self.mitsuba else [])
        body = self.room(closed) if closed or self.p(0.8) else ""
        body += "".join(self.shape(self.u(0.3, 0.9), self.colour(-1.2, 1.2)) for _ in range(self.r.randint(1, 4))) + (self.instances() if self.p(0.25) else "")
        body += "".join(self.light(self.one(*kinds)) for _ in range(self.r.randint(1, 3))) + (self.environment() if not closed and self.p(0.5) else "")
        depth = self.one(40, -1) if "null" in self.has else self.one(2, 3, 4, 5, 6, 8, -1)  # Mitsuba counts what paths pass through
        t = tag("integer", "max_depth", depth) + (tag("integer", "rr_depth", self.r.randint(1, 8)) if depth < 0 or self.p(0.4) else "")
        if self.p(0.15) and not (self.mitsuba and "area" in self.has):  # Mitsuba hides the surface as well
            self.has.add("hidden")
            t += flag("hide_emitters")
        integrator = "volpath" if "null" in self.has else "path"  # Mitsuba's path tracer stops shadow rays at null
        return f'<scene version="3.0.0">\n<integrator type="{integrator}">{t}</integrator>\n{self.sensor()}{body}</scene>\n'
