#!/usr/bin/env python3
"""Denoises a picture with Intel Open Image Denoise, told by its albedo and normals; the result is biased.

    pip install pyoidn OpenEXR numpy
    abbe render SCENE -o noisy.exr --set output.exr.precision=float \\
        --set 'layers=[albedo, normal]'
    tools/denoise.py noisy.exr denoised.exr
"""
import sys

import numpy as np
import OpenEXR
import pyoidn


def layer(channels, name):
    """Three channels side by side, whether the file groups them or not."""
    if name + "RGB" in channels or name + "RGBA" in channels:
        return channels.get(name + "RGB", channels.get(name + "RGBA")).pixels[..., :3]
    for letters in ("RGB", "XYZ"):
        if name + letters[0] in channels:
            return np.stack([channels[name + letter].pixels for letter in letters], axis=-1)
    for key in channels:
        if key.rstrip(".") == name.rstrip("."):
            return channels[key].pixels[..., :3]
    sys.exit(f"{sys.argv[1]}: no layer {name!r}; there are {', '.join(channels)}")


with OpenEXR.File(sys.argv[1]) as file:
    channels = file.channels()
    images = {name: np.ascontiguousarray(layer(channels, prefix), dtype=np.float32)
              for name, prefix in [("color", ""), ("albedo", "albedo."), ("normal", "normal.")]}
output = np.zeros_like(images["color"])
device = pyoidn.Device()
device.commit()
denoise = pyoidn.Filter(device, "RT")
for name, image in (images | {"output": output}).items():
    denoise.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
denoise.set_bool("hdr", True)
denoise.commit()
denoise.execute()
OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": output}).write(sys.argv[2])
