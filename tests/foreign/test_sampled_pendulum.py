"""The paper's pendulum with sampled controllers: the claims of docs/explanation/sampled.md."""

import json
import re

import numpy as np
import pytest

from conftest import ROOT
from residual_over_sample_time import (
    CONSTANT,
    CONSTANT_PREDICTION,
    RAMP,
    TRUE_START,
    WEIGHTED,
    couple,
    design,
    noise_gain,
)

# Sample time in s, residual of the first prototype in mm.
PROTOTYPE = [(1e-4, 1.3), (5e-4, 1.3), (1e-3, 1.8), (1e-2, 18.0)]


@pytest.mark.parametrize("period, prototype", PROTOTYPE)
def test_the_residual_is_at_most_that_of_the_prototype(tmp_path, period, prototype):
    assert couple(design(CONSTANT, period, tmp_path), period) < prototype


@pytest.mark.parametrize("choice", [RAMP, WEIGHTED], ids=lambda choice: choice.label)
@pytest.mark.parametrize("period, prototype", PROTOTYPE)
def test_with_the_ramp_model_the_residual_is_below_a_tenth_of_the_prototypes(tmp_path, choice, period, prototype):
    assert couple(design(choice, period, tmp_path), period) < 0.1 * prototype


@pytest.mark.parametrize("period", [2e-3, 5e-3, 1e-2])
def test_the_current_estimator_has_a_third_less_residual_than_the_prediction(tmp_path, period):
    early, late = (
        couple(design(choice, period, tmp_path), period) for choice in (CONSTANT, CONSTANT_PREDICTION)
    )
    assert early < 2 / 3 * late


@pytest.mark.parametrize("choice", [CONSTANT, RAMP], ids=lambda choice: choice.label)
@pytest.mark.parametrize("part", [1 / 3, 1 / 2.7, 0.7])
def test_the_communication_step_need_not_divide_the_sample_time(tmp_path, choice, part):
    period = 5e-3
    fmu = design(choice, period, tmp_path)
    whole = couple(fmu, period, settings=TRUE_START)
    assert couple(fmu, part * period, settings=TRUE_START) == pytest.approx(whole, rel=0.02)


def test_with_the_ramp_model_a_delay_of_a_sample_fells_the_pendulum_and_of_a_tenth_does_not(tmp_path):
    period = 5e-3
    fmu = design(RAMP, period, tmp_path)
    assert couple(fmu, period, "jacobi", TRUE_START) is None
    whole = couple(fmu, period, settings=TRUE_START)
    assert couple(fmu, period / 10, "jacobi", TRUE_START) == pytest.approx(whole, rel=0.01)


def test_the_constant_model_tolerates_a_delay_of_a_sample(tmp_path):
    fmu = design(CONSTANT, 1e-2, tmp_path)
    assert couple(fmu, 1e-2, "jacobi") == pytest.approx(couple(fmu, 1e-2), rel=0.05)


def test_fmpy_gives_the_same_residual(tmp_path, python, packed):
    period = 5e-3
    fmu = design(CONSTANT, period, tmp_path)
    done = python(
        *(ROOT / "scripts" / "reference" / "couple_with_fmpy.py", "--plant", packed["plant"]),
        *("--controller", fmu, "--step", period),
    )
    assert done.returncode == 0, done.stderr
    residual = 1e3 * json.loads(done.stdout)["residual"]["x_p"]
    assert residual == pytest.approx(couple(fmu, period), rel=1e-3)


def test_noise_is_amplified_as_the_page_says(tmp_path):
    """From x_p, theta: the ramp model beside the constant one; weights beside eigenvalues, up to 3 ms and from 5 ms on."""
    gains = {}
    for period in (3e-3, 5e-3):
        for choice in (CONSTANT, RAMP, WEIGHTED):
            design(choice, period, tmp_path)
            gains[period, choice] = np.array(noise_gain(tmp_path / "design.toml"))
        ratio = gains[period, RAMP] / gains[period, CONSTANT]
        assert 1.6 <= ratio[0] <= 6.2 and 2.9 <= ratio[1] <= 4.1, (period, ratio)
    early, late = (gains[period, WEIGHTED] / gains[period, RAMP] for period in (3e-3, 5e-3))
    assert (early >= 1.5).all() and (early <= 8.5).all(), early
    assert late[1] < 1, late


def test_the_tables_of_the_page_are_those_of_the_figure():
    page = (ROOT / "docs" / "explanation" / "sampled.md").read_text(encoding="utf-8")
    lines = (ROOT / "docs" / "figures" / "residual_over_sample_time.csv").read_text(encoding="utf-8").splitlines()
    table = {}
    for row in lines[1:]:
        label, cart = re.match(r'[\d.]+,"(.*)",([\d.]+),', row).groups()
        table.setdefault(label, []).append(f"{float(cart):.3g}")
    assert len(table) == 4
    for label, carts in table.items():
        assert f"| {label} | {' | '.join(carts)} |" in page
