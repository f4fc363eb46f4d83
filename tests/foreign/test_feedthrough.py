"""Plants whose measurements contain the commands, y = C x + D u: margins by numpy, runs of the FMU with FMPy.

The oracle does not use the design's own loop: S is computed from the transfer functions of the plant, D included, and
of the controller, whose equations are

  y_f' = W (y - D u - y_f),  x_hat' = A x_hat + B u + F_a f_hat + L_x e,  f_hat' = L_f e,  e = y_f - C x_hat

and in a sampled controller y_f[k+1] = y_f[k] + W (y[k] - D u[k-1] - y_f[k]).
"""

import json
import tomllib

import numpy as np
import pytest

from conftest import ROOT
from design_oracle import WITHOUT_PROOFS
from matrices import zoh
from stepped import Stepped
from test_estimation_laws import Designed as DesignedFmu

# Two masses between springs; position of the first one and acceleration of the second one are measured.
A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-30, 10, -0.8, 0.1], [12, -25, 0.1, -1.1]])
B = np.array([[0.0], [0.0], [0.4], [2.0]])
C = np.array([[1, 0, 0, 0], [12, -25, 0.1, -1.1]])
D = np.array([[0.0], [2.0]])
PLANT = f"""A = {A.tolist()}
B = {B.tolist()}
C = {C.tolist()}
D = {D.tolist()}
actuators = ["force"]
measurements = ["position", "acceleration"]
actuator_faults = "all"
filter = [80, 60]
feedback.eigenvalues = [-4, -5, {{ re = -3, im = 4 }}]
observer.eigenvalues = [-14, -16, -18, -20, -22, -24, -26]
robustness.noise = 0.01
"""
SAMPLED = PLANT.replace("filter", "sample_time = 0.01\nfilter")
TEXTS = {"continuous": PLANT, "sampled": SAMPLED}


class Designed(DesignedFmu):
    def __init__(self, aso_ftc, folder, text):
        super().__init__(aso_ftc, folder, text)
        self.design = tomllib.loads((folder / "design.toml").read_text(encoding="utf-8"))

    def __getattr__(self, name):
        return np.array(self.design[name])

    def points(self):
        return {point["point"]: point for point in self.report["robustness"]["points"]}

    def controller(self, s, fed, kind):
        """The transfer function from y to u at s or z; `fed`: D, or D / z; `kind`: continuous or sampled."""
        n, q, p, m = len(self.A), self.F_a.shape[1], len(self.C), self.B.shape[1]
        W = np.diag(self.design["filter"])
        # z = [x_hat; f_hat], e = y_f - C x_hat: u = K_1 y_f, then y_f from y and u.
        C_0 = np.hstack([self.C, np.zeros((p, q))])
        K = np.hstack([self.K_x, self.K_f])
        L = np.vstack([self.L_x, self.L_f])
        A_f = np.zeros((q, q)) if kind == "continuous" else np.eye(q)
        A_0 = np.block([[self.A, self.F_a], [np.zeros((q, n)), A_f]])
        B_0 = np.vstack([self.B, np.zeros((q, m))])
        one = np.eye(n + q)
        if kind == "continuous":
            K_1 = K @ np.linalg.solve(s * one - A_0 - B_0 @ K + L @ C_0, L)
            filtered = W @ np.linalg.inv(s * np.eye(p) + W)
        else:
            # Corrected estimate z+ = (1 - L C) z + L y_f, z[k+1] = (A_0 + B_0 K) z+.
            G = A_0 + B_0 @ K
            corrected = one - L @ C_0
            z = np.linalg.solve(s * one - G @ corrected, G @ L)
            K_1 = K @ (corrected @ z + L)
            filtered = W @ np.linalg.inv((s - 1) * np.eye(p) + W)
        K_1 = K_1 @ filtered
        return np.linalg.solve(np.eye(m) + K_1 @ fed, K_1)

    def plant(self, s, A, B, C, D, kind):
        """The transfer function of the plant, and the part of it that is D."""
        if kind == "continuous":
            return C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D, D
        h = self.design["sample_time"]
        phi, gamma = zoh(A, B, h)
        return C @ np.linalg.solve(s * np.eye(len(A)) - phi, gamma) + D / s, D / s


@pytest.fixture(scope="module", params=["continuous", "sampled"])
def designed(request, aso_ftc, tmp_path_factory):
    return request.param, Designed(aso_ftc, tmp_path_factory.mktemp(request.param), TEXTS[request.param])


