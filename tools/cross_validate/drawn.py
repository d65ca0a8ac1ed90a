"""Scenes drawn at random from most of Mitsuba's plugins, for what no scene of one feature shows: how they go together.

A scene is a function of its number. It has a ground, one to three bodies, one or two lights, a camera and an integrator,
each with parameters, textures and transforms that are drawn. What the two renderers are known to mean otherwise
(docs/mitsuba.md says why) is left out here, beside the word "known".
"""

import random
import re
from pathlib import Path

from scene_files import FOLDER, SceneFile

SIZE = 32
ASSETS = FOLDER / "assets"
# Square: `bumpmap` takes the slopes of turned pictures along the wrong sides where they are not (known).
RELIEF = "waves.png"
PICTURES = ("patch.png", "slide.png", "stencil.png", RELIEF)
MESHES = {"obj": ("tile.obj", "roof.obj"), "ply": ("tile.ply", "tile_text.ply"), "serialized": ("tiles.serialized",)}
# Colours of its vertices and faces.
PAINT = ("vertex_color", "face_paint_color")
CURVES = {"bsplinecurve": ("coil.txt", "tuft.txt"), "linearcurve": ("zigzag.txt",)}
SHAPES = ("sphere", "cube", "cylinder", "disk", "rectangle", *MESHES, *CURVES, "sdfgrid")
# Surfaces that let nothing through, that let light through, and that are made of others.
OPAQUE = ("diffuse", "conductor", "roughconductor", "plastic", "roughplastic", "principled")
CLEAR = ("dielectric", "thindielectric", "roughdielectric", "null", "principledthin")
LAYERED = ("mask", "twosided", "blendbsdf", "bumpmap", "normalmap")
METALS = ("Au", "Ag", "Cu", "Al", "Cr", "W", "none")
# What is met without a change of direction.
OPEN = ("mask", "null", "thindielectric")
# Light that no scattered ray meets.
DELTA = {"point", "spot", "projector", "directional"}
SKIES = {"constant", "envmap", "sunsky"}
# What `ptracer` does otherwise than `path` (known): lamps that are turned balls, bands, clipping planes, moved middles; things behind
# what is open; geometric normals of mirrored cubes, slopes, tints by the luminance of a few wavelengths. Hair is not reciprocal.
UNTRACED = (
    r'type="sphere">(?:(?!</shape>)[\s\S])*<emitter|specfilm|_clip|principal_point|'
    f'"({"|".join(OPEN)})"|'
    r'scale x="-|bumpmap|normalmap|_tint|hair|texture type="checkerboard" name="(radiance|irradiance|texture)|blackbody'
)
# What tangents turn.
GRAIN = "alpha_u|anisotropic|bumpmap|normalmap"


def number(x: float) -> str:
    return f"{x:.6g}"


def leaf(kind: str, name: str, value) -> str:
    return f'<{kind} name="{name}" value="{value}"/>'


def plugin(family: str, kind: str, *inside: str, name: str = "") -> str:
    named = f' name="{name}"' if name else ""
    return f'<{family} type="{kind}"{named}>{"".join(inside)}</{family}>'


def to_world(steps: str) -> str:
    return f'<transform name="to_world">{steps}</transform>'


