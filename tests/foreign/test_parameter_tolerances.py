"""Tolerances of the parameters of a plant's FMU, beside the equations of the DC servo in numpy.

J w' = k i - F_v w, R i = u - k w (examples/dc-servo, friction off); the random numbers are those of SplitMix64 (Steele, Lea, Flood
2014)."""

import json
import tomllib

import numpy as np
import pytest

from design_loop import packed_plant
from design_oracle import WITHOUT_PROOFS, Matrices, closed_loop, commands
from split_mix import uniform

NOMINAL = {"J": 3.2284e-6, "k": 0.0274, "R": 4.0, "F_v": 3.5077e-6}
LIMITS = {
    "F_v": [0.1 * NOMINAL["F_v"], 1.9 * NOMINAL["F_v"]],
    "J": [0.1 * NOMINAL["J"], 8e-6],
    "R": [0.2 * NOMINAL["R"], 1.8 * NOMINAL["R"]],
    "k": [0.2 * NOMINAL["k"], 0.05],
}
WIDE = f'parameters = {{ F_v = 0.9, J = {LIMITS["J"]}, R = 0.8, k = {LIMITS["k"]} }}\ncases = 300\nseed = 7\n'


def servo(**changed):
    """A and B of the servo with other parameters."""
    J, k, R, F_v = (NOMINAL | changed).values()
    return np.array([[0, 1], [0, -(F_v + k**2 / R) / J]]), np.array([[0], [k / (R * J)]])


def value(name, deviation):
    low, high = LIMITS[name]
    return NOMINAL[name] + ((high if deviation >= 0 else low) - NOMINAL[name]) * abs(deviation)


@pytest.fixture
def designed(aso_ftc, tmp_path):
    """Designs for the servo with a table `[robustness]`; returns exit status, report or error, and matrices."""
    fmu = packed_plant(aso_ftc, "DcServo")

    def design(robustness):
        plant = tmp_path / "servo.toml"
        plant.write_text(
            f'plant = "{fmu}"\noperating_point = {{ friction = 0 }}\nactuators = ["u"]\nmeasurements = ["theta_m"]\n'
            'actuator_faults = "all"\nfeedback.eigenvalues = [-40, -60]\nobserver.eigenvalues = [-300, -350, -400]\n'
            f"[robustness]\n{robustness}"
        )
        files = ("--out", tmp_path / "design.toml", "--worst-case", tmp_path / "worst.toml", "--json", "--force")
        done = aso_ftc("design", plant, *files, *WITHOUT_PROOFS)
        if done.returncode == 2:
            return done.stderr
        matrices = Matrices(tomllib.loads((tmp_path / "design.toml").read_text()))
        return done.returncode, json.loads(done.stdout), matrices, tomllib.loads((tmp_path / "worst.toml").read_text())

    return design


def instability(design, a, b):
    """The largest real part of the eigenvalues of the loop with another plant."""
    loop = closed_loop(design)[0]
    loop[: design.n] = np.hstack([a, np.zeros((design.n, design.n + design.q))]) + b @ commands(design)
    return np.linalg.eigvals(loop).real.max()


def peak(design, a, b):
    """The peak of S of the loop with another plant; one command, one measurement."""
    loop, n = closed_loop(design)[0], design.n
    inner, entering, leaving = loop[n:, n:], loop[n:, [0]], commands(design)[:, n:]
    points = 1j * np.linspace(20, 400, 40_001)
    through = (leaving @ np.linalg.solve(points[:, None, None] * np.eye(len(inner)) - inner, entering))[:, 0, 0]
    plant = b[1, 0] / (points * (points - a[1, 1]))
    return np.abs(1 / (1 - through * plant)).max()


def test_random_cases_and_worst_case_are_those_of_the_equations(designed):
    status, report, design, worst = designed(WIDE)
    tolerance = report["robustness"]["tolerance"]
    random = uniform(7)
    cases = [{name: value(name, 2 * next(random) - 1) for name in LIMITS} for _ in range(300)]
    values = [instability(design, *servo(**case)) for case in cases]
    stable = sum(value < 0 for value in values)
    assert 0 < stable < 300, "the test needs cases of both kinds"
    assert tolerance["stable"] == pytest.approx(stable / 300)
    parameters = {one["name"]: one for one in tolerance["parameters"]}
    assert {name: one["limits"] for name, one in parameters.items()} == {
        name: pytest.approx(limits) for name, limits in LIMITS.items()
    }
    a, b = servo(**{name: one["worst"] for name, one in parameters.items()})
    assert tolerance["worst_instability"] == pytest.approx(instability(design, a, b), rel=1e-4)
    vertices = np.array(np.meshgrid(*LIMITS.values())).reshape(4, -1).T
    assert tolerance["worst_instability"] >= max(
        instability(design, *servo(**dict(zip(LIMITS, vertex)))) for vertex in vertices
    ) * (1 - 1e-4)
    assert np.array(worst["A"]) == pytest.approx(a, rel=1e-5) and np.array(worst["B"]) == pytest.approx(b, rel=1e-5)
    part = tolerance["first_unstable"]
    near = [
        instability(design, *servo(**{
            name: NOMINAL[name] + scale * part * (one["worst"] - NOMINAL[name]) for name, one in parameters.items()
        }))
        for scale in (0.999, 1.001)
    ]
    assert near[0] < 0 < near[1]
    assert status == 1 and report["verdict"]["level"] == "red"
    assert any("J from 3.2284e-7 to 8e-6" in reason for reason in report["verdict"]["reasons"])


def test_effects_of_parameters_are_the_changes_of_the_peak(designed):
    _, report, design, _ = designed("parameters = { J = 0.01, k = 0.01, R = 0.01 }\n")
    parameters = report["robustness"]["tolerance"]["parameters"]
    assert {one["name"] for one in parameters} == {"J", "k", "R"}
    for one in parameters:
        low, high = (peak(design, *servo(**{one["name"]: limit})) for limit in one["limits"])
        assert one["effects"] == pytest.approx([(high - low) / 2] * 2, rel=0.02)


@pytest.mark.parametrize(
    "robustness, place, sentence",
    [
        ("parameters = { j = 0.1 }", "9:20", 'DcServo has no variable "j"'),
        ("parameters = { omega = 0.1 }", "9:24", "expected a parameter of type Real, found Real of causality"),
        ("parameters = { friction = 0.1 }", "9:27", "expected a parameter of type Real, found Boolean"),
        ("parameters = { E = 0.1 }", "9:20", "expected the lowest and the highest value, E = [low, high]"),
        ("parameters = { J = [1.0, 2.0] }", "9:20", "expected limits around its value 0.0000032284, found 1 and 2"),
        ("parameters = { J = 1.5 }", "9:20", "expected a number from 0 to below 1, found 1.5"),
        ("parameters = { E = [-1.0, 1.0] }", "9:20", "-1 to 1 is not within `min` (0) and `max` (1) of the FMU"),
        ("parameters = {}", "9:14", "expected parameters of the FMU and their tolerances, found none"),
        ("tolerance = 0.1\nparameters = { J = 0.1 }", "10:14", "found both"),
    ],
)
def test_parameters_that_cannot_vary_are_refused_at_their_line(designed, robustness, place, sentence):
    error = designed(robustness + "\n")
    assert f"servo.toml:{place}: " in error and sentence in error, error
