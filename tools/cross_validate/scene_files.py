"""Mitsuba's own scene files, rendered by both as they are.

`mitsuba/NAME.xml` shows one feature each. Both renderers read the same file; nothing is corrected, for the importer
speaks Mitsuba's conventions. Every channel that Mitsuba writes is compared: colours, bands, moments, distances.

A comment at the head of a file says what it shows. Options follow it in a line `cross_validate: KEY=VALUE …`:
`spp` (ours; Mitsuba's is four times as many), `inner=N` (leave N pixels at the border out of the judgement: a filter
wider than a pixel has fewer samples there in Mitsuba), `skip=A,B` (channels that Mitsuba means otherwise; the comment
says why), `allow=0.01` (relative difference of a mean that Mitsuba's own approximation explains; the comment says
which).
"""

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import OpenEXR

import judge
from conventions import ALLOWANCE
from renderers import PASSES, Mitsuba, RenderError

FOLDER = Path(__file__).resolve().parent / "mitsuba"

# Independent renders of ours.
SEEDS = 8
# Mitsuba's path per sample carries four wavelengths, ours eight.
PEER_FACTOR = 4
OPTIONS = {"spp", "inner", "skip", "allow"}


@dataclass
class SceneFile:
    """One file and how to compare it."""

    path: Path
    about: str
    spp: int = 256
    inner: int = 0
    allow: float = ALLOWANCE
    skip: set = field(default_factory=set)
    # Further settings of ours.
    settings: list = field(default_factory=list)
    # Noise that hides what is asked for is no fault of such a scene.
    may_be_noisy: bool = False

    @property
    def name(self) -> str:
        return self.path.stem


def read(path: Path) -> SceneFile:
    """The file's own words about itself."""
    text = path.read_text()
    comment = re.search(r"<!--(.*?)-->", text, re.S)
    about = " ".join(comment[1].split()) if comment else ""
    if not about:
        raise ValueError(f"{path}: expected a comment that says what the scene shows")
    options = {}
    if "cross_validate:" in about:
        about, written = about.split("cross_validate:", 1)
        options = dict(word.split("=", 1) for word in written.split())
        if unknown := set(options) - OPTIONS:
            raise ValueError(f"{path}: unknown option {', '.join(sorted(unknown))}; known: {', '.join(sorted(OPTIONS))}")
    return SceneFile(
        path,
        about.strip(),
        spp=int(options.get("spp", 256)),
        inner=int(options.get("inner", 0)),
        allow=float(options.get("allow", ALLOWANCE)),
        skip=set(options.get("skip", "").split(",")) - {""},
    )


def all_files() -> list[SceneFile]:
    return [read(path) for path in sorted(FOLDER.glob("*.xml"))]


def abbe_channels(binary: Path, case: SceneFile, exr: Path, spp: int, seed: int) -> dict:
    """The channels of one render by name, (h, w) each."""
    command = [binary, "render", case.path, "-o", exr, "--spp", spp, "--seed", seed, "-q"]
    for setting in ["output.exr.precision=float", *case.settings]:
        command += ["--set", setting]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise RenderError(f"abbe ended with {done.returncode}: {(done.stderr or done.stdout).strip()[-2000:]}")
    with OpenEXR.File(str(exr), separate_channels=True) as file:
        return {name: c.pixels.astype(np.float64) for name, c in file.channels().items()}


def groups(names) -> list[list[str]]:
    """Channels that are measured by one scale: the colours of one picture; any other channel alone."""
    found: dict[str, list[str]] = {}
    for name in names:
        layer, _, last = name.rpartition(".")
        found.setdefault(layer if last in ("R", "G", "B") else name, []).append(name)
    order = {"R": 0, "G": 1, "B": 2}
    return [sorted(group, key=lambda n: order.get(n.rpartition(".")[2], 3)) for group in found.values()]


def compare(case: SceneFile, binary: Path, mitsuba: Mitsuba, folder: Path, effort: int, rng: np.random.Generator):
    """Renders a file with both and judges; the verdict (of the worst group) and the pictures of the first group."""
    folder.mkdir(parents=True, exist_ok=True)
    spp = max(1, case.spp * effort // SEEDS)
    seeds = rng.choice(2**31, SEEDS + PASSES, replace=False)
    runs = [abbe_channels(binary, case, folder / f"{i}.exr", spp, seed) for i, seed in enumerate(seeds[:SEEDS])]
    ours = {name: np.stack([run[name] for run in runs]) for name in runs[0]}
    peer_spp = max(1, PEER_FACTOR * case.spp * effort // PASSES)
    theirs = mitsuba.channels(case.path, peer_spp, seeds[SEEDS:])

    wanted = [name for name in theirs if name not in case.skip]
    if missing := [name for name in wanted if name not in ours]:
        raise RenderError(f"channels {', '.join(missing)} are missing; found {', '.join(ours)}")
    inner = slice(case.inner, -case.inner or None)
    verdicts = []
    for group in groups(wanted):
        a, b = (np.stack([side[name] for name in group], -1)[:, inner, inner] for side in (ours, theirs))
        if a.shape[1:] != b.shape[1:]:
            raise RenderError(f"{group}: {a.shape[1:]} pixels and channels, Mitsuba has {b.shape[1:]}")
        # Means of blocks and of the whole come from whole renders: a filter correlates the pixels of one.
        pair = judge.picture_of_replicates(a, spp * SEEDS, False), judge.picture_of_replicates(b, peer_spp * PASSES, False)
        verdict = judge.judge(*pair, case.allow)
        if not verdict.passed:
            verdict.reason = f"{', '.join(group)}: {verdict.reason}"
        verdicts.append((verdict, *pair))
    failed = [v for v in verdicts if not v[0].passed]
    return (failed or verdicts)[0][0], *verdicts[0][1:]
