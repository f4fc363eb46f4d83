"""Plants whose matrices are of sampled time, beside scipy's discretisation."""

import json
import tomllib

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import cont2discrete

PERIOD = 0.05
# A motor with a flexible shaft: angle and speed of both ends.
A = np.array([[0, 1, 0, 0], [-40, -0.4, 40, 0.1], [0, 0, 0, 1], [20, 0.05, -20, -0.3]])
B = np.array([[0], [5], [0], [0]])
C = np.array([[1, 0, 0, 0], [0, 0, 1, 0]])
F = np.array([[0], [0], [0], [2]])
SAMPLED, INPUTS = cont2discrete((A, np.hstack([B, F]), C, np.zeros((2, 2))), PERIOD)[:2]
REST = f"""C = {C.tolist()}
sample_time = {PERIOD}
feedback.Q = [1, 0.1, 1, 0.1]
feedback.R = [1]
observer.W = [0.01, 0.1, 0.01, 0.1, 1]
observer.V = [0.01, 0.01]
"""
CONTINUOUS = f"A = {A.tolist()}\nB = {B.tolist()}\nF_a = {F.tolist()}\n{REST}"
PLANT = f"""matrices = "sampled"
A = {SAMPLED.tolist()}
B = {INPUTS[:, :1].tolist()}
F_a = {INPUTS[:, 1:].tolist()}
{REST}"""


@pytest.fixture
def design(aso_ftc, tmp_path):
    """Designs a plant file; returns what the command printed and wrote."""

    def run(text, *options):
        (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
        return aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--force", *options)

    return run


def test_sampled_matrices_give_the_design_of_the_plant_that_was_sampled(design):
    reports = []
    for text in (PLANT, CONTINUOUS):
        done = design(text, "--json")
        assert done.returncode in (0, 1), done.stderr
        reports.append(json.loads(done.stdout))
    for one, other in zip(reports[0]["gains"], reports[1]["gains"], strict=True):
        np.testing.assert_allclose(one["values"], other["values"], rtol=1e-8, atol=1e-9)
    found, expected = ([point["s_peak"] for point in report["robustness"]["points"]] for report in reports)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_the_worst_plant_of_sampled_matrices_is_a_plant_file(design, aso_ftc, tmp_path):
    done = design(PLANT, "--worst-case", tmp_path / "worst.toml")
    assert done.returncode in (0, 1), done.stderr
    worst = tomllib.loads((tmp_path / "worst.toml").read_text(encoding="utf-8"))
    assert "matrices" not in worst
    np.testing.assert_allclose(worst["F_a"], F, atol=1e-9)
    np.testing.assert_allclose(worst["A"], A, rtol=0.11, atol=1e-9)
    assert aso_ftc("design", tmp_path / "worst.toml", "--out", tmp_path / "other.toml").returncode in (0, 1)


def test_matlab_variables_with_a_sample_time_become_a_sampled_plant(aso_ftc, tmp_path):
    savemat(tmp_path / "plant.mat", {"A": SAMPLED, "B": INPUTS[:, :1], "C": C, "Ts": PERIOD})
    done = aso_ftc("design", "--init", tmp_path / "plant.mat", "--out", tmp_path / "plant.toml")
    assert done.returncode == 0 and done.stderr == "", done.stderr
    made = tomllib.loads((tmp_path / "plant.toml").read_text(encoding="utf-8"))
    assert (made["matrices"], made["sample_time"]) == ("sampled", PERIOD)
    assert made["observer"]["bandwidth"] > made["feedback"]["bandwidth"] > 0
    np.testing.assert_array_equal(made["A"], SAMPLED)


SCALAR = 'B = [[1]]\nC = [[1]]\nactuator_faults = "all"\n'


@pytest.mark.parametrize(
    "text, message",
    [
        (f'matrices = "sampled"\nsample_time = 0.1\nA = [[-0.3]]\n{SCALAR}', "1:12: matrices: sampled every 0.1 s: no continuous"),
        (f'matrices = "sampled"\nsample_time = 0.1\nA = [[0]]\n{SCALAR}', "1:12: matrices: sampled every 0.1 s: no continuous"),
        (f'matrices = "sampled"\nA = [[0.5]]\n{SCALAR}', "1:12: matrices: expected `sample_time`, too"),
        (f'matrices = "discrete"\nA = [[0.5]]\n{SCALAR}', 'expected "continuous" or "sampled", found "discrete"'),
        (PLANT + "[[family]]\nA = [[1]]\n", "expected continuous matrices"),
    ],
)
def test_samples_of_no_continuous_plant_are_refused_with_the_reason(design, text, message):
    done = design(text)
    assert done.returncode == 2 and message in done.stderr, done.stderr