def test_the_peaks_of_s_are_those_of_the_transfer_functions(designed):
    kind, loop = designed
    points = loop.points()
    frequencies = np.geomspace(0.05, 300, 6000)[:, None, None]
    s = 1j * frequencies if kind == "continuous" else np.exp(1j * frequencies * loop.design["sample_time"])
    g, fed = loop.plant(s, A, B, C, D, kind)
    k = loop.controller(s, fed, kind)
    for name, product in [("input", k @ g), ("output", g @ k)]:
        peak = np.linalg.norm(np.linalg.inv(np.eye(product.shape[-1]) - product), 2, axis=(1, 2)).max()
        assert points[name]["s_peak"] == pytest.approx(peak, rel=2e-3), (name, kind)


def test_the_sensitivity_to_an_entry_of_d_is_that_of_another_plant(designed):
    """The effect of D on the peak at the commands, against the peak of a plant with another D and the same controller."""
    kind, loop = designed
    at = loop.points()["input"]["s_frequency"]
    s = 1j * at if kind == "continuous" else np.exp(1j * at * loop.design["sample_time"])
    k = loop.controller(s, D if kind == "continuous" else D / s, kind)

    def peak(factor):
        g, _ = loop.plant(s, A, B, C, D * factor, kind)
        return np.linalg.norm(np.linalg.inv(np.eye(1) - k @ g), 2)

    expected = (peak(1 + 1e-5) - peak(1 - 1e-5)) / 2e-5
    sensitivity = loop.report["robustness"]["sensitivity"][0]
    assert sensitivity["point"] == "input"
    values = {matrix["name"]: np.array(matrix["values"]) for matrix in sensitivity["matrices"]}
    assert values["D"][1, 0] == pytest.approx(expected, rel=1e-3)
    worst = {matrix["name"]: np.array(matrix["values"]) for matrix in loop.report["robustness"]["tolerance"]["worst"]}
    assert worst["D"][1, 0] / 2 in (pytest.approx(0.9), pytest.approx(1.1))


class Run(Stepped):
    """The FMU and the exact plant, exchanged every `step` seconds."""

    def __init__(self, fmu, folder, step):
        super().__init__(fmu, folder)
        (self.phi, self.gamma), self.size = zoh(A, B, step), step

    def measure(self, k, y):
        """Step `k` with these measurements."""
        self.set_reals(("position", "acceleration"), y)
        self.step(k * self.size, self.size)

    def run(self, end, fault):
        """The state of the plant, and the last estimate of the fault."""
        x = np.array([0.02, -0.01, 0.0, 0.0])
        u = self.get("force")
        count = round(end / self.size)
        for k in range(count):
            f = fault if k * self.size >= end / 2 else 0.0
            self.measure(k, C @ x + D @ (u + f))
            u = self.get("force")
            x = self.phi @ x + self.gamma @ (u + f)
        return x, self.get("f_hat")


def test_the_fault_is_estimated_and_cancelled_through_the_feedthrough(designed, tmp_path):
    kind, loop = designed
    run = Run(loop.fmu, tmp_path, 0.0005 if kind == "continuous" else 0.01)
    x, estimate = run.run(16.0, 0.7)
    assert estimate[0] == pytest.approx(0.7, rel=1e-3)
    assert abs(x).max() < 1e-4


def test_a_sampled_controller_follows_its_equations_with_limits(aso_ftc, tmp_path):
    """Fifty samples of measurements without a pattern; the commands reach their limits."""
    text = SAMPLED.replace('["force"]', '[{ name = "force", limits = [-0.4, 0.5], operating = 0.1 }]')
    controller = Designed(aso_ftc, tmp_path, text)
    run = Run(controller.fmu, tmp_path / "unpacked", 0.01)
    n = len(controller.A)
    x_hat, f_hat, y_f, u = np.zeros(n), np.zeros(1), np.zeros(2), np.zeros(1)
    W = controller.design["filter"]
    reached = set()
    for k in range(50):
        y = np.array([0.3 * np.sin(0.9 * k), 2.0 * np.cos(0.37 * k * k)])
        if k == 0:
            y = np.zeros(2)
        filter_input = y - D @ u
        e = y_f - controller.C @ x_hat
        x, f = x_hat + controller.L_x @ e, f_hat + controller.L_f @ e
        u = np.clip(controller.K_x @ x + controller.K_f @ f, -0.5, 0.4)
        reached.update(np.round(u, 12).tolist())
        x_hat, f_hat = controller.A @ x + controller.B @ u + controller.F_a @ f, f
        y_f = y_f + W * (filter_input - y_f)
        run.measure(k, y)
        assert run.get("force")[0] == pytest.approx(u[0] + 0.1, abs=1e-11), k
    assert {-0.5, 0.4} <= reached


