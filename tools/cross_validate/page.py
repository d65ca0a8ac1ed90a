"""The results as one HTML page without other files: a table, and for each case both pictures and where they differ."""

import base64
import html
import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

SIDE = 192
# Standard errors at which the map's colours end.
Z_END = 5.0

STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; margin: 2rem; color: #222; background: #fafafa; }
table { border-collapse: collapse; } th, td { padding: .2rem .6rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child, td.words { text-align: left; }
.differ { background: #fdd; } .cases { display: grid; grid-template-columns: repeat(auto-fill, minmax(620px, 1fr)); gap: 1rem; }
figure { margin: 0; padding: .6rem; background: #fff; border: 1px solid #ddd; } figure.differ { border-color: #c00; }
figcaption { margin-top: .3rem; } figcaption b { font-size: 15px; } img { image-rendering: pixelated; width: 32%; }
"""


def data_url(rgb: np.ndarray) -> str:
    """8-bit pixels (h, w, 3) as a PNG in the page."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "p.png"
        output = oiio.ImageOutput.create(str(path))
        output.open(str(path), oiio.ImageSpec(rgb.shape[1], rgb.shape[0], 3, "uint8"))
        output.write_image(np.ascontiguousarray(rgb))
        output.close()
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()


def enlarged(pixels: np.ndarray) -> np.ndarray:
    """Whole multiples of a small picture."""
    factor = max(1, SIDE // max(pixels.shape[:2]))
    return pixels.repeat(factor, 0).repeat(factor, 1)


def shown(mean: np.ndarray, scale: float) -> np.ndarray:
    """Linear values as sRGB, one at `scale`."""
    rgb = np.clip(np.nan_to_num(mean) / scale, 0, 1)
    rgb = rgb.repeat(3, -1) if rgb.shape[-1] == 1 else rgb[..., :3]
    curved = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * rgb ** (1 / 2.4) - 0.055)
    return enlarged((255 * curved + 0.5).astype(np.uint8))


def z_map(a, b) -> np.ndarray:
    """Blue where we are darker than Mitsuba, red where brighter, in standard errors of the mean over channels."""
    error = np.sqrt((a.variance + b.variance).mean(-1)) + 1e-12
    z = np.clip((a.mean - b.mean).mean(-1) / error / Z_END, -1, 1)
    warm, cold = np.clip(z, 0, 1)[..., None], np.clip(-z, 0, 1)[..., None]
    rgb = 255 * (1 - warm * [0.1, 0.9, 0.9] - cold * [0.9, 0.6, 0.1])
    return enlarged(rgb.astype(np.uint8))


def row(name: str, result: dict) -> str:
    word = "agree" if result["passed"] else "DIFFER"
    cells = [html.escape(name), word]
    if "ratio" in result:
        cells += [" ".join(f"{r:.5f}" for r in result["ratio"]), f"{100 * max(result['standard_error']):.3f}"]
        cells += [f"{max(result['z'], key=abs):.2f}", f"{result['blocks'] - result['blocks_rejected']}/{result['blocks']}"]
        cells += [f"{100 * result['pixels_accepted']:.3f}"]
    else:
        cells += [""] * 5
    cells.append(f"{result['seconds']:.1f}")
    body = "".join(f"<td>{c}</td>" for c in cells) + f'<td class="words">{html.escape(result["reason"])}</td>'
    return f"<tr{'' if result['passed'] else ' class=differ'}>{body}</tr>"


def figure(name: str, about: str, result: dict, pair) -> str:
    words = f"<figcaption><b>{html.escape(name)}</b> {html.escape(about)} {html.escape(result['reason'])}</figcaption>"
    pictures = ""
    if pair:
        a, b = pair[0].pixels, pair[1].pixels
        scale = max(float(np.percentile(b.mean, 99)), 1e-6)
        urls = [data_url(shown(a.mean, scale)), data_url(shown(b.mean, scale)), data_url(z_map(a, b))]
        pictures = " ".join(f'<img src="{u}" alt="">' for u in urls)
    return f"<figure{'' if result['passed'] else ' class=differ'}>{pictures}{words}</figure>"


def write(path: Path, report: dict, pictures: dict) -> None:
    """`report` as `__main__` makes it; `pictures` holds for each case a pair of `judge.Picture`."""
    last = {name: (case["about"], case["attempts"][-1]) for name, case in report["cases"].items()}
    head = "case,,ratio of means,s.e. %,worst z,blocks,pixels %,s,".split(",")
    heads = "".join(f"<th>{h}</th>" for h in head)
    rows = "".join(row(name, result) for name, (_, result) in last.items())
    figures = "".join(figure(name, about, result, pictures.get(name)) for name, (about, result) in last.items())
    path.write_text(
        f"<!doctype html><meta charset=utf-8><title>Abbe against Mitsuba</title><style>{STYLE}</style>"
        f"<h1>Abbe against {html.escape(report['peer'])}</h1>"
        f"<p>{report['passed']} passed, {report['failed']} failed; seed {report['seed']}. Each case: Abbe, Mitsuba, and "
        f"the difference in standard errors, red where Abbe is brighter, full colour at {Z_END:.0f}.</p>"
        f"<table><tr>{heads}</tr>{rows}</table><h2>Pictures</h2><div class=cases>{figures}</div>"
    )
