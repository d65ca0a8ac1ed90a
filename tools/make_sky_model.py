#!/usr/bin/env python3
"""Writes src/scene/daylight/hosek_wilkie.f32: the coefficients of the sky and the sun of Hošek and Wilkie.

    target/venv/bin/python tools/make_sky_model.py

Hošek and Wilkie 2012, "An Analytic Model for Full Spectral Sky-Dome Radiance", and 2013, "Adding a Solar-Radiance
Function to the Hošek-Wilkie Skylight Model": fits, of which only the numbers are kept.  They are taken from the file of
tensors that the Python package `mitsuba` has them in; LICENSE beside the result is that of the numbers.  Little-endian
f32, one array after the other:

* sky: [turbidity 1 to 10][albedo 0, 1][6 control points][11 bands][9]
* radiance of the sky, W m^-2 sr^-1 nm^-1: [10][2][6][11]
* radiance of the sun's middle: [10][45 pieces of elevation][11][powers 0 to 3 of the elevation within the piece]
* what is left of it toward the edge: [11][powers 0 to 5 of the cosine]

Bands are at 320, 360, ... 720 nm.
"""
import argparse
import importlib.util
import pathlib
import struct

HERE = pathlib.Path(__file__).resolve().parent.parent
FIELDS = {
    "sky_params_spec": (10, 2, 6, 11, 9),
    "sky_rad_spec": (10, 2, 6, 11),
    "sun_rad_spec": (10, 45, 11, 4),
    "sun_ld_spec": (11, 6),
}
DOUBLE = 11


def fields(raw):
    """The arrays of a file of tensors, by name."""
    import numpy

    assert raw.startswith(b"tensor_file\0"), "not a file of tensors"
    (count,), at = struct.unpack_from("<I", raw, 14), 18
    found = {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", raw, at)
        name = raw[at + 2 : at + 2 + length].decode()
        at += 2 + length
        rank, kind, start = struct.unpack_from("<HBQ", raw, at)
        at += 11
        shape = struct.unpack_from(f"<{rank}Q", raw, at)
        at += 8 * rank
        if kind == DOUBLE:
            size = int(numpy.prod(shape))
            found[name] = numpy.frombuffer(raw, "<f8", size, start).reshape(shape)
    return found


def main():
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    package = pathlib.Path(importlib.util.find_spec("mitsuba").origin).parent
    found = fields((package / "data/sunsky/sunsky_datasets.bin").read_bytes())
    parts = []
    for name, shape in FIELDS.items():
        assert found[name].shape == shape, f"{name}: expected {shape}, found {found[name].shape}"
        parts.append(found[name].astype("<f4").tobytes())
    out = HERE / "src/scene/daylight/hosek_wilkie.f32"
    out.write_bytes(b"".join(parts))
    print(f"{out}: {out.stat().st_size} bytes")


main()
