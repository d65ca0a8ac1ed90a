"""Writes src/optics/hair_vectors.txt: what Mitsuba 3's hair BSDF evaluates to.

    python tools/vectors/hair.py > src/optics/hair_vectors.txt
"""

import math

import mitsuba as mi

mi.set_variant("scalar_spectral")

# Index, roughness along and around, tilt in degrees, absorption.
FIBRES = [(1.55, 0.3, 0.3, 2.0, 0.3), (1.4, 0.6, 0.4, 5.0, 0.05), (1.55, 0.2, 0.7, 0.0, 1.5), (1.8, 0.9, 0.9, 3.0, 0.0)]
PAIRS = [((x, y), (u, v)) for x, y in [(20, 40), (60, 190), (75, 95)] for u, v in [(25, 220), (70, 10), (120, 75), (160, 300)]]


def direction(theta_deg, phi_deg):
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    return [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]


def main():
    print(f"# Mitsuba {mi.__version__} scalar_spectral, made by tools/vectors/hair.py.")
    print("# hair: index, roughness along and around, tilt (degrees), absorption; row: viewer, light, eval.")
    for eta, along, around, tilt, absorption in FIBRES:
        bsdf = mi.load_dict({
            "type": "hair", "int_ior": eta, "ext_ior": 1.0, "longitudinal_roughness": along,
            "azimuthal_roughness": around, "scale_tilt": tilt,
            "sigma_a": {"type": "uniform", "value": absorption},
        })
        print("hair", eta, along, around, tilt, absorption)
        for viewer, light in PAIRS:
            si = mi.SurfaceInteraction3f()
            si.wi = mi.Vector3f(direction(*viewer))
            si.wavelengths = [450, 520, 580, 650]
            wo = mi.Vector3f(direction(*light))
            value = bsdf.eval(mi.BSDFContext(), si, wo, True)[0]
            print("row", " ".join(f"{v:.9g}" for v in [*si.wi, *wo, value]))


if __name__ == "__main__":
    main()
