"""Runs the two renderers and reads what they made."""

import multiprocessing
import os
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import OpenEXR
import yaml

import judge
from conventions import ALLOWANCE, LUMINANCE, PIXEL_FACTOR
from mitsuba_xml import Writer

# Abbe estimates the error of a pixel from this many independently scrambled replicates.
REPLICATES = 4
# Mitsuba's is estimated from this many renders with seeds of their own.
PASSES = 16

# LLVM 14 is refused by Dr.Jit, 15 and 16 abort the process on some processors.
OLDEST_LLVM = 19


class RenderError(RuntimeError):
    """A renderer refused a scene or failed."""


class PeerDied(RenderError):
    """Mitsuba ends in a segmentation fault for every seed: there is nothing to compare."""


# -- Abbe ---------------------------------------------------------------------------------------------


def abbe_picture(binary: Path, scene: dict, path: Path, samples: int, seed: int):
    """Renders `scene` written to `path`; the picture and its standard error, (h, w, 3) each."""
    output = {"exr": {"precision": "float", "compression": "zips", "stderr": True}}
    path.write_text(yaml.safe_dump({**scene, "output": output}, sort_keys=False, default_flow_style=None))
    exr = path.with_suffix(".abbe.exr")
    command = [binary, "render", path, "-o", exr, "--spp", samples, "--seed", seed, "-q"]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip()
        raise RenderError(f"abbe ended with {done.returncode}: {said[-2000:]}")
    with OpenEXR.File(str(exr), separate_channels=True) as file:
        channels = file.channels()
        mean = np.stack([channels[c].pixels for c in "RGB"], -1).astype(np.float64)
        error = np.stack([channels[f"stderr.{c}"].pixels for c in "RGB"], -1).astype(np.float64)
    return mean, error


# -- Mitsuba ------------------------------------------------------------------------------------------


def usable_llvm():
    """The newest libLLVM that Mitsuba can use, or None."""
    found = []
    folders = ["/usr/lib", "/usr/lib64", "/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/local/lib"]
    folders += [str(p) for p in Path("/usr/lib").glob("llvm-*/lib")]
    for folder in folders:
        for file in Path(folder).glob("libLLVM*.so*"):
            version = re.fullmatch(r"libLLVM(?:-(\d+)\.so(?:\.\d+)?|\.so\.(\d+)(?:\.\d+)*)", file.name)
            if version:
                found.append((int(version[1] or version[2]), str(file)))
    found = [f for f in found if f[0] >= OLDEST_LLVM]
    return max(found)[1] if found else None


def choose_variant() -> str:
    """`llvm_ad_spectral` where a render in a process of its own succeeds, else `scalar_spectral`."""
    path = os.environ.get("DRJIT_LIBLLVM_PATH") or usable_llvm()
    if path is None:
        return "scalar_spectral"
    os.environ["DRJIT_LIBLLVM_PATH"] = path
    trial = (
        "import mitsuba as mi; mi.set_variant('llvm_ad_spectral'); "
        "s = mi.cornell_box(); s['sensor']['film'].update(width=8, height=8); "
        "print(mi.render(mi.load_dict(s), spp=1))"
    )
    done = subprocess.run([sys.executable, "-c", trial], capture_output=True)
    return "llvm_ad_spectral" if done.returncode == 0 else "scalar_spectral"


class Mitsuba:
    """Mitsuba in a process of its own, which is started anew where it dies: some renders end in a segmentation fault for some
    seeds (`hair_curves` at thousands of samples a pixel), and took all verdicts with them."""

    # So many sets of seeds are tried.
    TRIES = 4

    def __init__(self, variant: str):
        self.variant = variant
        self.pool = None
        self.name = self._call(_name)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.pool is not None:
            self.pool.shutdown()

    def replicates(self, scene: dict, path: Path, samples: int, seeds) -> np.ndarray:
        """Independent renders of `scene`, (passes, h, w, 3); `samples` is their sum."""
        Writer(scene, path.parent).write(path)
        pictures = self.pictures(path, max(1, samples // len(seeds)), seeds) * PIXEL_FACTOR
        header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.scanlineimage}
        mean = pictures.mean(0).astype(np.float32)
        OpenEXR.File(header, {"RGB": mean}).write(str(path.with_suffix(".mitsuba.exr")))
        return pictures

    def pictures(self, path: Path, spp: int, seeds) -> np.ndarray:
        """Independent renders of a file, (passes, h, w, channels)."""
        return self._of_seeds(_pictures, path, spp, seeds)

    def channels(self, path: Path, spp: int, seeds) -> dict:
        """The channels of independent renders by name, (passes, h, w) each; colours as R, G, B whatever the film's own
        format."""
        return self._of_seeds(_channels, path, spp, seeds)

    def _of_seeds(self, render, path: Path, spp: int, seeds):
        for attempt in range(self.TRIES):
            try:
                return self._call(render, str(path), spp, [int(seed) + attempt for seed in seeds])
            except BrokenProcessPool:
                self.pool = None
                print(f"{path.stem}: Mitsuba's process died; once more with other seeds", flush=True)
        raise PeerDied(f"Mitsuba's process died {self.TRIES} times")

    def _call(self, function, *arguments):
        if self.pool is None:
            context = multiprocessing.get_context("spawn")
            self.pool = ProcessPoolExecutor(1, context, _start, [self.variant])
        return self.pool.submit(function, *arguments).result()


# What follows runs in that process.


def _start(variant: str) -> None:
    import mitsuba

    mitsuba.set_variant(variant)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)


