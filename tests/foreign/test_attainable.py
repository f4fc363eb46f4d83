"""What no controller can reach is said before a design that asks for it: formulas of Freudenberg and Looze, 1985."""

import json

import numpy as np
import pytest
from scipy.signal import tf2ss

from design_oracle import WITHOUT_PROOFS


@pytest.fixture
def report(aso_ftc, tmp_path):
    """The report of a plant given by its numerator and denominator."""

    def run(numerator, denominator, requirements):
        a, b, c, _ = (matrix.tolist() for matrix in tf2ss(numerator, denominator))
        text = f"A = {a}\nB = {b}\nC = {c}\nactuator_faults = \"all\"\n{requirements}"
        (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
        done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--json", "--force", *WITHOUT_PROOFS)
        assert done.returncode in (0, 1), done.stderr
        return json.loads(done.stdout)

    return run


def said(report, words):
    return [warning for warning in report["warnings"] if words in warning]


def peaks(report):
    return [point["s_peak"] for point in report["robustness"]["points"]]


def test_a_zero_beside_an_unstable_eigenvalue_forces_the_peak_of_every_controller(report):
    # (s - 3) / ((s - 2) (s + 1)): (3 + 2) / (3 - 2) = 5.
    result = report([1, -3], np.poly([2, -1]), "")
    (warning,) = said(result, "no controller has a peak of S below 5: its zero at 3 1/s")
    assert "plant.toml" in warning
    assert min(peaks(result)) >= 5


def test_a_zero_far_from_the_unstable_eigenvalue_is_no_warning(report):
    # The X-29: about 6 and 26 1/s, (26 + 6) / (26 - 6) = 1.6 (Stein, IEEE Control Systems 23 (2003)).
    result = report([1, -26], np.poly([6, -1, -30]), "")
    assert not said(result, "no controller") and min(peaks(result)) >= 1.6


def test_a_feedback_faster_than_the_zero_allows_is_named_with_the_speed_that_it_allows(report):
    plant = [1, -2], np.poly([-1, -3])
    requirements = "feedback.eigenvalues = [-20, -25]\nobserver.eigenvalues = [-60, -70, -80]\n"
    fast = report(*plant, requirements)
    (warning,) = said(fast, "too fast for the plant: its zero at 2 1/s")
    # |S| <= 1/sqrt(2) up to 20 rad/s and Theta = 2 atan(20 / 2).
    theta = 2 * np.arctan(10)
    bound = np.sqrt(2) ** (theta / (np.pi - theta))
    assert float(warning.split("the peak of S ")[1].split()[0]) == pytest.approx(bound, rel=1e-3)
    # Theta / (pi - Theta) = 2 for a peak of 2.
    allowed = 2 * np.tan(np.pi / 3)
    assert float(warning.split("below ")[1].split()[0]) == pytest.approx(allowed, rel=1e-3)
    # A regulator whose loop gain crosses one at 20 rad/s need not make |S| small up to there.
    for requirements in ("feedback.bandwidth = 1\nobserver.bandwidth = 4\n", "feedback.bandwidth = 20\nobserver.bandwidth = 4\n"):
        slow = report(*plant, requirements)
        assert not said(slow, "too fast") and max(peaks(slow)) < 2 < min(peaks(fast)), requirements


def test_samples_too_far_apart_for_an_unstable_plant_are_named_with_the_time_that_is_short_enough(report):
    # The mean of log |S| over the unit circle is 10 * 0.1: no peak below e.
    result = report([1], np.poly([10, -1]), "sample_time = 0.1\n")
    (warning,) = said(result, "no controller has a peak of S below 2.7183")
    assert float(warning.split("at most ")[1].split()[0]) == pytest.approx(np.log(2) / 10, rel=1e-3)
    assert min(peaks(result)) >= np.e
    assert not said(report([1], np.poly([10, -1]), "sample_time = 0.01\n"), "no controller")


def test_samples_between_which_the_plant_grows_beyond_any_loop_are_refused_with_a_time_that_is_short_enough(aso_ftc, refusal, tmp_path):
    text = "sample_time = {}\nA = [[300, 0], [0, -1]]\nB = [[1], [1]]\nC = [[1, 1]]\nactuator_faults = 'all'\n"
    error = refusal(text.format(0.1))
    assert "no controller has a peak of S below 1.0686e13" in error and "plant.toml:1:15" in error
    allowed = float(error.split("at most ")[1].split()[0])
    assert allowed == pytest.approx(np.log(2) / 300, rel=1e-3)
    (tmp_path / "plant.toml").write_text(text.format(allowed), encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml")
    assert done.returncode in (0, 1), done.stderr


def test_a_case_that_grows_beyond_the_numbers_within_a_sample_is_unstable(aso_ftc, tmp_path):
    """A in coordinates in which a tenth of its entries makes eigenvalues of 1e4 1/s: e^(1e4 s^-1 0.1 s) is no number."""
    turned = np.array([[1, 1], [1, 1 + 1e-5]])
    a = turned @ np.diag([1.0, -2.0]) @ np.linalg.inv(turned)
    b, c = turned @ [[1.0], [1.0]], [[1.0, 0.5]] @ np.linalg.inv(turned)
    text = f"sample_time = 0.1\nA = {a.tolist()}\nB = {b.tolist()}\nC = {c.tolist()}\nactuator_faults = 'all'\n"
    (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--json")
    assert done.returncode == 1, done.stderr
    stable = json.loads(done.stdout)["robustness"]["tolerance"]["stable"]
    assert stable < 0.1, stable
