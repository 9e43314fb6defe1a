"""Makes the textures and meshes in scenes/assets/. They are committed; run this only to change them.

Usage: python scenes/make_assets.py        (needs numpy, Pillow and OpenEXR, see requirements.txt)
Everything is a formula with a fixed seed, so running it again writes the same pictures and meshes.
"""

from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

ASSETS = Path(__file__).parent / "assets"


def save_png(name, image):
    """Writes values in [0,1], shape (h, w) or (h, w, 3 or 4), as 8 bits per channel."""
    Image.fromarray((np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)).save(ASSETS / name, optimize=True)


def pixel_grid(size):
    """Centres of size x size pixels, (x, y) in [0,1)."""
    c = (np.arange(size) + 0.5) / size
    return np.meshgrid(c, c)


def tiles(size=128, count=4):
    """sRGB colour of tiles with mortar between them; each tile has a hue of its own."""
    rng = np.random.default_rng(1)
    x, y = pixel_grid(size)
    ix, iy = (x * count).astype(int), (y * count).astype(int)
    base = np.array([0.72, 0.42, 0.30]) + 0.16 * (rng.random((count, count, 3)) - 0.5)
    fx, fy = x * count - ix, y * count - iy
    mortar = np.minimum(np.minimum(fx, 1 - fx), np.minimum(fy, 1 - fy)) < 0.06
    return np.where(mortar[..., None], np.array([0.80, 0.78, 0.74]), base[iy, ix])


def waves(size=128):
    """Heights in [0,1] of a ripple that repeats at the borders, for bumpmap."""
    x, y = pixel_grid(size)
    return 0.5 + 0.25 * np.sin(2 * np.pi * 6 * x) + 0.25 * np.sin(2 * np.pi * 6 * y)


def dimples(size=128, count=6, depth=0.9):
    """Tangent-space normals (n + 1) / 2 of a grid of round dimples. y of the normal points along +t, which is up in the picture."""
    x, y = pixel_grid(size)
    u = 2 * ((x * count) % 1) - 1
    v = 1 - 2 * ((y * count) % 1)
    inside = (u * u + v * v < 0.8)
    n = np.dstack([-depth * u * inside, -depth * v * inside, np.ones_like(u)])
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    return (n + 1) / 2


def leaf(size=128):
    """Opacity of a pointed leaf with a stem: 1 inside, 0 outside."""
    x, y = pixel_grid(size)
    s, t = 2 * x - 1, 1 - y
    blade = np.abs(s) < 0.75 * np.sin(np.pi * np.clip((t - 0.12) / 0.85, 0, 1)) ** 0.8
    stem = (np.abs(s) < 0.03) & (t < 0.2)
    return (blade | stem).astype(float)


def sky(width=64, height=32):
    """Linear RGB latitude-longitude image, row 0 at the zenith: a sky gradient, dull ground and a soft sun.

    The sun is wide (about 11 degrees to 1/e) and 40 times the sky: importance sampling matters and this small image still resolves it.
    """
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi, theta = np.meshgrid(phi, theta)
    d = np.dstack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)])
    up = np.clip(d[..., 1:2], 0, 1)
    image = (1 - up) * np.array([0.55, 0.62, 0.70]) + up * np.array([0.16, 0.30, 0.62])
    image = np.where(d[..., 1:2] < 0, np.array([0.12, 0.11, 0.10]), image)
    axis = np.array([0.5, 0.62, 0.6])
    cosine = d @ (axis / np.linalg.norm(axis))
    image += 14 * np.exp(55 * (cosine - 1))[..., None] * np.array([1.0, 0.86, 0.66])
    return image.astype(np.float16)


def torus_obj(name, rings=40, sides=20, major=0.7, minor=0.3):
    """Wavefront OBJ of quads with normals and texture coordinates: tests faces of more than three vertices."""
    lines = ["# Torus around +y: made by scenes/make_assets.py"]
    for kind in ("v", "vt", "vn"):
        for i in range(rings + 1):
            for j in range(sides + 1):
                a, b = 2 * np.pi * i / rings, 2 * np.pi * j / sides
                n = np.array([np.cos(b) * np.cos(a), np.sin(b), np.cos(b) * np.sin(a)])
                p = n * minor + major * np.array([np.cos(a), 0, np.sin(a)])
                values = {"v": p, "vt": (4 * i / rings, 2 * j / sides), "vn": n}[kind]
                # + 0.0 turns -0 into 0
                lines.append(kind + " " + " ".join(f"{round(float(v), 4) + 0.0:g}" for v in values))
    for i in range(rings):
        for j in range(sides):
            corner = lambda di, dj: (i + di) * (sides + 1) + j + dj + 1
            quad = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)]
            lines.append("f " + " ".join(f"{k}/{k}/{k}" for k in quad))
    (ASSETS / name).write_text("\n".join(lines) + "\n")


