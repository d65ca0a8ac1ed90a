"""Renders the same scenes with Abbe and with Mitsuba 3, live, and tells whether they agree.

    python tools/cross_validate [--binary PATH] [--only NAME] [--nightly] [--seed N] [--out DIR]

Two kinds of cases: scenes in Abbe's grammar, written for Mitsuba (`scenes.py`), and Mitsuba's own scene files, read
by both (`mitsuba/*.xml`, `scene_files.py`). Of the files a dozen are drawn by the seed, all with --nightly or --all.

For each case: the ratio of the means (R, G, B), the standard error of that ratio, blocks and pixels that
fit (see `judge.py`). A case that fails is rendered once more with four times the samples and other
seeds, and the second verdict counts: noise fails one in hundreds, and rarely twice. The scenes, as YAML
and as XML, and the pictures stay in the output directory; `index.html` there shows them all.

Exit code 0 if every case agrees, 1 if one does not, 2 if the comparison could not be made.
"""

import argparse
import datetime
import json
import os
import sys
import time
import zlib
from pathlib import Path

import numpy as np

import drawn
import page
import renderers
import scene_files
from judge import Picture, judge
from renderers import Mitsuba, PeerDied, RenderError, choose_variant
from scenes import BANDS, Case, all_cases

ROOT = Path(__file__).resolve().parents[2]

# Files of Mitsuba's that a run takes without --all.
DRAWN = 12


def count(text: str) -> int:
    """A number of scenes."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 up, found {text}")
    return int(text)


def arguments() -> argparse.Namespace:
    today = int(datetime.date.today().strftime("%Y%m%d"))
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser = argparse.ArgumentParser(prog="cross_validate", description=__doc__.splitlines()[0])
    parser.add_argument("--binary", type=Path, default=target / "release" / "abbe", help="the renderer to judge")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="cases whose name holds this")
    parser.add_argument("--nightly", action="store_true", help="eight times the samples")
    parser.add_argument("--seed", type=int, default=int(os.environ.get("ABBE_SEED", today)), help="default: the date")
    parser.add_argument("--out", type=Path, default=ROOT / "target" / "cross_validate", help="where files are left")
    parser.add_argument("--variant", help="of Mitsuba; default: the fastest that works here")
    parser.add_argument("--all", action="store_true", help="every file of Mitsuba's, not a dozen drawn by the seed")
    parser.add_argument("--files", action="store_true", help="only Mitsuba's files")
    parser.add_argument("--drawn", type=count, metavar="N", help="only N scenes drawn at random by the seed from most plugins")
    parser.add_argument("--list", action="store_true", help="print the cases and render nothing")
    return parser.parse_args()


def chosen_cases(a: argparse.Namespace) -> list:
    """Those that --only names, from all; else ours and a draw of Mitsuba's files; or drawn scenes alone."""
    files = scene_files.all_files()
    if not (a.all or a.nightly or a.only or a.list or a.files) and len(files) > DRAWN:
        chosen = np.random.default_rng(a.seed).choice(len(files), DRAWN, replace=False)
        files = [files[i] for i in sorted(chosen)]
    cases = files if a.files else [*all_cases(), *files]
    if a.drawn:
        cases = drawn.cases(a.drawn, a.seed, a.out / "drawn")
    return [c for c in cases if not a.only or any(part in c.name for part in a.only)]


def one_case(case: Case | scene_files.SceneFile, attempt: int, a: argparse.Namespace, mitsuba: Mitsuba):
    """A verdict, with the pictures it rests on."""
    rng = np.random.default_rng([a.seed, zlib.crc32(case.name.encode()), attempt])
    effort = (8 if a.nightly else 1) * 4**attempt
    compare = scene_files.compare if isinstance(case, scene_files.SceneFile) else renderers.compare
    return compare(case, a.binary, mitsuba, a.out / case.name, effort, rng)


HEADLINE = (
    f"{'case':28} {'':6} {'ratio of means R, G, B':>26} {'s.e. %':>7} {'worst z':>8} "
    f"{'blocks':>8} {'pixels %':>9} {'s':>6}"
)


