"""Jobs of Open Job Description, checked and run by its own command line."""

import json
import shlex
import sys
from pathlib import Path

import pytest
import yaml
from farm import assert_same, run, write_batch

OPENJD = Path(sys.executable).parent / "openjd"
pytestmark = pytest.mark.skipif(not OPENJD.exists(), reason="openjd is not there; pip install openjd-cli")


def start(job: Path, step: str, *arguments, code=0):
    values = f"file://{job}/parameters.json"
    return run(OPENJD, "run", job / "template.yaml", "--step", step, "-p", values, *arguments, code=code, cwd=job)


@pytest.fixture
def farm(binary, tmp_path):
    """Writes a job."""

    def write(batch: Path, *arguments) -> Path:
        job = tmp_path / "job"
        said = run(binary, "farm", batch, "--format", "openjd", "-o", job, "--program", binary, "--threads", 1, *arguments)
        (tmp_path / "start.txt").write_text(said)
        assert "passes validation checks" in run(OPENJD, "check", job / "template.yaml")
        return job

    return write


def test_frames_of_a_farm_are_those_of_one_process(binary, farm, tmp_path):
    batch = write_batch(tmp_path, "1-9x4,2", samples=8)
    run(binary, "render", batch, "-q", "-o", tmp_path / "one")
    job = farm(batch, "--tiles", 2, "--sample-ranges", 2, "--frames-per-task", 3)
    # The line that was printed runs all: two groups, and what adds up the parts of each.
    [line] = [line for line in (tmp_path / "start.txt").read_text().splitlines() if line.startswith("openjd ")]
    log = run(OPENJD, *shlex.split(line)[1:], cwd=job)
    assert "openjd_progress: 100.0" in log and "openjd_status: moving.0009" in log
    assert_same(job / "pictures", tmp_path / "one")
    # What is there is left alone.
    before = {p: p.stat().st_mtime_ns for p in (job / "pictures" / "parts").rglob("*.exr")}
    start(job, "Render")
    assert before == {p: p.stat().st_mtime_ns for p in before} and len(before) == 4 * 4 + 4


def test_pictures_that_are_not_cut_need_no_second_step(binary, farm, tmp_path):
    batch = write_batch(tmp_path, "3-4", samples=4)
    run(binary, "render", batch, "-q", "-o", tmp_path / "one", "--spp", 2)
    job = farm(batch, "--frames-per-task", 2, "--spp", 2)
    steps = [step["name"] for step in yaml.safe_load((job / "template.yaml").read_text())["steps"]]
    assert steps == ["Render", "Render2"]
    for step in steps:
        start(job, step)
    assert_same(job / "pictures", tmp_path / "one")
    assets = yaml.safe_load((job / "asset_references.yaml").read_text())["assetReferences"]
    assert {Path(p).name for p in assets["inputs"]["filenames"]} == {"batch.yaml", "moving.yaml", "still one.yaml"}


def test_arguments_may_have_maps_in_maps(binary, farm, tmp_path):
    batch = write_batch(tmp_path, "1", samples=4, still=False)
    told = ["--set", 'output.exr={precision: float, attributes: {owner: "a{{b"}}']
    run(binary, "render", batch, "-q", "-o", tmp_path / "one", *told)
    job = farm(batch, *told)
    start(job, "Render")
    assert_same(job / "pictures", tmp_path / "one")


def test_a_part_that_is_missing_fails_the_merge(farm, tmp_path):
    job = farm(write_batch(tmp_path, "1", samples=4, still=False), "--tiles", 2)
    start(job, "Render")
    next((job / "pictures" / "parts").rglob("*tile1of2.exr")).unlink()
    log = start(job, "Merge", "--no-run-dependencies", code=1)
    assert "exited with code: 3" in log and "of row 16 are missing" in log


def test_a_task_that_is_ended_goes_on_where_it_was(binary, farm, tmp_path):
    batch = write_batch(tmp_path, "1", samples=4000, still=False)
    job = farm(batch)
    template = job / "template.yaml"
    text = template.read_text()
    template.write_text(text.replace("        cancelation:", "        timeout: 1\n        cancelation:"))
    log = start(job, "Render", code=1)
    assert "exited with code: 75" in log and "--resume goes on from there" in log
    assert (job / "pictures" / "moving.0001.exr.checkpoint").is_file()
    template.write_text(text)
    log = start(job, "Render")
    assert "resumed at" in log
    run(binary, "render", batch, "-q", "-o", tmp_path / "one")
    assert_same(job / "pictures", tmp_path / "one")


def test_files_are_found_where_the_session_says(binary, farm, tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    for place in (here, there):
        place.mkdir()
        (place / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    batch = write_batch(tmp_path, "1", samples=4, still=False)
    scene = yaml.safe_load((tmp_path / "moving.yaml").read_text())
    scene["shapes"].append({"mesh": {"file": str(here / "t.obj")}})
    (tmp_path / "moving.yaml").write_text(yaml.safe_dump(scene))
    run(binary, "render", batch, "-q", "-o", tmp_path / "one")
    job = farm(batch, "--tiles", 2)
    run(binary, "render", batch, "-q", "--frames", 1, "--tile", "0/2", "-o", job / "pictures/parts/moving/1", "--resume")
    (here / "t.obj").unlink()
    rules = [{"source_path_format": "POSIX", "source_path": str(here), "destination_path": str(there)}]
    rules = json.dumps({"version": "pathmapping-1.0", "path_mapping_rules": rules})
    # The part that was made where the file is elsewhere is one of the same picture.
    start(job, "Merge", "--run-dependencies", "--path-mapping-rules", rules)
    assert_same(job / "pictures", tmp_path / "one")
