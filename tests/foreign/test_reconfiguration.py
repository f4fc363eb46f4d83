"""An actuator is gone: the gains of the report, and runs of the controller FMU beside scipy."""

import json
import tomllib

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import place_poles

from conftest import ROOT
from matrices import zoh
from stepped import Stepped

PLANT = ROOT / "examples/plants/actuators/underwater-vehicle.toml"


@pytest.fixture(scope="module")
def vehicle(aso_ftc, tmp_path_factory):
    """Design file, report and FMU of the vehicle; without losses to prove, which take time."""
    folder = tmp_path_factory.mktemp("vehicle")
    text = PLANT.read_text(encoding="utf-8").replace("up_to = 0.6\n", "") + "[robustness]\ncases = 0\n"
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    out = ("--out", folder / "design.toml", "--fmu", folder / "Vehicle.fmu", "--json", "--certificate-time", "0")
    done = aso_ftc("design", folder / "plant.toml", *out)
    assert done.returncode == 0, done.stderr
    return tomllib.loads((folder / "design.toml").read_text()), json.loads(done.stdout), folder / "Vehicle.fmu"


def matrix(design, name):
    return np.array(design[name])


def test_three_thrusters_have_the_effect_of_four_with_the_least_effort(vehicle):
    design, report, _ = vehicle
    b, k_x = matrix(design, "B"), matrix(design, "K_x")
    assert [entry["gone"] for entry in design["reconfigurations"]] == ["T1", "T2", "T3", "T4"]
    for at, entry in enumerate(design["reconfigurations"]):
        gains = matrix(entry, "K_x")
        assert abs(gains[at]).max() == 0 and abs(b @ gains - b @ k_x).max() < 1e-12
        # For a state, no other command of the three has the same effect with less effort.
        x = np.array([0.4, -0.2, 0.1, 0.05, 0.03, -0.02])
        rest = np.delete(b, at, axis=1)
        solved = minimize(
            lambda u: u @ u,
            np.zeros(3),
            constraints={"type": "eq", "fun": lambda u: (rest @ u - b @ k_x @ x)[3:]},
            options={"ftol": 1e-15},
        )
        assert abs(np.delete(gains @ x, at) - solved.x).max() < 1e-6
        # At rest the three do what the fourth did.
        outcome = report["reconfiguration"]["without"][at]["outcome"]
        commands = np.array([command["value"] for command in outcome["commands"]])
        assert commands[at] == 0 and abs(b @ (commands - 3)).max() < 1e-12 and outcome["kept"]
    assert ("loss" in design["reconfigurations"][0]) and ("loss" not in design["reconfigurations"][2])


class Loop(Stepped):
    """The controller FMU and the plant by scipy, coupled every `step` s; commands are held in between."""

    def __init__(self, vehicle, folder, step=0.005):
        self.design, _, fmu = vehicle
        super().__init__(fmu, folder)
        self.size = step
        a, b = matrix(self.design, "A"), matrix(self.design, "B")
        self.phi, self.gamma = zoh(a, b, step)
        self.x, self.time = np.zeros(6), 0.0

    def gone(self, j, value=True):
        self.set(f"actuator_gone[{j}]", value)

    def run(self, end, effect):
        """Runs to `end`; `effect` turns the commands into what the thrusters do. Returns the largest |x|."""
        largest = np.zeros(6)
        while self.time < end - 1e-9:
            u = effect(self.get("T1", "T2", "T3", "T4"))
            self.x = self.phi @ self.x + self.gamma @ (u - 3.0)
            self.set_reals(("x", "y", "psi"), self.x[:3])
            self.step(self.time, self.size)
            self.time += self.size
            largest = np.maximum(largest, abs(self.x))
        return largest


@pytest.fixture
def loop(vehicle, tmp_path):
    closed_loop = Loop(vehicle, tmp_path)
    yield closed_loop
    closed_loop.close()


def without(at, stuck=0.0):
    """The thrusters of which number `at` is stuck."""

    def effect(u):
        u = u.copy()
        u[at] = stuck
        return u

    return effect


@pytest.mark.parametrize("at", range(4))
def test_without_a_thruster_the_vehicle_returns_to_its_position(loop, at):
    loop.run(1.0, lambda u: u)
    loop.gone(at + 1)
    loop.run(15.0, without(at))
    assert loop.number() == at + 1
    assert abs(loop.x).max() < 2e-4
    commands = loop.get("T1", "T2", "T3", "T4")
    entry = loop.design["reconfigurations"][at]
    expected = 3 + matrix(entry, "K_s") * -3.0
    expected[at] = 0.0
    assert abs(commands - expected).max() < 0.02