def row(name: str, verdict: dict) -> str:
    ratio = " ".join(f"{r:8.5f}" for r in verdict["ratio"])
    worst = max(verdict["z"], key=abs)
    blocks = f"{verdict['blocks'] - verdict['blocks_rejected']}/{verdict['blocks']}"
    word = "agree" if verdict["passed"] else "DIFFER"
    return (
        f"{name:28} {word:6} {ratio:>26} {100 * max(verdict['standard_error']):7.3f} {worst:8.2f} {blocks:>8} "
        f"{100 * verdict['pixels_accepted']:9.3f} {verdict['seconds']:6.1f}"
        + (f"  {verdict['reason']}" if verdict["reason"] else "")
    )


def neighbours_differ(pictures: dict) -> list:
    """The control of the dispersion cases: a band must not agree with Mitsuba's picture of the next.

    If it did, the comparison could not see dispersion, and its agreement would be worth nothing.
    """
    results = []
    for nm, other in zip(BANDS, BANDS[1:]):
        ours, theirs = pictures.get(f"dispersion_{nm}"), pictures.get(f"dispersion_{other}")
        if ours and theirs:
            verdict = judge(ours[0], theirs[1])
            results.append(
                {"abbe_nm": nm, "mitsuba_nm": other, "told_apart": not verdict.passed, "why": verdict.reason}
            )
    return results


def main() -> int:
    a = arguments()
    cases = chosen_cases(a)
    if a.list:
        for case in cases:
            print(f"{case.name:28} {case.about}")
        return 0
    if not cases:
        print(f"cross_validate: no case is named like {', '.join(a.only)}; --list shows them", file=sys.stderr)
        return 2
    if not a.binary.is_file():
        print(f"cross_validate: {a.binary} does not exist; build it with `cargo build --release`", file=sys.stderr)
        return 2
    with Mitsuba(a.variant or choose_variant()) as mitsuba:
        return judge_all(cases, a, mitsuba)


def judge_all(cases: list, a: argparse.Namespace, mitsuba: Mitsuba) -> int:
    """Judges the cases, writes the report and tells the exit code."""
    print(f"{mitsuba.name} against {a.binary}, seed {a.seed}")
    print(HEADLINE)

    started = time.monotonic()
    report = {"peer": mitsuba.name, "binary": str(a.binary), "seed": a.seed, "nightly": a.nightly, "cases": {}}
    pictures: dict[str, tuple[Picture, Picture]] = {}
    passed = failed = undecided = 0
    for case in cases:
        attempts = []
        may_be_noisy = getattr(case, "may_be_noisy", False)
        # Rare bright samples make a drawn scene look as if it differed.
        last = 2 if may_be_noisy else 1
        for attempt in range(last + 1):
            before = time.monotonic()
            try:
                verdict, *pair = one_case(case, attempt, a, mitsuba)
                pictures[case.name] = tuple(pair)
                result = verdict.as_dict()
            except (RenderError, RuntimeError, ValueError, KeyError) as error:
                result = {"passed": False, "reason": f"{type(error).__name__}: {error}", "undecided": isinstance(error, PeerDied)}
            result["seconds"] = round(time.monotonic() - before, 2)
            attempts.append(result)
            text = row(case.name, result) if "ratio" in result else f"{case.name:28} FAILED {result['reason']}"
            again = not result["passed"] and attempt < last and "ratio" in result
            print(text + ("  once more with 4 times the samples:" if again else ""), flush=True)
            if not again:
                break
        spared = may_be_noisy and attempts[-1].get("undecided", False)
        undecided += spared
        passed += attempts[-1]["passed"]
        failed += not (attempts[-1]["passed"] or spared)
        report["cases"][case.name] = {"about": case.about, "attempts": attempts}

    controls = neighbours_differ(pictures)
    for control in controls:
        passed += control["told_apart"]
        failed += not control["told_apart"]
    if controls:
        blind = [f"{c['abbe_nm']} nm and {c['mitsuba_nm']} nm" for c in controls if not c["told_apart"]]
        print(
            "control FAILED: pictures agree although the index differs, " + ", ".join(blind)
            if blind
            else f"control: each of {len(controls)} bands differs from Mitsuba's picture of the next, as it must"
        )
    report.update(controls=controls, passed=passed, failed=failed, seconds=round(time.monotonic() - started, 1))
    a.out.mkdir(parents=True, exist_ok=True)
    (a.out / "report.json").write_text(json.dumps(report, indent=1))
    page.write(a.out / "index.html", report, pictures)
    print(f"report: {a.out / 'index.html'}, {a.out / 'report.json'}")
    print(f"{passed} passed, {failed} failed" + (f", {undecided} undecided" if undecided else ""))
    return 0 if failed == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
