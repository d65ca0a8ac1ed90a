"""`tools/denoise.py` keeps what a file says; the filter of Open Image Denoise is stood in for by one that halves."""

import os
import subprocess
import sys

import numpy as np
import OpenEXR
import pytest
from conftest import ROOT

STAND_IN = """
OIDN_FORMAT_FLOAT3 = 3

class Device:
    def commit(self): pass

class Filter:
    def __init__(self, device, kind): self.images = {}
    def set_image(self, name, image, form):
        assert image.dtype.name == "float32" and image.flags.c_contiguous and image.shape[2] == form
        self.images[name] = image
    def set_bool(self, name, value): pass
    def commit(self): pass
    def execute(self):
        assert set(self.images) == {"color", "albedo", "normal", "output"}
        self.images["output"][:] = self.images["color"] / 2
"""


@pytest.mark.parametrize(
    "channels, colour, layout",
    [
        ("rgba", "acescg", "single"),
        ("rgba", "acescg", "multipart"),
        ("rgb", "rec709", "multipart"),
        ("xyza", "rec709", "single"),
        ("xyza", "rec709", "multipart"),
        ("luminance_alpha", "rec709", "single"),
        ("luminance_alpha", "rec709", "multipart"),
    ],
)
def test_windows_colours_and_alpha_are_kept(render, tmp_path, channels, colour, layout):
    noisy = render(
        "noisy",
        image={"width": 40, "height": 30, "crop": {"x": 5, "y": 4, "width": 20, "height": 12}},
        layers=["albedo", "normal"],
        output={"colour": colour, "exr": {"channels": channels, "layout": layout, "attributes": {"owner": "us"}}},
    )
    (tmp_path / "pyoidn.py").write_text(STAND_IN)
    denoised = tmp_path / "denoised.exr"
    command = [sys.executable, ROOT / "tools" / "denoise.py", noisy, denoised]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with OpenEXR.File(str(noisy), separate_channels=True) as file:
        before, own = dict(file.parts[0].header), {n: c.pixels for n, c in file.parts[0].channels.items() if "." not in n}
    with OpenEXR.File(str(denoised), separate_channels=True) as file:
        after, found = dict(file.header()), {n: c.pixels for n, c in file.channels().items()}
    for name in ["dataWindow", "displayWindow", "chromaticities", "colorInteropID", "owner", "worldToCamera"]:
        assert (name in after) == (name in before), name
        assert name not in before or np.array_equal(after[name], before[name]), name
    assert not [name for name in after if name.startswith("abbe/")]
    assert found.keys() == own.keys() and len(own) == {"rgba": 4, "rgb": 3, "xyza": 4, "luminance_alpha": 2}[channels]
    for name, pixels in own.items():
        expected = pixels if name == "A" else pixels.astype(np.float32) / 2
        assert np.array_equal(found[name], expected), name
