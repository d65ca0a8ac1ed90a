#!/usr/bin/env python3
"""Lays the pictures of a batch out on one sheet, each with its caption.

    python3 -m venv .venv && .venv/bin/pip install pillow
    .venv/bin/python tools/contact_sheet.py out/gallery configs/gallery.jpg

The order is that of `report.json` beside the pictures. Rows are justified: pictures keep their shape, all of a row have
one height, every row fills the width. The JPEG takes the best quality that keeps it under the limit (--kib, 250).
"""

import argparse
import io
import json
from pathlib import Path

# Before what has to be installed, which who asks for help need not have.
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("pictures", type=Path, help="directory of the PNG files and report.json")
parser.add_argument("output", type=Path, help="the sheet, JPEG")
parser.add_argument("--kib", type=float, default=250, help="largest size of the file")
arguments = parser.parse_args()

from PIL import Image, ImageDraw, ImageFont  # noqa: E402

WIDTH = 1400
GAP = 4
CAPTION = 18
# Height that a row aims for, pixels.
ROW = 172
BACKGROUND = (24, 24, 26)
INK = (205, 205, 205)


def justified(shapes, width, height):
    """Rows of indices: each broken where it comes closest to `height` once it fills `width`."""

    def row_height(row):
        return (width - GAP * (len(row) + 1)) / sum(shapes[i] for i in row)

    # The least sum of squared deviations over all ways to break: best[i] is that for the first i pictures.
    best = [(0.0, 0)] + [(float("inf"), 0)] * len(shapes)
    for end in range(1, len(shapes) + 1):
        for start in range(max(0, end - 12), end):
            off = row_height(range(start, end)) / height - 1
            cost = best[start][0] + off * off
            if cost < best[end][0]:
                best[end] = (cost, start)
    breaks = [len(shapes)]
    while breaks[-1] > 0:
        breaks.append(best[breaks[-1]][1])
    breaks.reverse()
    return [(list(range(a, b)), row_height(range(a, b))) for a, b in zip(breaks, breaks[1:])]


def sheet(pictures):
    """One image of all (caption, picture) pairs."""
    rows = justified([p.width / p.height for _, p in pictures], WIDTH, ROW)
    total = sum(round(h) + CAPTION + GAP for _, h in rows) + GAP
    out = Image.new("RGB", (WIDTH, total), BACKGROUND)
    draw = ImageDraw.Draw(out)
    font = ImageFont.load_default(12)
    y = GAP
    for row, height in rows:
        x = float(GAP)
        for i in row:
            caption, picture = pictures[i]
            width = height * picture.width / picture.height
            left, right = round(x), round(x + width)
            out.paste(picture.resize((right - left, round(height)), Image.Resampling.LANCZOS), (left, y))
            draw.text((left + 1, y + round(height) + 2), caption, INK, font)
            x += width + GAP
        y += round(height) + CAPTION + GAP
    return out


def main():
    report = json.loads((arguments.pictures / "report.json").read_text())
    names = [scene["name"] for scene in report["scenes"]]
    out = sheet([(name, Image.open(arguments.pictures / f"{name}.png").convert("RGB")) for name in names])
    for quality in range(92, 40, -2):
        buffer = io.BytesIO()
        out.save(buffer, "JPEG", quality=quality, optimize=True, progressive=True)
        if buffer.tell() <= arguments.kib * 1024:
            break
    arguments.output.write_bytes(buffer.getvalue())
    print(f"{arguments.output}: {out.width} × {out.height}, {buffer.tell() / 1024:.0f} KiB, quality {quality}")


if __name__ == "__main__":
    main()
