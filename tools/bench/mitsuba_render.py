"""Renders one scene with Mitsuba as often as it is asked to, in one process, on two threads: tools/bench/peers drives it.

    mitsuba_render.py VARIANT SCENE.xml SAMPLER INTEGRATOR RES

INTEGRATOR takes the place of `volpath`; other integrators stay.

Says first how long loading took, then reads lines `SAMPLES SEED FILE.npy` and answers each with the seconds that the render
took. The first render of a number of samples compiles.
"""
import pathlib
import re
import sys
import time

import numpy as np


def main():
    variant, scene, sampler, integrator, res = sys.argv[1:]
    start = time.perf_counter()
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(variant)
    dr.set_thread_count(2)
    # Its answers go where its warnings would.
    mi.set_log_level(mi.LogLevel.Error)
    text = re.sub(r'<sampler type="\w+">', f'<sampler type="{sampler}">', pathlib.Path(scene).read_text())
    text = text.replace('<integrator type="volpath">', f'<integrator type="{integrator}">')
    # Files are named from where the scene lies.
    mi.file_resolver().prepend(str(pathlib.Path(scene).resolve().parent))
    loaded = mi.load_string(text, res=int(res))
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
