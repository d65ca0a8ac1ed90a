#!/usr/bin/env python3
"""Renders a scene of tools/bench/scenes by LuxCore: rectangles, balls (as fine meshes), meshes, diffuse and smooth dispersive
materials, lamps, an even sky.

    luxcore_render.py SCENE.yaml OUT.npy --spp EYE LIGHT [--engine PATHCPU|BIDIRCPU] [--seed N] [--threads N]

LIGHT above 0 turns its light tracing on. OUT is linear Rec. 709, float32, (height, width, 3), row 0 on top.
"""
import argparse
import math
import os
import pathlib
import time

import numpy as np
import pyluxcore
import yaml

# A ball is a mesh of so many parts around and from pole to pole.
AROUND, DOWN = 256, 128


def ball(center, radius):
    """Corners, triangles and normals of a ball."""
    phi, theta = np.meshgrid(np.arange(AROUND) * 2 * math.pi / AROUND, np.arange(DOWN + 1) * math.pi / DOWN)
    normals = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1).reshape(-1, 3)
    at = lambda i, j: i * AROUND + j % AROUND
    triangles = []
    for i in range(DOWN):
        for j in range(AROUND):
            a, b, c, d = at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)
            triangles += [(a, b, c)] * (i > 0) + [(b, d, c)] * (i < DOWN - 1)
    return np.asarray(center) + radius * normals, triangles, normals


def triangles_of(path):
    """Corners and triangles of an OBJ file."""
    lines = [line.split() for line in path.read_text().splitlines()]
    points = [[float(x) for x in words[1:4]] for words in lines if words[:1] == ["v"]]
    faces = [[int(word.split("/")[0]) - 1 for word in words[1:4]] for words in lines if words[:1] == ["f"]]
    return points, faces


def properties(**named):
    out = pyluxcore.Properties()
    for name, values in named.items():
        values = values if isinstance(values, (list, tuple)) else [values]
        out.Set(pyluxcore.Property(name.replace("__", "."), list(values)))
    return out


def build(description, folder):
    scene = pyluxcore.Scene()
    camera, image = description["camera"], description["image"]
    assert image["width"] == image["height"], "LuxCore's field of view is that of the shorter side"
    scene.Parse(properties(
        scene__camera__lookat__orig=camera["origin"], scene__camera__lookat__target=camera["target"],
        scene__camera__up=[0, 1, 0], scene__camera__fieldofview=camera["fov_deg"], scene__camera__type="perspective",
        scene__camera__autofocus__enable=0,
    ))
    for name, material in description["materials"].items():
        kind, fields = next(iter(material.items()))
        prefix = f"scene__materials__{name}__"
        if kind == "diffuse":
            wanted = {"type": "matte", "kd": [fields["reflectance"]] * 3}
        elif kind == "dielectric":
            a, b = fields["ior"]["cauchy"]
            wanted = {"type": "glass", "kr": [1.0] * 3, "kt": [1.0] * 3, "interiorior": a, "exteriorior": 1.0, "cauchyb": b}
        else:
            raise SystemExit(f"{name}: {kind} is not mapped")
        scene.Parse(properties(**{prefix + key: value for key, value in wanted.items()}))
    for shape in description["shapes"]:
        kind, fields = next(iter(shape.items()))
        name, normals, material = fields["name"], None, fields["material"]
        if kind == "rectangle":
            c, u, v = (np.array(fields[k], float) for k in ("corner", "edge_u", "edge_v"))
            points, faces = [c, c + u, c + u + v, c + v], [(0, 1, 2), (0, 2, 3)]
        elif kind == "sphere":
            points, faces, normals = ball(fields["center"], fields["radius"])
        elif kind == "mesh":
            points, faces = triangles_of(folder / fields["file"])
        else:
            raise SystemExit(f"{name}: {kind} is not mapped")
        as_lists = lambda rows: None if rows is None else [tuple(float(x) for x in row) for row in rows]
        scene.DefineMesh(name, as_lists(points), [tuple(int(i) for i in f) for f in faces], as_lists(normals), None, None, None)
        if "emission" in fields:
            prefix = f"scene__materials__{material}_{name}__"
            wanted = {"type": "matte", "kd": [0.0] * 3, "emission": [float(fields["emission"])] * 3}
            scene.Parse(properties(**{prefix + key: value for key, value in wanted.items()}))
            material = f"{material}_{name}"
        scene.Parse(properties(**{f"scene__objects__{name}__shape": name, f"scene__objects__{name}__material": material}))
    for light in description.get("lights", []):
        kind, fields = next(iter(light.items()))
        if kind != "constant":
            raise SystemExit(f"a light of kind {kind} is not mapped")
        scene.Parse(properties(scene__lights__sky__type="constantinfinite", scene__lights__sky__color=[fields["radiance"]] * 3))
    return scene


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--spp", type=int, nargs=2, default=(32, 64))
    parser.add_argument("--engine", default="PATHCPU")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    pyluxcore.Init(lambda message: None)
    description = yaml.safe_load(arguments.scene.read_text())
    depth = description["integrator"]["path"]["max_depth"]
    width, height = description["image"]["width"], description["image"]["height"]
    eye, light = arguments.spp
    config = properties(
        renderengine__type=arguments.engine, sampler__type="SOBOL" if arguments.engine == "PATHCPU" else "RANDOM",
        native__threads__count=arguments.threads,
        renderengine__seed=arguments.seed,
        film__width=width, film__height=height, film__filter__type="BOX", film__filter__width=0.5,
        # Nothing is done to the picture: linear and whole.
        film__imagepipelines__0__0__type="NOP",
        film__outputs__0__type="RGB", film__outputs__0__filename="unused.exr",
        path__pathdepth__total=depth, path__pathdepth__diffuse=depth, path__pathdepth__glossy=depth,
        path__pathdepth__specular=depth, path__maxdepth=depth, light__maxdepth=depth,
        path__clamping__variance__maxvalue=0,
        batch__haltspp=[eye, light] if light else [eye],
    )
    if light:
        config.Set(properties(
            path__hybridbackforward__enable=1, path__hybridbackforward__partition=eye / (eye + light),
            path__hybridbackforward__glossinessthreshold=0.05,
        ))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config, build(description, arguments.scene.parent)))
    session.Start()
    while not session.HasDone():
        time.sleep(0.05)
        session.UpdateStats()
    session.Stop()
    pixels = np.zeros((height, width, 3), np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, pixels)
    np.save(arguments.out, pixels[::-1])
    # Tearing the session down crashes now and then; the picture is written.
    os._exit(0)


if __name__ == "__main__":
    main()
