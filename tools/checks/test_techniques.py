"""Techniques are ways to the same picture: drawn scenes with one of them on and with it off.

Scenes follow ABBE_SEED, else the date. Where only one of two ways finds a light at all (lamps without extent through
glass) there is nothing to compare: lamps here have a size, or are skies.
"""

import datetime
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cross_validate"))

import drawn  # noqa: E402
import judge  # noqa: E402
from renderers import REPLICATES  # noqa: E402
from scene_files import SceneFile, abbe_channels  # noqa: E402

NIGHTLY = "ABBE_NIGHTLY" in os.environ
SEED = int(os.environ.get("ABBE_SEED") or datetime.date.today().strftime("%Y%m%d"))
SCENES = 40 if NIGHTLY else 4
SPP = 512
# A judgement of a drawn scene that fails is made again with four times the samples, three times: rare bright samples make
# pictures look as if they differed, and of a hundred means one lies three standard errors away.
ATTEMPTS = 4
# Of each of two pictures that are compared pixel by pixel.
SEEDS = 16
# By which they are made in turn.
FILTERS = ["box", "{gaussian: {stddev: 0.5}}"]

# Merging blurs.
TRACED = ["render.techniques.light_tracing=on", "render.techniques.merging=off"]
UNTRACED = ["render.techniques.light_tracing=off", "render.techniques.packets=off"]
GLASS = re.compile(r'(type="(?:thin|rough)?dielectric">\s*)<(?:float|string) name="int_ior" value="[^"]*"/>')


def scenes(tmp_path: Path, salt: int, change=lambda scene, _: scene):
    """Scenes whose lights have an extent and whose pictures have errors, others for each `salt` below ten."""
    for i in range(salt, 100_000, 10):
        scene = drawn.Draw(SEED * 100_000 + i).scene()
        if not any(f'type="{kind}"' in scene for kind in {*drawn.DELTA, "specfilm"}) and (scene := change(scene, i)):
            path = tmp_path / f"drawn_{i}.xml"
            path.write_text(scene)
            yield SceneFile(path, "drawn at random")


def dispersive(scene: str, number: int) -> str | None:
    """The scene with glass whose index falls by 0.02 to 0.3 from violet to red; none without glass."""
    fall = 0.02 * (1 + number // 10 % 15)
    index = f'<spectrum name="int_ior" value="360:{1.4 + fall:.2f}, 500:{1.4 + 0.3 * fall:.3f}, 830:1.4"/>'
    changed, count = GLASS.subn(lambda found: found[1] + index, scene)
    return changed if count else None


def in_force(binary: Path, case: SceneFile, technique: str, settings: list) -> bool:
    """Whether the plan of a scene has a technique; of packets those from the lights or those from the camera.

    Media that overlap make other pictures from the lights than from the camera, as a note says: nothing to compare.
    """
    settings = [f"render.samples={SPP}", *settings]
    command = [binary, "plan", case.path, "--format", "json", *(x for s in settings for x in ("--set", s))]
    plan = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)[0]
    overlapping = any("and both hold a medium" in note for note in plan["notes"])
    return not overlapping and any(entry["on"] for entry in plan["techniques"] if entry["name"].startswith(technique))


def picture(binary: Path, case: SceneFile, settings: list, spp: int, seed: int) -> judge.Picture:
    case.settings = [*settings, "output.exr.stderr=true"]
    channels = abbe_channels(binary, case, case.path.with_suffix(".exr"), spp, seed)
    names = sorted(name for name in channels if f"stderr.{name}" in channels)
    mean, error = (np.stack([channels[layer + name] for name in names], -1) for layer in ("", "stderr."))
    return judge.picture_of_errors(mean, error, REPLICATES - 1, spp)


def fault(binary: Path, case: SceneFile, ways: list) -> str | None:
    """What speaks against two ways to a picture; none where noise says nothing either way."""
    verdict = None
    for attempt in range(ATTEMPTS):
        spp = SPP * 4**attempt
        pictures = [picture(binary, case, way, spp, 2 * attempt + i) for i, way in enumerate(ways)]
        # The judge excuses what is not a number in the second one, which is Mitsuba's elsewhere.
        if not all(one.finite for one in pictures):
            return f"a pixel is not a finite number\n{case.path.read_text()}"
        verdict = judge.judge(*pictures)
        if verdict.passed:
            return ""
    return None if verdict.undecided else f"{verdict.reason}: ratio {verdict.ratio}, z {verdict.z}\n{case.path.read_text()}"