def test_an_fmu_with_feedthrough_gives_the_design_of_its_matrices(aso_ftc, tmp_path):
    """examples/state-space with D = 0.5, and the same plant as matrices; its D as an uncertain parameter."""
    done = aso_ftc("pack", ROOT / "examples/state-space", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    controller = (
        'actuator_faults = "all"\nfilter = 40\nfeedback.eigenvalues = [-2, -3]\n'
        "observer.eigenvalues = [-8, -9, -10, -11]\n"
    )
    of_fmu = (
        f'plant = "StateSpace.fmu"\nactuators = ["u[1]"]\nmeasurements = ["y[1]"]\n{controller}'
        'robustness.parameters = { "D[1,1]" = 0.2 }\noperating_point = { "D[1,1]" = 0.5 }\n'
    )
    of_matrices = f"A = [[0, 1], [-1, 0]]\nB = [[0], [1]]\nC = [[1, 0]]\nD = [[0.5]]\n{controller}"
    reports = []
    for name, text in [("fmu", of_fmu), ("matrices", of_matrices)]:
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
        done = aso_ftc("design", tmp_path / f"{name}.toml", "--out", tmp_path / f"{name}-design.toml", "--json", *WITHOUT_PROOFS)
        assert done.returncode in (0, 1), done.stderr
        reports.append(json.loads(done.stdout))
    for one, other in zip(reports[0]["gains"], reports[1]["gains"], strict=True):
        assert np.allclose(one["values"], other["values"], rtol=1e-6, atol=1e-9), one["name"]
    [varied] = reports[0]["robustness"]["tolerance"]["parameters"]
    assert varied["limits"] == pytest.approx([0.4, 0.6]) and varied["worst"] in varied["limits"]


def test_a_fault_in_the_acceleration_is_detected_with_the_stated_delay(aso_ftc, tmp_path):
    """The tests of both kinds of controller take D u off the measurements: no alarm without a fault, one after it."""
    for kind, text in TEXTS.items():
        text += (
            '[detection]\nmethod = "cusum"\nfalse_alarm_interval = 1e5\nsizes = { f_force = 0.5 }\n'
            "from = 2.0\n"
        )
        folder = tmp_path / kind
        folder.mkdir()
        controller = Designed(aso_ftc, folder, text)
        run = Run(controller.fmu, folder / "unpacked", 0.01)
        detection = controller.report["detection"]
        latest = detection["faults"][0]["delay_90"]
        generator = np.random.default_rng(5)
        deviation = 0.01 if kind == "sampled" else 0.01 / np.sqrt(0.01)
        x, u, detected = np.zeros(4), run.get("force"), None
        for k in range(2000 + round(200 * latest)):
            f = 0.5 if k >= 2000 else 0.0
            run.measure(k, C @ x + D @ (u + f) + deviation * generator.standard_normal(2))
            u = run.get("force")
            x = run.phi @ x + run.gamma @ (u + f)
            if detected is None and run.slave.getBoolean([run.names["fault_detected"]])[0]:
                detected = 0.01 * (k - 2000)
        # No false alarm in 18 s; twice the delay that nine of ten detections do not exceed.
        assert detected is not None and 0 <= detected < 2 * latest, (kind, detected, latest)


def test_the_master_does_not_extrapolate_across_the_jumps_of_a_sampled_command(aso_ftc, tmp_path):
    """A loop with a delay margin of one sample: a measurement with D u that is extrapolated by its last values makes it unstable."""
    done = aso_ftc("pack", ROOT / "examples/state-space", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "plant.toml").write_text(
        'plant = "StateSpace.fmu"\nactuators = ["u[1]"]\nmeasurements = ["y[1]"]\nactuator_faults = "all"\n'
        "sample_time = 0.02\nfilter = 40\nfeedback.eigenvalues = [-2, -3]\nobserver.eigenvalues = [-8, -9, -10, -11]\n"
        'operating_point = { "D[1,1]" = 0.5, "x[1]" = 0 }\n',
        encoding="utf-8",
    )
    fmu = tmp_path / "Own.fmu"
    done = aso_ftc(
        "design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--fmu", fmu,
        "--from", ROOT / "dist/AsoController.fmu", "--json", *WITHOUT_PROOFS,
    )  # fmt: skip
    assert json.loads(done.stdout)["robustness"]["delay_margin"] == pytest.approx(0.02, rel=0.05)
    links = ("--connect", "Own.u[1]=StateSpace.u[1]", "--connect", "StateSpace.y[1]=Own.y[1]")
    done = aso_ftc(
        "run", tmp_path / "StateSpace.fmu", fmu, "--set", "StateSpace.D[1,1]=0.5", *links,
        "--stop-time", "8", "--step", "0.02", "--out", tmp_path / "run",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    table = np.genfromtxt(tmp_path / "run/results.csv", delimiter=",", names=True, deletechars="")
    columns = [name for name in table.dtype.names if name.startswith("StateSpace.x")]
    assert len(columns) == 2 and table[columns[0]][0] == 1.0
    assert all(abs(table[name][-1]) < 1e-5 for name in columns)
