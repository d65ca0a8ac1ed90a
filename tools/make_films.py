#!/usr/bin/env python3
"""Writes the maps of films of configs/scenes: configs/films/soap.png and oil.png, 16 bits grey, and grit.png, asphalt.

    pip install numpy pillow
    python3 tools/make_films.py [--out configs/films]

A film that drains is thin above and thick below, and its layers are drawn out by convection into whorls; oil spreads from
where it fell and is stirred by the wind. Both are sums of value noise looked up at places that other noise has moved
("domain warping"). Columns repeat: u runs around. The numbers are shares of the scene's `to`.
"""
import argparse
import os

# Before what has to be installed, which who asks for help need not have.
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--out", default="configs/films")
arguments = parser.parse_args()

import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402


def smooth(t):
    return t * t * t * (t * (t * 6 - 15) + 10)


class Noise:
    """Value noise on a lattice of `nx` x `ny` cells over the unit square; columns repeat."""

    def __init__(self, rng, nx, ny):
        self.values, self.nx, self.ny = rng.uniform(-1, 1, (ny + 1, nx)), nx, ny

    def __call__(self, u, v):
        x, y = (u % 1.0) * self.nx, np.clip(v, 0, 1) * self.ny
        i, j = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), self.ny - 1)
        s, t = smooth(x - i), smooth(y - j)
        i, k, a = i % self.nx, (i + 1) % self.nx, self.values
        return (a[j, i] * (1 - s) + a[j, k] * s) * (1 - t) + (a[j + 1, i] * (1 - s) + a[j + 1, k] * s) * t


def octaves(rng, nx, ny, count):
    layers = [(Noise(rng, nx << k, ny << k), 0.5**k) for k in range(count)]
    return lambda u, v: sum(weight * layer(u, v) for layer, weight in layers)


def grid(width, height):
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    return u, v


def soap(rng, width, height):
    u, v = grid(width, height)
    du, dv, fine = octaves(rng, 4, 3, 3), octaves(rng, 5, 4, 4), octaves(rng, 6, 6, 4)
    # Whorls calm down toward the poles, where a column is a point.
    calm = np.sin(np.pi * v) ** 0.7
    u2, v2 = u + 0.10 * calm * du(u, v), v + 0.085 * calm * dv(u, v)
    height_ = 0.5 - 0.5 * np.cos(np.pi * np.clip(v2, 0, 1))
    drained = 0.015 + 0.985 * (1 - height_) ** 1.3
    return drained + 0.055 * calm * fine(u2, v2)


def oil(rng, width, height):
    u, v = grid(width, height)
    du, dv, fine = octaves(rng, 4, 4, 3), octaves(rng, 4, 4, 3), octaves(rng, 7, 7, 3)
    x, y = u - 0.5 + 0.10 * du(u, v), v - 0.5 + 0.10 * dv(u, v)
    drops = [(-0.04, 0.03, 0.95, 0.15), (0.22, -0.17, 0.55, 0.07), (-0.27, -0.16, 0.45, 0.06), (0.22, 0.24, 0.36, 0.05)]
    depth = sum(a * np.exp(-((x - p) ** 2 + (y - q) ** 2) / (2 * s * s)) for p, q, a, s in drops)
    return depth * (1 + 0.10 * fine(u, v))


def grit(rng, size, stones):
    """Stones in tar: the highest of round caps at random places, on a square that repeats."""
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    high = np.zeros((size, size))
    for _ in range(stones):
        a, b, r = rng.uniform(0, size), rng.uniform(0, size), rng.uniform(2.2, 5.5)
        dx, dy = np.abs(x - a), np.abs(y - b)
        d2 = (np.minimum(dx, size - dx) ** 2 + np.minimum(dy, size - dy) ** 2) / r**2
        high = np.maximum(high, np.sqrt(np.maximum(0, 1 - d2)) * rng.uniform(0.5, 1) * r / 5.5)
    return 0.08 + 0.34 * high


def write(path, values, bits=16):
    top = (1 << bits) - 1
    values = np.round(np.clip(values, 0, 1) * top).astype(np.uint16 if bits == 16 else np.uint8)
    Image.fromarray(values).save(path, optimize=True)
    print(f"{path}: {values.shape[1]} x {values.shape[0]}, {values.min() / top:.3f} to {values.max() / top:.3f}")


def main():
    out = arguments.out
    os.makedirs(out, exist_ok=True)
    write(os.path.join(out, "soap.png"), soap(np.random.default_rng(11), 320, 160))
    write(os.path.join(out, "oil.png"), oil(np.random.default_rng(5), 256, 256))
    write(os.path.join(out, "grit.png"), grit(np.random.default_rng(3), 192, 2600), bits=8)


if __name__ == "__main__":
    main()
