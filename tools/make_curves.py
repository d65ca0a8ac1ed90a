#!/usr/bin/env python3
"""Writes the yarn and the hollow ball of the gallery: configs/curves/knit.txt and configs/curves/ball.vol.

    python3 tools/make_curves.py

The yarn of a plain knit runs x = t/2 + a sin 2t, y = −b cos t and sways by c cos 2t out of the cloth, row over row; three
plies turn about it. The ball is a shell of the gyroid sin x cos y + sin y cos z + sin z cos x = 0 within a sphere, as
signed distances (to first order: value over slope) on a grid. Needs nothing but Python.
"""

import argparse
from math import cos, pi, sin, sqrt
from pathlib import Path
from struct import pack

FOLDER = Path(__file__).resolve().parent.parent / "configs" / "curves"

ROWS, STITCHES = 9, 8
# Control points a stitch, turns of the plies a stitch.
POINTS, TWIST = 22, 2.5
# Distance of the plies from the middle of the yarn, and their radius, where a stitch is π wide.
PLY, RADIUS = 0.175, 0.172
# Between rows, and how high a stitch is: it reaches into the next row.
ROW, HEIGHT = 1.85, 3.05


def yarn(t, row):
    """The middle of the yarn: along the row, out of the cloth, across the rows."""
    return (0.5 * t + 0.62 * sin(2 * t), 0.42 * cos(2 * t), -ROW * row - 0.5 * HEIGHT * (1 - cos(t)))


def normalised(v):
    length = sqrt(sum(x * x for x in v))
    return tuple(x / length for x in v)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def knit():
    lines = []
    scale = 1 / pi
    for row in range(ROWS):
        for ply in range(3):
            for i in range(STITCHES * POINTS + 1):
                t = 2 * pi * i / POINTS
                p = yarn(t, row)
                q = yarn(t + 1e-5, row)
                along = normalised([b - a for a, b in zip(p, q)])
                side = normalised(cross(along, (0, 1, 0)))
                up = cross(side, along)
                angle = TWIST * t + 2 * pi * ply / 3
                at = [p[k] + PLY * (cos(angle) * side[k] + sin(angle) * up[k]) for k in range(3)]
                x, y, z = (c * scale for c in at)
                lines.append(f"{x - STITCHES / 2:.3f} {y:.3f} {z + (ROWS * ROW + HEIGHT - ROW) * scale / 2:.3f} {RADIUS * scale:.4f}")
            lines.append("")
    return "\n".join(lines)


def ball(n=36, waves=2.25, thickness=0.035, radius=0.47):
    k = 2 * pi * waves
    values = []
    grid = [i / (n - 1) - 0.5 for i in range(n)]
    for z in grid:
        for y in grid:
            for x in grid:
                (a, b, c), (d, e, f) = ((sin(k * u) for u in (x, y, z)), (cos(k * u) for u in (x, y, z)))
                value = a * e + b * f + c * d
                slope = k * sqrt((d * e - c * a) ** 2 + (e * f - a * b) ** 2 + (f * d - b * c) ** 2)
                shell = abs(value) / max(slope, 0.5 * k) - thickness
                values.append(max(shell, sqrt(x * x + y * y + z * z) - radius))
    header = b"VOL\x03" + pack("<5i", 1, n, n, n, 1) + pack("<6f", 0, 0, 0, 1, 1, 1)
    return header + pack(f"<{n**3}f", *values)


argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
FOLDER.mkdir(exist_ok=True)
(FOLDER / "knit.txt").write_text(knit())
(FOLDER / "ball.vol").write_bytes(ball())
