"""Abbe's description of a scene as Mitsuba 3 XML.

The part of the grammar that the cases use; whatever is outside it is refused by name, never left out.
Why a number is changed on the way stands in `conventions.py`.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from conventions import PIXEL_FACTOR

# Mitsuba's sphere has its pole at +z and its seam at +x; Abbe's at +y and -z. Columns: where
# Mitsuba's x, y and z come to lie.
SPHERE = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])

# Shapes whose v runs downward in Mitsuba and upward in Abbe. (Mitsuba reads OBJ with v flipped and
# PLY without.)
DOWNWARD = {"sphere", "obj"}

# A depth that no path reaches.
NO_ROULETTE = 1_000_000


def number(x: float) -> str:
    return repr(float(x))


def numbers(values) -> str:
    return ", ".join(number(x) for x in values)


def kind(node: dict) -> tuple:
    """The one key of a singleton map and its value."""
    if not isinstance(node, dict) or len(node) != 1:
        raise ValueError(f"expected a map of one key, found {node!r}")
    return next(iter(node.items()))


def add(parent, tag, name=None, value=None, **attributes):
    """A child element."""
    e = ElementTree.SubElement(parent, tag)
    if name is not None:
        e.set("name", name)
    if value is not None:
        e.set("value", value if isinstance(value, str) else number(value))
    for key, v in attributes.items():
        e.set(key, v)
    return e


def check_fields(what: str, node: dict, known: set):
    unknown = set(node) - known
    if unknown:
        raise ValueError(f"{what}: nothing in the translation for {sorted(unknown)}")


# -- spectra ------------------------------------------------------------------------------------------


def table_of(spectrum, nm: np.ndarray) -> np.ndarray:
    """The spectrum's values at `nm`."""
    if isinstance(spectrum, (int, float)):
        return np.full(nm.shape, float(spectrum))
    key, value = kind(spectrum)
    if key == "table":
        t = np.array(value)
        return np.interp(nm, t[:, 0], t[:, 1])
    if key == "scaled":
        return value["by"] * table_of(value["of"], nm)
    raise ValueError(f"no table for a spectrum of kind {key}")


def table_text(pairs) -> str:
    return ", ".join(f"{number(nm)}:{number(v)}" for nm, v in pairs)


def box(line: dict) -> list:
    """A line as a table: a box with flanks of a millionth of its width."""
    half, flank = line.get("width_nm", 1.0) / 2, line.get("width_nm", 1.0) * 1e-6
    height = line.get("power", 1.0) / (2 * half)
    nm = line["nm"]
    return [[nm - half - flank, 0.0], [nm - half, height], [nm + half, height], [nm + half + flank, 0.0]]


def spectrum(parent, name: str, value, emits: bool = False, by: float = 1.0):
    """A spectrum element; `by` multiplies it."""
    if isinstance(value, (int, float)):
        # Several tables have a number where only one value is meant; `spectrum` keeps it raw.
        return add(parent, "spectrum", name, number(value * by))
    key, body = kind(value)
    if key == "scaled":
        return spectrum(parent, name, body["of"], emits, by * body["by"])
    if key == "table":
        return add(parent, "spectrum", name, table_text([nm, v * by] for nm, v in body))
    if key == "rgb":
        if emits:
            by /= PIXEL_FACTOR
        return add(parent, "rgb", name, numbers(c * by for c in body))
    if key == "lines" and emits and len(body) == 1:
        return add(parent, "spectrum", name, table_text([nm, v * by] for nm, v in box(body[0])))
    if key == "illuminant" and emits:
        body = {"name": body} if isinstance(body, str) else body
        if body["name"] == "D65":
            e = add(parent, "spectrum", name, type="d65")
            add(e, "float", "scale", by * body.get("scale", 1.0) / PIXEL_FACTOR)
            return e
    if key == "blackbody" and emits and body.get("normalised") is False and by * body.get("scale", 1.0) == 1.0:
        e = add(parent, "spectrum", name, type="blackbody")
        add(e, "float", "temperature", body["kelvin"])
        return e
    raise ValueError(f"{name}: no translation for the spectrum {value!r}")


def matrix(parent, name: str, m: np.ndarray):
    """A transform; `m` is 4 x 4."""
    t = add(parent, "transform", name)
    add(t, "matrix", None, " ".join(number(x) for x in np.asarray(m).ravel()))


