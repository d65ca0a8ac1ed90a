"""Makes configs/volumes/cloud.vol: the density of a small cumulus, for configs/scenes/cloud.yaml.

    python tools/make_cloud.py

A heap of balls with a flat base, worn at the edges by five octaves of value noise. Needs nothing but Python; the noise is
a hash, so the file is the same everywhere. Format: src/scene/grid.rs.
"""

import argparse
import math
import struct
from pathlib import Path

SIZE = (44, 26, 36)
BALLS = [
    ((0.30, 0.30, 0.50), 0.19),
    ((0.47, 0.40, 0.45), 0.27),
    ((0.62, 0.30, 0.55), 0.22),
    ((0.76, 0.26, 0.48), 0.15),
    ((0.52, 0.60, 0.50), 0.20),
    ((0.40, 0.28, 0.62), 0.20),
    ((0.18, 0.24, 0.46), 0.11),
]


def hashed(x: int, y: int, z: int) -> float:
    """A number in [0, 1) for each point of the lattice."""
    h = (x * 0x8DA6B343 ^ y * 0xD8163841 ^ z * 0xCB1AB31F) & 0xFFFFFFFF
    h = (h ^ h >> 15) * 0x2C1B3C6D & 0xFFFFFFFF
    h = (h ^ h >> 12) * 0x297A2D39 & 0xFFFFFFFF
    return (h ^ h >> 15) / 2**32


def noise(x: float, y: float, z: float) -> float:
    """Value noise in [0, 1), smooth between the points of the lattice."""
    cells = [math.floor(v) for v in (x, y, z)]
    sx, sy, sz = ((f * f * (3 - 2 * f)) for f in (v - c for v, c in zip((x, y, z), cells)))
    total = 0.0
    for dz in (0, 1):
        for dy in (0, 1):
            for dx in (0, 1):
                weight = (sx if dx else 1 - sx) * (sy if dy else 1 - sy) * (sz if dz else 1 - sz)
                total += weight * hashed(cells[0] + dx, cells[1] + dy, cells[2] + dz)
    return total


def density(x: float, y: float, z: float) -> float:
    """In [0, 1] for a point of the unit cube."""
    turbulence = sum(noise(5 * 2**k * x, 5 * 2**k * y + 7, 5 * 2**k * z) / 2**k for k in range(4)) / 1.875
    # Signed distance to the heap, in units of the cube; the grid is twice as wide as high.
    heap = min(math.dist((x, 0.6 * y, 0.8 * z), (c[0], 0.6 * c[1], 0.8 * c[2])) - r for c, r in BALLS)
    worn = heap + 0.30 * (turbulence - 0.42)
    inside = min(1.0, max(0.0, -worn / 0.07))
    base = min(1.0, max(0.0, (y - 0.12) / 0.08))
    return inside * base


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    nx, ny, nz = SIZE
    values = [
        density((x + 0.5) / nx, (y + 0.5) / ny, (z + 0.5) / nz) for z in range(nz) for y in range(ny) for x in range(nx)
    ]
    path = Path(__file__).resolve().parent.parent / "configs" / "volumes" / "cloud.vol"
    path.parent.mkdir(exist_ok=True)
    header = b"VOL\x03" + struct.pack("<5i6f", 1, nx, ny, nz, 1, 0, 0, 0, 1, 1, 1)
    path.write_bytes(header + struct.pack(f"<{len(values)}f", *values))


if __name__ == "__main__":
    main()
