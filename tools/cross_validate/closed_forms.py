#!/usr/bin/env python3
"""Where a comparison with Mitsuba must differ: scenes whose answer is a closed form, rendered by both.

    tools/cross_validate/closed_forms.py [--binary PATH] [--spp N] [--only TEXT] [--markdown]

Every pixel of a scene has the same answer, derived below, so the mean of the picture is compared with it. Abbe must
agree within 0.1 % and four standard errors, or the exit code is 1; of Mitsuba the figure is only told. Both read the
same XML. A Mitsuba picture's unit is corrected by `conventions.PIXEL_FACTOR`.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

from conventions import PIXEL_FACTOR
from renderers import Mitsuba, RenderError, choose_variant

ROOT = Path(__file__).resolve().parents[2]
SIDE = 16
SEEDS = 8
# Tables of the observer and single precision (see conventions.py).
ALLOWANCE = 0.001

SKY = '<emitter type="constant"><spectrum name="radiance" value="1"/></emitter>'
GREY = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.5"/></bsdf>'


def camera(origin, target, fov, up="0, 1, 0", far=1e4) -> str:
    """A small picture that sees nothing but what is asked."""
    return f"""<sensor type="perspective">
        <float name="fov" value="{fov!r}"/><float name="far_clip" value="{far!r}"/>
        <transform name="to_world"><lookat origin="{origin}" target="{target}" up="{up}"/></transform>
        <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
        <film type="hdrfilm">
            <integer name="width" value="{SIDE}"/><integer name="height" value="{SIDE}"/>
            <string name="component_format" value="float32"/><rfilter type="box"/>
        </film>
    </sensor>"""


def sphere(center, radius, inside=GREY) -> str:
    return f"""<shape type="sphere"><point name="center" value="{center}"/><float name="radius" value="{radius!r}"/>
        {inside}</shape>"""


@dataclass
class Case:
    """A scene, the luminance of every pixel, and why."""

    name: str
    expected: float
    why: str
    body: str
    depth: int = -1
    integrator: str = "path"


def cases() -> list[Case]:
    # Every point of a convex body gets the whole hemisphere of an even sky of one.
    convex = "a convex body in an even sky, ρ"
    found = []

    def under(light: str, ground: str = GREY) -> str:
        turned = '<transform name="to_world"><rotate x="1" angle="-90"/></transform>'
        return camera("1, 1, 0", "0, 0, 0", 0.01) + light + f'<shape type="rectangle">{turned}{ground}</shape>'

    # A lamp of radius r straight above at distance 1, by its centre: E = π L (r / d)², and L is chosen such that E = π; the
    # floor sends back ρ E / π.
    def lamp(r: float) -> str:
        return sphere("0, 1, 0", r, f"""<emitter type="area"><spectrum name="radiance" value="{1 / r**2!r}"/></emitter>
            <bsdf type="diffuse"><spectrum name="reflectance" value="0"/></bsdf>""")

    for r in (1e-2, 1e-3, 1e-4):
        found.append(Case(f"lamp of radius {r:g} at distance 1", 0.5, "E = π L r²/d², back comes ρ E / π", under(lamp(r)), 2))
    half = f'<bsdf type="mask"><float name="opacity" value="0.5"/>{GREY}</bsdf>'
    found.append(Case("lamp of radius 0.01 over ground of opacity 1/2", 0.25, "half of that", under(lamp(1e-2), half), 2))
    # The formula holds for all of a ball above the horizon.
    board = "".join(f'<spectrum name="color{i}" value="{1 / 0.6**2!r}"/>' for i in range(2))
    light = f"""<shape type="sphere">
        <transform name="to_world"><scale value="0.6"/><rotate x="1" angle="120"/><translate y="1"/></transform>
        <emitter type="area"><texture type="checkerboard" name="radiance">{board}</texture></emitter></shape>"""
    turned = "lamp of radius 0.6, turned, its light a board of one colour"
    found.append(Case(turned, 0.5, "as of any ball of even light", under(light), 2))
    mist = """<bsdf type="null"/><medium type="homogeneous" name="interior"><spectrum name="albedo" value="1"/>
        <spectrum name="sigma_t" value="380:1, 760:1"/></medium>"""
    body = camera("0, 0, 5", "0, 0, 0", 5.0) + sphere("0, 0, 0", 1.0, mist) + SKY
    thin = "ball of white mist that is none beyond 380 and 760 nm (`volpathmis`)"
    found.append(Case(thin, 1.0, "a furnace", body, integrator="volpathmis"))
    for d in (1e4, 1e5, 1e6):
        body = camera(f"0, 0, {d!r}", "0, 0, 0", np.degrees(0.5 / d).item(), far=1e9) + sphere("0, 0, 0", 1.0) + SKY
        found.append(Case(f"unit sphere seen from {d:g}", 0.5, convex, body))
    body = camera("0, 0, 50000", "0, 0, 0", np.degrees(0.5 / 5e4).item()) + sphere("0, 0, 0", 1.0) + SKY
    found.append(Case("unit sphere seen from 5e4, far_clip as it is by default", 0.5, "far_clip 1e4 belongs to the scene: sky, 1", body))
    found[-1].expected = 1.0
    for radius in (1e3, 1e5, 1e6):
        body = camera("0, 1, 0", "2, 0, 0", 20.0) + sphere(f"0, {-radius!r}, 0", radius) + SKY
        found.append(Case(f"ground that is a sphere of radius {radius:g}", 0.5, convex, body))
    for shift in (1e6, 1e7):
        body = camera(f"{shift!r}, 0, 5", f"{shift!r}, 0, 0", 5.0) + sphere(f"{shift!r}, 0, 0", 1.0) + SKY
        found.append(Case(f"unit sphere at x = {shift:g}", 0.5, convex, body))
    for gap in (1e-3, 1e-4, 1e-5):
        shell = sphere("0, 0, 0", 1 + gap, """<bsdf type="dielectric">
            <float name="int_ior" value="1"/><float name="ext_ior" value="1"/></bsdf>""")
        body = camera("0, 0, 5", "0, 0, 0", 5.0) + sphere("0, 0, 0", 1.0) + shell + SKY
        found.append(Case(f"shell of index 1, {gap:g} above a unit sphere", 0.5, convex + "; the shell does nothing", body))
    for albedo in (0.5, 0.9):
        walls = sphere("0, 0, 0", 1.0, f"""<boolean name="flip_normals" value="true"/>
            <emitter type="area"><spectrum name="radiance" value="1"/></emitter>
            <bsdf type="diffuse"><spectrum name="reflectance" value="{albedo}"/></bsdf>""")
        body = camera("0, 0, 0.2", "0, 0, 1", 40.0) + walls
        found.append(Case(f"inside a glowing sphere of albedo {albedo}", 1 / (1 - albedo), "L / (1 − ρ)", body))
    for radius in (1.0, 1e-3, 1e-5):
        ball = sphere("0, 0, 0", radius, '<bsdf type="dielectric"/>')
        body = camera(f"0, 0, {5 * radius!r}", "0, 0, 0", 30.0) + ball + SKY
        body = body.replace('name="far_clip"', f'name="near_clip" value="{radius / 10!r}"/><float name="far_clip"')
        found.append(Case(f"glass ball of radius {radius:g} in a white sky", 1.0, "a furnace: glass neither adds nor takes", body))
    return found


def write(case: Case, path: Path) -> None:
    path.write_text(f"""<scene version="3.0.0">
    <default name="spp" value="256"/>
    <integrator type="{case.integrator}"><integer name="max_depth" value="{case.depth}"/></integrator>
    {case.body}
