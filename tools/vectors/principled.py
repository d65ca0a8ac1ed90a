"""Writes src/optics/principled/vectors.txt: what Mitsuba 3's principled BSDFs evaluate to.

    python tools/vectors/principled.py > src/optics/principled/vectors.txt

Needs the pip package mitsuba (tools/requirements.txt); the file says which version made it.
"""

import math

import mitsuba as mi

mi.set_variant("scalar_spectral")

NM = [450.0, 520.0, 580.0, 650.0]
BASE = [0.15, 0.75, 0.35, 0.9]

SOLID = [
    {},
    {"roughness": 0.15, "specular": 0.9},
    {"roughness": 0.4, "metallic": 1.0},
    {"roughness": 0.3, "metallic": 0.6, "spec_tint": 0.7, "eta": 1.8},
    {"roughness": 0.35, "anisotropic": 0.9, "metallic": 0.4},
    {"roughness": 0.7, "flatness": 0.8},
    {"roughness": 0.6, "sheen": 0.9, "sheen_tint": 0.5},
    {"roughness": 0.5, "clearcoat": 0.8, "clearcoat_gloss": 0.1},
    {"roughness": 0.3, "clearcoat": 1.0, "clearcoat_gloss": 0.9, "eta": 1.2},
    {"roughness": 0.4, "spec_trans": 1.0, "eta": 1.5},
    {"roughness": 0.5, "spec_trans": 0.6, "eta": 1.33, "anisotropic": 0.5, "spec_tint": 0.4},
    {"roughness": 0.3, "spec_trans": 0.7, "eta": 0.7, "metallic": 0.2},
    {"roughness": 0.4, "specular": 0.0, "metallic": 0.5},
    {"roughness": 0.02, "specular": 0.3},
    {
        "roughness": 0.45, "metallic": 0.3, "spec_trans": 0.4, "anisotropic": 0.7, "flatness": 0.3, "sheen": 0.4,
        "sheen_tint": 0.8, "spec_tint": 0.6, "clearcoat": 0.7, "clearcoat_gloss": 0.3, "specular": 0.6,
        "main_specular_sampling_rate": 2.0, "clearcoat_sampling_rate": 3.0,
        "diffuse_reflectance_sampling_rate": 0.5,
    },
]

THIN = [
    {},
    {"roughness": 0.3, "spec_trans": 1.0},
    {"roughness": 0.4, "spec_trans": 0.8, "diff_trans": 0.6, "eta": 1.33, "spec_tint": 0.5},
    {"roughness": 0.5, "diff_trans": 2.0},
    {"roughness": 0.6, "diff_trans": 1.0, "flatness": 0.7, "sheen": 0.8, "sheen_tint": 0.4},
    {"roughness": 0.35, "anisotropic": 0.8, "spec_trans": 0.5, "eta": 1.8},
    {"roughness": 0.4, "spec_trans": 0.7, "eta": 0.8},
    {
        "roughness": 0.45, "anisotropic": 0.4, "spec_trans": 0.3, "diff_trans": 0.5, "flatness": 0.2, "sheen": 0.3,
        "sheen_tint": 0.6, "spec_tint": 0.8, "eta": 1.6, "specular_reflectance_sampling_rate": 2.0,
        "specular_transmittance_sampling_rate": 0.5, "diffuse_reflectance_sampling_rate": 3.0,
        "diffuse_transmittance_sampling_rate": 1.5,
    },
]


def direction(theta_deg, phi_deg):
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    return [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]


# Viewer, light; degrees from the normal and about it. Mirrored pairs, near and far, and refracted ones.
PAIRS = [
    ((30, 10), (32, 188)),
    ((20, 40), (65, 300)),
    ((70, 0), (72, 181)),
    ((80, 90), (20, 30)),
    ((55, 120), (58, 290)),
    ((30, 10), (161, 192)),
    ((60, 250), (140, 60)),
    ((75, 33), (120, 200)),
    ((150, 10), (135, 185)),
    ((155, 70), (40, 255)),
    ((110, 200), (65, 10)),
    ((160, 300), (25, 118)),
]


def numbers(values):
    return " ".join(f"{v:.9g}" for v in values)


def main():
    print(f"# Mitsuba {mi.__version__} scalar_spectral: eval (with the cosine) and pdf of its principled BSDFs.")
    print("# Made by tools/vectors/principled.py.")
    print("# wavelengths (nm), base colour there, its luminance as Mitsuba estimates it; then for each material a line")
    print("# with its parameters and rows: viewer (x y z), light (x y z), eval at the wavelengths, pdf.")
    base = {"type": "irregular", "wavelengths": ", ".join(map(str, [359, *NM, 831])),
            "values": ", ".join(map(str, [BASE[0], *BASE, BASE[-1]]))}
    luminance = mi.luminance(BASE, NM)
    print("colour", numbers(NM), numbers(BASE), numbers([luminance]))
    for kind, materials in [("principled", SOLID), ("principledthin", THIN)]:
        for parameters in materials:
            bsdf = mi.load_dict({"type": kind, "base_color": base, **parameters})
            print(kind, " ".join(f"{k}={v}" for k, v in parameters.items()))
            for viewer, light in PAIRS:
                if kind == "principled" and viewer[0] > 90 and "spec_trans" not in parameters:
                    continue  # black from behind, and `sample` never gets there, whatever `pdf` says
                si = mi.SurfaceInteraction3f()
                si.wi = mi.Vector3f(direction(*viewer))
                si.wavelengths = NM
                wo = mi.Vector3f(direction(*light))
                context = mi.BSDFContext()
                value = bsdf.eval(context, si, wo, True)
                pdf = bsdf.pdf(context, si, wo, True)
                print(numbers([*si.wi, *wo, *value, pdf]))


if __name__ == "__main__":
    main()
