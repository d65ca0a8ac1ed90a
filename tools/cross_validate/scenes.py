"""The cases: small scenes, each about one thing that two renderers may see differently.

A scene is written once, in Abbe's own grammar; `mitsuba_xml.py` says it in Mitsuba's words. y is up,
lengths are metres. Sample counts are chosen such that the standard error of each channel's mean is
about a thousandth of it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from conventions import n_sf11


@dataclass
class Case:
    """A scene and what to compare."""

    name: str
    about: str
    scene: dict
    samples: int = 256
    peer_samples: int = 512
    # Mitsuba's scene where it is not the same.
    peer: dict | None = None
    # Writes the files that the scene names into a directory.
    assets: Callable[[Path], None] | None = None
    # Shows nothing but the light: comparison is relative to it.
    light_seen: dict | None = None


# -- bricks -------------------------------------------------------------------------------------------

# Measured-like tables that cover the whole band, as reflectances must.
BRICK = {"table": [[360, 0.06], [480, 0.09], [560, 0.18], [600, 0.42], [680, 0.58], [830, 0.62]]}
MOSS = {"table": [[360, 0.05], [470, 0.1], [530, 0.45], [580, 0.3], [660, 0.12], [830, 0.5]]}
LINEN = {"table": [[360, 0.45], [420, 0.62], [500, 0.74], [830, 0.8]]}
# Between copper and gold.
ETA = {"table": [[360, 1.3], [450, 1.2], [520, 1.05], [580, 0.45], [650, 0.22], [830, 0.16]]}
K = {"table": [[360, 1.9], [450, 2.2], [520, 2.35], [580, 2.7], [650, 3.5], [830, 5.1]]}
WARM = {"table": [[380, 0.9], [450, 1.8], [560, 3.2], [640, 4.0], [780, 4.4]]}

BOARD = {"board": {"checkerboard": {"a": 0.15, "b": LINEN, "scale": [6, 6]}}}

BLACK = {"diffuse": {"reflectance": 0.0}}


def diffuse(reflectance) -> dict:
    return {"diffuse": {"reflectance": reflectance}}


def rectangle(corner, edge_u, edge_v, material, **more) -> dict:
    return {"rectangle": {"corner": corner, "edge_u": edge_u, "edge_v": edge_v, "material": material, **more}}


def floor(material, half=4.0) -> dict:
    """At y = 0, its normal up."""
    return rectangle([-half, 0, half], [2 * half, 0, 0], [0, 0, -2 * half], material)


def ceiling_light(emission, half=1.0, y=3.0, x=0.0) -> dict:
    """Shines down."""
    return rectangle([x - half, y, -half], [2 * half, 0, 0], [0, 0, 2 * half], BLACK, emission=emission)


def sphere(center, radius, material, **more) -> dict:
    return {"sphere": {"center": center, "radius": radius, "material": material, **more}}


def scene(shapes, lights=(), depth=6, size=64, camera=None, image=None, **more) -> dict:
    described = {
        "camera": {"origin": [0, 1.7, 5.5], "target": [0, 0.8, 0], "fov_deg": 36, "fov_axis": "x", **(camera or {})},
        "image": {"width": size, "height": size, **(image or {})},
        "integrator": {"path": {"max_depth": depth}},
        **more,
        "shapes": list(shapes),
    }
    if lights:
        described["lights"] = list(lights)
    return described


def sky(radiance=0.5) -> dict:
    return {"constant": {"radiance": radiance}}


# -- files --------------------------------------------------------------------------------------------


def write_picture(folder: Path):
    """`picture.png`: sRGB, every texel another colour, none saturated; no symmetry."""
    import OpenImageIO as oiio

    h, w = 12, 16
    y, x = np.mgrid[0:h, 0:w]
    rgb = np.stack([70 + 9 * x + 3 * y, 220 - 11 * y - x, 90 + 90 * ((x // 3 + y // 4) % 2) + 3 * y], -1)
    image = oiio.ImageOutput.create(str(folder / "picture.png"))
    image.open(str(folder / "picture.png"), oiio.ImageSpec(w, h, 3, "uint8"))
    image.write_image(np.clip(rgb, 0, 255).astype(np.uint8))
    image.close()


def write_sky(folder: Path):
    """`sky.exr` and its twin on Mitsuba's grid: one smooth function of direction on both."""
    import OpenEXR

    def radiance(d):
        blob = lambda axis, width: np.exp((d @ (np.array(axis) / np.linalg.norm(axis)) - 1) / width)  # noqa: E731
        base = np.stack([0.35 + 0.1 * d[..., 0], 0.45 + 0.2 * d[..., 1], 0.6 + 0.25 * d[..., 1]], -1)
        sun = blob([0.7, 0.6, 0.4], 0.05)[..., None] * np.array([6.0, 5.0, 3.0])
        red = blob([-0.8, 0.2, -0.5], 0.1)[..., None] * np.array([1.5, 0.5, 0.3])
        return base + sun + red

    def grid(theta, longitude):
        t, p = np.meshgrid(theta, longitude, indexing="ij")
        # Longitude 0 looks along -z and grows toward +x.
        return np.stack([np.sin(t) * np.sin(p), np.cos(t), -np.sin(t) * np.cos(p)], -1)

    h, w = 96, 192
    columns = (np.arange(w) + 0.5) / w * 2 * np.pi
    ours = radiance(grid((np.arange(h) + 0.5) / h * np.pi, columns - np.pi))
    theirs = radiance(grid(np.arange(h) / (h - 1) * np.pi, columns))
    for name, pixels in [("sky.exr", ours), ("sky.mitsuba.exr", theirs)]:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": pixels.astype(np.float32)}).write(str(folder / name))


