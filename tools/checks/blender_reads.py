#!/usr/bin/env python3
"""OpenEXR files that Abbe writes, read by Blender itself (the package bpy): finite pixels, the means of each channel to 1e-6, and
the colour space by its name.

usage: blender_reads.py BINARY          (pip install bpy; Python 3.11)

The last line is `N passed in S s`; the exit code is 1 at the first file that Blender reads otherwise.
"""
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

SCENE = {
    "camera": {"origin": [0, 1.5, 5], "target": [0, 0.8, 0], "fov_deg": 36},
    "image": {"width": 40, "height": 30},
    "shapes": [
        {"plane": {"normal": [0, 1, 0], "material": {"diffuse": {"reflectance": {"rgb": [0.2, 0.5, 0.7]}}}}},
        {"sphere": {"center": [0, 0.8, 0], "radius": 0.8, "material": {"dielectric": {"ior": 1.5}}}},
    ],
    "lights": [{"constant": {"radiance": 0.4}}, {"point": {"position": [2, 4, 3], "intensity": 20}}],
}
# What Blender calls the spaces that it knows by colorInteropID.
SPACES = {"rec709": "Linear Rec.709", "acescg": "ACEScg", "aces2065-1": "ACES2065-1", "rec2020": "Linear Rec.2020"}


def pixels(path):
    """Pixels from the top, and the name of the colour space."""
    image = bpy.data.images.load(str(path))
    space = image.colorspace_settings.name
    image.colorspace_settings.name = "Non-Color"
    found = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(found)
    return found.reshape(image.size[1], image.size[0], image.channels)[::-1], space


def main(binary):
    start, passed = time.time(), 0
    with tempfile.TemporaryDirectory() as folder:
        for precision in ["half", "float"]:
            for compression in ["none", "zips", "zip", "piz"]:
                for colour, space in SPACES.items():
                    exr = {"precision": precision, "compression": compression}
                    scene = Path(folder) / "scene.yaml"
                    scene.write_text(json.dumps({**SCENE, "output": {"colour": colour, "exr": exr}}))
                    out = Path(folder) / f"{passed}.exr"
                    subprocess.run([binary, "render", scene, "-o", out, "--spp", "4", "-q"], check=True)
                    said = subprocess.run([binary, "info", "--json", out], check=True, capture_output=True, text=True)
                    found, name = pixels(out)
                    if name != space:
                        sys.exit(f"{precision} {compression} {colour}: expected the space {space}, found {name}")
                    # What the file holds, by its own account: means of the channels.
                    described = json.loads(said.stdout)
                    if not np.isfinite(found).all() or found.shape != (30, 40, 4):
                        sys.exit(f"{precision} {compression} {colour}: {found.shape}")
                    for i, channel in enumerate("RGBA"):
                        expected = mean_of(described, channel)
                        if abs(found[..., i].astype(np.float64).mean() - expected) > 1e-6 * max(1, expected):
                            sys.exit(f"{precision} {compression} {colour} {channel}: {found[..., i].mean()}, not {expected}")
                    passed += 1
    print(f"{passed} passed in {time.time() - start:.1f}s")


def mean_of(described, channel):
    """The mean of a channel, wherever in the description it stands."""
    if isinstance(described, dict):
        if described.get("name") == channel and "mean" in described:
            return described["mean"]
        described = list(described.values())
    if isinstance(described, list):
        for inner in described:
            found = mean_of(inner, channel)
            if found is not None:
                return found
    return None


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
