#!/usr/bin/env python3
"""Writes textures/clear_sky.hdr: a clear sky with sun and ground, 512 x 256, linear Rec.709.

    python3 tools/make_sky.py [--turbidity 3] [--elevation 40] [--out textures/clear_sky.hdr]

Needs only the standard library.  The picture is computed, so it is free of anybody's rights.

* Sky: Preetham, Shirley and Smits 1999, "A Practical Analytic Model for Daylight": Perez'
  luminance and chromaticity with the coefficients of their appendix.
* Sun: a disc whose illuminance is the IES clear-sky value 128 klx * exp(-0.21 m), m the air mass
  of Kasten and Young 1989; its colour is white through Rayleigh and Angstrom extinction at 610,
  550 and 465 nm with the same paper's turbidity.  The disc is 1.5 degrees wide, not 0.53, so
  that it covers whole texels; its illuminance is right.
* Ground: grey of albedo 0.2, lit by sun and sky.

The scale is such that a white diffuse surface that lies flat has radiance 1.  Layout: top row is the
zenith, columns run through the azimuth, the sun stands in the middle column (u = 0.5).
"""
import argparse
import math
import os

W, H = 512, 256
GROUND = 0.2
SUN_RADIUS = math.radians(0.75)


def perez(c, cos_theta, gamma):
    a, b, cc, d, e = c
    return (1 + a * math.exp(b / max(cos_theta, 0.005))) * (1 + cc * math.exp(d * gamma) + e * math.cos(gamma) ** 2)


def poly(rows, t, s):
    """t^2, t, 1 times rows times s^3, s^2, s, 1."""
    powers = (s**3, s**2, s, 1.0)
    return sum(k * sum(r * p for r, p in zip(row, powers)) for k, row in zip((t * t, t, 1.0), rows))


