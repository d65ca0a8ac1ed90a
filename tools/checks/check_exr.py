#!/usr/bin/env python3
"""Reads OpenEXR files with the official library and with OpenImageIO and holds them against each other.

usage: check_exr.py FILE.exr...        (pip install OpenEXR OpenImageIO numpy)

Checks, for each file: both readers open it; windows, channel names and every sample agree bit for bit; colour
attributes are consistent (OpenEXR.checkColorMetadata, the Color Interop Forum's rules); RGB has a colorInteropID with
chromaticities; text is UTF-8; the file's attributes are sorted by name. Exit code 0 if all pass, 1 otherwise.
"""
import struct
import sys

import numpy as np
import OpenEXR
import OpenImageIO as oiio


def attribute_names(path):
    """The names of the attributes in the order in which they stand in the file."""
    with open(path, "rb") as f:
        data = f.read(1 << 20)
    assert data[:4] == b"\x76\x2f\x31\x01", "magic number"
    at, names = 8, []
    while data[at]:
        end = data.index(0, at)
        names.append(data[at:end])
        at = data.index(0, end + 1) + 1
        at += 4 + struct.unpack_from("<i", data, at)[0]
    return names


def check(path):
    faults = []

    def expect(condition, what):
        if not condition:
            faults.append(what)

    # Not `with`: leaving it empties the header.
    file = OpenEXR.File(path, separate_channels=True)
    header = file.header()
    channels = {name: np.array(c.pixels) for name, c in file.channels().items()}
    expect(OpenEXR.checkColorMetadata(header) == 0, "checkColorMetadata finds the colour attributes inconsistent")
    (x0, y0), (x1, y1) = header["dataWindow"]
    shape = (y1 - y0 + 1, x1 - x0 + 1)

    image = oiio.ImageInput.open(path)
    if image is None:
        return faults + ["OpenImageIO: " + oiio.geterror()]
    spec = image.spec()
    expect((spec.x, spec.y, spec.width, spec.height) == (x0, y0, shape[1], shape[0]), "data windows differ")
    (fx0, fy0), (fx1, fy1) = header["displayWindow"]
    full = (spec.full_x, spec.full_y, spec.full_x + spec.full_width - 1, spec.full_y + spec.full_height - 1)
    expect(full == (fx0, fy0, fx1, fy1), "display windows differ")
    expect(sorted(spec.channelnames) == sorted(channels), f"channels differ: {spec.channelnames} {sorted(channels)}")
    pixels = image.read_image(oiio.FLOAT).reshape(shape + (spec.nchannels,))
    for k, name in enumerate(spec.channelnames):
        own = channels[name]
        if own.dtype == np.uint32:
            # OpenImageIO scales integers to [0, 1] when asked for floats: read them as they are.
            raw = image.read_image(0, 0, k, k + 1, oiio.UINT).reshape(shape)
            expect(np.array_equal(raw, own), f"{name}: integers differ")
            continue
        wide = own.astype(np.float32)
        expect(np.array_equal(wide.view(np.uint32), np.ascontiguousarray(pixels[..., k]).view(np.uint32))
               or np.array_equal(wide, pixels[..., k], equal_nan=True), f"{name}: samples differ")
    image.close()

    interop = header.get("colorInteropID")
    if {"R", "G", "B"} <= set(channels):
        expect(interop not in (None, "data"), "RGB without a colorInteropID")
        expect("chromaticities" in header, "RGB without chromaticities")
    names = attribute_names(path)
    expect(names == sorted(names), "attributes are not sorted by name")
    for name in names:
        name.decode("utf-8")
    for value in header.values():
        if isinstance(value, bytes):
            value.decode("utf-8")
    print(f"{path}: {shape[1]}x{shape[0]} at ({x0}, {y0}), {len(channels)} channels, {header['compression']}, {interop}: "
          + ("ok" if not faults else "; ".join(faults)))
    return faults


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sys.exit(1 if any([check(path) for path in sys.argv[1:]]) else 0)
