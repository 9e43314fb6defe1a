"""Scenes as LuxCore reads them, for what means the same there; all else is refused by name.

The input is a scene of format 3 (mitsuba_scene.convert). Meshes are in world coordinates.
"""

import math
from pathlib import Path

import numpy as np

from peer_protocol import Refused

SEGMENTS = 512  # of a circle: its area is 2.5e-5 too small


def floats(text):
    return [float(w) for w in text.replace(",", " ").split()]


def parameter(element, name, fallback=None):
    """Number or colour of that name."""
    for e in element:
        if e.get("name") == name:
            if e.tag == "rgb":
                values = floats(e.get("value"))
                return values * 3 if len(values) == 1 else values
            if e.tag == "float":
                return float(e.get("value"))
            raise Refused(f"{name} of {element.get('type')} is a {e.tag} {e.get('type') or ''}: only numbers and rgb are the same in LuxCore")
    return fallback


def rotation(axis, degrees):
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    m = np.eye(4)
    m[:3, :3] = c * np.eye(3) + s * cross + (1 - c) * np.outer([x, y, z], [x, y, z])
    return m


def look_at(origin, target, up):
    """Mitsuba's: z to the target, x to the left."""
    m = np.eye(4)
    z = target - origin
    z = z / np.linalg.norm(z)
    x = np.cross(up, z)
    x = x / np.linalg.norm(x)
    m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3] = x, np.cross(z, x), z, origin
    return m


def step(e):
    xyz = lambda fallback: np.array([float(e.get(k, e.get("value", fallback) if fallback == 1 else fallback)) for k in "xyz"])
    m = np.eye(4)
    if e.tag == "matrix":
        values = floats(e.get("value"))
        if len(values) != 16:
            raise Refused("a matrix that has not 16 numbers")
        return np.array(values).reshape(4, 4)
    if e.tag == "scale":
        values = floats(e.get("value", "")) or list(xyz(1))
        m[:3, :3] = np.diag(values * 3 if len(values) == 1 else values)
    elif e.tag == "translate":
        m[:3, 3] = floats(e.get("value", "")) or xyz(0)
    elif e.tag == "rotate":
        return rotation(floats(e.get("value", "")) or xyz(0), float(e.get("angle")))
    elif e.tag == "lookat":
        return look_at(*(np.array(floats(e.get(k, "0,1,0"))) for k in ("origin", "target", "up")))
    else:
        raise Refused(f"transformation {e.tag}")
    return m


def transform_of(element):
    m = np.eye(4)
    for t in element.findall("transform"):
        if t.get("name") == "to_world":
            for e in t:
                m = step(e) @ m
    return m


