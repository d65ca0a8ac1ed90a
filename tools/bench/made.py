"""Meshes and skies that scenes of tools/bench name, made where they are missing; they are the same each time.

    target/venv/bin/python tools/bench/made.py

writes them to target/bench/made, where scenes/plain looks for them (tools/test makes target/venv). PLY is binary, little-endian, with positions and triangles alone.
"""
import math
import pathlib

import numpy as np
import OpenEXR


def write_ply(path, points, triangles):
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property float {c}" for c in "xyz"]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header", ""]
    with open(path, "wb") as file:
        file.write("\n".join(header).encode())
        np.ascontiguousarray(points, dtype="<f4").tofile(file)
        faces.tofile(file)


def grid(rows, columns, wrap):
    """Triangles between rows × columns points; `wrap`: the last row and column meet the first."""
    i, j = np.meshgrid(np.arange(rows - (not wrap)), np.arange(columns - (not wrap)), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = (i + 1) % rows * columns + j, (i + 1) % rows * columns + (j + 1) % columns
    return np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([b, c, d], -1).reshape(-1, 3)]).astype(np.int32)


def terrain(path, triangles):
    """Hills over the square from -1 to 1, y up, of some `triangles`; how many there are."""
    n = max(round(math.sqrt(triangles / 2)), 1)
    x, z = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    y = np.zeros_like(x)
    draw = np.random.default_rng(1)
    for octave in range(9):
        turn, phase, size = draw.uniform(0, 2 * math.pi), draw.uniform(0, 2 * math.pi, 2), 2.3 * 1.9**octave
        u, v = x * math.cos(turn) - z * math.sin(turn), x * math.sin(turn) + z * math.cos(turn)
        y += 0.33 / size * np.sin(size * u + phase[0]) * np.cos(size * v + phase[1])
    write_ply(path, np.stack([x, y, z], -1).reshape(-1, 3), grid(n + 1, n + 1, wrap=False))
    return 2 * n * n


def knot(path, around=500, across=100, p=2, q=3):
    """A tube along the (p, q) knot on a torus, 2 · around · across triangles, without a seam."""
    t = np.arange(around) * 2 * math.pi / around

    def along(t):
        r = 1.0 + 0.42 * np.cos(q * t)
        return np.stack([r * np.cos(p * t), r * np.sin(p * t), 0.42 * np.sin(q * t)], -1)

    middle, tangent = along(t), along(t + 1e-4) - along(t - 1e-4)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    # Away from the circle that the torus is wound around: smooth, and the same after one turn.
    core = np.stack([np.cos(p * t), np.sin(p * t), 0 * t], -1)
    normal = middle - core
    normal -= (normal * tangent).sum(-1, keepdims=True) * tangent
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    other = np.cross(tangent, normal)
    s = np.arange(across) * 2 * math.pi / across
    ring = np.cos(s)[None, :, None] * normal[:, None] + np.sin(s)[None, :, None] * other[:, None]
    write_ply(path, (middle[:, None] + 0.16 * ring).reshape(-1, 3), grid(around, across, wrap=True)[:, ::-1])


def sky(path, width=512):
    """Blue above, white towards the horizon, brown below, clouds, and a wide veiled sun."""
    v, u = np.meshgrid((np.arange(width // 2) + 0.5) / (width // 2), (np.arange(width) + 0.5) / width, indexing="ij")
    up = np.cos(v * math.pi)
    direction = np.stack([np.sin(v * math.pi) * np.sin(2 * math.pi * u), up, -np.sin(v * math.pi) * np.cos(2 * math.pi * u)], -1)
    high = np.clip(up, 0, 1)[..., None] ** 0.6
    picture = (1 - high) * np.array([0.75, 0.78, 0.8]) + high * np.array([0.14, 0.28, 0.62])
    cloud = sum(np.sin(k * direction[..., 0] * 2.1 + k) * np.sin(k * direction[..., 2] * 1.7 - k) / k for k in (2, 3, 5, 9, 14))
    picture += np.clip(cloud, 0, 1)[..., None] * high * 0.6
    picture[up < 0] = [0.22, 0.18, 0.14]
    sun = np.array([0.55, 0.6, 0.58]) / np.linalg.norm([0.55, 0.6, 0.58])
    picture += 25 * np.exp(150 * (direction @ sun - 1))[..., None] * np.array([1, 0.86, 0.62])
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(picture, dtype=np.float32)}).write(str(path))


def ensure(folder):
    """What scenes/plain names, in `folder`."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in {"knot.ply": knot, "terrain.ply": lambda path: terrain(path, 200_000), "sky.exr": sky}.items():
        if not (folder / name).is_file():
            make(folder / name)
    return folder


if __name__ == "__main__":
    ensure(pathlib.Path(__file__).resolve().parents[2] / "target" / "bench" / "made")