@pytest.mark.parametrize(
    ("technique", "on", "off", "change"),
    [
        ("light tracing", TRACED, UNTRACED, lambda scene, _: scene),
        ("wavelength packets", [*TRACED, "render.techniques.packets=on"], UNTRACED, dispersive),
        ("adaptive sampling", ["render.techniques.adaptive=on"], ["render.techniques.adaptive=off"], lambda scene, _: scene),
    ],
    ids=["light_tracing", "packets", "adaptive"],
)
def test_a_technique_changes_no_picture(binary, tmp_path, technique, on, off, change):
    compared = 0
    for case in scenes(tmp_path, len(technique) % 10, change):
        if not in_force(binary, case, technique, on):
            continue
        told = fault(binary, case, [on, off])
        if told is None:
            continue
        assert not told, told
        compared += 1
        if compared == SCENES:
            return
    pytest.fail(f"of ten thousand scenes {compared} have it and can be judged")


def of_seeds(binary: Path, case: SceneFile, kernel: str, glints: str, spp: int) -> np.ndarray:
    """Sums of the channels of each pixel, by seed, without what trials may choose otherwise."""
    others = ["light_tracing=off", "reuse=off", "shadow_rays=1", "equiangular=off", "even_sky=on", f"glints={glints}"]
    case.settings = ["output.exr.stderr=true", f"image.filter={kernel}", *(f"render.techniques.{choice}" for choice in others)]
    sums = []
    for seed in range(SEEDS):
        channels = abbe_channels(binary, case, case.path.with_suffix(".exr"), spp, seed)
        sums.append(sum(channels[name] for name in channels if f"stderr.{name}" in channels))
    return np.array(sums, dtype=np.float64)


def same_light(binary: Path, case: SceneFile, kernel: str) -> bool | None:
    """Whether lamps looked for by themselves have the light that chance finds; `None` where that is not known to 5 %.

    Pixels in which they are looked for differ from those of the same seed without. The mean of what they differ by is held
    to 4.07 of its standard errors, which Student's t of 15 degrees of freedom exceeds by chance once in a thousand. Chance
    that meets a lamp in no seed knows no error, so that what speaks against it is looked at with up to 1024 times the samples.
    """
    for spp in (64, 256, 1024, 4096, 16384, 65536):
        on, off = (of_seeds(binary, case, kernel, glints, spp) for glints in ("on", "off"))
        seen = (on != off).any(0)
        excess = (on - off)[:, seen].sum(1)
        bound = 4.07 * excess.std(ddof=1) / SEEDS**0.5
        agree = abs(excess.mean()) <= bound
        if agree and bound < 0.05 * on[:, seen].sum(1).mean():
            return True
        if agree and spp >= 256:
            return None
    return False


def test_light_of_small_pictures_is_what_chance_finds(binary, tmp_path):
    compared = 0
    for case in scenes(tmp_path, 4):
        if not in_force(binary, case, "small pictures", ["render.techniques.glints=on"]):
            continue
        told = same_light(binary, case, FILTERS[compared % len(FILTERS)])
        assert told is not False, case.path.read_text()
        compared += told is True
        if compared == SCENES:
            return
    pytest.fail(f"of ten thousand scenes {compared} show small pictures and can be judged")


def test_noise_is_no_agreement_and_what_is_no_number_is_excused_nowhere(monkeypatch, tmp_path):
    """The mean of 256 pixels with an error of 0.2 each has one of 0.0125; that of two such differs by 0.018, above 0.005."""
    path = tmp_path / "scene.xml"
    path.write_text("<scene/>")

    def told(*ways):
        monkeypatch.setattr(f"{__name__}.picture", lambda binary, case, way, spp, seed: way)
        return fault(Path("abbe"), SceneFile(path, "drawn at random"), ways)

    def of(mean, error):
        even = np.full((16, 16, 3), mean)
        return judge.picture_of_errors(even, np.full_like(even, error), REPLICATES - 1, SPP)

    assert told(of(1.0, 0.001), of(1.0, 0.001)) == ""
    assert told(of(1.0, 0.2), of(1.0, 0.2)) is None
    assert told(of(1.0, 0.001), of(1.1, 0.001)).startswith("means differ")
    for ways in [(of(np.nan, 0.001), of(1.0, 0.001)), (of(1.0, 0.001), of(np.nan, 0.001))]:
        assert told(*ways).startswith("a pixel is not a finite number")


def test_effects_that_a_scene_lacks_change_no_bit(binary, tmp_path):
    """The kernel of all effects and that of the scene's own have the same pixels, to the last bit."""
    for _, case in zip(range(10 * SCENES), scenes(tmp_path, 0)):
        found = []
        for effects in ("auto", "all"):
            case.settings = [f"render.effects={effects}"]
            found.append(abbe_channels(binary, case, case.path.with_suffix(".exr"), 16, 1))
        assert all(np.array_equal(found[0][name], found[1][name], equal_nan=True) for name in found[0]), case.path.read_text()