def grid(columns, rows):
    """Triangles of a grid of (columns + 1) x (rows + 1) points."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(columns), np.arange(rows)))
    a = j * (columns + 1) + i
    b, c = a + 1, a + columns + 1
    return np.concatenate([np.stack([a, b, c + 1], 1), np.stack([a, c + 1, c], 1)])


def rectangle(_, changes):
    return np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float), np.array([[0, 1, 2], [0, 2, 3]]), None


def cube(_, changes):
    points, triangles = [], []
    for axis in range(3):
        for side in (-1, 1):
            u, v = np.eye(3)[(axis + 1) % 3] * side, np.eye(3)[(axis + 2) % 3]
            n = np.eye(3)[axis] * side
            triangles += [[len(points) + k for k in t] for t in ((0, 1, 2), (0, 2, 3))]
            points += [n - u - v, n + u - v, n + u + v, n - u + v]
    return np.array(points), np.array(triangles), None


def disk(_, changes):
    angles = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(SEGMENTS)], 1)
    k = np.arange(SEGMENTS)
    changes.add(f"a disk is {SEGMENTS} triangles")
    return np.vstack([[[0, 0, 0]], rim]), np.stack([np.zeros(SEGMENTS, int), 1 + k, 1 + (k + 1) % SEGMENTS], 1), None


def sphere(shape, changes):
    phi, theta = np.meshgrid(np.linspace(0, 2 * np.pi, SEGMENTS + 1), np.linspace(np.pi, 0, SEGMENTS // 2 + 1))
    n = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)
    center = next((np.array([float(e.get(k, 0)) for k in "xyz"]) for e in shape.findall("point") if e.get("name") == "center"), np.zeros(3))
    triangles = grid(SEGMENTS, SEGMENTS // 2)
    changes.add(f"a sphere is {len(triangles)} triangles with its normals at the corners")
    return center + parameter(shape, "radius", 1.0) * n, triangles, n


def obj(shape, changes):
    """Positions, normals and faces of a Wavefront file; groups and materials mean nothing here."""
    name = next((e.get("value") for e in shape.findall("string") if e.get("name") == "filename"), None)
    positions, normals, corners, index = [], [], {}, []
    for line in Path(name).read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            positions.append([float(w) for w in words[1:4]])
        elif words[0] == "vn":
            normals.append([float(w) for w in words[1:4]])
        elif words[0] == "f":
            face = []
            for w in words[1:]:
                p, n = int(w.split("/")[0]), w.split("/")[2] if w.count("/") == 2 else ""
                key = (p - 1 if p > 0 else len(positions) + p, (int(n) - 1 if int(n) > 0 else len(normals) + int(n)) if n else -1)
                face.append(corners.setdefault(key, len(corners)))
            index += [(face[0], face[k], face[k + 1]) for k in range(1, len(face) - 1)]
    flat = any(e.get("name") == "face_normals" and e.get("value") == "true" for e in shape.findall("boolean"))
    smooth = normals and not flat and all(n >= 0 for _, n in corners)
    if normals == [] and not flat:
        changes.add("a mesh without normals is flat")
    return (np.array([positions[p] for p, _ in corners]), np.array(index), np.array([normals[n] for _, n in corners]) if smooth else None)


SHAPES = {"rectangle": rectangle, "cube": cube, "disk": disk, "sphere": sphere, "obj": obj}


def mesh_of(shape, changes):
    kind = shape.get("type")
    if kind not in SHAPES:
        raise Refused(f"shape {kind}: known are {', '.join(SHAPES)}")
    points, triangles, normals = SHAPES[kind](shape, changes)
    m = transform_of(shape)
    linear = m[:3, :3]
    points = points @ linear.T + m[:3, 3]
    if normals is not None:
        normals = normals @ np.linalg.inv(linear)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    flipped = any(e.get("name") == "flip_normals" and e.get("value") == "true" for e in shape.findall("boolean"))
    # The normal of an analytic shape is transformed; that of a triangle follows its corners.
    if flipped != (kind != "obj" and np.linalg.det(linear) < 0):
        triangles = triangles[:, ::-1]
    return points, triangles, -normals if flipped and normals is not None else normals


def material_of(bsdf, changes):
    """Properties of a material, without the name in front."""
    kind = bsdf.get("type")
    if kind == "twosided":
        inner = bsdf.findall("bsdf")
        if len(inner) != 1 or inner[0].get("type") != "diffuse":
            raise Refused("twosided of other than diffuse")
        return material_of(inner[0], None)
    if kind == "diffuse":
        if changes is not None:
            changes.add("diffuse scatters on both sides, not on the front alone")
        return {"type": "matte", "kd": parameter(bsdf, "reflectance", [0.5] * 3)}
    if kind == "dielectric":
        ior = {key: parameter(bsdf, key, fallback) for key, fallback in (("int_ior", 1.5046), ("ext_ior", 1.000277))}
        return {"type": "glass", "kr": parameter(bsdf, "specular_reflectance", [1.0] * 3), "kt": parameter(bsdf, "specular_transmittance", [1.0] * 3),
                "interiorior": ior["int_ior"], "exteriorior": ior["ext_ior"]}
    raise Refused(f"bsdf {kind}: the same in LuxCore are diffuse, twosided diffuse and dielectric")


def camera_of(sensor, size):
    if sensor.get("type") != "perspective":
        raise Refused(f"sensor {sensor.get('type')}")
    m = transform_of(sensor)
    if np.linalg.det(m[:3, :3]) < 0:
        raise Refused("a camera whose transformation mirrors")
    tangent, aspect = math.tan(math.radians(parameter(sensor, "fov", 40.0)) / 2), size[0] / size[1]
    axis = next((e.get("value") for e in sensor.findall("string") if e.get("name") == "fov_axis"), "x")
    if axis == "diagonal":
        raise Refused("fov_axis diagonal")
    along_y = axis == "y" or (axis == "smaller" and aspect > 1) or (axis == "larger" and aspect < 1)
    vertical = tangent if along_y else tangent / aspect
    # The field of view is that of the shorter side, whose window is [-1, 1].
    shorter = vertical * min(1.0, aspect)
    window = [max(1.0, aspect), max(1.0, 1 / aspect)]
    # LuxCore's first row lies one pixel lower than its window says.
    row = 2 * window[1] / size[1]
    origin, target = m[:3, 3], m[:3, 3] + m[:3, 2]
    return {"scene.camera.type": "perspective", "scene.camera.lookat.orig": origin.tolist(), "scene.camera.lookat.target": target.tolist(),
            "scene.camera.up": m[:3, 1].tolist(), "scene.camera.fieldofview": 2 * math.degrees(math.atan(shorter)), "scene.camera.cliphither": 1e-4,
            "scene.camera.screenwindow": [-window[0], window[0], -window[1] - row, window[1] - row], "scene.camera.autofocus.enable": False}


def light_of(emitter):
    if emitter.get("type") != "constant":
        raise Refused(f"emitter {emitter.get('type')}: the same in LuxCore are area and constant")
    return {"scene.lights.sky.type": "constantinfinite", "scene.lights.sky.color": [1.0] * 3, "scene.lights.sky.gain": parameter(emitter, "radiance", [1.0] * 3)}


def convert(root, size, changes):
    """(properties, meshes by name)."""
    known = {e.get("id"): e for e in root.iter("bsdf") if e.get("id")}
    properties, meshes = camera_of(root.find("sensor"), size), {}
    for emitter in root.findall("emitter"):
        properties.update(light_of(emitter))
    for number, shape in enumerate(root.findall("shape")):
        name = f"shape{number}"
        meshes[name] = mesh_of(shape, changes)
        bsdf = shape.find("bsdf")
        if bsdf is None:
            bsdf = next((known[e.get("id")] for e in shape.findall("ref") if e.get("id") in known), None)
        material = {"type": "matte", "kd": [0.5] * 3} if bsdf is None else material_of(bsdf, changes)
        emitter = shape.find("emitter")
        if emitter is not None:
            if emitter.get("type") != "area":
                raise Refused(f"emitter {emitter.get('type')} of a shape")
            material["emission"] = parameter(emitter, "radiance", [1.0] * 3)
        properties.update({f"scene.materials.{name}.{key}": value for key, value in material.items()})
        properties.update({f"scene.objects.{name}.shape": name, f"scene.objects.{name}.material": name})
    return properties, meshes