def torus(rings=72, sides=48, radius=0.8, tube=0.33):
    """Vertices, normals, texture coordinates and faces of a torus about +y; with a seam.

    Facets are fine because the two renderers differ, by convention, where the smooth normal faces away
    and the facet does not: at the silhouette, in proportion to the angle between facets.
    """
    a, b = np.meshgrid(np.linspace(0, 1, rings + 1), np.linspace(0, 1, sides + 1), indexing="ij")
    u, v = a.ravel(), b.ravel()
    p, q = 2 * np.pi * u, 2 * np.pi * v
    n = np.stack([np.cos(q) * np.cos(p), np.sin(q), np.cos(q) * np.sin(p)], -1)
    x = np.stack([np.cos(p), np.zeros_like(p), np.sin(p)], -1) * radius + tube * n
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij"))
    k = lambda di, dj: (i + di) * (sides + 1) + j + dj  # noqa: E731
    faces = np.concatenate([np.stack([k(0, 0), k(0, 1), k(1, 0)], -1), np.stack([k(1, 0), k(0, 1), k(1, 1)], -1)])
    return x, n, np.stack([u, v], -1), faces


def write_ply(path: Path, x, n, uv, faces):
    """ASCII."""
    names = ["x", "y", "z", "nx", "ny", "nz", "u", "v"]
    head = ["ply", "format ascii 1.0", f"element vertex {len(x)}", *(f"property float {name}" for name in names)]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(f"{value:.7g}" for value in row) for row in np.concatenate([x, n, uv], 1)]
    rows += [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(head + rows) + "\n")


def write_obj(path: Path, x, n, uv, faces):
    """With normals and texture coordinates."""
    rows = []
    for letter, values in [("v", x), ("vn", n), ("vt", uv)]:
        rows += [f"{letter} " + " ".join(f"{value:.7g}" for value in row) for row in values]
    rows += ["f " + " ".join(f"{i + 1}/{i + 1}/{i + 1}" for i in face) for face in faces]
    path.write_text("\n".join(rows) + "\n")


def write_meshes(folder: Path):
    """A torus twice, a picture, and a prism without normals."""
    write_picture(folder)
    write_ply(folder / "torus.ply", *torus())
    write_obj(folder / "torus.obj", *torus())


