"""OpenEXR files that others write: read right, or refused with one clear error."""

import json
import subprocess

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

HEIGHT, WIDTH = 20, 32
PIXELS = np.random.default_rng(1).random((HEIGHT, WIDTH, 3)).astype(np.float32)
SMOOTH = np.linspace(0, 1, HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)


def header(**attributes):
    return {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **attributes}


def write(path, head, channels):
    OpenEXR.File(head, channels).write(str(path))
    return path


def told(binary, *paths):
    done = subprocess.run([str(binary), "info", "--json", *map(str, paths)], capture_output=True, text=True)
    return done.returncode, json.loads(done.stdout), done.stderr


def means(answer, part=0):
    layers = answer["exr"]["parts"][part]["layers"]
    return {(la["layer"], c["name"]): c["mean"] for la in layers for c in la["channels"]}


def compare(binary, a, b):
    return subprocess.run([str(binary), "compare", str(a), str(b)], capture_output=True, text=True)


def check_rgb(binary, path, pixels=PIXELS, tolerance=1e-6):
    code, [answer], errors = told(binary, path)
    assert code == 0 and errors == ""
    found = means(answer)
    for i, c in enumerate("RGB"):
        assert abs(found["", c] - pixels[..., i].mean(dtype=float)) < tolerance, c
    return answer["exr"]


def refused(binary, path, words):
    """By whatever reads pixels, in one line and with exit code 3."""
    scene = path.with_suffix(".yaml")
    scene.write_text(
        "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 2, height: 2}\n"
        f"lights: [{{environment: {{file: {path.name}}}}}]\n"
    )
    command = [str(binary), "render", str(scene), "-q", "-o", str(path.parent / "o")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    assert len(done.stderr.splitlines()) == 1 and words in done.stderr and path.name in done.stderr, done.stderr
    done = compare(binary, path, path)
    assert done.returncode == 3 and len(done.stderr.splitlines()) == 1 and words in done.stderr, done.stderr


@pytest.mark.parametrize("name", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24"])
def test_scan_lines_of_each_lossless_compression(binary, tmp_path, name):
    head = header(compression=getattr(OpenEXR, f"{name}_COMPRESSION"))
    # PXR24 keeps 24 bits of a float.
    check_rgb(binary, write(tmp_path / "a.exr", head, {"RGB": PIXELS}), tolerance=1e-5 if name == "PXR24" else 1e-6)


@pytest.mark.parametrize("name", ["B44", "B44A", "DWAA", "DWAB"])
def test_lossy_compressions_are_near(binary, tmp_path, name):
    head = header(compression=getattr(OpenEXR, f"{name}_COMPRESSION"))
    check_rgb(binary, write(tmp_path / "a.exr", head, {"RGB": PIXELS.astype(np.float16)}), tolerance=0.02)


@pytest.mark.parametrize("name", ["HTJ2K256", "HTJ2K32", "ZSTD"])
def test_new_compressions_are_refused(binary, tmp_path, name):
    path = write(tmp_path / "a.exr", header(compression=getattr(OpenEXR, f"{name}_COMPRESSION")), {"RGB": PIXELS})
    refused(binary, path, "is not supported: save it as ZIP first")
    code, [answer], _ = told(binary, path)
    assert code == 0 and "compression" in answer["exr"]["unread"]


def test_tiles_and_their_smaller_levels(binary, tmp_path):
    tiled = header(type=OpenEXR.tiledimage, tiles=OpenEXR.TileDescription())
    assert check_rgb(binary, write(tmp_path / "a.exr", tiled, {"RGB": PIXELS}))["parts"][0]["type"] == "tiledimage"
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, "float")
    buffer = oiio.ImageBuf(spec)
    buffer.set_pixels(oiio.ROI(), PIXELS)
    assert oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, buffer, str(tmp_path / "mip.exr"))
    check_rgb(binary, tmp_path / "mip.exr")


def test_several_parts(binary, tmp_path):
    parts = [
        OpenEXR.Part(header(name="left"), {"RGB": PIXELS}),
        OpenEXR.Part(header(name="depth"), {"Z": SMOOTH}),
    ]
    path = tmp_path / "a.exr"
    OpenEXR.File(parts).write(str(path))
    assert [part["name"] for part in check_rgb(binary, path)["parts"]] == ["left", "depth"]
    _, [answer], _ = told(binary, path)
    assert abs(means(answer, 1)["", "Z"] - SMOOTH.mean(dtype=float)) < 1e-6


