"""Which entries vary within their tolerances, and what becomes of the loop, by numpy: two masses and a spring.

The benchmark of B. Wie and D. S. Bernstein (American Control Conference 1990): m1 = m2 = k = 1, the spring is uncertain from
0.5 to 2. All its numbers are 0, 1 and -1; those of the spring and of the masses are parameters all the same."""

import numpy as np
import pytest

from design_oracle import WITHOUT_PROOFS, closed_loop, commands, design_and_report
from split_mix import uniform

SPRING = ["A[3][1]", "A[3][2]", "A[4][1]", "A[4][2]"]
CASES = 400


def plant_file(tolerance, k=1.0):
    return f"""A = [[0, 0, 1, 0], [0, 0, 0, 1], [{-k}, {k}, 0, 0], [{k}, {-k}, 0, 0]]
B = [[0], [0], [{k}], [0]]
C = [[0, 1, 0, 0]]
actuator_faults = "all"
feedback.eigenvalues = [-1, -1.1, -1.2, -1.3]
observer.eigenvalues = [-4, -5, -6, -7, -8]
[robustness]
tolerance = {tolerance}
cases = {CASES}
"""


def instability(matrices, factors):
    """The largest real part of the loop's eigenvalues with entries (row, column; column 4 is B) times factors."""
    a, b = matrices.A.copy(), matrices.B.copy()
    for (row, column), factor in factors.items():
        matrix, column = (a, column) if column < 4 else (b, 0)
        matrix[row, column] *= factor
    loop = closed_loop(matrices)[0]
    loop[: matrices.n] = np.hstack([a, np.zeros((matrices.n, matrices.n + matrices.q))]) + b @ commands(matrices)
    return np.linalg.eigvals(loop).real.max()


def stable_part(matrices, groups, tolerance):
    """The part of random cases that is stable; each group of entries has one factor."""
    random = uniform(1)
    cases = [[1 + tolerance * (2 * next(random) - 1) for _ in groups] for _ in range(CASES)]
    factors = [{place: factor for group, factor in zip(groups, case) for place in group} for case in cases]
    return np.mean([instability(matrices, case) < 0 for case in factors])


@pytest.mark.parametrize("k", [1.0, 1.0001])
def test_ones_that_are_parameters_vary_and_rows_that_are_structure_do_not(aso_ftc, tmp_path, k):
    matrices, report = design_and_report(aso_ftc, tmp_path, plant_file(0.5, k))
    tolerance = report["robustness"]["tolerance"]
    assert [item["entries"] for item in tolerance["varying"]] == [[name] for name in [*SPRING, "B[3][1]"]]
    assert {item["tolerance"] for item in tolerance["varying"]} == {0.5} and tolerance["entries"] == 5
    groups = [[(2, 0)], [(2, 1)], [(3, 0)], [(3, 1)], [(2, 4)]]
    part = stable_part(matrices, groups, 0.5)
    assert tolerance["stable"] == pytest.approx(part) and part < 1
    assert report["verdict"]["level"] == "red"


def test_entries_that_are_named_together_have_one_factor(aso_ftc, tmp_path):
    text = plant_file(f'{{ entries = {{ "{", ".join(SPRING)}" = 0.5 }} }}')
    matrices, report = design_and_report(aso_ftc, tmp_path, text)
    tolerance = report["robustness"]["tolerance"]
    assert tolerance["varying"] == [{"entries": SPRING, "tolerance": 0.5}] and tolerance["entries"] == 4
    spring = [(2, 0), (2, 1), (3, 0), (3, 1)]
    with_spring = [instability(matrices, dict.fromkeys(spring, factor)) for factor in (0.5, 1.5, 2.0)]
    assert with_spring[0] == pytest.approx(0.10, abs=0.01) and with_spring[2] == pytest.approx(0.33, abs=0.01)
    assert tolerance["stable"] == pytest.approx(stable_part(matrices, [spring], 0.5))
    assert tolerance["worst_instability"] == pytest.approx(max(with_spring[:2]), rel=1e-6)
    assert report["verdict"]["level"] == "red"


def test_without_entries_that_vary_nothing_is_called_stable(aso_ftc, tmp_path):
    text = plant_file(0.0)
    _, report = design_and_report(aso_ftc, tmp_path, text)
    tolerance = report["robustness"]["tolerance"]
    assert (tolerance["entries"], tolerance["varying"], tolerance["stable"]) == (0, [], None)
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--force", *WITHOUT_PROOFS)
    assert "parameter tolerances: not examined, no entry of the plant varies" in done.stdout
    page = (tmp_path / "plant-report.html").read_text(encoding="utf-8")
    assert "Not examined: no entry" in page and "100 %" not in done.stdout


def test_terminal_and_page_say_which_entries_vary(aso_ftc, tmp_path):
    design_and_report(aso_ftc, tmp_path, plant_file(0.5))
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--force", *WITHOUT_PROOFS)
    stated = f"±50 % of {', '.join(SPRING)}, B[3][1]"
    assert f"parameter tolerances: 5 entries vary, {stated}" in done.stdout
    assert stated in (tmp_path / "plant-report.html").read_text(encoding="utf-8")