def write_prism(folder: Path):
    """`prism.obj`: an equilateral prism along z, its edge up; faces only."""
    s = 0.7
    corners = [(-s, 0.0), (s, 0.0), (0.0, s * 3**0.5)]
    vertices = [(x, y, z) for z in (-0.8, 0.8) for x, y in corners]
    faces = [(1, 3, 2), (4, 5, 6), (1, 2, 5), (1, 5, 4), (2, 3, 6), (2, 6, 5), (3, 1, 4), (3, 4, 6)]
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces]
    (folder / "prism.obj").write_text("\n".join(rows) + "\n")


# -- cases --------------------------------------------------------------------------------------------


def surfaces() -> list:
    """What surfaces do with light."""
    light = ceiling_light(12.0)
    pair = lambda a, b: [sphere([-0.85, 0.8, 0], 0.8, a), sphere([0.85, 0.8, 0], 0.8, b)]  # noqa: E731
    metal = lambda **more: {"conductor": {"eta": ETA, "k": K, **more}}  # noqa: E731
    glass = lambda **more: {"dielectric": {"ior": 1.5, **more}}  # noqa: E731
    return [
        Case(
            "diffuse",
            "diffuse sphere on a floor under an area light",
            scene([floor(diffuse(LINEN)), sphere([0, 0.9, 0], 0.9, diffuse(BRICK)), light]),
            peer_samples=1024,
        ),
        Case(
            "cylinders",
            "an open cylinder, one with caps, a cube, a disk that shines",
            scene(
                [
                    floor(diffuse(LINEN)),
                    {
                        "cylinder": {
                            "base": [-1.2, 0.3, 0.4],
                            "top": [-0.5, 1.3, -0.6],
                            "radius": 0.55,
                            "caps": "none",
                            "material": diffuse(MOSS),
                        }
                    },
                    {
                        "cylinder": {
                            "base": [0.7, 0, 0.2],
                            "top": [0.9, 1.2, 0],
                            "radius": 0.4,
                            "caps": "both",
                            "material": diffuse(BRICK),
                        }
                    },
                    {
                        "cube": {
                            "size": [0.5, 0.8, 0.6],
                            "material": diffuse(0.7),
                            "transform": [
                                {"rotate": {"axis": [1, 2, 0.5], "deg": 35}},
                                {"translate": [0.1, 0.7, 1.2]},
                            ],
                        }
                    },
                    {
                        "disk": {
                            "center": [0.4, 2.8, 0.6],
                            "normal": [-0.1, -1, -0.3],
                            "radius": 1.1,
                            "material": BLACK,
                            "emission": 12.0,
                        }
                    },
                ]
            ),
            peer_samples=1024,
        ),
        Case(
            "conductor",
            "a metal by tables of eta and k, smooth",
            scene([floor(diffuse(LINEN)), *pair(metal(), diffuse(MOSS)), light], [sky()]),
            peer_samples=768,
        ),
        Case(
            "rough_conductor",
            "the same metal, GGX and Beckmann",
            scene(
                [
                    floor(diffuse(LINEN)),
                    *pair(metal(roughness=0.25), metal(roughness=0.35, distribution="beckmann")),
                    light,
                ],
                [sky()],
            ),
            peer_samples=1024,
        ),
        Case(
            "dielectric",
            "glass of one index, and glass filled with water",
            scene(
                [
                    floor(diffuse({"texture": "board"})),
                    *pair(glass(), {"dielectric": {"ior": 1.333, "exterior_ior": 1.1}}),
                    ceiling_light(1.5, half=2.0),
                ],
                [sky()],
                depth=8,
                textures=BOARD,
            ),
        ),
        Case(
            "rough_dielectric",
            "frosted glass, GGX and Beckmann",
            scene(
                [
                    floor(diffuse({"texture": "board"})),
                    *pair(glass(roughness=0.3), glass(roughness=0.2, distribution="beckmann")),
                    ceiling_light(1.5, half=2.0),
                ],
                [sky()],
                depth=8,
                textures=BOARD,
            ),
        ),
        Case(
            "plastic",
            "a diffuse base under a smooth coat, with and without colour shift",
            scene(
                [
                    floor(diffuse(LINEN)),
                    *pair(
                        {"plastic": {"reflectance": BRICK, "ior": 1.5}},
                        {"plastic": {"reflectance": BRICK, "ior": 1.9, "nonlinear": True}},
                    ),
                    light,
                ],
                [sky()],
            ),
            peer_samples=1024,
        ),
        Case(
            "rough_plastic",
            "a diffuse base under a rough coat, GGX and Beckmann",
            scene(
                [
                    floor(diffuse(LINEN)),
                    *pair(
                        {"plastic": {"reflectance": MOSS, "ior": 1.5, "roughness": 0.2}},
                        {
                            "plastic": {
                                "reflectance": BRICK,
                                "ior": 1.6,
                                "roughness": 0.3,
                                "distribution": "beckmann",
                                "nonlinear": True,
                            }
                        },
                    ),
                    light,
                ],
                [sky()],
            ),
            peer_samples=768,
        ),
        Case(
            "textures",
            "a picture on a sphere and a wall, bilinear and repeated; a checkerboard under both",
            scene(
                [
                    floor(diffuse({"texture": "board"})),
                    rectangle([-3, 0, -2], [6, 0, 0], [0, 4, 0], diffuse({"texture": "wall"})),
                    sphere(
                        [-0.85, 0.8, 0],
                        0.8,
                        diffuse({"texture": "picture"}),
                        transform=[{"rotate": {"axis": [0, 1, 0], "deg": 40}}],
                    ),
                    sphere([0.85, 0.8, 0], 0.8, diffuse({"texture": "globe"})),
                    light,
                ],
                [sky(0.3)],
                textures={
                    **BOARD,
                    "picture": {"image": {"file": "picture.png"}},
                    "wall": {"image": {"file": "picture.png", "scale": [2.6, 1.7], "offset": [0.3, 0.45]}},
                    "globe": {"checkerboard": {"a": BRICK, "b": 0.75, "scale": [5, 3.25]}},
                },
            ),
            peer_samples=1536,
            assets=write_picture,
        ),
        Case(
            "meshes",
            "OBJ with texture and PLY in colour, smooth normals from the files",
            scene(
                [
                    floor(diffuse(LINEN)),
                    {
                        "mesh": {
                            "file": "torus.obj",
                            "material": diffuse({"texture": "picture"}),
                            "transform": [
                                {"rotate": {"axis": [1, 0, 0], "deg": 65}},
                                {"translate": [-0.8, 0.95, 0.2]},
                            ],
                        }
                    },
                    {
                        "mesh": {
                            "file": "torus.ply",
                            "material": {"plastic": {"reflectance": MOSS, "ior": 1.5}},
                            "transform": [
                                {"scale": 0.8},
                                {"rotate": {"axis": [0, 0, 1], "deg": 50}},
                                {"translate": [0.95, 0.8, -0.3]},
                            ],
                        }
                    },
                    light,
                ],
                [sky(0.3)],
                textures={"picture": {"image": {"file": "picture.png", "scale": [2, 1]}}},
            ),
            peer_samples=1024,
            assets=write_meshes,
        ),
    ]


