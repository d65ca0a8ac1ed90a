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


def attributes(path):
    file = oiio.ImageInput.open(str(path))
    spec = file.spec()
    file.close()
    return spec


def linear(path):
    """Display light of the picture, from sixteen bits."""
    file = oiio.ImageInput.open(str(path))
    coded = np.asarray(file.read_image("uint16"), dtype=float)[..., :3] / 65535
    file.close()
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def test_the_file_says_for_which_display_it_is(render):
    """Both displays show the same light, each in its primaries, where the picture is within both."""
    png = {"tonemap": "none", "bits": 16, "dither": "none", "exposure": -2}
    srgb = render("srgb", output={"png": png}).with_suffix(".png")
    p3 = render("p3", output={"png": {**png, "space": "display_p3"}}).with_suffix(".png")
    spec = attributes(p3)
    assert list(spec.getattribute("CICP")) == [12, 13, 0, 1]
    assert spec.getattribute("ICCProfile:profile_description") == "Display P3"
    assert spec.format == "uint16"
    assert attributes(srgb).getattribute("ICCProfile") is None
    # SMPTE EG 432-1 with the white D65, from Rec. 709.
    p3_from_rec709 = np.array([[0.8225, 0.1774, 0.0], [0.0332, 0.9669, 0.0], [0.0171, 0.0724, 0.9108]])
    shown, expected = linear(p3), linear(srgb) @ p3_from_rec709.T
    inside = (linear(srgb) > 1e-4).all(-1) & (linear(srgb) < 0.999).all(-1)
    assert inside.mean() > 0.5
    assert np.abs(shown - expected)[inside].max() < 5e-4


def test_a_metered_picture_is_shown_in_middle_grey(render):
    """Whatever the light: a lamp of sixteen times the power gives the same picture, four stops lower."""
    light = [{"constant": {"radiance": 0.4}}, {"point": {"position": [2, 4, 3], "intensity": {"rgb": [20, 16, 12]}}}]
    more = [{"constant": {"radiance": 6.4}}, {"point": {"position": [2, 4, 3], "intensity": {"rgb": [320, 256, 192]}}}]
    stops, pictures = [], []
    for name, lights in [("dim", light), ("bright", more)]:
        png = render(name, lights=lights, output={"png": {"exposure": "auto", "bits": 16}}).with_suffix(".png")
        text = attributes(png).getattribute("abbe/exposure")
        assert text.endswith(" stops, metered"), text
        stops.append(float(text.split()[0]))
        pictures.append(linear(png))
    assert abs(stops[0] - stops[1] - 4) < 0.02
    assert np.abs(pictures[0] - pictures[1]).max() < 0.02
    y = pictures[0] @ [0.2126, 0.7152, 0.0722]
    y = np.sort(y[y > 0])
    middle = y[int(0.2 * len(y)) : int(0.98 * len(y))]
    assert 0.15 < np.exp(np.log(middle).mean()) < 0.21


def test_a_white_wall_is_white_under_its_lamp(render):
    """Under a tungsten lamp a grey floor is orange, balanced it is grey: by name, by the lamps, or by temperature."""
    floor = {
        "rectangle": {
            "corner": [-9, 0, 9],
            "edge_u": [18, 0, 0],
            "edge_v": [0, 0, -18],
            "material": {"diffuse": {"reflectance": 0.5}},
        }
    }
    lights = [{"constant": {"radiance": {"illuminant": "A"}}}]
    casts = {}
    for name, white in [("not", "none"), ("named", {"illuminant": "A"}), ("auto", "auto"), ("kelvin", 2856)]:
        png = {"tonemap": "none", "bits": 16, "exposure": -2, "white_balance": white}
        exr = render(name, shapes=[floor], lights=lights, output={"png": png})
        r, _, b = linear(exr.with_suffix(".png"))[20:].mean((0, 1))
        casts[name] = r / b
    assert casts["not"] > 4
    assert all(abs(casts[name] - 1) < 0.03 for name in ["named", "auto", "kelvin"]), casts
