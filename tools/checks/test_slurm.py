"""An array of Slurm over four nodes of which one is taken away, one loses a task and one breaks down."""

import os
import re
import signal
import tempfile
import time
from pathlib import Path

import pytest
from farm import assert_same, run, write_batch
from slurm import Cluster, until, why_not

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not())

NIGHTLY = "ABBE_NIGHTLY" in os.environ


@pytest.fixture
def cluster():
    # Names of sockets are short.
    with tempfile.TemporaryDirectory(prefix="abbe") as place:
        Path(place).chmod(0o755)
        with Cluster(Path(place)) as cluster:
            yield cluster


def test_frames_are_the_same_whatever_dies(binary, cluster, tmp_path):
    # About six seconds of one thread a task.
    size = (64, 48)
    batch = write_batch(tmp_path, "1-2", samples=64, still=False, size=size)
    start = time.monotonic()
    run(binary, "render", batch, "-q", "-o", tmp_path / "trial", "--threads", 1, "--frames", 1)
    seconds = time.monotonic() - start
    frames, cuts = ("1-6", 4) if NIGHTLY else ("1-2", 4)
    samples = max(64, int(64 * 6 * cuts / seconds))
    batch = write_batch(tmp_path, frames, samples=samples, still=False, size=size)
    job = tmp_path / "job"
    program = ["--program", binary, "--threads", 1]
    run(binary, "farm", batch, "--format", "slurm", "-o", job, "--tiles", 2, "--sample-ranges", 2, *program)
    cluster.ask(job / "submit.sh", "-p", "spot")
    busy = lambda node: lambda: cluster.processes(node, "abbe")
    for node in ("n1", "n2", "n3"):
        until(busy(node), 30, f"{node} renders\n{cluster.log()}")
    time.sleep(1)

    # Somebody who goes first takes n1; a task of n2 is killed; n3 loses its power, and has it back later.
    cluster.ask("sbatch", "-p", "hot", "-w", "n1", "--exclusive", "-o", "/dev/null", "--wrap", "sleep 2")
    os.kill(cluster.processes("n2", "abbe")[0], signal.SIGKILL)
    cluster.node_lost("n3")
    until(lambda: "n3" in cluster.ask("sinfo", "-h", "-N", "-t", "down", "-o", "%N"), 60, f"n3 is missed\n{cluster.log()}")
    cluster.node_up("n3")
    until(cluster.empty, 400 if NIGHTLY else 120, f"all is done\n{cluster.log()}")

    logs = {file.name: file.read_text() for file in (job / "log").glob("*.log")}
    told = "\n".join(f"== {name}\n{text}" for name, text in sorted(logs.items()))
    run(binary, "render", batch, "-q", "-o", tmp_path / "one")
    assert (job / "pictures").is_dir(), told
    assert_same(job / "pictures", tmp_path / "one")
    # It did happen: one was stopped and went on, others began again.
    assert re.search(r"stopped at .* --resume goes on from there", told) and "resumed at" in told, told
    again = [text for text in logs.values() if "begun again 1 times" in text]
    assert len(again) >= 3, told


def test_a_part_that_never_comes_fails_the_merge(binary, cluster, tmp_path):
    batch = write_batch(tmp_path, "1", samples=4, still=False)
    job = tmp_path / "job"
    run(binary, "farm", batch, "--format", "slurm", "-o", job, "--tiles", 2, "--program", binary)
    # The second task of the array finds no program.
    script = job / "render.sbatch"
    script.write_text(script.read_text().replace("restarts=$", "[ $SLURM_ARRAY_TASK_ID = 0 ] || abbe=/none\nrestarts=$", 1))
    cluster.ask(job / "submit.sh")
    until(cluster.empty, 60, f"all is done\n{cluster.log()}")
    (log,) = (job / "log").glob("merge*.log")
    assert "of row 16 are missing" in log.read_text()
    assert not list((job / "pictures").glob("*.exr"))