class Draw:
    """Draws the parts of one scene."""

    def __init__(self, seed: int):
        self.random = random.Random(seed)

    # -- numbers ---------------------------------------------------------------------------------------

    def chance(self, p: float) -> bool:
        return self.random.random() < p

    def one(self, *of):
        return self.random.choice(of)

    def between(self, low: float, high: float) -> str:
        return number(self.random.uniform(low, high))

    def float(self, name: str, low: float, high: float) -> str:
        return leaf("float", name, self.between(low, high))

    def maybe(self, part, p: float = 0.3) -> str:
        return part() if self.chance(p) else ""

    # -- places ----------------------------------------------------------------------------------------

    def turn(self) -> str:
        axis = [self.random.gauss(0, 1) for _ in range(3)]
        length = sum(x * x for x in axis) ** 0.5
        x, y, z = (f"{a / length:.12f}" for a in axis)
        return f'<rotate x="{x}" y="{y}" z="{z}" angle="{self.between(0, 360)}"/>'

    def place(self, x: float, even: bool, mirrored: bool = True) -> str:
        sign = "-" if mirrored and not even and self.chance(0.15) else ""
        if even:
            scale = f'<scale value="{self.between(0.4, 0.8)}"/>'
        else:
            scale = "<scale " + " ".join(f'{a}="{sign * (a == "x")}{self.between(0.4, 0.8)}"' for a in "xyz") + "/>"
        move = f'<translate x="{number(x)}" y="{self.between(0.6, 1.4)}" z="{self.between(-0.5, 0.5)}"/>'
        return to_world(scale + self.turn() + move)

    def above(self, scale: str = "") -> str:
        """Looks down at the scene from somewhere above."""
        x, z = self.between(-3, 3), self.one(self.between(1.5, 3), self.between(-3, -1.5))
        up = f"{self.between(-0.3, 0.3)}, 1, {self.between(-0.3, 0.3)}"
        look = f'<lookat origin="{x}, {self.between(2.5, 4)}, {z}" target="0, 0.7, 0" up="{up}"/>'
        return to_world(scale + look)

    # -- spectra and textures --------------------------------------------------------------------------

    def spectrum(self, name: str, low: float, high: float, rgb: bool = True) -> str:
        form = self.one("one", "list", "rgb" if rgb else "list", "irregular")
        if form == "one":
            return leaf("spectrum", name, self.between(low, high))
        if form == "rgb":
            return leaf("rgb", name, ", ".join(self.between(low, high) for _ in range(3)))
        # To the ends: `volpathmis` loses light where a medium has no extinction at some wavelengths (known).
        knots = {nm: self.between(low, high) for nm in (360, 480, 540, 620, 830)}
        if form == "irregular":
            columns = leaf("string", "wavelengths", ", ".join(map(str, knots))), leaf("string", "values", ", ".join(knots.values()))
            return plugin("spectrum", form, *columns, name=name)
        return leaf("spectrum", name, ", ".join(f"{nm}:{value}" for nm, value in knots.items()))

    def on_surface(self) -> str:
        if self.chance(0.5):
            return ""
        steps = [
            f'<scale x="{self.between(0.5, 5)}" y="{self.between(0.5, 5)}"/>',
            f'<rotate z="1" angle="{self.between(0, 360)}"/>',
            f'<translate x="{self.between(-1, 1)}" y="{self.between(-1, 1)}"/>',
        ]
        steps = self.random.sample(steps, self.random.randint(1, 3))
        return f'<transform name="to_uv">{"".join(steps)}</transform>'

    def bitmap(self, name: str, file: str, raw: bool, filters=("nearest", "bilinear")) -> str:
        return plugin(
            "texture",
            "bitmap",
            leaf("string", "filename", ASSETS / file),
            leaf("string", "filter_type", self.one(*filters)),
            leaf("string", "wrap_mode", self.one("repeat", "mirror", "clamp")),
            leaf("boolean", "raw", str(raw).lower()),
            self.on_surface(),
            name=name,
        )

    def grid(self, family: str, name: str, file: str) -> str:
        """Values all over the scene."""
        around = to_world('<translate x="-0.5" y="-0.5" z="-0.5"/>' + self.turn() + f'<scale value="{self.between(1, 5)}"/>')
        form = [leaf("string", "filter_type", self.one("trilinear", "nearest"))]
        form += [leaf("string", "wrap_mode", self.one("repeat", "mirror", "clamp"))]
        return plugin(family, "gridvolume", leaf("string", "filename", ASSETS / file), *form, around, name=name)

    def texture(self, name: str, of_volume: bool = False) -> str:
        if of_volume and self.chance(0.1):
            return plugin("texture", "volume", self.grid("volume", "volume", "colours.vol"), name=name)
        if self.chance(0.5):
            return self.bitmap(name, self.one(*PICTURES), False)
        colours = self.spectrum("color0", 0.05, 0.9) + self.spectrum("color1", 0.05, 0.9)
        return plugin("texture", "checkerboard", colours, self.on_surface(), name=name)

    def reflectance(self, name: str, of_volume: bool = True) -> str:
        return self.texture(name, of_volume) if self.chance(0.4) else self.spectrum(name, 0.02, 0.9)

    def scalar(self, name: str, low: float, high: float, textured: float = 0.2, pictures: bool = True) -> str:
        if not self.chance(textured):
            return self.float(name, low, high)
        if pictures and self.chance(0.5):
            return self.bitmap(name, self.one(*PICTURES), True)
        values = (leaf("spectrum", f"color{i}", self.between(low, high)) for i in range(2))
        return plugin("texture", "checkerboard", *values, self.on_surface(), name=name)

    # -- surfaces --------------------------------------------------------------------------------------

    def indices(self) -> str:
        inside = self.one(self.float("int_ior", 1.05, 2.2), leaf("string", "int_ior", self.one("bk7", "water", "diamond")))
        return inside + self.maybe(lambda: self.float("ext_ior", 1.0, 1.4), 0.2)

    def tints(self) -> str:
        names = ("specular_reflectance", "specular_transmittance")
        return "".join(self.maybe(lambda n=n: self.spectrum(n, 0.3, 1)) for n in names)

    def roughness(self) -> str:
        shape = leaf("string", "distribution", self.one("ggx", "beckmann"))
        # Pictures have black, and no roughness is none.
        names = ("alpha_u", "alpha_v") if self.chance(0.3) else ("alpha",)
        alphas = "".join(self.scalar(name, 0.05, 0.6, pictures=False) for name in names)
        return shape + alphas + self.maybe(lambda: leaf("boolean", "sample_visible", "false"), 0.15)

    def bsdf(self, depth: int = 2, clear: bool = True) -> str:
        """A surface with others in it, at most `depth` deep; whether it may let light through."""
        kind = self.one("diffuse", *OPAQUE, *(CLEAR if clear else ()), *(LAYERED if depth else ()))
        return plugin("bsdf", kind, getattr(self, kind)(depth, clear))

    def diffuse(self, *_):
        return self.maybe(lambda: self.reflectance("reflectance"), 0.9)

    def dielectric(self, *_):
        return self.indices() + self.tints()

    thindielectric = dielectric

    def roughdielectric(self, *_):
        return self.indices() + self.roughness() + self.tints()

    def conductor(self, *_):
        # Colours above one for eta and k are known.
        measured = leaf("string", "material", self.one(*METALS))
        given = self.spectrum("eta", 0.2, 2, rgb=False) + self.spectrum("k", 1, 5, rgb=False)
        return self.one(measured, given) + self.maybe(lambda: self.reflectance("specular_reflectance"))

    def roughconductor(self, *_):
        return self.conductor() + self.roughness()

    def plastic(self, *_):
        index = self.one(self.float("int_ior", 1.2, 1.9), leaf("string", "int_ior", "bk7"))
        shine = self.maybe(lambda: self.spectrum("specular_reflectance", 0.3, 1))
        nonlinear = self.maybe(lambda: leaf("boolean", "nonlinear", "true"))
        # There is no mean of a volume.
        return index + self.reflectance("diffuse_reflectance", False) + nonlinear + shine

    def roughplastic(self, *_):
        return self.plastic() + leaf("string", "distribution", self.one("ggx", "beckmann")) + self.float("alpha", 0.05, 0.6)

    def some(self, names, textured: float = 0.2) -> str:
        return "".join(self.maybe(lambda n=n: self.scalar(n, 0, 1, textured), 0.4) for n in names)

    def principled(self, _, clear: bool):
        base = self.reflectance("base_color") + self.scalar("roughness", 0.1, 1, pictures=False)
        names = ["metallic", "anisotropic", "spec_tint", "sheen", "sheen_tint", "clearcoat", "clearcoat_gloss", "flatness"]
        names += ["spec_trans"] * (clear and self.chance(0.5))
        index = self.one(self.float("specular", 0.1, 0.9), self.float("eta", 1.1, 2), "")
        return base + self.some(names) + index

    def principledthin(self, *_):
        base = self.reflectance("base_color") + self.scalar("roughness", 0.1, 1, pictures=False)
        names = ("anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness")
        further = self.maybe(lambda: self.scalar("diff_trans", 0, 2)) + self.maybe(lambda: self.float("eta", 1.1, 2))
        return base + self.some(names) + further

    def null(self, *_):
        return ""

    def mask(self, depth: int, clear: bool):
        return self.scalar("opacity", 0, 1, 0.5) + self.bsdf(depth - 1, clear)

    def twosided(self, *_):
        return self.bsdf(0, False) + self.maybe(lambda: self.bsdf(0, False), 0.4)

    def blendbsdf(self, depth: int, clear: bool):
        inside = [self.bsdf(depth - 1, clear) for _ in range(2)]
        # Perfect lobes, rough glass and thin sheets in a blend are known.
        while any(re.search('"(conductor|plastic|.*dielectric|principledthin|null|mask)"', b) for b in inside):
            inside = [self.bsdf(depth - 1, clear) for _ in range(2)]
        return self.scalar("weight", 0, 1, 0.5) + "".join(inside)

    def bumpmap(self, *_):
        inside = self.bsdf(0, False)
        # Grain under a relief is known.
        while re.search(GRAIN, inside):
            inside = self.bsdf(0, False)
        return self.bitmap("relief", RELIEF, True, ("bilinear",)) + self.float("scale", 0.01, 0.15) + inside

    def normalmap(self, *_):
        return self.bitmap("normalmap", "normals.png", True) + self.bsdf(0, False)

    # -- bodies ----------------------------------------------------------------------------------------

    def body(self, x: float, inside: str, closed: bool = False, mesh: bool = False) -> str:
        kind = self.one("sphere", "cube") if closed else self.one(*(MESHES if mesh else SHAPES))
        # Linear curves have no tangents, nor have grids of distances; relief on curves takes light through their backs (known).
        while kind in (*CURVES, "sdfgrid") and re.search(GRAIN, inside):
            inside = self.bsdf()
        if kind in CURVES:
            file = leaf("string", "filename", ASSETS / self.one(*CURVES[kind]))
            if kind == "bsplinecurve" and self.chance(0.5):
                inside = plugin("bsdf", "hair", self.hair())
            place = to_world(f'<rotate y="1" angle="{self.between(0, 360)}"/><translate x="{number(x)}"/>')
            return plugin("shape", kind, file, place, inside)
        if kind == "sdfgrid":
            file = leaf("string", "filename", ASSETS / "ring_and_ball.vol")
            place = to_world(f'<scale value="1.4"/><translate x="{number(x - 0.7)}" z="-0.7"/>')
            # Mirrors by coarse normals throw light through the surface (known).
            normals = self.one("analytic", "smooth" if re.search('"(diffuse|principled)"', inside) else "analytic")
            return plugin("shape", kind, file, leaf("string", "normals", normals), place, inside)
        turned = "" if closed or kind == "cube" else self.maybe(lambda: leaf("boolean", "flip_normals", "true"), 0.1)
        if kind in MESHES:
            file = leaf("string", "filename", ASSETS / self.one(*MESHES[kind]))
            if "tile_text" in file and not mesh and self.chance(0.6):
                colours = plugin("texture", "mesh_attribute", leaf("string", "name", self.one(*PAINT)), name="base_color")
                inside = plugin("bsdf", "principled", colours, self.scalar("roughness", 0.1, 1, pictures=False))
            # Shading normals turn light through backs, which is known.
            flat = self.maybe(lambda: leaf("boolean", "face_normals", "true"), 1.0 if "roof" in file else 0.3)
            return plugin("shape", kind, file, flat, self.place(x, False), turned, inside)
        # Media of mirrored cubes are outside of them, and relief on what is mirrored is black (known).
        place = self.place(x, kind not in ("cube", "rectangle"), mirrored=not closed and "bumpmap" not in inside)
        return plugin("shape", kind, "" if closed else self.measures(kind), place, turned, inside)

    def filled(self, x: float) -> str:
        """A body with a medium in it, and often something in that."""
        skin = self.one(plugin("bsdf", "null"), plugin("bsdf", "dielectric", self.indices()))
        name = f"mist{number(x)}"
        made = self.medium().replace('<medium type', f'<medium id="{name}" type', 1).replace(' name="interior"', "", 1)
        outer = self.body(x, skin + f'<ref name="interior" id="{name}"/>', closed=True)
        if self.chance(0.5):
            return made + outer
        middle = re.findall(r"<translate[^>]*>", outer)[-1]
        place = to_world(f'<scale value="{self.between(0.1, 0.22)}"/>' + self.turn() + middle)
        glass = self.one("dielectric", "roughdielectric")
        clear = plugin("bsdf", glass, getattr(self, glass)()) + f'<ref name="exterior" id="{name}"/>'
        return made + outer + plugin("shape", self.one("sphere", "cube"), place, self.one(self.bsdf(0, False), clear))

    def measures(self, kind: str) -> str:
        """Where a round shape is before it is placed, if not in the middle."""
        if kind not in ("sphere", "cylinder") or self.chance(0.7):
            return ""
        point = lambda name: leaf("point", name, ", ".join(self.between(-0.5, 0.5) for _ in range(3)))  # noqa: E731
        radius = self.float("radius", 0.3, 1)
        return radius + (point("center") if kind == "sphere" else point("p0") + point("p1"))

    def merged(self, x: float) -> str:
        """Meshes that are one; they have a surface in common."""
        made = plugin("bsdf", "twosided", plugin("bsdf", "diffuse", self.reflectance("reflectance")))
        surface = made.replace("<bsdf", f'<bsdf id="skin{number(x)}"', 1)
        parts = [self.body(x, f'<ref id="skin{number(x)}"/>', mesh=True) for _ in range(2)]
        # They have to have the same things at their corners.
        kinds = [re.findall(r'assets/\S+|face_normals|flip_normals|<scale x="-?', part) for part in parts]
        if kinds[0] != kinds[1]:
            return self.merged(x)
        return surface + plugin("shape", "merge", *parts)

    def group(self, x: float) -> str:
        members = [self.body(0, self.bsdf(1, False)) for _ in range(2)]
        # Two grids would be in one place.
        if all("sdfgrid" in member for member in members):
            return self.group(x)
        made = plugin("shape", "shapegroup", *members).replace("<shape", f'<shape id="set{number(x)}"', 1)
        turn = self.maybe(lambda: f'<rotate y="1" angle="{self.between(0, 360)}"/>')
        scale = f'<scale x="0.8" y="{self.between(0.5, 1)}" z="0.7"/>'
        places = [to_world(turn + scale + f'<translate x="{number(x)}"/>')]
        if self.chance(0.3):
            places.append(to_world(self.turn() + f'<scale value="0.5"/><translate x="{number(x)}" y="1.5" z="-1"/>'))
        return made + "".join(plugin("shape", "instance", f'<ref id="set{number(x)}"/>', place) for place in places)

    def hair(self) -> str:
        names = ("eumelanin", "pheomelanin")
        # Colours above 1 are cut there.
        dye = self.spectrum("sigma_a", 0.1, 1) if self.chance(0.3) else "".join(self.float(n, 0.05, 0.6) for n in names)
        rough = self.float("longitudinal_roughness", 0.2, 0.8) + self.maybe(lambda: self.float("azimuthal_roughness", 0.2, 0.8))
        return dye + rough + self.maybe(lambda: self.float("scale_tilt", 0, 4)) + self.maybe(lambda: self.float("int_ior", 1.3, 1.7))

    def phase(self) -> str:
        lobe = lambda: plugin("phase", "hg", self.float("g", -0.8, 0.8))  # noqa: E731
        kind = self.one("isotropic", "hg", "rayleigh", "blendphase", "tabphase")
        if kind == "hg":
            return lobe()
        if kind == "blendphase":
            weight = self.grid("volume", "weight", "mix.vol") if self.chance(0.3) else self.float("weight", 0, 1)
            return plugin("phase", kind, weight, self.one(plugin("phase", "isotropic"), lobe()), lobe())
        if kind == "tabphase":
            return plugin("phase", kind, leaf("string", "values", ", ".join(self.between(0.1, 1) for _ in range(4))))
        return plugin("phase", kind)

    def medium(self) -> str:
        if self.chance(0.3):
            around = to_world('<scale value="4"/><translate x="-2" y="-1" z="-2"/>')
            grid = plugin("volume", "gridvolume", leaf("string", "filename", ASSETS / "puff.vol"), around, name="sigma_t")
            grid = self.one(grid, grid, self.grid("volume", "sigma_t", "mix.vol"), self.grid("volume", "sigma_t", "colours.vol"))
            scale = self.float("scale", 1, 5)
            return plugin("medium", "heterogeneous", grid, self.albedo(), scale, self.phase(), name="interior")
        colour = self.spectrum("sigma_t", 0.3, 1) if self.chance(0.5) else self.float("sigma_t", 0.3, 3)
        return plugin("medium", "homogeneous", self.albedo(), colour, self.float("scale", 0.7, 2), self.phase(), name="interior")

    def albedo(self) -> str:
        form = self.one("plain", "plain", "even", "grid")
        if form == "even":
            return plugin("volume", "constvolume", self.spectrum("value", 0.2, 0.95), name="albedo")
        return self.grid("volume", "albedo", "colours.vol") if form == "grid" else self.spectrum("albedo", 0.2, 0.95)

    def fog(self) -> tuple[str, list[str]]:
        """Thin mist around all, and what the camera in it says."""
        mist = self.float("sigma_t", 0.02, 0.15) + self.spectrum("albedo", 0.2, 0.95) + self.phase()
        made = plugin("medium", "homogeneous", mist).replace("<medium", '<medium id="fog"', 1)
        shell = leaf("float", "radius", 12) + plugin("bsdf", "null") + '<ref name="interior" id="fog"/>'
        return made + plugin("shape", "sphere", shell), ['<ref id="fog"/>']

    # -- lights ----------------------------------------------------------------------------------------

    def light(self, name: str, most: float) -> str:
        form = self.one("d65", "d65", "blackbody", "regular", *("plain",) * 6)
        if form == "d65":
            return plugin("spectrum", form, self.float("scale", 0.2 * most, most), name=name)
        if form == "blackbody":
            # As bright as it is: some 100 W·m⁻²·sr⁻¹·nm⁻¹ at 2700 K. Redder ones have next to no blue to compare.
            return plugin("spectrum", form, self.float("temperature", 2400, 3200), name=name)
        if form == "regular":
            ends = leaf("float", "wavelength_min", 360) + leaf("float", "wavelength_max", 830)
            values = leaf("string", "values", ", ".join(self.between(0.1 * most, most) for _ in range(6)))
            return plugin("spectrum", form, ends, values, name=name)
        return self.spectrum(name, 0.1 * most, most)

    def emitter(self, traced: bool) -> tuple[str, str]:
        """A light, and its kind; whether paths start from it alone."""
        near = ("area", "area", "point", "spot", "projector")
        # Skies in `ptracer` are known, and nothing else finds light along normals.
        kind = self.one(*near, *(["directionalarea"] if traced else ["constant", "envmap", "sunsky", "directional"]))
        if kind == "directionalarea":
            shines = plugin("emitter", kind, self.light("radiance", 3))
            return plugin("shape", self.one("rectangle", "disk"), self.above('<scale value="0.8"/>'), shines), kind
        if kind == "area":
            shape = self.one("rectangle", "disk", "sphere", "cylinder", "cube", "obj", "ply")
            # Textures of things that shine, other than flat ones, are known.
            plain = shape not in ("rectangle", "disk") or self.chance(0.6)
            radiance = self.light("radiance", 8) if plain else self.texture("radiance")
            surface = self.maybe(lambda: self.bsdf(0, False))
            scale = f'<scale value="{self.between(0.3, 0.8)}"/>'
            file = leaf("string", "filename", ASSETS / self.one(*MESHES[shape])) if shape in MESHES else ""
            flat = leaf("boolean", "face_normals", "true") if shape in MESHES else ""
            return plugin("shape", shape, file, flat, self.above(scale), surface, plugin("emitter", "area", radiance)), kind
        if kind == "point":
            at = f"{self.between(-2, 2)}, {self.between(2.5, 4)}, {self.between(-2, 2)}"
            return plugin("emitter", kind, leaf("point", "position", at), self.light("intensity", 30)), kind
        if kind == "constant":
            return plugin("emitter", kind, self.light("radiance", 1)), kind
        if kind == "envmap":
            picture = self.one("sky.exr", "sky.exr", "patch.png")
            file, turn = leaf("string", "filename", ASSETS / picture), self.maybe(lambda: to_world(self.turn()))
            return plugin("emitter", kind, file, self.float("scale", 0.5, 2), turn), kind
        if kind == "sunsky":
            sun = f"{self.between(-1, 1)}, {self.between(-1, 1)}, {self.between(0.3, 1)}"
            air = self.float("turbidity", 1.5, 8) + self.spectrum("albedo", 0, 1) + self.float("sky_scale", 1, 5)
            # Wide enough to be found by chance; that of an even disc is known.
            disc = self.float("sun_aperture", 3, 15) + self.float("sun_scale", 0, 1) + leaf("boolean", "complex_sun", "true")
            up = to_world('<rotate x="1" angle="-90"/>')
            return plugin("emitter", kind, leaf("vector", "sun_direction", sun), air, disc, up), kind
        if kind == "spot":
            edge = self.float("cutoff_angle", 15, 60) + self.maybe(lambda: leaf("float", "beam_width", "10"))
            shade = self.maybe(lambda: self.texture("texture"))
            return plugin("emitter", kind, self.above(), self.light("intensity", 30), edge, shade), kind
        if kind == "projector":
            field, scale = self.float("fov", 25, 70), self.float("scale", 3, 20)
            return plugin("emitter", kind, self.above(), field, self.texture("irradiance"), scale), kind
        way = f"{self.between(-1, 1)}, -1, {self.between(-1, 1)}"
        return plugin("emitter", kind, leaf("vector", "direction", way), self.light("irradiance", 3)), kind

    def lights(self, traced: bool) -> tuple[str, set]:
        first, kind = self.emitter(traced)
        if self.chance(0.5):
            return first, {kind}
        second, other = self.emitter(traced)
        # One sky a scene.
        while kind in SKIES and other in SKIES:
            second, other = self.emitter(traced)
        return first + second, {kind, other}

    # -- the whole -------------------------------------------------------------------------------------

    def crop(self) -> str:
        ends = {"offset_x": (0, 8), "offset_y": (0, 8), "width": (16, 24), "height": (8, 16)}
        return "".join(leaf("integer", f"crop_{name}", self.random.randint(*of)) for name, of in ends.items())

    def sensor(self, *inside_of: str, traced: bool) -> str:
        # Paths that start from lights do not meet a camera without extent or place.
        kind = self.one("perspective", "perspective", "thinlens", "thinlens" if traced else "orthographic")
        origin = f"{self.between(-1.5, 1.5)}, {self.between(1.2, 3)}, {self.between(5, 6)}"
        look = f'<lookat origin="{origin}" target="0, 0.8, 0" up="{self.between(-0.2, 0.2)}, 1, 0"/>'
        look = self.maybe(lambda: '<scale x="-1"/>', 0.15) + look
        inside = to_world('<scale x="2" y="2"/>' + look if kind == "orthographic" else look)
        if kind != "orthographic":
            inside += self.float("fov", 30, 50)
            inside += self.maybe(lambda: leaf("string", "fov_axis", self.one("x", "y", "diagonal", "smaller", "larger")))
        if kind == "perspective":
            inside += self.maybe(lambda: "".join(self.float(f"principal_point_offset_{a}", -0.1, 0.1) for a in "xy"), 0.2)
        if kind == "thinlens":
            inside += self.float("aperture_radius", 0.02, 0.2) + self.float("focus_distance", 4, 7)
        size = leaf("integer", "width", SIZE) + leaf("integer", "height", self.one(SIZE, SIZE * 3 // 4))
        size += self.maybe(self.crop, 0.15)
        if self.chance(0.1):
            film = plugin("film", "specfilm", size, *self.bands(), '<rfilter type="box"/>')
        else:
            form = leaf("string", "pixel_format", self.one("rgb", "rgb", "rgb", "xyz", "luminance"))
            film = plugin("film", "hdrfilm", size, form, leaf("string", "component_format", "float32"), '<rfilter type="box"/>')
        inside += self.maybe(lambda: self.float("near_clip", 3, 5.5), 0.05) + self.maybe(lambda: self.float("far_clip", 5, 7), 0.05)
        # Numbers of `ldsampler` that go together shift means by a hundredth (known), and those of `orthogonal` may.
        sampler = self.one("independent", "independent", "stratified", "multijitter")
        return plugin("sensor", kind, inside, film, plugin("sampler", sampler), *inside_of)

    def bands(self) -> list[str]:
        """What the channels of a film take of the light."""
        starts = sorted(self.random.sample(range(380, 700, 20), 3))
        return [leaf("spectrum", f"b{i}", f"{nm}:0, {nm + 20}:1, {nm + 60}:{self.between(0.2, 1)}, {nm + 80}:0") for i, nm in enumerate(starts)]

    def scene(self) -> str:
        air = self.one(*["clear"] * 13, *["misty"] * 6, "foggy")
        # Far from its ends the roulette of `volpathmis` shows in fog (known).
        integrators = {"clear": ("path", "path", "volpath", "direct"), "misty": ("volpath", "volpathmis"), "foggy": ("volpath",)}
        integrator = self.one(*integrators[air])
        if air == "clear" and self.chance(0.1):
            integrator = "ptracer"
        # Others than those that the two are known to mean otherwise.
        while (scene := self.scene_in(air, integrator)) is None:
            pass
        return scene

    def scene_in(self, air: str, integrator: str) -> str | None:
        """A scene, or none where the two are known to differ."""
        misty, foggy, traced = air == "misty", air == "foggy", integrator == "ptracer"
        bodies = ""
        count = self.random.randint(1, 3)
        for i in range(count):
            x = 1.7 * (i - (count - 1) / 2)
            if misty and self.chance(0.7):
                bodies += self.filled(x)
            elif self.chance(0.1):
                bodies += self.group(x)
            elif self.chance(0.05):
                bodies += self.merged(x)
            else:
                bodies += self.body(x, self.bsdf(clear=not foggy))
        flat = to_world('<scale value="4"/><rotate x="1" angle="-90"/>')
        ground = plugin("shape", "rectangle", flat, self.bsdf(1, False))
        lights, kinds = self.lights(traced)
        settings = ""
        if integrator != "direct":
            settings = leaf("integer", "max_depth", self.random.randint(2, 7))
            settings += leaf("integer", "rr_depth", self.random.randint(3, 9))
        if integrator in ("path", "direct") and any(f'"{kind}"' in ground + bodies for kind in OPEN):
            # Lamps through what is open, and samples that end behind it: known.
            if kinds & DELTA or not kinds & SKIES:
                return None
        elif not foggy:
            # What is behind a hidden lamp in fog is known.
            settings += self.maybe(lambda: leaf("boolean", "hide_emitters", "true"))
        fog, around = self.fog() if foggy else ("", [])
        sensor = self.sensor(*around, traced=traced)
        if traced and re.search(UNTRACED, sensor + ground + bodies + lights):
            return None
        if "far_clip" in sensor and any(f'"{kind}"' in bodies + ground for kind in OPEN):
            # Behind what lets light straight through the far plane is forgotten there (known).
            return None
        if (misty or foggy) and "_clip" in sensor:
            # A body that is cut open has its medium here alone, and fog beyond the far plane is seen here alone (known).
            return None
        if "specfilm" in sensor and "_tint" in ground + bodies:
            # The luminance of a tint is that of the wavelengths that a film wants (known).
            return None
        parts = plugin("integrator", integrator, settings) + fog + sensor + ground + bodies + lights
        return f'<scene version="3.0.0">{parts}</scene>'.replace("><", ">\n<")


def cases(count: int, seed: int, folder: Path) -> list[SceneFile]:
    """`count` scenes, written to `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for i in range(count):
        drawn = seed * 1000 + i
        path = folder / f"drawn_{drawn}.xml"
        scene = Draw(drawn).scene()
        path.write_text(scene)
        # Merged photons blur over pixels, which are large here.
        settings = ["render.techniques.merging=off"]
        made.append(SceneFile(path, "drawn at random", spp=1024, settings=settings, may_be_noisy=True))
    return made
