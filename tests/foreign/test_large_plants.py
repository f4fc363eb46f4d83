"""A lightly damped chain of 25 masses, 50 states: the numbers of `aso-ftc design --json` by scipy."""

import json
import tomllib

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov
from scipy.optimize import linear_sum_assignment, minimize_scalar

import large_plants
from design_oracle import Matrices, closed_loop, says_nothing
from matrices import zoh

MASSES, COMMANDS, MEASUREMENTS = 25, 3, 6
STATES = 2 * MASSES


@pytest.fixture(scope="module")
def designed(aso_ftc, tmp_path_factory):
    """The report and the matrices of the design file."""
    folder = tmp_path_factory.mktemp("chain")
    a, b, c = large_plants.chain(STATES, commands=COMMANDS, measurements=MEASUREMENTS)
    text = "".join(f"{name} = {matrix.tolist()}\n" for name, matrix in zip("ABC", (a, b, c)))
    text += f"feedback.Q = {[1.0] * STATES}\nfeedback.R = {[1.0] * COMMANDS}\n"
    text += f"observer.W = {[1.0] * (STATES + 1)}\nobserver.V = {[0.01] * MEASUREMENTS}\n"
    text += '[[faults]]\nname = "f"\nactuator = "u1"\nbound = 1.0\nrate_bound = 1.0\n'
    (folder / "chain.toml").write_text(text + "[robustness]\ncases = 50\n", encoding="utf-8")
    options = ("--certificate-time", "0", "--out", folder / "design.toml", "--json")
    done = aso_ftc("design", folder / "chain.toml", *options)
    assert done.returncode in (0, 1), done.stderr
    assert says_nothing(done), done.stderr
    design = tomllib.loads((folder / "design.toml").read_text(encoding="utf-8"))
    return json.loads(done.stdout), Matrices(design)


def loop_at_the_measurements(design):
    """A, B, C of -T at the measurements, with the states of plant and controller."""
    a, _, _, _ = closed_loop(design)
    n, q = design.n, design.q
    b = np.vstack([np.zeros((n, MEASUREMENTS)), design.L_x, design.L_f])
    return a, b, np.hstack([design.C, np.zeros((MEASUREMENTS, n + q))])


def h_infinity(a, b, c, d, start):
    """The largest singular value near `start`, refined; and the test that none is larger, by its Hamiltonian matrix."""

    def largest(w):
        return np.linalg.norm(c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) + d, 2)

    inner = minimize_scalar(lambda w: -largest(w), bounds=(0.9 * start, 1.1 * start), method="bounded")
    gamma = 1.001 * -inner.fun
    r = np.linalg.inv(gamma**2 * np.eye(d.shape[1]) - d.T @ d)
    moved = a + b @ r @ d.T @ c
    hamiltonian = np.block(
        [[moved, b @ r @ b.T], [-c.T @ (np.eye(len(d)) + d @ r @ d.T) @ c, -moved.T]]
    )
    return -inner.fun, np.abs(np.linalg.eigvals(hamiltonian).real).min()


def test_the_gains_are_those_of_scipys_riccati_equations(designed):
    _, design = designed
    a, b, c = large_plants.chain(STATES, commands=COMMANDS, measurements=MEASUREMENTS)
    p = solve_continuous_are(a, b, np.eye(STATES), np.eye(COMMANDS))
    assert np.abs(design.K_x + b.T @ p).max() < 1e-9 * np.abs(p).max()
    a_0, c_0, gain = design.augmented
    p = solve_continuous_are(a_0.T, c_0.T, np.eye(len(a_0)), 0.01 * np.eye(MEASUREMENTS))
    assert np.abs(gain - p @ c_0.T / 0.01).max() < 1e-8 * np.abs(gain).max()


def test_the_eigenvalues_are_those_of_numpy(designed):
    report, design = designed
    for name, dynamics in (("feedback", design.fed_back), ("observer", design.error_dynamics)):
        stated = np.array([complex(*pair) for pair in report[name]["eigenvalues"]])
        distances = np.abs(stated[:, None] - np.linalg.eigvals(dynamics)[None, :])
        pairs = linear_sum_assignment(distances)
        assert distances[pairs].max() < 1e-5, name


def test_the_peaks_are_h_infinity_norms_and_noise_h2_norms(designed):
    report, design = designed
    a, b, c = loop_at_the_measurements(design)
    (point,) = (entry for entry in report["robustness"]["points"] if entry["point"] == "output")
    for name, system in (("s", (a, b, c, np.eye(MEASUREMENTS))), ("t", (a, b, c, 0 * np.eye(MEASUREMENTS)))):
        peak, distance = h_infinity(*system, point[f"{name}_frequency"])
        assert point[f"{name}_peak"] == pytest.approx(peak, rel=2e-4)
        assert distance > 1e-7, "a singular value is larger"
    covariance = solve_continuous_lyapunov(a, -b @ b.T)
    commands = np.hstack([np.zeros((COMMANDS, STATES)), design.K_x, design.K_f])
    together = [number["value"] for number in report["robustness"]["noise_together"]]
    expected = np.sqrt(np.diag(commands @ covariance @ commands.T))
    assert together[:COMMANDS] == pytest.approx(expected, rel=1e-6)


