"""The error of an excursion beyond a limit within a step: docs/reference/plant-file/limits.md."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from c_abi import Instance
from design_file import design_text, redesigned, shipped_design

JUMP = 1e-4  # m, of the measured position at the begin of the step
LIMITS = [-10.0, 20.0]  # N: the lower one is passed from 0.08 ms to 0.5 ms
ESTIMATES = [*(f"x_hat[{k}]" for k in range(1, 5)), "f_hat"]


def integrated(design, limits, size):
    """The estimates after `size` s by scipy: equations (4), (5) with a command within limits."""
    names = ("A", "B", "F_a", "C", "L_x", "L_f", "K_x", "K_f")
    a, b, f_a, c, l_x, l_f, k_x, k_f = (np.array(design[name], float) for name in names)

    def slope(_, z):
        x_hat, f_hat = z[:4], z[4:]
        command = np.clip(k_x @ x_hat + k_f @ f_hat, *limits)
        innovation = [JUMP, 0.0] - c @ x_hat
        x_slope = a @ x_hat + b @ command + f_a @ f_hat + l_x @ innovation
        return [*x_slope, *(l_f @ innovation)]

    options = {"method": "LSODA", "rtol": 1e-10, "atol": 1e-13, "max_step": 1e-6}
    return solve_ivp(slope, (0.0, size), np.zeros(5), **options).y[:, -1]


def stepped(fmu, size):
    """The estimates after one communication step."""
    with Instance(fmu) as instance:
        instance.start({"t_on": 0.0})
        instance.set({"x_p": JUMP})
        instance.step(0.0, size)
        return instance.get(*ESTIMATES)


def test_an_excursion_is_exact_if_the_middle_or_the_end_of_the_step_is_in_it(
    controller, tmp_path
):
    design = shipped_design(controller)
    design["actuators"][0]["limits"] = LIMITS
    limited = redesigned(controller, design_text(design), tmp_path / "limited")
    free = [-np.inf, np.inf]
    for size, is_detected in ((3e-4, True), (9e-4, True), (2e-3, False), (5e-3, False)):
        right, without = integrated(design, LIMITS, size), integrated(design, free, size)
        assert abs(right[4] - without[4]) > 0.01, "the limit matters"
        expected = right if is_detected else without
        assert stepped(limited, size) == pytest.approx(expected, rel=1e-7, abs=1e-9), size
    assert stepped(limited, 5e-3)[4] - right[4] == pytest.approx(-1.23, abs=0.005)