def lights() -> list:
    """Where light comes from."""
    things = [floor(diffuse(LINEN)), sphere([-0.8, 0.8, 0], 0.8, diffuse(BRICK))]
    box = {
        "cube": {
            "center": [0.8, 0.6, 0],
            "size": 1.0,
            "material": diffuse(MOSS),
            "transform": [{"rotate": {"axis": [0, 1, 0], "deg": 25}}],
        }
    }
    return [
        Case(
            "delta_lights",
            "point, spot and directional light",
            scene(
                [*things, box],
                [
                    {"point": {"position": [-2, 2.5, 2], "intensity": 20.0}},
                    {
                        "spot": {
                            "position": [2.5, 3, 2],
                            "target": [0.5, 0.3, 0],
                            "cutoff_deg": 25,
                            "beam_deg": 15,
                            "intensity": {"scaled": {"by": 5.0, "of": WARM}},
                        }
                    },
                    {"directional": {"direction": [0.4, -1, -0.7], "irradiance": 3.0}},
                ],
                depth=4,
            ),
            peer_samples=1024,
        ),
        Case("constant", "the same radiance from everywhere", scene([*things, box], [sky(1.0)])),
        Case(
            "environment",
            "an image all around, seen directly, in a mirror and by diffuse surfaces; turned about y",
            scene(
                [*things, sphere([0.85, 0.8, 0], 0.8, {"conductor": {"eta": ETA, "k": K}})],
                [{"environment": {"file": "sky.exr", "scale": 1.2, "rotate_deg": 35}}],
            ),
            assets=write_sky,
        ),
        Case(
            "emitters",
            "RGB, D65, a table and a number as emission",
            scene(
                [
                    floor(diffuse(0.7)),
                    ceiling_light({"rgb": [8.0, 2.8, 1.2]}, half=0.4, x=-1.5, y=2.2),
                    ceiling_light({"illuminant": {"name": "D65", "scale": 5.0}}, half=0.4, x=-0.5, y=2.2),
                    ceiling_light(WARM, half=0.4, x=0.5, y=2.2),
                    ceiling_light(5.0, half=0.4, x=1.5, y=2.2),
                    sphere([0, 0.5, 0], 0.5, diffuse({"rgb": [0.3, 0.55, 0.7]})),
                ]
            ),
            peer_samples=3072,
        ),
        Case(
            "blackbody",
            "a black body in absolute units",
            scene([*things, ceiling_light({"blackbody": {"kelvin": 3200, "normalised": False}})]),
            peer_samples=768,
        ),
        Case(
            "shapes_that_shine",
            "sphere, cylinder, cube and mesh as area lights",
            scene(
                [
                    floor(diffuse(LINEN)),
                    sphere([-1.3, 1.3, 0], 0.35, BLACK, emission=3.0),
                    {
                        "cylinder": {
                            "base": [-0.5, 0.4, 0.4],
                            "top": [-0.2, 1.6, 0.2],
                            "radius": 0.15,
                            "caps": "both",
                            "material": BLACK,
                            "emission": {"rgb": [2.0, 1.2, 0.4]},
                        }
                    },
                    {
                        "cube": {
                            "size": 0.5,
                            "material": BLACK,
                            "emission": 2.0,
                            "transform": [
                                {"rotate": {"axis": [1, 1, 0], "deg": 40}},
                                {"translate": [0.5, 0.8, 0]},
                            ],
                        }
                    },
                    {
                        "mesh": {
                            "file": "torus.ply",
                            "material": BLACK,
                            "emission": WARM,
                            "transform": [
                                {"scale": 0.4},
                                {"rotate": {"axis": [1, 0, 0], "deg": 80}},
                                {"translate": [1.4, 1.2, 0]},
                            ],
                        }
                    },
                ]
            ),
            peer_samples=1024,
            assets=write_meshes,
        ),
        Case(
            "medium",
            "fog whose extinction depends on wavelength, and mist in glass whose albedo does",
            scene(
                [
                    floor(diffuse(LINEN)),
                    sphere([-0.85, 0.85, 0], 0.8, {"boundary": {}}, inside="fog"),
                    sphere([0.85, 0.85, 0], 0.8, {"dielectric": {"ior": 1.3}}, inside="mist"),
                    ceiling_light(2.0, half=1.5),
                ],
                [sky()],
                depth=16,
                media={
                    "fog": {
                        "homogeneous": {
                            "absorption": {"table": [[360, 1.0], [830, 0.1]]},
                            "scattering": {"table": [[360, 4.0], [830, 0.4]]},
                            "phase": {"hg": 0.6},
                        }
                    },
                    "mist": {
                        "homogeneous": {
                            "absorption": {"table": [[360, 0.1], [830, 1.2]]},
                            "scattering": {"table": [[360, 1.4], [830, 0.3]]},
                            "phase": "isotropic",
                        }
                    },
                },
            ),
        ),
    ]


