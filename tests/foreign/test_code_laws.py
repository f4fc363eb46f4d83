"""The source code of sampled controllers with other laws that estimate the faults.

`test_code.py` compares their bits with those of the FMU.
"""

import numpy as np
import pytest

from code_cases import CASES, TANKS, UNSTABLE, Built, fed, law, stated
from design_loop import packed_plant
from test_code import differences


@pytest.fixture
def built(aso_ftc, packed, tmp_path):
    """The code of a case, by its name."""
    packed_plant(aso_ftc, "ThreeTank")
    return lambda name, *options: Built(aso_ftc, CASES[name].text, tmp_path, *options)


def test_the_stated_arithmetic_of_a_direct_term_has_its_second_innovation(built):
    build = built("fast-adaptive-schedule")
    n, m, p, q = build.sizes
    # A, B, C twice, F_a, K_x, K_f, L_x, L_f, P_f are interpolated.
    moving = n * n + n * m + 2 * p * n + n * q + m * n + m * q + n * p + 2 * q * p
    vectors = n + m + p
    # Deviations, e twice, f_hat, x_hat, u, x_hat[k+1], f_hat[k+1] + 0; the operating point, theta + 0 and its weights, the limits.
    others = (p + p + n) + 2 * p + q + n + 2 * m + 3 * n + q + vectors + 4 + 2 * m
    counts = stated(build)
    assert counts["multiplications"] == 3 * moving + 2 * vectors
    assert counts["additions"] == 2 * moving + others
    assert counts["divisions"] == 1


def test_the_stated_arithmetic_of_a_sliding_mode_has_its_quotients(built):
    build = built("sliding-mode")
    (n, m, p, q), t = build.sizes, len(build.design["references"])
    # As its linearisation has a fault model: A_f; with references K_i, L_w, H.
    products = p * n + n * p + q * p + m * n + m * q + n * n + n * m + n * q + q * q + 2 * m * t + t * p
    counts = stated(build)
    assert counts["multiplications"] == products + q + t
    assert counts["divisions"] == q
    assert counts["comparisons"] == 2 * (p + t + m + n + q + n + q + t) + 2 * m + q


@pytest.mark.parametrize(
    ("text", "most"),
    [
        (CASES["proportional-integral"].text, 200),
        (CASES["proportional-integral-detection"].text, 200),
        (law(TANKS["plant"], "fast-adaptive"), 200),
        (law(UNSTABLE, "fast-adaptive"), 200),
        (CASES["feedthrough"].text, 200),
        # The slope of its law may be any up to that at 0.
        (law(TANKS["plant"], "sliding-mode"), 2000),
    ],
    ids=["proportional-integral", "proportional-integral-detection", "fast-adaptive", "unstable", "feedthrough", "sliding-mode"],
)
def test_float_stays_within_its_bound_with_each_law(aso_ftc, packed, tmp_path, text, most):
    packed_plant(aso_ftc, "ThreeTank")
    difference, bound, checked = differences(aso_ftc, tmp_path, text)
    assert (difference < bound).all(), difference / bound
    assert (difference[checked] > bound[checked] / most).all(), bound / difference


def test_a_loss_of_effectiveness_beyond_the_range_is_the_largest_number(built):
    build = built("fast-adaptive")
    (n, m, p, q), samples = build.sizes, np.ones((60, build.sizes[2] + 1))
    samples[:, :p] = [signal["operating"] for signal in build.design["measurements"]]
    samples[50, :p] = 1.7e308 * np.array([1, -1, 1])
    for program in (build.compiled("-O2"), build.crate()):
        rows = fed(program, samples)[0]
        losses = abs(rows[:, m + n + q : -1])
        assert np.isfinite(rows).all() and losses[50].max() == np.finfo(float).max and losses[:50].max() < 1


def test_after_an_overflow_the_estimated_fault_is_its_integral_part(aso_ftc, packed, tmp_path):
    """f_hat_i = f_hat - P_f (y - C x_hat) of the sample before, as the fault is constant."""
    build = Built(aso_ftc, law(UNSTABLE, "fast-adaptive"), tmp_path)
    (n, m, p, q), plant = build.sizes, {name: np.array(build.design[name]) for name in ("C", "P_f")}
    y_op = np.array([signal.get("operating", 0.0) for signal in build.design["measurements"]])
    x_op = np.array([signal.get("operating", 0.0) for signal in build.design["states"]])
    samples = np.hstack([y_op + 1e-3 * np.sin(np.arange(60))[:, None] * np.arange(1, p + 1), np.ones((60, 1))])
    samples[50, :p] = 1.7e308 * np.sign(build.design["L_x"][0])
    for program in (build.compiled("-O2"), build.crate()):
        rows = fed(program, samples)[0]
        assert np.isfinite(rows).all() and rows[50, -1] == 4
        assert (rows[50, :m] == rows[49, :m]).all()
        e = samples[49, :p] - y_op - plant["C"] @ (rows[49, m : m + n] - x_op)
        f_hat_i = rows[49, m + n : m + n + q] - plant["P_f"] @ e
        scale = abs(rows[49, m + n : m + n + q]).max()
        assert np.allclose(rows[50, m + n : m + n + q], f_hat_i, rtol=0, atol=1e-12 * scale) and abs(plant["P_f"] @ e).max() > 1e-3 * scale


def test_float_refuses_bounds_that_it_cannot_hold(aso_ftc, tmp_path):
    (tmp_path / "plant.toml").write_text(law(UNSTABLE.replace("bound = 2.0", "bound = 1e-20"), "sliding-mode"), encoding="utf-8")
    options = ("--out", tmp_path / "design.toml", "--c-code", tmp_path / "c", "--certificate-time", "0")
    done = aso_ftc("design", tmp_path / "plant.toml", *options, "--float")
    assert done.returncode == 2 and "rho or delta = 2e-20; `float` code has them from 1e-18 to 1e18" in done.stderr
    assert aso_ftc("design", tmp_path / "plant.toml", *options).returncode in (0, 1), "double holds them"
