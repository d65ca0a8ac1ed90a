"""Layers, mattes and spectral files, read by programs that are not Abbe's."""

import json
import subprocess
import sys
from pathlib import Path

import colour
import cryptomatte_api
import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest
from check_exr import check
from test_exr_files import flat, official, specification

COMPONENTS = ["emission", "caustic", "diffuse", "glossy", "transmission", "media"]
LAYERS = ["Z", "P", "uv", "normal", "albedo", "variance", "stderr", "sampleCount", *COMPONENTS]


@pytest.mark.parametrize("precision", ["half", "float"])
def test_layers_are_read_and_add_up(render, precision):
    path = render("layers", layers=LAYERS, output={"exr": {"precision": precision}})
    assert check(str(path)) == []
    channels, _ = official(path)
    assert channels["sampleCount"].dtype == np.uint32 and (channels["sampleCount"] == 8).all()
    for name in ["Z", "P.X", "uv.U", "normal.Z", "stderr.R", "variance.B"]:
        assert channels[name].dtype == np.float32, name
    for c in "RGB":
        parts = [channels[f"{layer}.{c}"] for layer in COMPONENTS]
        light = np.float16 if precision == "half" else np.float32
        assert all(part.dtype == light for part in parts)
        total = sum(part.astype(np.float64) for part in parts)
        # A half is off by half a unit in the last of its 11 bits, 2^-11 of it at most; floats by sixteen roundings of
        # the colours on their way (tests/compositing). The smallest step of a half is 2^-24.
        size = sum(np.abs(part.astype(np.float64)) for part in parts) + np.abs(channels[c].astype(np.float64))
        colours = sum(np.abs(channels[k].astype(np.float64)) for k in "RGB")
        bound = size * 2.0**-11 + 7 * 2.0**-25 if precision == "half" else 0
        assert (np.abs(total - channels[c]) <= bound + 16 * colours * 2.0**-24).all(), c


MATTES = ["crypto_object", "crypto_material", "crypto_asset"]


def test_mattes_are_decoded(render):
    path = render("mattes", layers=MATTES, assets={"balls": ["sphere1", "sphere2"]})
    mattes = {matte.metadata().name(): matte for matte in cryptomatte_api.Cryptomatte.load(str(path))}
    assert set(mattes) == {"CryptoObject", "CryptoMaterial", "CryptoAsset"}
    objects = mattes["CryptoObject"].masks()
    assert {"rectangle0", "sphere1", "sphere2"} <= set(objects)
    alpha = official(path)[0]["A"].astype(np.float32)
    total = sum(np.asarray(mask).reshape(alpha.shape) for mask in objects.values())
    assert np.abs(total - alpha).max() <= 2.0**-11, "coverage of all objects is that of the picture"
    balls = np.asarray(mattes["CryptoAsset"].mask("balls")).reshape(alpha.shape)
    assert np.allclose(balls, sum(np.asarray(objects[n]).reshape(alpha.shape) for n in ["sphere1", "sphere2"]), atol=1e-6)
    assert balls[15, 8] == 1 and balls[0, 0] == 0


def test_mattes_in_parts_have_their_manifests_beside_them(render):
    """The reader above takes the first part alone; what it would need of the others stands in them."""
    single, header = official(render("one", layers=MATTES))
    path = render("parts", layers=MATTES, output={"exr": {"layout": "multipart"}})
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1 + len(MATTES)
        for part in file.parts[1:]:
            assert all(np.array_equal(c.pixels, single[name]) for name, c in part.channels.items())
            own = {name for name in part.header if name.startswith("cryptomatte/")}
            assert len(own) == 4 and [part.header[n] for n in own if n.endswith("/name")] == [part.name()]
            assert all(part.header[name] == header[name] for name in own)


def test_parts_have_the_layers_and_the_same_pixels(render):
    layers = ["Z", "normal", "diffuse", "stderr", "sampleCount"]
    single, _ = official(render("single", layers=layers))
    path = render("several", layers=layers, output={"exr": {"layout": "multipart"}})
    with OpenEXR.File(str(path), separate_channels=True) as file:
        parts = {part.name(): dict(part.channels) for part in file.parts}
        headers = {part.name(): dict(part.header) for part in file.parts}
        pixels = {n: c.pixels.copy() for part in parts.values() for n, c in part.items()}
    assert list(parts)[0] == "rgba" and set(parts) == {"rgba", *layers}
    assert all(np.array_equal(single[name], pixels[name], equal_nan=True) for name in single)
    for name, header in headers.items():
        assert (header["colorInteropID"] == "data") == (name not in ["rgba", "diffuse"]), name
    names = []
    for i in range(len(parts)):
        file = oiio.ImageInput.open(str(path))
        assert file.seek_subimage(i, 0)
        names += file.spec().channelnames
        assert np.isfinite(file.read_image(i, 0, 0, file.spec().nchannels, oiio.FLOAT)).all()
        file.close()
    # OpenImageIO shortens names that begin with the part's own.
    assert len(names) == len(single)


