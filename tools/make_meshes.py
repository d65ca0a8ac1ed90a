#!/usr/bin/env python3
"""Writes the two ground stones of the gallery: configs/meshes/brilliant.obj and configs/meshes/prism.obj.

    python3 tools/make_meshes.py

A cut stone is what is left between half-spaces. Each facet is one plane, and the corners are the points where three
planes meet and no fourth cuts them off. Needs nothing but Python.
"""

import argparse
from itertools import combinations
from math import cos, pi, radians, sin, sqrt, tan
from pathlib import Path

MESHES = Path(__file__).resolve().parent.parent / "configs" / "meshes"

# Corners closer than this, in girdle diameters, are one. Sixteen digits of a coordinate near one leave 1e-13 after the
# solution of three equations whose determinant is above 1e-3; the shortest edge of the cut is 1e-2.
SAME = 1e-9


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def meet(p, q, r):
    """The point on three planes (normal, distance), or None where they have none in common."""
    qr, rp, pq = cross(q[0], r[0]), cross(r[0], p[0]), cross(p[0], q[0])
    det = dot(p[0], qr)
    if abs(det) < 1e-6:
        return None
    return tuple((p[1] * qr[i] + q[1] * rp[i] + r[1] * pq[i]) / det for i in range(3))


def solid(planes):
    """Corners, and for each plane the corners on it, counter-clockwise as seen from outside."""
    corners = []
    for three in combinations(planes, 3):
        x = meet(*three)
        if x is None or any(dot(n, x) > d + SAME for n, d in planes):
            continue
        if not any(all(abs(x[i] - y[i]) < SAME for i in range(3)) for y in corners):
            corners.append(x)
    faces = []
    for n, d in planes:
        on = [i for i, x in enumerate(corners) if abs(dot(n, x) - d) < SAME]
        if len(on) < 3:
            continue
        centre = tuple(sum(corners[i][k] for i in on) / len(on) for k in range(3))
        from_centre = {i: tuple(corners[i][k] - centre[k] for k in range(3)) for i in on}
        u = from_centre[on[0]]
        v = cross(n, u)
        # Angle of u is 0; the order of a pseudo-angle is that of the angle.
        def turn(i):
            x, y = dot(from_centre[i], u), dot(from_centre[i], v)
            r = x / sqrt(x * x + y * y)
            return 1 - r if y >= 0 else 3 + r
        faces.append(sorted(on, key=turn))
    return corners, faces


def facet(azimuth, slope, radius, height):
    """The plane that falls outward by `slope` (rises, for a negative one) through the point at `radius` and `height`."""
    up = cos(slope) if slope > 0 else -cos(slope)
    out = abs(sin(slope))
    normal = (out * cos(azimuth), up, out * sin(azimuth))
    return normal, dot(normal, (radius * cos(azimuth), height, radius * sin(azimuth)))


def brilliant():
    """A round brilliant after Tolkowsky (1919): girdle diameter 1, table 53 %, crown 34.5°, pavilion 40.75°.

    The table lies up, the girdle about y = 0. Star and halves facets have the slopes usual in the trade.
    """
    girdle = 0.01
    crown, pavilion = radians(34.5), radians(40.75)
    table = girdle + (0.5 - 0.265) * tan(crown)
    planes = [((0.0, 1.0, 0.0), table)]
    for k in range(8):
        azimuth = k * pi / 4
        planes.append(facet(azimuth, crown, 0.5, girdle))
        planes.append(facet(azimuth, -pavilion, 0.5, -girdle))
        # A star touches the table's corner circle: the apothem of the octagon is 0.265, its corners are at 0.287.
        planes.append(facet(azimuth + pi / 8, radians(23.0), 0.265 / cos(pi / 8) - 0.022, table))
        for side in (-1, 1):
            planes.append(facet(azimuth + side * pi / 16, radians(40.0), 0.5, girdle))
            planes.append(facet(azimuth + side * pi / 16, -radians(42.2), 0.5, -girdle))
    for k in range(32):
        azimuth = (k + 0.5) * pi / 16
        planes.append(((cos(azimuth), 0.0, sin(azimuth)), 0.4985))
    return solid(planes)


def prism():
    """An equilateral prism: edges of 1 along the triangle, height 1 along y, its axis through the origin.

    One edge points along +x.
    """
    planes = [((0.0, 1.0, 0.0), 0.5), ((0.0, -1.0, 0.0), 0.5)]
    for k in range(3):
        azimuth = pi / 3 + k * 2 * pi / 3
        planes.append(((cos(azimuth), 0.0, sin(azimuth)), sqrt(3) / 6))
    return solid(planes)


def write(name, about, shape):
    corners, faces = shape
    lines = [f"# {about}", "# Written by tools/make_meshes.py."]
    lines += ["v " + " ".join(f"{x:.9f}" for x in corner) for corner in corners]
    for face in faces:
        lines += [f"f {face[0] + 1} {b + 1} {c + 1}" for b, c in zip(face[1:], face[2:])]
    (MESHES / name).write_text("\n".join(lines) + "\n")
    print(f"{name}: {len(corners)} corners, {len(faces)} facets")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    MESHES.mkdir(parents=True, exist_ok=True)
    write("brilliant.obj", "A round brilliant, girdle diameter 1 about y = 0, table up.", brilliant())
    write("prism.obj", "An equilateral prism, edges of length 1, standing along y.", prism())
