"""Parts of a picture: read by the official library and by OpenImageIO, and added up in plain Python."""

import json

import numpy as np
import OpenEXR
import OpenImageIO as oiio


# Light from the lamps would land in all rows.
OFF = {"techniques": {"light_tracing": "off"}}


def sums(path):
    """The numbers of each plane as Python integers, and the header, as src/film/exr/part.rs says."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels, header = file.channels(), file.header()
        part = json.loads(header["abbe/part"])
        planes = {}
        for plane in part["planes"]:
            n = 32 * plane["words"]
            words = range(plane["words"])
            total = sum(channels[f"{plane['name']}.w{w}"].pixels.astype(object) << 32 * w for w in words)
            planes[plane["name"]] = (total - (total >> n - 1 << n)) << plane["shift"] if n else 0
        window = [[int(x) for x in corner] for corner in header["dataWindow"]]
        return planes, part, window


def test_parts_are_openexr_files_whose_numbers_add_up(render):
    whole, part, window = sums(render("whole", "--tile", "0/1", render=OFF))
    assert window == [[0, 0], [39, 29]] and part["claims"]["camera"] == [[0, 0, 40, 30, 0, 8]]
    first, _, window = sums(render("first", "--samples", "0-2", render=OFF))
    assert window == [[0, 0], [39, 29]]
    upper, _, window = sums(render("upper", "--samples", "3-7", "--tile", "0/2", render=OFF))
    assert window == [[0, 0], [39, 14]]
    lower, _, window = sums(render("lower", "--samples", "3-7", "--tile", "1/2", render=OFF))
    assert window == [[0, 15], [39, 29]]
    zero = np.zeros((15, 40), dtype=object)
    for name, numbers in whole.items():
        rest = np.concatenate([upper[name] + zero, lower[name] + zero])
        assert np.array_equal(np.zeros((30, 40), dtype=object) + numbers, rest + first[name]), name
    assert (whole["camera0.n"] == 2).all() and (whole["camera3.Y"] > 0).any()


def test_the_mean_of_the_sums_is_the_picture(render):
    whole, part, _ = sums(render("sums", "--tile", "0/1", render=OFF))
    output = {"exr": {"precision": "float", "channels": "xyz"}}
    with OpenEXR.File(str(render("picture", output=output, render=OFF)), separate_channels=True) as file:
        for letter in "XYZ":
            total = sum(whole[f"camera{r}.{letter}"] for r in range(4))
            mean = (total / (2.0**64 / 2.0 ** part["exponent"] * 8)).astype(np.float32)
            assert np.allclose(mean, file.channels()[letter].pixels, rtol=1e-6), letter


def test_openimageio_reads_a_part(render):
    file = oiio.ImageInput.open(str(render("oiio", "--samples", "1-4", "--tile", "2/3", render=OFF)))
    assert file, oiio.geterror()
    spec = file.spec()
    assert (spec.y, spec.height, spec.full_height, str(spec.format)) == (20, 10, 30, "uint")
    assert spec.getattribute("abbe/samples") == "1-4" and spec.getattribute("abbe/tile") == "2/3"
    assert file.read_image().shape[:2] == (10, 40)
    file.close()