def test_the_run_is_that_of_the_reconfigured_equations(vehicle, loop):
    """From another state, observer and plant by scipy with the matrices of the design file."""
    design = loop.design
    entry = design["reconfigurations"][2]
    a, b, c, f_a = (matrix(design, name) for name in ("A", "B", "C", "F_a"))
    gain = np.vstack([matrix(design, "L_x"), matrix(design, "L_f")])
    loop.gone(3)
    loop.x[:] = [0.05, -0.03, 0.02, 0.0, 0.0, 0.0]
    x, z, step = loop.x.copy(), np.zeros(8), loop.size
    u_3 = -3.0
    # z' = M z + N [y; u_3] with the feedback of the design file; y is held over a step.
    feedback = np.hstack([matrix(entry, "K_x"), matrix(entry, "K_f")])
    feedback[2] = 0.0
    constant = matrix(entry, "K_s") * u_3
    constant[2] = u_3
    m = np.block([[a, f_a], [np.zeros((2, 8))]]) + np.vstack([b @ feedback, np.zeros((2, 8))])
    m -= gain @ np.hstack([c, np.zeros((3, 2))])
    n = np.hstack([gain, np.concatenate([b @ constant, np.zeros(2)])[:, None]])
    phi, gamma = zoh(m, n, step)
    u = np.array([3.0, 3.0, 3.0, 3.0])
    for k in range(400):
        loop.run((k + 1) * step, without(2))
        u[2] = 0.0
        x = loop.phi @ x + loop.gamma @ (u - 3.0)
        z = phi @ z + gamma @ np.concatenate([c @ x, [1.0]])
        u = 3.0 + feedback @ z + constant
        assert abs(loop.x - x).max() < 1e-9, k
        assert abs(loop.get("T1", "T2", "T3", "T4") - (u - [0, 0, 0, 0])).max() < 1e-7, k


def test_the_estimated_loss_decides_that_a_thruster_is_gone(loop):
    """Thruster 1 loses all of its effect; nobody tells the controller. Thruster 2 only half of it: no decision."""
    loop.run(1.0, lambda u: u)
    loop.run(4.0, lambda u: u * [1, 0.5, 1, 1])
    assert loop.number() == 0 and loop.get("E_hat[2]")[0] == pytest.approx(0.5, abs=0.05)
    loop.run(30.0, lambda u: u * [0, 1, 1, 1])
    assert loop.number() == 1 and loop.get("T1")[0] == 0
    assert abs(loop.x).max() < 1e-3
    # The thruster does nothing, as assumed.
    assert abs(loop.get("f_hat[1]")[0]) < 0.05


def test_a_thruster_that_is_stuck_elsewhere_is_compensated_by_the_estimate(loop):
    """Assumed are 0 N, real are 6 N: the estimate is the difference, and the others answer it."""
    loop.gone(1)
    loop.run(20.0, without(0, 6.0))
    assert loop.get("f_hat[1]")[0] == pytest.approx(6.0, abs=0.05)
    assert abs(loop.x).max() < 1e-3
    # Back again: the intact gains, and an estimate from 0 on.
    loop.gone(1, False)
    loop.run(35.0, lambda u: u)
    assert loop.number() == 0 and abs(loop.x).max() < 1e-3


SMALL = """
A = [[-1, 1, 0], [1, -2, 0.5], [0, 0.3, 0.4]]
B = [[1, 0], [0, 1], [0, 1]]
C = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
actuators = [{ name = "u1", limits = [-1, 1] }, { name = "u2", limits = [-1, 1] }]
actuator_faults = "all"
feedback.eigenvalues = [-2, -3, -4]
observer.eigenvalues = [-6, -7, -8, -9, -10]
robustness.cases = 0
[reconfiguration]
actuators = "all"
keep = ["y3"]
stuck_at = { u1 = 0.3 }
"""


def designed(aso_ftc, folder, text):
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    return aso_ftc("design", folder / "plant.toml", "--out", folder / "design.toml", "--json", "--certificate-time", "0")


def test_without_exact_allocation_the_feedback_is_designed_again_and_keeps_what_must_be_kept(aso_ftc, tmp_path):
    done = designed(aso_ftc, tmp_path, SMALL)
    report, design = json.loads(done.stdout), tomllib.loads((tmp_path / "design.toml").read_text())
    a, b = matrix(design, "A"), matrix(design, "B")
    assert [entry["gone"] for entry in design["reconfigurations"]] == ["u1", "u2"]
    for at, entry in enumerate(design["reconfigurations"]):
        outcome = report["reconfiguration"]["without"][at]["outcome"]
        k_x, k_s = matrix(entry, "K_x"), matrix(entry, "K_s")
        assert outcome["residual"] > 1e-3 and "Designed again" in outcome["method"]
        rest = b.copy()
        rest[:, at] = 0
        eigenvalues = np.sort(np.linalg.eigvals(a + rest @ k_x).real)
        assert eigenvalues == pytest.approx([-4, -3, -2], abs=1e-6)
        # At rest under the stuck command the third state is zero.
        x = np.linalg.solve(a + rest @ k_x, -(b[:, at] + rest @ k_s))
        assert abs(x[2]) < 1e-10 and outcome["kept"]


