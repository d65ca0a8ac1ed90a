"""The scenes of the gallery, made smaller."""
import pathlib

import yaml

GALLERY = pathlib.Path(__file__).resolve().parents[2] / "configs" / "gallery.yaml"


def path_traced(share):
    """Names of the path-traced scenes, each with a share of its width and height."""
    for entry in yaml.safe_load(GALLERY.read_text())["scenes"]:
        changes = entry.get("set", {})
        scene = yaml.safe_load((GALLERY.parent / entry["file"]).read_text())
        integrator = changes.get("integrator", scene.get("integrator", "path"))
        if "path" not in integrator or any(key.startswith("integrator.whitted") for key in changes):
            continue
        size = [changes.get(f"image.{side}", scene.get("image", {}).get(side)) for side in ("width", "height")]
        yield entry.get("name", pathlib.Path(entry["file"]).stem), [round(share * x) for x in size]