class Sky:
    def __init__(self, t, sun_zenith):
        self.sun_zenith = sun_zenith
        self.coefficients = [
            (0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771, -0.0670 * t + 0.3703),
            (-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989, -0.0033 * t + 0.0452),
            (-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537, -0.0109 * t + 0.0529),
        ]
        chi = (4 / 9 - t / 120) * (math.pi - 2 * sun_zenith)
        luminance = (4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192
        x = poly(
            [(0.00166, -0.00375, 0.00209, 0), (-0.02903, 0.06377, -0.03202, 0.00394), (0.11693, -0.21196, 0.06052, 0.25886)],
            t,
            sun_zenith,
        )
        y = poly(
            [(0.00275, -0.00610, 0.00317, 0), (-0.04214, 0.08970, -0.04153, 0.00516), (0.15346, -0.26756, 0.06670, 0.26688)],
            t,
            sun_zenith,
        )
        self.zenith = (luminance, x, y)

    def xyz(self, cos_theta, gamma):
        """Luminance in kcd/m^2 as X, Y, Z."""
        big_y, x, y = (
            z * perez(c, cos_theta, gamma) / perez(c, 1.0, self.sun_zenith) for z, c in zip(self.zenith, self.coefficients)
        )
        return (x / y * big_y, big_y, (1 - x - y) / y * big_y)


def rec709(xyz):
    m = ((3.2409699, -1.5373832, -0.4986108), (-0.9692436, 1.8759675, 0.0415551), (0.0556301, -0.2039770, 1.0569715))
    return [max(0.0, sum(a * b for a, b in zip(row, xyz))) for row in m]


def sun_illuminance(t, zenith):
    """Of a surface that faces the sun, klx, as linear Rec.709 whose luminance is the illuminance."""
    degrees = math.degrees(zenith)
    mass = 1 / (math.cos(zenith) + 0.50572 * (96.07995 - degrees) ** -1.6364)
    beta = 0.04608 * t - 0.04586
    rgb = [math.exp(-mass * (0.008735 * w**-4.08 + beta * w**-1.3)) for w in (0.610, 0.550, 0.465)]
    luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
    return [v / luminance * 128.0 * math.exp(-0.21 * mass) for v in rgb]


def rgbe(rgb):
    top = max(rgb)
    if top < 1e-32:
        return (0, 0, 0, 0)
    mantissa, exponent = math.frexp(top)
    scale = mantissa * 256.0 / top
    return tuple(min(255, int(v * scale)) for v in rgb) + (exponent + 128,)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--turbidity", type=float, default=3.0)
    parser.add_argument("--elevation", type=float, default=40.0, help="of the sun, degrees")
    parser.add_argument("--out", default=os.path.join(os.path.dirname(__file__), "..", "textures", "clear_sky.hdr"))
    args = parser.parse_args()
    zenith = math.radians(90 - args.elevation)
    sky = Sky(args.turbidity, zenith)
    sun = sun_illuminance(args.turbidity, zenith)

    # A sub-texel grid of 4 x 4 finds how much of each texel the sun's disc covers.
    direction = lambda row, column: (math.pi * row / H, 2 * math.pi * (column / W - 0.5))  # noqa: E731

    def angle(theta, phi):
        c = math.cos(theta) * math.cos(zenith) + math.sin(theta) * math.sin(zenith) * math.cos(phi)
        return math.acos(max(-1.0, min(1.0, c)))

    solid = [2 * math.pi / W * (math.cos(math.pi * i / H) - math.cos(math.pi * (i + 1) / H)) for i in range(H)]
    sub = [(k + 0.5) / 4 for k in range(4)]
    cover = {}
    for i in range(H // 2):
        for j in range(W):
            if angle(*direction(i + 0.5, j + 0.5)) < SUN_RADIUS + 0.03:
                hits = sum(angle(*direction(i + a, j + b)) < SUN_RADIUS for a in sub for b in sub)
                if hits:
                    cover[i, j] = hits / 16
    disc = sum(share * solid[i] for (i, _), share in cover.items())

    image = [[None] * W for _ in range(H)]
    irradiance = [v * math.cos(zenith) for v in sun]
    for i in range(H // 2):
        for j in range(W):
            theta, phi = direction(i + 0.5, j + 0.5)
            rgb = rec709(sky.xyz(math.cos(theta), angle(theta, phi)))
            irradiance = [e + v * math.cos(theta) * solid[i] for e, v in zip(irradiance, rgb)]
            share = cover.get((i, j), 0.0)
            image[i][j] = [v + share * s / disc for v, s in zip(rgb, sun)]
    ground = [GROUND * e / math.pi for e in irradiance]
    for i in range(H // 2, H):
        image[i] = [ground] * W
    luminance = 0.2126 * irradiance[0] + 0.7152 * irradiance[1] + 0.0722 * irradiance[2]
    scale = math.pi / luminance
    print(f"flat illuminance {luminance:.1f} klx, of it sun {sun[1] * math.cos(zenith):.1f}; sun texel {max(max(p) for r in image for p in r) * scale:.0f}")

    with open(args.out, "wb") as f:
        f.write(b"#?RADIANCE\n# clear sky by tools/make_sky.py\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {H} +X {W}\n".encode())
        for row in image:
            texels = [rgbe([v * scale for v in rgb]) for rgb in row]
            f.write(bytes((2, 2, W >> 8, W & 255)))
            for c in range(4):
                plane = [texel[c] for texel in texels]
                # Runs of equal bytes, else literal stretches of up to 128.
                i = 0
                while i < W:
                    run = 1
                    while i + run < W and run < 127 and plane[i + run] == plane[i]:
                        run += 1
                    if run > 3:
                        f.write(bytes((128 + run, plane[i])))
                        i += run
                        continue
                    start = i
                    while i < W and i - start < 128 and not (i + 3 < W and len(set(plane[i : i + 4])) == 1):
                        i += 1
                    f.write(bytes([i - start]) + bytes(plane[start:i]))
    print(args.out, os.path.getsize(args.out), "bytes")


if __name__ == "__main__":
    main()