ALBEDO, LIGHT = "albedo", {"name": "light", "light": "path", "form": "xyz"}
BANDS = {"width": 40, "height": 30, "bands": [{"name": "a", "response": 1}, {"name": "b", "response": 2}]}


@pytest.mark.parametrize(
    "channels, layers, image",
    [
        ("xyza", [ALBEDO], None),
        ("luminance_alpha", [ALBEDO], None),
        ("rgba", [LIGHT], None),
        ("rgba", [LIGHT, "Z"], BANDS),
        ("rgba", [LIGHT, ALBEDO, "Z"], BANDS),
    ],
)
def test_all_parts_have_one_set_of_primaries(render, channels, layers, image):
    """No reader opens a file whose parts differ in them."""
    sections = {"layers": layers, **({"image": image} if image else {})}
    exr = {"channels": channels, "precision": "float"}
    single, header = official(render("single", output={"colour": "acescg", "exr": exr}, **sections))
    path = render("parts", output={"colour": "acescg", "exr": {**exr, "layout": "multipart"}}, **sections)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        headers = [dict(part.header) for part in file.parts]
        pixels = {n: c.pixels.copy() for part in file.parts for n, c in part.channels.items()}
    assert set(pixels) == set(single) and all(np.array_equal(single[name], pixels[name]) for name in single)
    rgb = any(name.split(".")[-1] == "R" for name in single)
    expected = [0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767] if rgb else [1, 0, 0, 1, 0, 0, 1 / 3, 1 / 3]
    for part in [header, *headers]:
        assert OpenEXR.checkColorMetadata(part) == 0
        if part.get("colorInteropID") != "data":
            assert np.allclose(flat(part["chromaticities"]), expected, atol=1e-6), part["name"]
    assert "chromaticities" in headers[0]
    file = oiio.ImageInput.open(str(path))
    assert file, oiio.geterror()
    spaces = {}
    for i in range(len(headers)):
        assert file.seek_subimage(i, 0)
        spaces[headers[i]["name"]] = file.spec().get_string_attribute("colorInteropID")
    file.close()
    xyz = ["light"] if channels == "rgba" else ["rgba"]
    assert all(spaces[name] == "lin_ciexyzd65_scene" for name in xyz), spaces
    assert spaces.get("albedo", "lin_ap1_scene") == "lin_ap1_scene" and spaces.get("a", "data") == "data", spaces


@pytest.mark.parametrize("precision", ["half", "float"])
@pytest.mark.parametrize("sensitivity", [1e6, 1e-8])
def test_dwa_takes_no_picture_that_halves_cannot_hold(render, sensitivity, precision):
    image = {"width": 40, "height": 30, "sensitivity": sensitivity}
    exr = {"precision": precision}
    plain, _ = official(render("plain", image=image, output={"exr": {**exr, "compression": "zip"}}))
    path = render("dwa", image=image, output={"exr": {**exr, "compression": "dwaa"}})
    packed, header = official(path)
    assert header["compression"] == OpenEXR.ZIPS_COMPRESSION
    assert all(np.isfinite(packed[c]).all() and np.array_equal(packed[c], plain[c]) for c in "RGBA")
    notes = json.loads((path.parent / "report.json").read_text())["scenes"][0]["notes"]
    assert any("packed as ZIPS in place of DWA" in note for note in notes), notes


@pytest.mark.parametrize("compression", ["dwaa", "dwab"])
def test_dwa_loses_light_only_and_says_how_much(render, compression):
    layers = ["Z", "diffuse"]
    plain, _ = official(render("plain", layers=layers))
    path = render("dwa", layers=layers, output={"exr": {"compression": compression, "layout": "multipart"}})
    with OpenEXR.File(str(path), separate_channels=True) as file:
        pixels = {n: c.pixels.copy() for part in file.parts for n, c in part.channels.items()}
        used = {part.name(): part.header["compression"] for part in file.parts}
    assert np.array_equal(pixels["Z"], plain["Z"])
    assert used["Z"] == OpenEXR.ZIPS_COMPRESSION and used["rgba"] == getattr(OpenEXR, f"{compression.upper()}_COMPRESSION")
    report = json.loads((path.parent / "report.json").read_text())
    note = next(note for note in report["scenes"][0]["notes"] if "DWA" in note)
    most = max(np.abs(pixels[c].astype(float) - plain[c].astype(float)).max() for c in [*"RGBA", "diffuse.R"])
    # The renderer decodes with another library than this one: each rounds to a half once more.
    stated = float(note.split("at most ")[1].split(";")[0])
    assert 0 < most <= stated * 1.05 + 2.0**-10, note


def test_an_aces_container_is_one(render):
    exr = {"aces_container": True, "compression": "none"}
    path = render("aces", output={"colour": "aces2065-1", "exr": exr})
    assert check(str(path)) == []
    _, header = official(path)
    assert header["acesImageContainerFlag"] == 1 and header["colorInteropID"] == "lin_ap0_scene"


