"""The tools beside this folder, as a person asks what they are."""

import shutil
import subprocess
import sys

import pytest
from conftest import ROOT

TOOLS = sorted((ROOT / "tools").glob("*.py"))


@pytest.mark.parametrize("arguments, code", [(["--help"], 0), (["--unknown"], 2)])
@pytest.mark.parametrize("tool", TOOLS, ids=lambda tool: tool.name)
def test_a_tool_tells_what_it_does_and_does_nothing(tool, arguments, code, tmp_path):
    # Many write beside themselves. Without packages (-S): who asks for help need not have them.
    copy = tmp_path / "tools" / tool.name
    copy.parent.mkdir()
    shutil.copy(tool, copy)
    done = subprocess.run([sys.executable, "-S", "-B", copy, *arguments], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert "usage: " in done.stdout + done.stderr
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [copy]
