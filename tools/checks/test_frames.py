"""Frames: what their headers say to the official library."""

from fractions import Fraction

import OpenEXR


def test_the_header_says_which_frame_it_is(render):
    sections = {"render": {"samples": 1, "frames_per_second": 23.976}, "output": {"png": {"exposure": {0: 0.0, 20: 1.0}}}}
    for number in (7, -12):
        exr = render(f"frame{number}", "--frames", number, **{k: dict(v) for k, v in sections.items()})
        with OpenEXR.File(str(exr)) as file:
            header = file.header()
            assert (header["imageCounter"], header["abbe/frame"]) == (number, number)
            assert header["framesPerSecond"] == Fraction(24000, 1001)
            assert header["abbe/seed"] == str(7 + number if number > -7 else 2**64 + 7 + number)