def cameras() -> list:
    """How light becomes pixels."""
    row = [
        sphere([x, 0.5, z], 0.5, diffuse(r))
        for x, z, r in [(-0.9, 1.2, BRICK), (0.0, 0.0, LINEN), (1.1, -2.0, MOSS), (-1.4, -2.5, 0.6)]
    ]
    here = [floor(diffuse({"texture": "board"})), *row]
    stage = lambda **more: scene(here, [sky(1.0)], textures=BOARD, depth=3, **more)  # noqa: E731
    return [
        Case("thin_lens", "depth of field", stage(camera={"lens": {"radius": 0.25, "focus_distance": 5.3}})),
        Case("orthographic", "parallel projection", stage(camera={"fov_deg": None, "orthographic_height": 3.6})),
        Case(
            "crop",
            "a part of a picture that is not square, seen along its height, the horizon inclined",
            stage(
                camera={"up": [0.2, 1, 0], "fov_axis": "y"},
                image={"width": 96, "height": 72, "crop": {"x": 8, "y": 16, "width": 72, "height": 48}},
            ),
        ),
        Case("gaussian", "Gaussian reconstruction filter", stage(image={"filter": {"gaussian": {"stddev": 0.5}}})),
    ]


# Sixteen bands over what the eye sees, among them lines of mercury, cadmium, hydrogen and helium, nm.
BANDS = (405, 420, 436, 452, 468, 486, 508, 526, 546, 566, 588, 610, 632, 656, 678, 700)
BAND_WIDTH = 4.0