</scene>
""")


def luminance(rgb: np.ndarray) -> np.ndarray:
    return rgb @ np.array([0.212671, 0.715160, 0.072169])


def abbe(binary: Path, xml: Path, spp: int) -> np.ndarray:
    """Means of independent pictures."""
    means = []
    for seed in range(SEEDS):
        exr = xml.with_suffix(".exr")
        command = [binary, "render", xml, "-o", exr, "--spp", spp, "--seed", seed, "-q"]
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
        if done.returncode:
            raise RenderError(f"abbe ended with {done.returncode}: {done.stderr.strip()[-1000:]}")
        with OpenEXR.File(str(exr), separate_channels=True) as file:
            c = file.channels()
            rgb = np.stack([c[n].pixels for n in "RGB"], -1).astype(np.float64)
        means.append(luminance(rgb).mean() / PIXEL_FACTOR)
    return np.array(means) * PIXEL_FACTOR


def mitsuba(peer: Mitsuba, xml: Path, spp: int) -> np.ndarray:
    return np.array([luminance(p[..., :3]).mean() for p in peer.pictures(xml, spp, range(SEEDS))])


def main() -> int:
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", type=Path, default=target / "release" / "abbe")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--only", default="")
    parser.add_argument("--markdown", action="store_true")
    a = parser.parse_args()
    wanted = [case for case in cases() if a.only in case.name]
    if not wanted:
        parser.error(f"no case has {a.only!r} in its name")
    variant = choose_variant()
    names = [variant] if variant == "scalar_spectral" else [variant, "scalar_spectral"]
    peers: dict[str, dict[str, np.ndarray]] = {}
    with tempfile.TemporaryDirectory() as folder:
        files = {case.name: Path(folder) / f"{i}.xml" for i, case in enumerate(wanted)}
        for case in wanted:
            write(case, files[case.name])
        for name in names:
            with Mitsuba(name) as peer:
                peers[name] = {case.name: mitsuba(peer, files[case.name], a.spp) for case in wanted}
        print(f"{'case':58} {'exact':>6} {'abbe':>9} " + " ".join(f"{n:>16}" for n in names))
        wrong = 0
        rows = []
        for case in wanted:
            # Both films read the file by Mitsuba's unit.
            ours = abbe(a.binary, files[case.name], a.spp) * PIXEL_FACTOR
            mean, error = ours.mean(), ours.std(ddof=1) / SEEDS**0.5
            good = abs(mean - case.expected) <= ALLOWANCE * case.expected + 4 * error
            wrong += not good
            theirs = [peers[n][case.name].mean() * PIXEL_FACTOR for n in names]
            figures = [f"{mean:9.5f}", *(f"{t:9.5f} {100 * (t / case.expected - 1):+5.1f}%" for t in theirs)]
            print(f"{case.name:58} {case.expected:6g} " + " ".join(figures) + ("" if good else "  WRONG"), flush=True)
            rows.append((case, mean, theirs))
    if a.markdown:
        print("\n| scene | exact, and why | Abbe | " + " | ".join(f"Mitsuba `{n}`" for n in names) + " |")
        print("|---|---|---|" + "---|" * len(names))
        for case, mean, theirs in rows:
            print(f"| {case.name} | {case.expected:g}: {case.why} | {mean:.4f} | " + " | ".join(f"{t:.4f}" for t in theirs) + " |")
    print(f"{len(rows) - wrong} passed, {wrong} failed")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
