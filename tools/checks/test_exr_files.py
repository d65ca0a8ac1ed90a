"""OpenEXR files that Abbe writes, read back by the official library and by OpenImageIO."""

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest
from check_exr import check

# What the Color Interop Forum's list and the standards say of each space that a file may be in.
COLOURS = {
    "rec709": ("lin_rec709_scene", [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290]),
    "acescg": ("lin_ap1_scene", [0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767]),
    "aces2065-1": ("lin_ap0_scene", [0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767]),
    "rec2020": ("lin_rec2020_scene", [0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290]),
    "p3": ("lin_p3d65_scene", [0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290]),
}


def official(path):
    """Channels by name and the header, by the official library."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: c.pixels.copy() for name, c in file.channels().items()}, dict(file.header())


def specification(path):
    """What OpenImageIO makes of the header."""
    file = oiio.ImageInput.open(str(path))
    assert file, oiio.geterror()
    spec = file.spec()
    file.close()
    return spec


def flat(x):
    """A vector-like attribute as a list of numbers, whatever type the binding gives it."""
    return [float(v) for v in np.ravel(np.array(x, dtype=object).tolist())]


@pytest.mark.parametrize("precision", ["half", "float"])
@pytest.mark.parametrize("compression", ["none", "zips", "zip", "piz"])
def test_both_readers_see_the_same_pixels(render, precision, compression):
    exr = {"precision": precision, "compression": compression, "stderr": True}
    path = render("same", output={"exr": exr})
    assert check(str(path)) == []
    ours, header = official(path)
    assert set(ours) >= {"R", "G", "B", "A", "stderr.R", "stderr.G", "stderr.B"}
    for name, pixels in ours.items():
        assert pixels.dtype == (np.float16 if precision == "half" and name in "RGBA" else np.float32), name
        assert pixels.shape == (30, 40), name
        assert np.isfinite(pixels).all(), name
    assert header["compression"] == getattr(
        OpenEXR, f"{'NO' if compression == 'none' else compression.upper()}_COMPRESSION"
    )
    assert ours["R"].max() > 0 and (ours["stderr.G"] > 0).any()


def test_compression_and_layout_do_not_change_a_pixel(render):
    reference, _ = official(render("zips", output={"exr": {"precision": "float"}}))
    for compression in ["none", "zip", "piz"]:
        exr = {"precision": "float", "compression": compression}
        pixels, _ = official(render(compression, output={"exr": exr}))
        assert all(np.array_equal(pixels[c], reference[c]) for c in "RGBA"), compression


def test_half_is_the_float_picture_rounded(render):
    float_, _ = official(render("float", output={"exr": {"precision": "float"}}))
    half, _ = official(render("half", output={"exr": {"precision": "half"}}))
    for c in "RGBA":
        assert np.array_equal(half[c], float_[c].astype(np.float16)), c


@pytest.mark.parametrize("colour", COLOURS)
def test_the_header_says_what_the_numbers_mean(render, colour):
    interop_id, chromaticities = COLOURS[colour]
    path = render("colour", output={"colour": colour})
    _, header = official(path)
    spec = specification(path)
    assert header["colorInteropID"] == interop_id
    assert spec.getattribute("colorInteropID") == interop_id
    # Attributes hold single floats: 2^-24 relative.
    assert np.allclose(flat(header["chromaticities"]), chromaticities, rtol=2**-23, atol=0)
    assert np.allclose(spec.getattribute("chromaticities"), chromaticities, rtol=2**-23, atol=0)
    assert check(str(path)) == []


def test_xyz_is_declared_consistently(render):
    assert check(str(render("xyz", output={"colour": "xyz"}))) == []


def test_spaces_differ_by_their_matrix_alone(render):
    """Pixels of another space are the Rec. 709 pixels times the matrix between the declared primaries.

    Only spaces with the same white: others are adapted, by a method that the file does not name.
    """

    def to_xyz(c):
        """SMPTE RP 177: columns are the primaries, scaled such that (1, 1, 1) is the white at Y = 1."""
        xy = np.array(c).reshape(4, 2)
        m = np.stack([xy[:3, 0], xy[:3, 1], 1 - xy[:3].sum(1)])
        x, y = xy[3]
        return m * np.linalg.solve(m, np.array([x / y, 1, (1 - x - y) / y]))

    exr = {"precision": "float"}
    base, _ = official(render("rec709", output={"exr": exr}))
    rgb = np.stack([base[c] for c in "RGB"], -1).astype(float)
    for colour in ["rec2020", "p3"]:
        pixels, _ = official(render(colour, output={"exr": exr, "colour": colour}))
        matrix = np.linalg.inv(to_xyz(COLOURS[colour][1])) @ to_xyz(COLOURS["rec709"][1])
        found = np.stack([pixels[c] for c in "RGB"], -1)
        # Three products and two sums of singles, and the rounding of both pictures: 8 halves of an ulp of the
        # largest term.
        bound = 8 * 2**-24 * np.abs(rgb).max(-1, keepdims=True) * np.abs(matrix).sum(-1).max()
        assert (np.abs(found - rgb @ matrix.T) <= bound).all(), colour


def test_a_crop_holds_its_part_of_the_frame_and_says_which(render):
    exr = {"precision": "float"}
    whole, _ = official(render("whole", output={"exr": exr}))
    image = {"width": 40, "height": 30, "crop": {"x": 7, "y": 5, "width": 20, "height": 11}}
    path = render("crop", image=image, output={"exr": exr})
    assert check(str(path)) == []
    part, header = official(path)
    assert flat(header["displayWindow"]) == [0, 0, 39, 29]
    assert flat(header["dataWindow"]) == [7, 5, 26, 15]
    spec = specification(path)
    assert (spec.x, spec.y, spec.width, spec.height) == (7, 5, 20, 11)
    assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, 40, 30)
    for c in "RGBA":
        assert np.array_equal(part[c], whole[c][5:16, 7:27]), c


def test_attributes_are_legible_to_both(render):
    path = render("attributes")
    _, header = official(path)
    spec = specification(path)
    assert "Abbe" in header["software"] or "abbe" in header["software"]
    assert spec.getattribute("Software") == header["software"]
    assert float(header["pixelAspectRatio"]) == 1.0
    # A radiance of one at every wavelength, in cd/m²: 683.002 lm/W times the sum of the CIE's ȳ of 1931, a value a nanometre.
    assert abs(float(np.ravel(header["whiteLuminance"])[0]) / (683.002 * 106.857) - 1) < 1e-5
    standard = {
        "channels",
        "compression",
        "dataWindow",
        "displayWindow",
        "lineOrder",
        "screenWindowCenter",
        "screenWindowWidth",
    }
    assert standard <= set(header)
    texts = {k: v for k, v in header.items() if isinstance(v, str)}
    assert all(value.isprintable() or "\n" in value for value in texts.values()), texts


def test_the_same_scene_gives_the_same_file_but_for_what_a_clock_says(render):
    a, header_a = official(render("same", "--threads", 1))
    b, header_b = official(render("same", "--threads", 2))
    assert a.keys() == b.keys() and all(np.array_equal(a[c], b[c]) for c in a)
    assert list(header_a) == list(header_b)
    # Channels have been looked at.
    differing = {name for name in header_a if name != "channels" and str(header_a[name]) != str(header_b[name])}
    assert differing <= {"abbe/renderSeconds", "abbe/secondsToHalveError"}