def blob_ply(name, rows=24, columns=48):
    """Binary little-endian PLY: a sphere with dents, with normals and u, v."""
    def surface(u, v):
        phi, theta = 2 * np.pi * u, np.pi * v
        r = 1 + 0.12 * np.sin(theta) ** 3 * np.cos(5 * phi)
        return np.stack([r * np.sin(theta) * np.sin(phi), r * np.cos(theta), r * np.sin(theta) * np.cos(phi)], -1)

    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    h = 1e-4
    inner = np.clip(v, 0.005, 0.995)  # tangents vanish at the poles
    normal = np.cross(surface(u, inner + h) - surface(u, inner - h), surface(u + h, inner) - surface(u - h, inner))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    vertices = np.concatenate([surface(u, v), normal, u[..., None], 1 - v[..., None]], -1).reshape(-1, 8).astype("<f4")
    faces = []
    for i in range(rows):
        for j in range(columns):
            a = i * (columns + 1) + j
            b = a + columns + 1
            # The first and last row close at the poles; their second triangle would have no area.
            if i > 0:
                faces.append((a, b, a + 1))
            if i < rows - 1:
                faces.append((a + 1, b, b + 1))
    face_data = np.zeros(len(faces), dtype=[("n", "u1"), ("i", "<i4", 3)])
    face_data["n"] = 3
    face_data["i"] = faces
    header = ["ply", "format binary_little_endian 1.0", "comment made by scenes/make_assets.py", f"element vertex {len(vertices)}"]
    header += [f"property float {p}" for p in ("x", "y", "z", "nx", "ny", "nz", "u", "v")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    (ASSETS / name).write_bytes("\n".join(header).encode() + b"\n" + vertices.tobytes() + face_data.tobytes())


def write_ply(name, points, normals):
    """Binary little-endian PLY of a grid of points and normals, shape (rows, columns, 3). The outside of its triangles is that of
    d/d(columns) x d/d(rows)."""
    rows, columns = points.shape[0] - 1, points.shape[1] - 1
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    vertices = np.concatenate([points, normals], -1).reshape(-1, 6).astype("<f4")
    corner = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3)
    # A point where a circle has shrunk to nothing: triangles without area are left out.
    corners = vertices[faces, :3]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    faces = faces[area > 1e-12]
    face_data = np.zeros(len(faces), dtype=[("n", "u1"), ("i", "<u2", 3)])
    face_data["n"] = 3
    face_data["i"] = faces
    header = ["ply", "format binary_little_endian 1.0", "comment made by scenes/make_assets.py", f"element vertex {len(vertices)}"]
    header += [f"property float {p}" for p in ("x", "y", "z", "nx", "ny", "nz")]
    header += [f"element face {len(faces)}", "property list uchar ushort vertex_indices", "end_header"]
    (ASSETS / name).write_bytes("\n".join(header).encode() + b"\n" + vertices.tobytes() + face_data.tobytes())


def water_ply(name, cells=40):
    """A square [-1,1]^2 of water about y = 0 with low waves in four directions; its outside is above."""
    waves = [(7, 3, 0.4, 0.018), (-4, 8, 1.9, 0.015), (11, -6, 4.0, 0.0075), (2, -10, 5.1, 0.01)]  # wave vector, phase, height
    c = np.linspace(-1, 1, cells + 1)
    x, z = np.meshgrid(c, -c)
    y, dx, dz = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for kx, kz, phase, height in waves:
        y += height * np.sin(kx * x + kz * z + phase)
        dx += height * kx * np.cos(kx * x + kz * z + phase)
        dz += height * kz * np.cos(kx * x + kz * z + phase)
    write_ply(name, np.stack([x, y, z], -1), np.stack([-dx, np.ones_like(x), -dz], -1))


def basin_ply(name, columns=40):
    """A round bowl of radius 1 and height 0.6 with a rim, around +y: a profile from the middle of its inside to that of its foot."""
    inside = [(0.94 * np.sin(a), 0.6 - 0.52 * np.cos(a)) for a in np.linspace(0, np.pi / 2, 11)]
    rim = [(0.97 + 0.03 * np.cos(a), 0.6 + 0.03 * np.sin(a)) for a in np.linspace(np.pi, 0, 7)[1:]]
    outside = [(0.45 + 0.55 * np.cos(a), 0.6 - 0.6 * np.sin(a)) for a in np.linspace(0, np.pi / 2, 9)[1:]]
    profile = np.array(inside + rim + outside)
    slope = np.gradient(profile, axis=0)
    slope[0] = (1, 0)
    phi = np.linspace(0, 2 * np.pi, columns + 1)
    ring = lambda radial, up: np.stack([radial[:, None] * np.cos(phi), up[:, None] + 0 * phi, radial[:, None] * np.sin(phi)], -1)
    write_ply(name, ring(profile[:, 0], profile[:, 1]), ring(-slope[:, 1], slope[:, 0]))


def main():
    ASSETS.mkdir(exist_ok=True)
    save_png("tiles.png", tiles())
    save_png("waves.png", waves())
    save_png("dimples.png", dimples())
    save_png("leaf.png", leaf())
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": sky()}).write(str(ASSETS / "sky.exr"))
    torus_obj("torus.obj")
    blob_ply("blob.ply")
    water_ply("water.ply")
    basin_ply("basin.ply")


if __name__ == "__main__":
    main()
