"""The judge of the cross-validation can fail: it passes the same light and finds small defects."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cross_validate"))

import judge  # noqa: E402
import scenes  # noqa: E402
from conventions import n_sf11  # noqa: E402
from mitsuba_xml import Writer  # noqa: E402

SIDE, SAMPLES = 64, 512


def pictures(truth_a, truth_b, seed=1):
    """Abbe's and Mitsuba's pictures of two truths, by the ways of estimating that are used on them: four
    replicates with a stated error, sixteen renders. Samples are exponential, as noisy as light."""
    rng = np.random.default_rng(seed)

    def replicates(truth, n):
        # The mean of k exponentials of mean 1 is a gamma variable.
        k = SAMPLES / n
        return truth * rng.gamma(k, 1 / k, (n, *truth.shape))

    a = replicates(truth_a, 4)
    ours = judge.picture_of_errors(a.mean(0), a.std(0, ddof=1) / 2, 3, SAMPLES)
    return ours, judge.picture_of_replicates(replicates(truth_b, 16), SAMPLES, True)


def truth():
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    return np.stack([0.2 + x, 0.3 + y, 0.5 + 0.4 * np.sin(9 * x * y)], -1)


@pytest.mark.parametrize("seed", range(20))
def test_the_same_light_passes(seed):
    verdict = judge.judge(*pictures(truth(), truth(), seed))
    assert verdict.passed, verdict


def test_one_per_cent_in_one_channel_is_found():
    other = truth() * [1.01, 1.0, 1.0]
    verdict = judge.judge(*pictures(other, truth()))
    assert not verdict.passed and "means" in verdict.reason


def test_a_defect_in_one_place_is_found():
    """Eight by eight pixels 10 % brighter: 0.16 % of the whole, which the mean alone would forgive."""
    other = truth()
    other[16:24, 40:48] *= 1.1
    verdict = judge.judge(*pictures(other, truth()))
    assert not verdict.passed and "block" in verdict.reason


def test_a_shift_by_one_pixel_is_found():
    verdict = judge.judge(*pictures(np.roll(truth(), 1, axis=1), truth()))
    assert not verdict.passed


def test_what_is_not_a_number_fails():
    other = truth()
    ours, theirs = pictures(other, truth())
    ours.pixels.mean[3, 3, 0] = np.nan
    again = judge.picture_of_errors(ours.pixels.mean, np.sqrt(ours.pixels.variance), 3, SAMPLES)
    verdict = judge.judge(again, theirs)
    assert not verdict.passed and "finite" in verdict.reason


def test_too_much_noise_is_no_agreement():
    ours, theirs = pictures(truth(), truth())
    ours.whole.variance = ours.whole.variance * 1e4
    verdict = judge.judge(ours, theirs)
    assert not verdict.passed and "noisy" in verdict.reason and verdict.undecided


def test_noise_excuses_nothing_that_differs():
    """Red is noisier than can be judged; green differs by a tenth."""
    ours, theirs = pictures(truth() * [1.0, 1.1, 1.0], truth())
    ours.whole.variance = ours.whole.variance * [1e4, 1.0, 1.0]
    verdict = judge.judge(ours, theirs)
    assert "noisy" in verdict.reason and "means" in verdict.reason and not verdict.undecided


def test_only_the_peer_may_have_no_picture():
    """What is not a number is nobody's verdict where it is Mitsuba's alone, and ours where it is ours as well."""
    ours, theirs = pictures(truth(), truth())
    theirs.finite = False
    verdict = judge.judge(ours, theirs)
    assert not verdict.passed and verdict.undecided
    ours.finite = False
    verdict = judge.judge(ours, theirs)
    assert not verdict.passed and not verdict.undecided


def test_the_index_of_n_sf11_is_that_of_the_data_sheet():
    # SCHOTT N-SF11: n_d = 1.78472 at 587.5618 nm, n_F = 1.80651 at 486.1327 nm, n_C = 1.77596 at 656.2725 nm.
    for nm, n in [(587.5618, 1.78472), (486.1327, 1.80651), (656.2725, 1.77596)]:
        assert abs(n_sf11(nm) - n) < 5e-6 + 1e-9, nm


def test_every_case_can_be_said_in_the_words_of_the_peer(tmp_path):
    names = set()
    for case in scenes.all_cases():
        Writer(case.peer or case.scene, tmp_path).write(tmp_path / "scene.xml")
        names.add(case.name)
    assert len(names) == len(scenes.all_cases()) >= 20


def test_what_has_no_translation_is_refused_by_name(tmp_path):
    scene = scenes.scene([{"torus": {"radius": 1}}])
    with pytest.raises(ValueError, match="torus"):
        Writer(scene, tmp_path).write(tmp_path / "scene.xml")
    scene = scenes.scene([scenes.sphere([0, 0, 0], 1, {"diffuse": {"reflectance": 0.5, "gloss": 1}})])
    with pytest.raises(ValueError, match="gloss"):
        Writer(scene, tmp_path).write(tmp_path / "scene.xml")