def under_rough_coat(plastic: dict) -> dict:
    """The reflectance that gives Mitsuba's `roughplastic` the base which the description has.

    Light that the base scatters is partly thrown back by the coat, f = r / (1 - r' F) with r' = r
    (`nonlinear`) or 1 and F the coat's diffuse reflectance from inside. Solved for Mitsuba's r with its F.
    """
    exact, theirs = internal_reflectances(plastic["ior"], plastic["roughness"], plastic.get("distribution", "ggx"))
    nm = np.arange(360.0, 831.0)
    r = table_of(plastic["reflectance"], nm)
    if plastic.get("nonlinear", False):
        r = r / (1 - r * (exact - theirs))
    else:
        r = r * (1 - theirs) / (1 - exact)
    return {"table": np.stack([nm, r], 1).tolist()}


def internal_reflectances(ior: float, alpha: float, distribution: str) -> tuple:
    """Diffuse reflectance of a rough coat from inside, 2 times the integral of R(mu) mu over mu = 0 to 1:
    as it is, and as Mitsuba sums it (64 values of mu from 0 to 1, both ends in full, over 64)."""
    nodes, weights = gauss(128)
    ends = np.maximum(np.linspace(0, 1, 64), 1e-6)
    inside = lambda mu: rough_reflectance(mu, 1 / ior, alpha, distribution)  # noqa: E731
    return float(2 * (weights * nodes * inside(nodes)).sum()), float(2 * (ends * inside(ends)).mean())


