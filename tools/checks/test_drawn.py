"""Scenes drawn from Mitsuba's plugins are files that we read."""

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cross_validate"))

import drawn  # noqa: E402


def test_every_drawn_scene_is_read(binary, tmp_path):
    """Whatever plugins go together; and a number always draws the same scene."""
    cases = drawn.cases(60, 1, tmp_path)
    for case in cases:
        done = subprocess.run([binary, "plan", case.path], capture_output=True, text=True)
        assert done.returncode == 0, f"{case.path.read_text()}\n{done.stderr}"
    again = drawn.cases(60, 1, tmp_path / "again")
    assert [c.path.read_text() for c in cases] == [c.path.read_text() for c in again]
    assert len({c.path.read_text() for c in cases}) == 60


def test_every_plugin_is_drawn():
    """Of two thousand scenes at least ten have each of the plugins."""
    scenes = [drawn.Draw(seed).scene() for seed in range(2000)]
    surfaces = [*drawn.OPAQUE, *drawn.CLEAR, *drawn.LAYERED, "hair"]
    lights = ["area", *drawn.DELTA, *drawn.SKIES]
    media = ["homogeneous", "heterogeneous", "hg", "rayleigh", "tabphase", "blendphase"]
    shapes = [*drawn.SHAPES, "instance", "merge"]
    volumes = ["gridvolume", "constvolume", "volume"]
    integrators = ["path", "volpath", "volpathmis", "direct", "ptracer"]
    for kind in [*surfaces, *shapes, *lights, "directionalarea", *media, *volumes, "specfilm", *integrators]:
        assert sum(f'type="{kind}"' in scene for scene in scenes) >= 10, kind
