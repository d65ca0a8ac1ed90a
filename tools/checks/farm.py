"""What the checks of farm engines share: an animated batch, the job that `abbe farm` makes of it, and its pixels."""

import subprocess
from pathlib import Path

import numpy as np
import OpenEXR
import yaml

# A ball that rolls past another one of glass, and a still picture: two kinds of group.
MOVING = {
    "camera": {"origin": [0, 1.5, 6], "target": [0, 0.7, 0], "fov_deg": 40},
    "image": {"width": 48, "height": 32},
    "output": {"exr": {"precision": "float"}},
    "shapes": [
        {"plane": {"normal": [0, 1, 0]}},
        {"sphere": {"center": {1: [-2, 0.5, 1], 5: [2, 0.5, 1]}, "radius": 0.5}},
        {"sphere": {"center": [0, 1, -1], "radius": 1, "material": {"dielectric": {"ior": 1.5}}}},
    ],
    "lights": [{"constant": {"radiance": 0.4}}],
    "render": {"techniques": {"light_tracing": "off"}},
}
STILL = {**MOVING, "shapes": MOVING["shapes"][::2]}


def run(*command, code=0, **options):
    """Runs a command and gives what it printed."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)
    assert done.returncode == code, f"{command}: {done.returncode}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
    return done.stdout + done.stderr


def write_batch(directory: Path, frames: str, samples: int, still=True, size=None) -> Path:
    """Writes the batch and its scenes."""
    for name, scene in [("moving", MOVING), ("still one", STILL)]:
        scene = {**scene, "image": {"width": size[0], "height": size[1]}} if size else scene
        (directory / f"{name}.yaml").write_text(yaml.safe_dump(scene, sort_keys=False))
    scenes = [{"file": "moving.yaml", "set": {"render.frames": frames}}] + [{"file": "still one.yaml"}] * still
    batch = directory / "batch.yaml"
    batch.write_text(yaml.safe_dump({"render": {"samples": samples}, "scenes": scenes}))
    return batch


def pixels(path: Path):
    """All channels of a picture."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.copy() for name, channel in file.channels().items()}


def assert_same(found: Path, expected: Path):
    """The pictures of the one directory are those of the other, pixel for pixel."""
    names = sorted(p.name for p in expected.glob("*.exr"))
    assert names and sorted(p.name for p in found.glob("*.exr")) == names
    for name in names:
        a, b = pixels(found / name), pixels(expected / name)
        assert a.keys() == b.keys(), name
        for channel, values in a.items():
            assert np.array_equal(values, b[channel]), f"{name}: {channel}"
