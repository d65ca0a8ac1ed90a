"""The page of `abbe accuracy`, opened as a person opens it."""

import json
import shutil
import subprocess

import pytest
import yaml

from conftest import SCENE

BROWSERS = ["chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"]


def test_a_browser_shows_the_page(binary, tmp_path):
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium is there; on Debian: apt-get install chromium-headless-shell")
    scene = tmp_path / "scene.yaml"
    scene.write_text(yaml.safe_dump({**SCENE, "render": {"samples": 16}}, sort_keys=False))
    command = [binary, "accuracy", scene, "-o", tmp_path, "--rounds", "1", "--pixels", "600", "-q"]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "accuracy.html").as_uri()
    shown = subprocess.run(
        [browser, "--no-sandbox", "--disable-gpu", "--virtual-time-budget=2000", "--dump-dom", page],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert shown.returncode == 0, shown.stderr
    rows = json.loads((tmp_path / "accuracy.json").read_text())[0]["rows"]
    # What the browser made of the page: a line of the table for each setting, a plot for each knob, a picture for each
    # setting but those of the file, and that of the reference.
    assert shown.stdout.count("<tr") == len(rows) + 1
    knobs = {row["knob"] for row in rows} - {"chosen", "file"}
    assert shown.stdout.count("<svg") == len(knobs)
    assert shown.stdout.count("<img") == len([row for row in rows if row["knob"] != "file"]) + 1
    assert "NaN" not in shown.stdout
    picture = tmp_path / "page.png"
    subprocess.run(
        [browser, "--no-sandbox", "--disable-gpu", "--window-size=1100,1600", f"--screenshot={picture}", page],
        capture_output=True,
        timeout=120,
        check=True,
    )
    assert picture.stat().st_size > 20_000, "an empty page is smaller"
