"""What no controller can reach is said before a design that asks for it: formulas of Freudenberg and Looze, 1985."""

import json

import numpy as np
import pytest
from scipy.signal import tf2ss


@pytest.fixture
def report(aso_ftc, tmp_path):
    """The report of a plant given by its numerator and denominator."""

    def run(numerator, denominator, requirements):
        a, b, c, _ = (matrix.tolist() for matrix in tf2ss(numerator, denominator))
        text = f"A = {a}\nB = {b}\nC = {c}\nactuator_faults = \"all\"\n{requirements}"
        (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
        done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--json", "--force")
        assert done.returncode in (0, 1), done.stderr
        return json.loads(done.stdout)

    return run


def said(report, words):
    return [warning for warning in report["warnings"] if words in warning]


def peaks(report):
    return [point["s_peak"] for point in report["robustness"]["points"]]


def test_a_zero_beside_an_unstable_eigenvalue_forces_the_peak_of_every_controller(report):
    # (s - 3) / ((s - 2) (s + 1)): (3 + 2) / (3 - 2) = 5.
    found = report([1, -3], np.poly([2, -1]), "")
    (warning,) = said(found, "no controller has a peak of S below 5: its zero at 3 1/s")
    assert "plant.toml" in warning
    assert min(peaks(found)) >= 5


def test_a_zero_far_from_the_unstable_eigenvalue_is_no_warning(report):
    # The X-29: about 6 and 26 1/s, (26 + 6) / (26 - 6) = 1.6 (Stein, IEEE Control Systems 23 (2003)).
    found = report([1, -26], np.poly([6, -1, -30]), "")
    assert not said(found, "no controller") and min(peaks(found)) >= 1.6


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
    slow = report(*plant, "feedback.bandwidth = 1\nobserver.bandwidth = 4\n")
    assert not said(slow, "too fast") and max(peaks(slow)) < 2 < min(peaks(fast))


def test_samples_too_far_apart_for_an_unstable_plant_are_named_with_the_time_that_is_short_enough(report):
    # The mean of log |S| over the unit circle is 10 * 0.1: no peak below e.
    found = report([1], np.poly([10, -1]), "sample_time = 0.1\n")
    (warning,) = said(found, "no controller has a peak of S below 2.7183")
    assert float(warning.split("at most ")[1].split()[0]) == pytest.approx(np.log(2) / 10, rel=1e-3)
    assert min(peaks(found)) >= np.e
    assert not said(report([1], np.poly([10, -1]), "sample_time = 0.01\n"), "no controller")