def test_attributes_have_their_types(render):
    attributes = {"owner": "us", "timeCode": "01:02:03:04", "expTime": 0.02, "shot": "0010", "take": 123456789, "big": 1e300}
    camera = {"origin": [0, 1.5, 5], "target": [0, 0.8, 0], "fov_deg": 36, "lens": {"radius": 0.01, "focus_distance": 5}}
    path = render("attributes", camera=camera, output={"exr": {"attributes": attributes}})
    _, header = official(path)
    spec = specification(path)
    assert (header["owner"], header["shot"]) == ("us", "0010")
    assert (header["take"], header["big"]) == (123456789, 1e300)
    code = header["timeCode"]
    assert (code.hours, code.minutes, code.seconds, code.frame) == (1, 2, 3, 4)
    # Of 60 frames a second two share a number; the bit of dropped frames stays off.
    _, header = official(render("fast", render={"samples": 4, "frames": 45, "frames_per_second": 60}, output={"exr": {"attributes": attributes}}))
    code = header["timeCode"]
    assert (code.seconds, code.frame, code.fieldPhase, code.dropFrame) == (3, 24, True, False)
    _, header = official(path)
    assert header["expTime"] == pytest.approx(0.02)
    # 36 mm of film seen under 36 degrees.
    focal = 18 / np.tan(np.radians(18))
    assert header["nominalFocalLength"] == pytest.approx(focal, rel=1e-6)
    assert header["aperture"] == pytest.approx(focal / 20, rel=1e-6)
    assert header["focus"] == 5
    assert spec.get_string_attribute("Copyright") == "us" or spec.get_string_attribute("owner") == "us"


def test_overscan_lies_around_the_same_frame(render):
    plain, _ = official(render("frame"))
    path = render("beyond", image={"width": 40, "height": 30, "overscan": 6}, layers=["Z", "crypto_object"])
    assert check(str(path)) == []
    wide, header = official(path)
    assert [tuple(map(int, corner)) for corner in header["dataWindow"]] == [(-6, -6), (45, 35)]
    assert [tuple(map(int, corner)) for corner in header["displayWindow"]] == [(0, 0), (39, 29)]
    for name in "RGBA":
        assert np.array_equal(wide[name][6:-6, 6:-6], plain[name]), name
    assert wide["Z"].shape == (42, 52)


def test_a_shutter_is_said_in_degrees_and_seconds(render):
    camera = {"origin": {1: [0, 1.5, 5], 2: [1, 1.5, 5]}, "target": [0, 0.8, 0], "fov_deg": 36, "shutter": 0.5}
    # The fixture names the file of a still picture.
    moving = {"frames": 1, "frames_per_second": 24}
    path = render("shutter", camera=camera, render=moving)
    _, header = official(path)
    assert header["shutterAngle"] == 180 and header["expTime"] == pytest.approx(1 / 48)
    assert header["imageCounter"] == 1


def test_the_tools_of_openimageio_open_all_of_it(render):
    """oiiotool and idiff of the wheel: the same picture in two compressions has no difference."""
    tools = Path(sys.executable).parent
    layers = ["Z", "diffuse", "crypto_object", "sampleCount"]
    paths = [render(c, layers=layers, output={"exr": {"compression": c, "layout": l}, "spectral": {"bands": 4}})
             for c, l in [("zips", "single"), ("piz", "single"), ("zip", "multipart")]]
    for path in [*paths, paths[0].with_name("zips.spectral.exr")]:
        said = subprocess.run([tools / "oiiotool", "--info", "-v", path], capture_output=True, text=True)
        assert said.returncode == 0 and "40 x   30" in said.stdout and not said.stderr, said.stdout + said.stderr
    said = subprocess.run([tools / "idiff", *paths[:2]], capture_output=True, text=True)
    assert said.returncode == 0 and "PASS" in said.stdout, said.stdout


def test_bands_are_a_file_that_colour_science_reads(render):
    path = render("bands", output={"spectral": {"bands": 12, "from_nm": 400, "to_nm": 700}})
    spectral = path.with_name("bands.spectral.exr")
    assert check(str(spectral)) == []
    components = colour.read_spectral_image_Fichet2021(str(spectral))
    nm, radiance = components["S0"]
    assert np.allclose(nm, 400 + 25 * (np.arange(12) + 0.5))
    assert radiance.shape == (30, 40, 12) and np.isfinite(radiance).all() and (radiance >= 0).all()
    channels, header = official(spectral)
    assert header["spectralLayoutVersion"] == "1.0" and header["emissiveUnits"] == "W.m^-2.sr^-1"
    assert {"R", "G", "B"} <= set(channels)
    # The sky of radiance 0.4 at every wavelength fills the upper corner.
    assert radiance[0].mean() == pytest.approx(0.4, rel=0.02)
    # Of 40 pixels with 8 samples of 8 wavelengths each some 190 are in a band: four standard errors of a count.
    assert radiance[0].mean(axis=0) == pytest.approx(np.full(12, 0.4), rel=4 / np.sqrt(190))