def _name() -> str:
    import mitsuba

    return f"Mitsuba {mitsuba.__version__} {mitsuba.variant()}"


def _pictures(path: str, spp: int, seeds: list[int]) -> np.ndarray:
    import mitsuba

    scene = mitsuba.load_file(path)
    return np.stack([np.array(mitsuba.render(scene, spp=spp, seed=seed), dtype=np.float64) for seed in seeds])


def _channels(path: str, spp: int, seeds: list[int]) -> dict:
    import mitsuba

    scene = mitsuba.load_file(path)
    stacks: dict[str, list] = {}
    for seed in seeds:
        scene.integrator().render(scene, seed=seed, spp=spp, develop=False)
        bitmap = scene.sensors()[0].film().bitmap(raw=False)
        pixels = np.array(bitmap, dtype=np.float64)
        pixels = pixels.reshape(*pixels.shape[:2], -1)
        for i, part in enumerate(bitmap.struct_()):
            stacks.setdefault(part.name, []).append(pixels[..., i])
    return {name: np.stack(stack) for name, stack in stacks.items()}


# -- one comparison -----------------------------------------------------------------------------------


def compare(case, binary: Path, mitsuba: Mitsuba, folder: Path, effort: int, rng: np.random.Generator):
    """Renders a case with both and judges; also the pictures, for looking at.

    `effort` multiplies the samples.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if case.assets:
        case.assets(folder)
    samples = case.samples * effort
    mean, error = abbe_picture(binary, case.scene, folder / f"{case.name}.yaml", samples, int(rng.integers(2**31)))
    seeds = rng.choice(2**31, PASSES, replace=False)
    peer_samples = case.peer_samples * effort
    replicates = mitsuba.replicates(case.peer or case.scene, folder / f"{case.name}.xml", peer_samples, seeds)

    if case.light_seen is not None:
        # One colour of light: the picture is a number at each pixel. It is read from the brightest
        # channel, in units of the light seen directly; the peer's light is white of Y = 1. A million
        # samples leave an error of 1e-4 in the unit.
        light_seed = int(rng.integers(2**31))
        seen, _ = abbe_picture(binary, case.light_seen, folder / f"{case.name}.light.yaml", 1024, light_seed)
        seen = seen.mean((0, 1))
        c = int(np.abs(seen).argmax())
        mean, error = mean[..., c : c + 1] / seen[c], error[..., c : c + 1] / abs(seen[c])
        replicates = (replicates @ np.array(LUMINANCE))[..., None]

    image = case.scene["image"]
    if image.get("filter", "box") != "box":
        # Abbe draws positions from the filter, which reaches beyond the border; Mitsuba's border
        # pixels only have the samples within. Two standard deviations more than any sample goes.
        inner = slice(judge.BLOCK // 2, -judge.BLOCK // 2)
        mean, error, replicates = mean[inner, inner], error[inner, inner], replicates[:, inner, inner]
    independent = image.get("filter", "box") == "box"
    ours = judge.picture_of_errors(mean, error, REPLICATES - 1, samples)
    theirs = judge.picture_of_replicates(replicates, peer_samples, independent)
    verdict = judge.judge(ours, theirs)
    if independent:
        # The product's own judge sees the same two pictures and must agree.
        spread = replicates.std(0, ddof=1) / np.sqrt(len(replicates))
        files = [folder / f"{case.name}.{side}.exr" for side in ("ours", "theirs")]
        write_with_errors(files[0], mean, error)
        write_with_errors(files[1], replicates.mean(0), spread)
        verdict.abbe_compare = abbe_compare(binary, *files)
        if verdict.abbe_compare != "same":
            verdict.passed = False
            verdict.reason = "; ".join(filter(None, [verdict.reason, f"abbe compare: {verdict.abbe_compare}"]))
    return verdict, ours, theirs


def write_with_errors(path: Path, mean: np.ndarray, error: np.ndarray) -> None:
    """A picture with its standard errors, as `abbe compare` reads them; one colour counts for all three."""
    channels = {}
    for i, name in enumerate("RGB"):
        c = min(i, mean.shape[-1] - 1)
        channels[name] = np.ascontiguousarray(mean[..., c], dtype=np.float32)
        channels[f"stderr.{name}"] = np.ascontiguousarray(error[..., c], dtype=np.float32)
    header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


def abbe_compare(binary: Path, ours: Path, theirs: Path) -> str:
    """The verdict of `abbe compare`: same, different, cannot_compare."""
    figures = ours.with_suffix(".json")
    command = [binary, "compare", ours, theirs, "--mean-tolerance", ALLOWANCE, "--json", figures]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode not in (0, 1, 2) or not figures.exists():
        raise RenderError(f"abbe compare ended with {done.returncode}: {done.stderr.strip()}")
    return ["same", "different", "cannot_compare"][done.returncode]
