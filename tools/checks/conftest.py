"""What the checks share: the binary, and small renders with it."""

import os
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]

# A scene of a few milliseconds with colour, shadow and a little glass.
SCENE = {
    "camera": {"origin": [0, 1.5, 5], "target": [0, 0.8, 0], "fov_deg": 36},
    "image": {"width": 40, "height": 30},
    "integrator": {"path": {"max_depth": 5}},
    "shapes": [
        {
            "rectangle": {
                "corner": [-4, 0, 4],
                "edge_u": [8, 0, 0],
                "edge_v": [0, 0, -8],
                "material": {"diffuse": {"reflectance": {"rgb": [0.2, 0.5, 0.7]}}},
            }
        },
        {"sphere": {"center": [-0.8, 0.8, 0], "radius": 0.8, "material": {"dielectric": {"ior": 1.5}}}},
        {"sphere": {"center": [0.8, 0.8, 0], "radius": 0.8, "material": {"diffuse": {"reflectance": 0.6}}}},
    ],
    "lights": [
        {"constant": {"radiance": 0.4}},
        {"point": {"position": [2, 4, 3], "intensity": {"rgb": [20, 16, 12]}}},
    ],
}


@pytest.fixture(scope="session")
def binary() -> Path:
    """The renderer under test."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = Path(os.environ.get("ABBE_BINARY", target / "release" / "abbe"))
    assert path.is_file(), f"{path} does not exist; build it with `cargo build --release`"
    return path


@pytest.fixture
def render(binary, tmp_path):
    """Renders `SCENE` with other sections put in; the path of the EXR file."""

    def run(name: str, *arguments, **sections) -> Path:
        described = {**SCENE, **sections}
        described.setdefault("output", {}).setdefault("dir", str(tmp_path / name))
        scene = tmp_path / f"{name}.yaml"
        scene.write_text(yaml.safe_dump(described, sort_keys=False))
        exr = tmp_path / name / f"{name}.exr"
        exr.parent.mkdir(exist_ok=True)
        command = [binary, "render", scene, "-o", exr, "--spp", 8, "--seed", 7, "-q", *arguments]
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr or done.stdout
        assert exr.is_file(), f"no {exr}; the directory holds {[p.name for p in exr.parent.iterdir()]}"
        return exr

    return run