def test_the_worst_case_and_the_longest_hold_are_on_the_limit(designed):
    report, design = designed
    robustness = report["robustness"]
    worst = robustness["tolerance"]
    values = {matrix["name"]: np.array(matrix["values"]) for matrix in worst["worst"]}
    n, q = design.n, design.q
    command, correction = np.hstack([design.K_x, design.K_f]), np.vstack([design.L_x, design.L_f])
    a_0 = np.block([[design.A, 0 * design.F_a], [np.zeros((q, n + q))]])
    b_0 = np.vstack([design.B, np.zeros((q, COMMANDS))])
    f_0 = np.vstack([design.F_a, np.zeros((q, q))])
    c_0 = np.hstack([design.C, np.zeros((MEASUREMENTS, q))])
    controller = a_0 + b_0 @ command - correction @ c_0
    controller[:, n:] += f_0

    def dynamics(part):
        a, b, c = (
            nominal + part * (values[name] - nominal)
            for name, nominal in (("A", design.A), ("B", design.B), ("C", design.C))
        )
        return np.block([[a, b @ command], [correction @ c, controller]])

    def instability(part):
        return np.linalg.eigvals(dynamics(part)).real.max()

    assert instability(1) == pytest.approx(worst["worst_instability"], abs=1e-7)
    if worst["first_unstable"] is not None:
        assert instability(0.999 * worst["first_unstable"]) < 0
        assert instability(1.001 * worst["first_unstable"]) > 0
    hold = robustness["longest_hold"]

    def radius(h):
        (a, b), (k, gain) = zoh(design.A, design.B, h), zoh(controller, correction, h)
        return np.abs(np.linalg.eigvals(np.block([[a, b @ command], [gain @ design.C, k]]))).max()

    assert radius(0.999 * hold) < 1 < radius(1.001 * hold)


@pytest.mark.parametrize("sample_time", [None, 0.05], ids=["continuous", "sampled"])
def test_placement_with_50_states_reaches_the_required_eigenvalues_to_the_error_that_it_states(
    aso_ftc, tmp_path, sample_time
):
    text = large_plants.plant_file(STATES, placement=True, sample_time=sample_time, seed=1)
    (tmp_path / "chain.toml").write_text(text + "[robustness]\ncases = 0\n", encoding="utf-8")
    options = ("--certificate-time", "0", "--out", tmp_path / "design.toml", "--json")
    done = aso_ftc("design", tmp_path / "chain.toml", *options)
    assert done.returncode in (0, 1), done.stderr
    report = json.loads(done.stdout)
    design = Matrices(tomllib.loads((tmp_path / "design.toml").read_text(encoding="utf-8")))
    a, _, _ = large_plants.chain(STATES, seed=1)
    for name, dynamics, left in (("feedback", design.fed_back, 0.2), ("observer", design.error_dynamics, 0.5)):
        above = np.array(large_plants.shifted(a, left))
        required = np.concatenate([above, above.conj(), [-1.0, -1.2][: len(dynamics) - STATES]])
        if sample_time is not None:
            required = np.exp(sample_time * required)
        distances = np.abs(required[:, None] - np.linalg.eigvals(dynamics)[None, :])
        reached = distances[linear_sum_assignment(distances)].max()
        assert report[name]["pole_error"] < 1e-9
        assert reached < 1e-8, name
    # The curves of a large loop are thinned, with their peaks.
    for step in report["steps"]:
        for curve in step["curves"]:
            assert len(curve["times"]) == len(curve["values"]) <= 1000
            assert max(map(abs, curve["values"])) == pytest.approx(abs(curve["peak"]), rel=0.1, abs=1e-12)


@pytest.mark.parametrize("states", [8, 10, 20, 40, 50, 200])
def test_a_chain_of_any_size_has_a_force_on_and_a_position_of_distinct_masses(states):
    _, b, c = large_plants.chain(states)
    masses = states // 2
    assert c.shape == (min(10, masses), states) and b.shape == (states, 4)
    assert not b[:masses].any() and not c[:, masses:].any(), "forces change velocities, positions are measured"
    for placed in (b.T, c):
        assert (placed.sum(axis=1) == 1).all() and len(set(placed.argmax(axis=1))) == len(placed)
