#!/usr/bin/env python3
"""Writes src/description/mitsuba/data/conductors.txt: the optical constants that Mitsuba 3 goes by for each name.

    target/venv/bin/python tools/make_conductors.py

Reads the tables that come with the package mitsuba (data/ior/NAME.eta.spd, NAME.k.spd), which are measurements
collected in the luxpop.com database (those whose name ends in _palik are from Palik's Handbook of Optical Constants of
Solids). Kept are the samples within 360 to 830 nm and the next one beyond each end, so that linear interpolation gives the
same numbers.
"""
import argparse
from pathlib import Path

BAND = (360.0, 830.0)
OUT = Path(__file__).resolve().parents[1] / "src/description/mitsuba/data/conductors.txt"


def table(path):
    rows = [line.split() for line in path.read_text().splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return [(float(nm), float(value)) for nm, value in rows]


def cut(pairs):
    first = max((i for i, (nm, _) in enumerate(pairs) if nm <= BAND[0]), default=0)
    last = min((i for i, (nm, _) in enumerate(pairs) if nm >= BAND[1]), default=len(pairs) - 1)
    return pairs[first : last + 1]


def main():
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    import mitsuba

    folder = Path(mitsuba.__file__).parent / "data" / "ior"
    lines = [
        f"# Optical constants by the names of Mitsuba {mitsuba.__version__}: measurements of the luxpop.com database, and of",
        "# Palik's Handbook of Optical Constants of Solids where the name ends in _palik. Written by tools/make_conductors.py.",
        "# A name, then a line for the real part of the index and one for the imaginary part: nm:value, linear between, zero",
        "# outside. Band: 360 to 830 nm and one sample beyond each end.",
    ]
    for eta in sorted(folder.glob("*.eta.spd")):
        name = eta.name.removesuffix(".eta.spd")
        parts = [cut(table(folder / f"{name}.{part}.spd")) for part in ("eta", "k")]
        if any(len(part) < 2 or part[-1][0] < BAND[0] or part[0][0] > BAND[1] for part in parts):
            continue
        lines.append(name)
        lines += [" ".join(f"{nm:.7g}:{value:.7g}" for nm, value in part) for part in parts]
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text("\n".join(lines) + "\n")
    print(f"{OUT}: {OUT.stat().st_size} bytes, {(len(lines) - 4) // 3} conductors")


main()
