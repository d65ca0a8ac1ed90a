"""The contact sheet of a batch, opened as a person opens it."""

import re
import shutil
import subprocess

import numpy as np
import OpenImageIO as oiio
import pytest
import yaml

from conftest import SCENE
from test_accuracy_page import BROWSERS


def batch(binary, tmp_path, *arguments, scenes=None):
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump({**SCENE, "render": {"samples": 16}}, sort_keys=False))
    scenes = scenes or [
        {"file": "scene.yaml", "name": "first & [best]"},
        {"file": "scene.yaml", "name": "bright #2", "set": {"output.png.exposure": 1}},
        {"file": "scene.yaml", "name": "whitted", "set": {"integrator": "whitted", "image.width": 60}},
    ]
    described = {"output": {"dir": str(tmp_path / "out")}, "scenes": scenes}
    (tmp_path / "batch.yaml").write_text(yaml.safe_dump(described, sort_keys=False))
    command = [binary, "render", tmp_path / "batch.yaml", "-q", *arguments]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return tmp_path / "out"


def test_a_browser_shows_the_page(binary, tmp_path):
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium is there; on Debian: apt-get install chromium-headless-shell")
    page = (batch(binary, tmp_path) / "contact-sheet.html").as_uri()
    start = [browser, "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files", "--virtual-time-budget=2000"]
    shown = subprocess.run([*start, "--dump-dom", page], capture_output=True, text=True, timeout=120)
    assert shown.returncode == 0, shown.stderr
    dom = shown.stdout
    assert dom.count("<figure") == 3 and "NaN" not in dom and "{{" not in dom
    # The script has run: two pictures of one shape stand side by side, named and divided in the middle.
    assert re.search(r'id="la">first &amp; \[best\]<', dom) and re.search(r'id="lb">bright #2<', dom)
    assert re.search(r'id="over"[^>]*clip-path: inset\(0px 50% 0px 0px\)', dom)
    assert 'src="bright%20%232.png"' in dom
    assert dom.count("<th><button>") == 7
    # Pictures with noise have an error map, the others have none.
    assert len(re.findall(r"data-map=", dom)) == 2
    picture = tmp_path / "page.png"
    subprocess.run([*start, "--window-size=1200,1500", f"--screenshot={picture}", page], check=True, timeout=120,
                   capture_output=True)
    assert picture.stat().st_size > 30_000, "an empty page is smaller"


def test_the_page_needs_no_network(binary, tmp_path):
    text = (batch(binary, tmp_path) / "contact-sheet.html").read_text()
    links = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert links and all(link.startswith(("data:image/png;base64,", "#")) or "://" not in link for link in links)
    assert "@import" not in text and "url(" not in text


def test_the_picture_holds_every_picture(binary, tmp_path):
    out = batch(binary, tmp_path)
    sheet = oiio.ImageBuf(str(out / "contact-sheet.png")).get_pixels(oiio.UINT8)
    for name in ["first & [best]", "bright #2", "whitted"]:
        small = oiio.ImageBuf(str(out / f"{name}.png")).get_pixels(oiio.UINT8)[..., :3]
        h, w = small.shape[:2]
        # Pictures below 256 pixels a side stand there pixel by pixel.
        corners = np.argwhere((sheet[: 1 - h or None, : 1 - w or None] == small[0, 0]).all(-1))
        assert any(np.array_equal(sheet[y : y + h, x : x + w], small) for y, x in corners), name


def test_pictures_that_were_there_are_on_the_sheet_with_their_figures(binary, tmp_path):
    out = batch(binary, tmp_path)
    first = (out / "contact-sheet.html").read_text()
    (out / "bright #2.png").unlink()
    again = (batch(binary, tmp_path, "--skip-existing") / "contact-sheet.html").read_text()
    assert "2 of them were there already" in again
    def errors(text):
        return re.findall(r'<p class="error \w*">([^<,]*)', text)

    assert errors(first) == errors(again) and len(errors(first)) == 3


def test_one_picture_or_none_wanted_makes_no_sheet(binary, tmp_path):
    out = batch(binary, tmp_path, "--scene", "whitted")
    assert not list(out.glob("contact-sheet*"))
    out = batch(binary, tmp_path, "--set", "output.contact_sheet=false")
    assert not list(out.glob("contact-sheet*"))
    out = batch(binary, tmp_path, "--tile", "0/2")
    assert not list(out.glob("contact-sheet*"))
