#!/usr/bin/env python3
"""Denoises a picture with Intel Open Image Denoise, told by its albedo and normals; the result is biased.

    pip install pyoidn OpenEXR numpy
    abbe render SCENE -o noisy.exr --set output.exr.precision=float \\
        --set 'layers=[albedo, normal]'
    tools/denoise.py noisy.exr denoised.exr

What is written has the windows, the colours and the alpha of what was read: R, G, B, or X, Y, Z, or Y.
"""
import argparse
import sys

# Before what has to be installed, which who asks for help need not have.
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("noisy", help="the picture, EXR")
parser.add_argument("denoised", help="where the result is written, EXR")
arguments = parser.parse_args()

import numpy as np  # noqa: E402
import OpenEXR  # noqa: E402
import pyoidn  # noqa: E402

# What the denoised file has of its own; `abbe/...` speaks of the pixels that were rendered.
OWN = {"acesImageContainerFlag", "channels", "chunkCount", "compression", "dwaCompressionLevel", "lineOrder", "name", "type"}


def letters(channels, layer, choices):
    """Names of the channels of a layer."""
    for choice in choices:
        if all(layer + letter in channels for letter in choice):
            return [layer + letter for letter in choice]
    expected = " or ".join(", ".join(layer + letter for letter in choice) for choice in choices)
    sys.exit(f"{arguments.noisy}: expected channels {expected}; found {', '.join(channels)}")


with OpenEXR.File(arguments.noisy, separate_channels=True) as file:
    parts = [(dict(part.header), {name: channel.pixels for name, channel in part.channels.items()}) for part in file.parts]
channels = {name: pixels for _, part in reversed(parts) for name, pixels in part.items()}
names = {
    "color": letters(channels, "", ["RGB", "XYZ", "Y"]),
    "albedo": letters(channels, "albedo.", ["RGB", "XYZ"]),
    "normal": letters(channels, "normal.", ["XYZ"]),
}
# Of luminance alone all three numbers are one.
images = {
    image: np.stack([channels[name] for name in (own if len(own) == 3 else own * 3)], axis=-1).astype(np.float32)
    for image, own in names.items()
}
output = np.zeros_like(images["color"])
device = pyoidn.Device()
device.commit()
denoise = pyoidn.Filter(device, "RT")
for name, image in (images | {"output": output}).items():
    denoise.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
denoise.set_bool("hdr", True)
denoise.commit()
denoise.execute()

picture = next(header for header, part in parts if names["color"][0] in part)
header = {name: value for name, value in picture.items() if name not in OWN and not name.startswith(("abbe/", "cryptomatte/"))}
header |= {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
written = {name: np.ascontiguousarray(output[..., i]) for i, name in enumerate(names["color"])}
if "A" in channels:
    written["A"] = channels["A"]
OpenEXR.File(header, written).write(arguments.denoised)
