"""Makes the small grids of the cross-validation scenes, in Mitsuba's .vol format (see src/scene/grid.rs).

    python tools/make_volumes.py

Writes tools/cross_validate/mitsuba/assets/{puff,colours,mix}.vol. Needs nothing but Python; the numbers are closed
forms, so the files are the same everywhere.
"""

import argparse
import math
import struct
from pathlib import Path

ASSETS = Path(__file__).resolve().parent / "cross_validate" / "mitsuba" / "assets"


def write(path: Path, size: tuple, box: tuple, voxel) -> None:
    """`voxel(x, y, z)`, in [0, 1] at voxel centres, gives the channels."""
    nx, ny, nz = size
    rows = [
        voxel((x + 0.5) / nx, (y + 0.5) / ny, (z + 0.5) / nz) for z in range(nz) for y in range(ny) for x in range(nx)
    ]
    header = b"VOL\x03" + struct.pack("<5i6f", 1, nx, ny, nz, len(rows[0]), *box)
    path.write_bytes(header + b"".join(struct.pack(f"<{len(row)}f", *row) for row in rows))


def puff(x: float, y: float, z: float) -> list:
    """A lopsided ball with an empty corner."""
    r = math.dist((x, y, z), (0.45, 0.4, 0.55))
    return [max(0.0, 1.0 - 2.2 * r) * (1.0 + 0.5 * math.sin(9 * x) * math.sin(7 * y + 2 * z))]


def colours(x: float, y: float, z: float) -> list:
    """Muted colours in waves."""
    wave = lambda t: 0.5 + 0.35 * math.sin(t)
    return [wave(5 * x + 1), wave(4 * y + 3 * z), wave(6 * z - 2 * x)]


def mix(x: float, _y: float, _z: float) -> list:
    """From 0 to 1 along x."""
    return [x]


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    write(ASSETS / "puff.vol", (9, 10, 8), (-1, -1, -1, 1, 1, 1), puff)
    write(ASSETS / "colours.vol", (6, 5, 6), (0, 0, 0, 1, 1, 1), colours)
    write(ASSETS / "mix.vol", (4, 2, 2), (0, 0, 0, 1, 1, 1), mix)


if __name__ == "__main__":
    main()