def gauss(n: int) -> tuple:
    """Nodes and weights of Gauss and Legendre on 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return (nodes + 1) / 2, weights / 2


def rough_reflectance(mu: np.ndarray, eta: float, alpha: float, distribution: str) -> np.ndarray:
    """Albedo of a rough dielectric's reflection for light along the cosines `mu`; `eta` beyond over here.

    The integral of F G1(o) G1(i) D(m) (o.m) / cos_o over facets m (Walter et al. 2007, eq. 20 and 14).
    """
    theta, weight = gauss(160)
    theta, weight = theta * np.pi / 2, weight * np.pi / 2
    phi = (np.arange(96) + 0.5) / 96 * np.pi
    t, p = np.meshgrid(theta, phi, indexing="ij")
    m = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1)
    tan2 = np.tan(t) ** 2 / alpha**2
    scale = np.pi * alpha**2 * m[..., 2] ** 4
    density = np.exp(-tan2) / scale if distribution == "beckmann" else 1 / (scale * (1 + tan2) ** 2)
    # Half the circle twice.
    measure = density * np.sin(t) * weight[:, None] * (2 * np.pi / 96)

    def masking(z):
        slope = np.sqrt(np.maximum(1 - z**2, 0)) / np.maximum(z, 1e-12) * alpha
        if distribution == "ggx":
            return 2 / (1 + np.sqrt(1 + slope**2))
        a = 1 / np.maximum(slope, 1e-12)
        return np.where(a >= 1.6, 1.0, (3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2))

    result = []
    for z in mu:
        o = np.array([np.sqrt(1 - z * z), 0.0, z])
        cos = np.maximum(m @ o, 0.0)
        out = 2 * cos * m[..., 2] - z
        sin2 = (1 - cos**2) / eta**2
        cos_t = np.sqrt(np.maximum(1 - sin2, 0))
        s = (cos - eta * cos_t) / (cos + eta * cos_t + 1e-300)
        q = (eta * cos - cos_t) / (eta * cos + cos_t + 1e-300)
        fresnel = np.where(sin2 >= 1, 1.0, (s**2 + q**2) / 2)
        result.append((fresnel * masking(z) * masking(out) * (out > 0) * cos / z * measure).sum())
    return np.array(result)


# -- the scene ----------------------------------------------------------------------------------------


class Writer:
    """One scene on its way."""

    def __init__(self, scene: dict, folder: Path):
        self.scene = scene
        self.folder = folder
        self.root = ElementTree.Element("scene", version="3.0.0")

    def write(self, path: Path):
        """Writes the XML to `path`."""
        s = self.scene
        known = {"camera", "image", "integrator", "output", "textures", "materials", "media", "shapes", "lights"}
        check_fields("scene", s, known)
        self.integrator()
        self.sensor()
        for shape in s.get("shapes", []):
            self.shape(shape)
        for light in s.get("lights", []):
            self.light(light)
        tree = ElementTree.ElementTree(self.root)
        ElementTree.indent(tree)
        tree.write(path)

    def integrator(self):
        path = self.scene["integrator"]["path"]
        check_fields("path", path, {"max_depth", "roulette_depth"})
        media = bool(self.scene.get("media"))
        roulette = NO_ROULETTE if media else path.get("roulette_depth", 5)
        e = add(self.root, "integrator", type="volpathmis" if media else "path")
        add(e, "integer", "max_depth", str(path.get("max_depth", -1)))
        add(e, "integer", "rr_depth", str(roulette))

    def sensor(self):
        camera, image = self.scene["camera"], self.scene["image"]
        known = {"origin", "target", "up", "fov_deg", "fov_axis", "orthographic_height", "lens"}
        check_fields("camera", camera, known)
        check_fields("image", image, {"width", "height", "filter", "crop"})
        up = camera.get("up", [0, 1, 0])
        lens = camera.get("lens")
        height = camera.get("orthographic_height")
        e = add(self.root, "sensor", type="orthographic" if height else "thinlens" if lens else "perspective")
        transform = add(e, "transform", "to_world")
        if height:
            # Mitsuba's picture is 2 units wide before the transform.
            half = 0.5 * height * image["width"] / image["height"]
            add(transform, "scale", x=number(half), y=number(half))
        add(
            transform,
            "lookat",
            origin=numbers(camera["origin"]),
            target=numbers(camera["target"]),
            up=numbers(up),
        )
        if not height:
            add(e, "float", "fov", camera["fov_deg"])
            add(e, "string", "fov_axis", camera.get("fov_axis", "x"))
        if lens:
            add(e, "float", "aperture_radius", lens["radius"])
            add(e, "float", "focus_distance", lens["focus_distance"])
        add(e, "sampler", type="independent")
        film = add(e, "film", type="hdrfilm")
        add(film, "integer", "width", str(image["width"]))
        add(film, "integer", "height", str(image["height"]))
        if crop := image.get("crop"):
            for ours, theirs in [("x", "offset_x"), ("y", "offset_y"), ("width", "width"), ("height", "height")]:
                add(film, "integer", f"crop_{theirs}", str(crop[ours]))
        add(film, "string", "pixel_format", "rgb")
        add(film, "string", "component_format", "float32")
        chosen = image.get("filter", "box")
        if chosen == "box":
            add(film, "rfilter", type="box")
        else:
            name, body = kind(chosen)
            if name != "gaussian":
                raise ValueError(f"filter: no translation for {name}")
            rfilter = add(film, "rfilter", type="gaussian")
            add(rfilter, "float", "stddev", body["stddev"])

    # Lights

    def light(self, light: dict):
        name, body = kind(light)
        if name == "point":
            e = add(self.root, "emitter", type="point")
            add(e, "point", "position", numbers(body["position"]))
            spectrum(e, "intensity", body["intensity"], emits=True)
        elif name == "spot":
            e = add(self.root, "emitter", type="spot")
            transform = add(e, "transform", "to_world")
            origin, target = np.array(body["position"], float), np.array(body["target"], float)
            axis = (target - origin) / np.linalg.norm(target - origin)
            up = [0, 0, 1] if abs(axis[1]) > 0.9 else [0, 1, 0]
            add(transform, "lookat", origin=numbers(origin), target=numbers(target), up=numbers(up))
            add(e, "float", "cutoff_angle", body["cutoff_deg"])
            add(e, "float", "beam_width", body["beam_deg"])
            spectrum(e, "intensity", body["intensity"], emits=True)
        elif name == "directional":
            e = add(self.root, "emitter", type="directional")
            add(e, "vector", "direction", numbers(body["direction"]))
            spectrum(e, "irradiance", body["irradiance"], emits=True)
        elif name == "constant":
            e = add(self.root, "emitter", type="constant")
            spectrum(e, "radiance", body["radiance"], emits=True)
        elif name == "environment":
            e = add(self.root, "emitter", type="envmap")
            # The twin of the file, on Mitsuba's grid; see `conventions.py`.
            file = Path(body["file"])
            add(e, "string", "filename", str(self.folder / f"{file.stem}.mitsuba{file.suffix}"))
            add(e, "float", "scale", body.get("scale", 1.0) / PIXEL_FACTOR)
            transform = add(e, "transform", "to_world")
            add(transform, "rotate", y="1", angle=number(body.get("rotate_deg", 0.0)))
        else:
            raise ValueError(f"lights: no translation for {name}")

    # Shapes

    def shape(self, shape: dict):
        name, body = kind(shape)
        fields = {
            "sphere": {"center", "radius"},
            "disk": {"center", "normal", "radius"},
            "rectangle": {"corner", "edge_u", "edge_v"},
            "cube": {"center", "size"},
            "cylinder": {"base", "top", "radius", "caps"},
            "mesh": {"file", "normals"},
        }
        if name not in fields:
            raise ValueError(f"shapes: no translation for {name}")
        check_fields(name, body, fields[name] | {"material", "emission", "inside", "transform"})
        world = np.eye(4)
        for step in body.get("transform", []):
            world = step_matrix(step) @ world

        if name == "mesh":
            extension = Path(body["file"]).suffix[1:]
            e = self.surface(extension, world, body, uv=extension)
            add(e, "string", "filename", str(self.folder / body["file"]))
            normals = body.get("normals", "file")
            if normals == "face":
                add(e, "boolean", "face_normals", "true")
            elif normals != "file":
                raise ValueError(f"mesh: no translation for normals {normals}")
        elif name == "sphere":
            to_world = affine(SPHERE * body["radius"], body.get("center", [0, 0, 0]))
            self.surface("sphere", world @ to_world, body, uv="sphere")
        elif name == "disk":
            self.disk(world, body, body.get("center", [0, 0, 0]), body["normal"], body["radius"])
        elif name == "rectangle":
            u, v = np.array(body["edge_u"], float), np.array(body["edge_v"], float)
            n = np.cross(u, v)
            columns = np.stack([u / 2, v / 2, n / np.linalg.norm(n)], 1)
            to_world = affine(columns, np.array(body["corner"]) + (u + v) / 2)
            self.surface("rectangle", world @ to_world, body, uv="rectangle")
        elif name == "cube":
            size = np.broadcast_to(np.array(body["size"], float), 3)
            self.surface("cube", world @ affine(np.diag(size / 2), body.get("center", [0, 0, 0])), body, uv=None)
        elif name == "cylinder":
            base, top = np.array(body["base"], float), np.array(body["top"], float)
            e = self.surface("cylinder", world, body, uv=None)
            add(e, "point", "p0", numbers(base))
            add(e, "point", "p1", numbers(top))
            add(e, "float", "radius", body["radius"])
            caps = body.get("caps", "both")
            if caps in ("both", "base"):
                self.disk(world, body, base, base - top, body["radius"])
            if caps in ("both", "top"):
                self.disk(world, body, top, top - base, body["radius"])

    def disk(self, world, body, center, normal, radius):
        self.surface("disk", world @ affine(frame(normal) * radius, center), body, uv=None)

    def surface(self, plugin: str, to_world, body: dict, uv):
        """A shape element with what it is made of."""
        e = add(self.root, "shape", type=plugin)
        matrix(e, "to_world", to_world)
        material = body["material"]
        if isinstance(material, str):
            material = self.scene["materials"][material]
        self.material(e, material, uv)
        if "emission" in body:
            emitter = add(e, "emitter", type="area")
            spectrum(emitter, "radiance", body["emission"], emits=True)
        if "inside" in body:
            self.medium(e, "interior", self.scene["media"][body["inside"]])
        return e

    def medium(self, parent, name: str, medium: dict):
        key, body = kind(medium)
        check_fields(key, body, {"absorption", "scattering", "phase"})
        e = add(parent, "medium", name, type="homogeneous")
        # Mitsuba has extinction and albedo. Their tables have a row each nanometre, because the
        # quotient of two linear functions is not linear.
        nm = np.arange(360.0, 831.0)
        scattering = table_of(body.get("scattering", 0.0), nm)
        extinction = scattering + table_of(body.get("absorption", 0.0), nm)
        add(e, "spectrum", "sigma_t", table_text(zip(nm, extinction)))
        add(e, "spectrum", "albedo", table_text(zip(nm, scattering / extinction)))
        phase = body.get("phase", "isotropic")
        if phase in ("isotropic", "rayleigh"):
            add(e, "phase", type=phase)
        else:
            p = add(e, "phase", type="hg")
            add(p, "float", "g", phase["hg"])

    # Materials

    def material(self, parent, material: dict, uv):
        name, body = kind(material)
        if name in ("diffuse", "conductor", "plastic") and body.get("two_sided", True):
            parent = add(parent, "bsdf", type="twosided")
        rough = body.get("roughness", 0.0)
        if name == "diffuse":
            check_fields(name, body, {"reflectance", "two_sided"})
            e = add(parent, "bsdf", type="diffuse")
            self.texture(e, "reflectance", body["reflectance"], uv)
        elif name == "conductor":
            check_fields(name, body, {"eta", "k", "roughness", "distribution", "two_sided"})
            e = add(parent, "bsdf", type="roughconductor" if rough else "conductor")
            spectrum(e, "eta", body["eta"])
            spectrum(e, "k", body["k"])
        elif name == "dielectric":
            check_fields(name, body, {"ior", "exterior_ior", "roughness", "distribution"})
            e = add(parent, "bsdf", type="roughdielectric" if rough else "dielectric")
            add(e, "float", "int_ior", body["ior"])
            add(e, "float", "ext_ior", body.get("exterior_ior", 1.0))
        elif name == "plastic":
            check_fields(name, body, {"reflectance", "ior", "roughness", "distribution", "nonlinear", "two_sided"})
            e = add(parent, "bsdf", type="roughplastic" if rough else "plastic")
            if rough:
                spectrum(e, "diffuse_reflectance", under_rough_coat(body))
            else:
                self.texture(e, "diffuse_reflectance", body["reflectance"], uv)
            add(e, "float", "int_ior", body["ior"])
            add(e, "float", "ext_ior", 1.0)
            add(e, "boolean", "nonlinear", str(body.get("nonlinear", False)).lower())
        elif name == "boundary":
            e = add(parent, "bsdf", type="null")
        else:
            raise ValueError(f"materials: no translation for {name}")
        if rough:
            add(e, "float", "alpha", rough)
            add(e, "string", "distribution", body.get("distribution", "ggx"))

    def texture(self, parent, name: str, value, uv):
        if not (isinstance(value, dict) and "texture" in value):
            spectrum(parent, name, value)
            return
        if uv is None:
            raise ValueError(f"{name}: no translation for a texture on this shape")
        key, body = kind(self.scene["textures"][value["texture"]])
        su, sv = body.get("scale", [1, 1])
        ou, ov = body.get("offset", [0, 0])
        # Abbe's v as a function of Mitsuba's, v = slope * v' + shift.
        slope, shift = (-1.0, 1.0) if uv in DOWNWARD else (1.0, 0.0)
        slope, shift = sv * slope, sv * shift + ov
        if key == "image":
            check_fields(key, body, {"file", "wrap", "filter", "scale", "offset"})
            e = add(parent, "texture", name, type="bitmap")
            add(e, "string", "filename", str(self.folder / body["file"]))
            add(e, "string", "filter_type", body.get("filter", "bilinear"))
            add(e, "string", "wrap_mode", body.get("wrap", "repeat"))
            # v = 0 is the top of the picture.
            slope, shift = -slope, 1.0 - shift
        elif key == "checkerboard":
            check_fields(key, body, {"a", "b", "scale", "offset"})
            e = add(parent, "texture", name, type="checkerboard")
            spectrum(e, "color0", body["a"])
            spectrum(e, "color1", body["b"])
        else:
            raise ValueError(f"textures: no translation for {key}")
        # Mitsuba leaves out the third row and column.
        matrix(e, "to_uv", [[su, 0, 0, ou], [0, slope, 0, shift], [0, 0, 1, 0], [0, 0, 0, 1]])


def affine(linear, origin) -> np.ndarray:
    """The 4 x 4 matrix of a linear map and a shift."""
    m = np.eye(4)
    m[:3, :3] = linear
    m[:3, 3] = origin
    return m


def frame(normal) -> np.ndarray:
    """A rotation whose third column is along `normal`."""
    n = np.array(normal, float) / np.linalg.norm(normal)
    s = np.cross(n, [1.0, 0.0, 0.0] if abs(n[0]) < 0.7 else [0.0, 1.0, 0.0])
    s /= np.linalg.norm(s)
    return np.stack([s, np.cross(n, s), n], 1)


def step_matrix(step: dict) -> np.ndarray:
    """One step of a transform."""
    key, body = kind(step)
    if key == "translate":
        return affine(np.eye(3), body)
    if key == "scale":
        return affine(np.diag(np.broadcast_to(np.array(body, float), 3)), [0, 0, 0])
    if key == "rotate":
        a = np.array(body["axis"], float) / np.linalg.norm(body["axis"])
        cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
        t = np.radians(body["deg"])
        return affine(np.eye(3) + np.sin(t) * cross + (1 - np.cos(t)) * cross @ cross, [0, 0, 0])
    raise ValueError(f"transform: no translation for {key}")
