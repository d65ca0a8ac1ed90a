"""PNG files that Abbe writes, read by OpenImageIO."""

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest


def read(path):
    file = oiio.ImageInput.open(str(path))
    assert file, oiio.geterror()
    spec, pixels = file.spec(), file.read_image("uint8")
    assert pixels is not None, file.geterror()
    file.close()
    return np.asarray(pixels), spec


@pytest.mark.parametrize("tonemap", ["aces", "agx", "reinhard", "none"])
def test_the_picture_is_legible_and_not_flat(render, tonemap):
    exr = render("shown", output={"png": {"tonemap": tonemap, "exposure": 0}})
    pixels, spec = read(exr.with_suffix(".png"))
    assert spec.format == "uint8" and pixels.shape[:2] == (30, 40) and spec.nchannels in (3, 4)
    grey = pixels[..., :3].astype(float).mean(-1)
    assert grey.std() > 5 and 20 < grey.mean() < 240


def test_one_stop_more_is_brighter(render):
    means = []
    for exposure in [-1, 0, 1]:
        exr = render(f"stop{exposure}", output={"png": {"tonemap": "none", "exposure": exposure}})
        means.append(read(exr.with_suffix(".png"))[0][..., :3].mean())
    assert means[0] < means[1] < means[2]


def test_without_a_tone_curve_it_is_the_exr_in_srgb(render):
    exr = render("plain", output={"png": {"tonemap": "none", "exposure": 0}, "exr": {"precision": "float"}})
    with OpenEXR.File(str(exr), separate_channels=True) as file:
        linear = np.stack([file.channels()[c].pixels for c in "RGB"], -1).clip(0, 1).astype(float)
    # IEC 61966-2-1.
    coded = 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    pixels = read(exr.with_suffix(".png"))[0][..., :3].astype(float)
    # Dithering chooses one of the two codes around the value.
    assert (np.abs(pixels - coded) <= 1 + 1e-3).all()
    # And right on average: the error of one pixel is below one code, so is the standard deviation.
    assert abs((pixels - coded).mean()) < 4 / np.sqrt(pixels.size)
