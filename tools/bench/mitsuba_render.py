"""Renders one scene with Mitsuba as often as it is asked to, in one process: tools/bench/peers drives it.

    mitsuba_render.py VARIANT SCENE.xml SAMPLER RES

Reads lines `SAMPLES SEED FILE.npy` and answers each with the seconds that the render took; the first answer, to an empty
line, is what loading took. The first render of a number of samples compiles.
"""
import pathlib
import re
import sys
import time

import numpy as np


def main():
    variant, scene, sampler, res = sys.argv[1:]
    start = time.perf_counter()
    import mitsuba as mi

    mi.set_variant(variant)
    # Its answers go where its warnings would.
    mi.set_log_level(mi.LogLevel.Error)
    # Two threads, as ours.
    text = pathlib.Path(scene).read_text()
    text = re.sub(r'<sampler type="\w+">', f'<sampler type="{sampler}">', text)
    # Beside the original: its files are named from there.
    copy = pathlib.Path(scene).with_name(f".{pathlib.Path(scene).stem}.{sampler}.{variant}.xml")
    try:
        copy.write_text(text)
        loaded = mi.load_file(str(copy), res=int(res))
    finally:
        copy.unlink(missing_ok=True)
    print(time.perf_counter() - start, flush=True)
    for line in sys.stdin:
        samples, seed, file = line.split()
        start = time.perf_counter()
        picture = np.array(mi.render(loaded, spp=int(samples), seed=int(seed)))
        seconds = time.perf_counter() - start
        np.save(file, picture[..., :3])
        print(seconds, flush=True)


if __name__ == "__main__":
    main()