def dispersion() -> list:
    """N-SF11 band by band: a prism and a ball before a ring of stripes. Through the prism, near its least
    deviation, a change of 0.01 in the index moves the stripes by 1.3 degrees, two pixels.

    Mitsuba has no dispersion. For one band it is given the index there as a number; as nothing else in
    the scene depends on wavelength its light may then be white, which spares it from drawing
    wavelengths that miss the band. Abbe has the glass by name and the band as its light.
    """

    def described(glass, light) -> dict:
        material = {"dielectric": {"ior": glass}}
        turns = [{"rotate": {"axis": [1, 0, 0], "deg": -90}}, {"rotate": {"axis": [0, 1, 0], "deg": 60}}]
        place = [{"translate": [0.75, 0.85, 0.6]}]
        prism = {"file": "prism.obj", "normals": "face", "material": material, "transform": turns + place}
        return scene(
            [
                floor(diffuse(0.6)),
                *(stripe(20.0 * i, light) for i in range(18)),
                sphere([-0.75, 0.75, 0.4], 0.7, material),
                {"mesh": prism},
            ],
            [{"constant": {"radiance": scaled(light, 0.3)}}],
            depth=10,
            camera={"origin": [0, 1.1, 3.6], "target": [0.1, 0.8, 0], "fov_deg": 40},
        )

    def stripe(deg, light) -> dict:
        """One of a ring of upright lights about the scene, 10 degrees wide, that shines inward."""
        a, radius = np.radians(deg), 4.0
        along, outward = np.array([np.cos(a), 0, np.sin(a)]), np.array([np.sin(a), 0, -np.cos(a)])
        width = 2 * radius * np.tan(np.radians(5))
        corner = radius * outward - width / 2 * along
        return rectangle(corner.tolist(), (width * along).tolist(), [0, 3.0, 0], BLACK, emission=light)

    def scaled(light, by):
        return light * by if isinstance(light, float) else {"scaled": {"by": by, "of": light}}

    cases = []
    for nm in BANDS:
        # As high as the white light of Mitsuba, so that noise per sample is alike.
        line = {"lines": [{"nm": nm, "power": BAND_WIDTH, "width_nm": BAND_WIDTH}]}
        cases.append(
            Case(
                f"dispersion_{nm}",
                f"N-SF11 at {nm} nm, n = {n_sf11(nm):.5f}",
                described({"glass": "N-SF11"}, line),
                peer=described(n_sf11(nm), 1.0),
                assets=write_prism,
                light_seen=scene([], [{"constant": {"radiance": line}}], size=32),
            )
        )
    return cases


def all_cases() -> list:
    """Every case, in the order of the report."""
    cases = surfaces() + lights() + cameras() + dispersion()
    for case in cases:
        camera = case.scene["camera"]
        if camera.get("fov_deg", 0) is None:
            del camera["fov_deg"], camera["fov_axis"]
    return cases