def test_an_actuator_that_the_plant_needs_is_amber_with_the_mode_that_nothing_moves(aso_ftc, tmp_path):
    text = SMALL.replace("[0, 1], [0, 1]]", "[0, 0], [0, 1]]").replace("[1, -2, 0.5], [0, 0.3, 0.4]", "[1, -2, 0], [0, 0, 0.4]")
    report = json.loads(designed(aso_ftc, tmp_path, text).stdout)
    one, two = report["reconfiguration"]["without"]
    assert "cannot be stabilised" in two["outcome"]["reason"] and "x3" in two["outcome"]["reason"]
    assert any(reason.startswith("without u2 there is no controller") for reason in report["verdict"]["reasons"])
    assert [entry["gone"] for entry in tomllib.loads((tmp_path / "design.toml").read_text()).get("reconfigurations", [])] in (
        [],
        ["u1"],
    )


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('actuators = "all"\nkeep', 'actuators = ["u7"]\nkeep', 'no actuator is named "u7"; there are u1, u2'),
        ('keep = ["y3"]', 'keep = ["u1"]', 'no measurement is named "u1"'),
        ("stuck_at = { u1", "stuck_at = { y1", "expected one of `actuators`: u1, u2, found `y1`"),
        ("keep =", "loss = 0.9\nkeep =", "expected `time` beside it"),
        ("keep =", "loss = 0.9\ntime = 1\nkeep =", "expected a fault with `loss_of` one of `actuators`"),
    ],
)
def test_a_bad_entry_is_refused_at_its_line(aso_ftc, tmp_path, old, new, message):
    assert old in SMALL
    done = designed(aso_ftc, tmp_path, SMALL.replace(old, new))
    assert done.returncode == 2 and message in done.stderr and "plant.toml:1" in done.stderr


def sensitivity(a, b, c, k, g, l):
    """p_u^2 p_y of the peaks of S at commands and measurements; the controller has the dynamics g and the gains k and l."""
    points = 1j * np.logspace(-3, 3, 2000)[:, None, None]
    plant = c @ np.linalg.solve(points * np.eye(len(a)) - a, b.astype(complex))
    controller = k @ np.linalg.solve(points * np.eye(len(g)) - g, l.astype(complex))
    peak = lambda loop: np.linalg.norm(np.linalg.inv(np.eye(loop.shape[1]) - loop), 2, axis=(1, 2)).max()
    return peak(controller @ plant) ** 2 * peak(plant @ controller)


@pytest.mark.parametrize("seed", [4, 6])
def test_of_the_feedbacks_with_the_required_eigenvalues_the_least_sensitive_is_used(aso_ftc, tmp_path, seed):
    random = np.random.default_rng(seed)
    a, b, c = np.round(random.standard_normal((5, 5)), 2), np.round(random.standard_normal((5, 4)), 2), np.eye(5)[:4]
    poles = [-1, -1.5, -2, -2.5, -3]
    done = designed(aso_ftc, tmp_path, f"""A = {a.tolist()}
B = {b.tolist()}
C = {c.tolist()}
actuators = ["u1", "u2", "u3", "u4"]
faults = [{{ name = "f", actuator = "u1" }}]
feedback.eigenvalues = {poles}
observer.eigenvalues = [-5, -6, -7, -8, -9, -10]
robustness.cases = 0
[reconfiguration]
actuators = ["u4"]
""")
    assert done.returncode in (0, 1), done.stderr
    design = tomllib.loads((tmp_path / "design.toml").read_text())
    entry, l = design["reconfigurations"][0], np.vstack([matrix(design, "L_x"), matrix(design, "L_f")])
    rest, f_a, k_f = np.hstack([b[:, :3], np.zeros((5, 1))]), matrix(design, "F_a"), matrix(entry, "K_f")

    def value(k_x):
        g = np.block([[a + rest @ k_x, f_a + rest @ k_f], [np.zeros((1, 6))]]) - l @ np.hstack([c, np.zeros((4, 1))])
        return sensitivity(a, rest, c, np.hstack([k_x, k_f]), g, l)

    placed = [place_poles(a, b[:, :3], poles, method=method).gain_matrix for method in ("YT", "KNV0")]
    others = [value(np.vstack([-gain, np.zeros((1, 5))])) for gain in placed]
    assert np.sort(np.linalg.eigvals(a + rest @ matrix(entry, "K_x")).real) == pytest.approx(np.sort(poles), abs=1e-6)
    assert value(matrix(entry, "K_x")) < 1.01 * min(others)