def test_windows_anywhere(binary, tmp_path):
    def box(a, b):
        return (np.array(a, "i"), np.array(b, "i"))

    head = header(dataWindow=box([-5, -3], [WIDTH - 6, HEIGHT - 4]), displayWindow=box([0, 0], [19, 9]))
    facts = check_rgb(binary, write(tmp_path / "a.exr", head, {"RGB": PIXELS}))
    assert facts["parts"][0]["window"] == {"x": -5, "y": -3, "width": WIDTH, "height": HEIGHT}
    shown = subprocess.run([str(binary), "info", str(tmp_path / "a.exr")], capture_output=True, text=True).stdout
    assert f"overscan: {WIDTH}x{HEIGHT} at (-5, -3), of a frame of 20x10 at (0, 0)" in shown


def test_deep_pixels_are_refused(binary, tmp_path):
    deep = np.empty((HEIGHT, WIDTH), dtype=object)
    for y in range(HEIGHT):
        for x in range(WIDTH):
            deep[y, x] = np.array([1.0, 2.0], "f") if (x + y) % 2 else None
    head = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    path = write(tmp_path / "a.exr", head, {"Z": OpenEXR.Channel(deep)})
    refused(binary, path, "deep pixels")


def test_luminance_and_thinned_chroma_are_refused(binary, tmp_path):
    """The official package writes thinned channels only if all are: the header is what is looked at, so it is changed."""
    path = write(tmp_path / "a.exr", header(), {"BY": SMOOTH, "RY": SMOOTH, "Y": SMOOTH})
    data = bytearray(path.read_bytes())
    for name in [b"BY\0", b"RY\0"]:
        at = data.index(name, data.index(b"chlist\0")) + len(name) + 8
        data[at : at + 8] = b"\2\0\0\0\2\0\0\0"
    path.write_bytes(data)
    refused(binary, path, "thinned chroma (YC)")
    code, [answer], _ = told(binary, path)
    channels = answer["exr"]["parts"][0]["layers"][0]["channels"]
    assert code == 0 and {c["name"]: c.get("sampling") for c in channels} == {"Y": None, "BY": [2, 2], "RY": [2, 2]}


def test_damaged_files_are_refused(binary, tmp_path):
    good = write(tmp_path / "good.exr", header(), {"RGB": np.stack([SMOOTH] * 3, -1)}).read_bytes()
    path = tmp_path / "a.exr"
    for length in [0, 3, 7, 60, len(good) // 2, len(good) - 1]:
        path.write_bytes(good[:length])
        refused(binary, path, "a.exr")
    broken = bytearray(good)
    middle = len(good) * 3 // 4
    for i in range(middle, middle + 8):
        broken[i] ^= 0x5A
    path.write_bytes(broken)
    refused(binary, path, "not a valid OpenEXR file")
    path.write_text("no picture")
    refused(binary, path, "not a valid OpenEXR file")


def test_what_is_not_finite_is_counted(binary, tmp_path):
    pixels = SMOOTH.copy()
    pixels[0, :3] = np.nan
    pixels[1, :2] = np.inf, -np.inf
    _, [answer], _ = told(binary, write(tmp_path / "a.exr", header(), {"depth.Z": pixels}))
    [layer] = answer["exr"]["parts"][0]["layers"]
    assert layer["layer"] == "depth"
    [channel] = layer["channels"]
    finite = pixels[np.isfinite(pixels)].astype(float)
    assert (channel["nan"], channel["infinite"]) == (3, 2)
    assert np.allclose([channel["min"], channel["max"], channel["mean"]], [finite.min(), finite.max(), finite.mean()])


def test_several_files_and_a_bad_one(binary, render, tmp_path):
    """Files that can be told of are, the others are said, and the exit code is that of an input that is missing."""
    ours = render("ours")
    code, answers, errors = told(binary, ours, tmp_path / "none.exr", ours.with_suffix(".png"))
    assert code == 3 and len(errors.splitlines()) == 1 and "none.exr: there is no such file" in errors
    assert [next(k for k in ("exr", "png", "error") if k in a) for a in answers] == ["exr", "error", "png"]
    exr = answers[0]["exr"]
    assert exr["as_written"] is True
    camera = exr["parts"][0]["camera"]
    assert np.allclose(camera["position"], [0, 1.5, 5], atol=1e-5)
    # fov_deg is across; 40 x 30 pixels.
    expected = [36, 2 * np.degrees(np.arctan(np.tan(np.radians(18)) * 0.75))]
    assert np.allclose(camera["fov_deg"], expected, atol=1e-3)
    assert answers[2]["png"]["size"] == [40, 30] and answers[2]["png"]["colours"] == "sRGB"


def test_a_checkpoint_says_how_far_it_is(binary, tmp_path, render):
    whole = render("scene")
    scene = whole.parent.parent / "scene.yaml"
    part = tmp_path / "part.exr"
    command = [binary, "render", scene, "-o", part, "--samples", "0-3", "--spp", "8", "-q"]
    subprocess.run([str(c) for c in command], check=True)
    _, [answer], _ = told(binary, part)
    found = answer["exr"]["part_of_picture"]
    assert found["whole"] is True and found["samples"] == [0, 3] and found["done"] == 1
