"""PI, PID and other controllers of low order of `[loop]`, beside their textbook form by numpy and scipy."""

import json
import re
import tomllib

import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.optimize import minimize
from scipy.signal import butter, cont2discrete, tf2ss

from design_oracle import WITHOUT_PROOFS

PEAK, FLOOR, ROLL_OFF, SET_POINT = 1.5, 0.01, 10.0, 0.3
PLANTS = {
    # 1 / (s^2 + 0.5 s), 1 / (s + 1)^3, 1 / (s - 1), and two commands that each act on both measurements.
    "cart": ([[0, 1], [0, -0.5]], [[0], [0.5]], [[1, 0]], 0.5),
    "three lags": ([[-1, 0, 0], [1, -1, 0], [0, 1, -1]], [[1], [0], [0]], [[0, 0, 1]], 0.4),
    "unstable": ([[1]], [[1]], [[1]], 1.5),
    "two channels": ([[-1, 0], [0, -1]], [[1, 0.5], [0.3, 1]], [[1, 0], [0, 1]], 1.0),
}


def plant_text(plant, structure, more="", of_loop=""):
    a, b, c, bandwidth = plant
    names = [f"y{at + 1}" for at in range(len(c))]
    return (
        f'A = {a}\nB = {b}\nC = {c}\nactuator_faults = "all"\nmeasurements = {names}\n{more}\n'
        f'[reference]\ntrack = {names}\n[loop]\nbandwidth = {bandwidth}\nstructure = {json.dumps(structure)}\n{of_loop}\n'
    )


def attempt(aso_ftc, folder, text, *options):
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    options = (*WITHOUT_PROOFS, *options)
    return aso_ftc("design", folder / "plant.toml", "--out", folder / "design.toml", "--json", "--force", *options)


def designed(aso_ftc, folder, text, *options):
    done = attempt(aso_ftc, folder, text, *options)
    assert (folder / "design.toml").exists(), done.stderr
    report = json.loads(done.stdout)
    gamma = re.search(r"gamma = ([0-9.e+-]+[0-9])", report["feedback"]["method"])
    return tomllib.loads((folder / "design.toml").read_text(encoding="utf-8")), report, float(gamma[1])


def derivatives(pid):
    """The gains of the filtered measurement's derivatives."""
    first = [] if pid["derivative"] is None else [pid["derivative"]]
    return [*first, *pid["higher_derivatives"]]


class Textbook:
    """The loop of a plant, its controllers of low order and an observer of plant and faults, at many frequencies."""

    def __init__(self, plant, design, report):
        self.a, self.b, self.c = (np.array(one, float) for one in plant[:3])
        self.bandwidth, (self.n, self.m) = plant[3], self.b.shape
        # The rows after those of the plant are those of the filters.
        self.l_x, self.l_f = np.array(design["L_x"], float)[: self.n], np.array(design["L_f"], float)
        self.pid = report["pid"]
        self.gains = [(one["integral"], one["proportional"], *derivatives(one)) for one in self.pid]

    def controller(self, s, gains, l_x, l_f):
        """From measurements and from references to commands: u = C(s) (y, r) - f_hat, f_hat by the observer from u and y."""
        from_y, from_r = np.zeros((2, len(s), self.m, len(self.c)), complex)
        for one, (k_i, *of_derivatives) in zip(self.pid, gains, strict=True):
            numerator, denominator = butter(len(of_derivatives), one["corner"], analog=True)
            filtered = np.polyval(numerator, s) / np.polyval(denominator, s)
            at = slice(None), int(one["command"][1:]) - 1, int(one["measurement"][1:]) - 1
            from_y[at] = -np.polyval(of_derivatives[::-1], s) * filtered - k_i / s
            from_r[at] = k_i / s
        q = self.m
        dynamics = np.block([[self.a, self.b], [np.zeros((q, self.n + q))]])
        correction = np.vstack([l_x, l_f])
        dynamics = dynamics - correction @ np.hstack([self.c, np.zeros((len(self.c), q))])
        entry = np.hstack([np.vstack([self.b, np.zeros((q, q))]), correction])
        estimates = np.linalg.solve(s[:, None, None] * np.eye(self.n + q) - dynamics, entry)[:, self.n :]
        f_u, f_y = estimates[..., : self.m], estimates[..., self.m :]
        inverse = np.linalg.inv(np.eye(self.m) + f_u)
        return inverse @ (from_y - f_y), inverse @ from_r

    def largest(self, omega, gains=None, l_x=None, l_f=None):
        """The largest weighted singular value, and the peaks of S at commands and measurements."""
        gains, l_x, l_f = gains or self.gains, self.l_x if l_x is None else l_x, self.l_f if l_f is None else l_f
        s, corner = 1j * omega, ROLL_OFF * self.bandwidth
        g = self.c @ np.linalg.solve(s[:, None, None] * np.eye(self.n) - self.a, self.b)
        k, k_r = self.controller(s, gains, l_x, l_f)

        def shaped(bandwidth):
            return abs((s / PEAK + bandwidth) / (s + FLOOR * bandwidth))

        def norm(matrices):
            return np.linalg.norm(matrices, 2, axis=(1, 2))

        def rest(matrices):
            return np.eye(matrices.shape[-1]) - matrices

        of_t = abs((s / corner + 1) / (s * FLOOR / corner + 1)) / PEAK
        sensitivities = [np.linalg.inv(rest(one)) for one in (k @ g, g @ k)]
        norms = np.array([norm(one) for one in sensitivities])
        weighted = [shaped(self.bandwidth) * norms, *(of_t * norm(rest(one)) for one in sensitivities)]
        weighted.append(shaped(SET_POINT * self.bandwidth) * norm(rest(g @ sensitivities[0] @ k_r)))
        return max(values.max() for values in weighted), norms.max(axis=1)


@pytest.mark.parametrize("structure", ["PI", "PID", 3, 5])
@pytest.mark.parametrize("name", PLANTS)
def test_gamma_and_the_peaks_are_those_of_the_textbook_controllers(aso_ftc, tmp_path, name, structure):
    plant = PLANTS[name]
    design, report, gamma = designed(aso_ftc, tmp_path, plant_text(plant, structure))
    assert len(derivatives(report["pid"][0])) == {"PI": 1, "PID": 2}.get(structure, structure) - 1
    largest, peaks = Textbook(plant, design, report).largest(plant[3] * np.logspace(-4, 4, 3000))
    assert gamma == pytest.approx(largest, rel=3e-3)
    stated = [point["s_peak"] for point in report["robustness"]["points"]]
    np.testing.assert_allclose(stated, peaks, rtol=3e-3)


def test_a_search_by_scipy_finds_no_better_gains_beside_those_of_the_design(aso_ftc, tmp_path):
    plant = PLANTS["unstable"]
    design, report, gamma = designed(aso_ftc, tmp_path, plant_text(plant, "PID"))
    loop = Textbook(plant, design, report)
    omega = plant[3] * np.logspace(-3, 3, 200)
    start = np.array([*loop.gains[0], *loop.l_x.ravel(), *loop.l_f.ravel()])

    def value(parts):
        gains, l_x, l_f = parts[:3] * start[:3], parts[3:4] * start[3:4], parts[4:] * start[4:]
        errors = np.array([[1.0 - l_x[0], 1.0], [-l_f[0], 0.0]])
        # Estimates as slow as the design allows, and no unstable controller that a frequency response does not show.
        slow = np.linalg.eigvals(errors).real.max() > -0.25 * plant[3]
        return 10.0 if slow else loop.largest(omega, [tuple(gains)], l_x[:, None], l_f[:, None])[0]

    near = minimize(value, np.ones(5), method="Nelder-Mead", options={"maxfev": 250, "initial_simplex": simplex(5)})
    assert near.fun > 0.97 * gamma, (near.fun, gamma, near.x)


@pytest.mark.parametrize("more", ["", "sample_time = 0.025\n"], ids=["continuous", "sampled"])
def test_the_search_does_not_exploit_the_approximation_of_a_delay(aso_ftc, tmp_path, more):
    """e^-s / (1 + 0.3 s): gains for the approximation alone had a peak of 36 with the delay itself."""
    plant = 'A = [[-3.3333]]\nB = [[1]]\nC = [[3.3333]]\nactuators = [{ name = "u", delay = 1 }]\nactuator_faults = "all"\n'
    shape = 'reference.track = ["y1"]\n[loop]\nbandwidth = 0.6166\nstructure = "PI"\n'
    _, report, _ = designed(aso_ftc, tmp_path, plant + more + shape)
    robustness = report["robustness"]
    assert robustness["delays"]["difference"] < 0.2
    approximated = max(point["s_peak"] for point in robustness["points"])
    assert max(robustness["delays"]["s_peaks"]) < min(2.0, 1.02 * approximated)


def simplex(count):
    return np.vstack([np.ones(count), np.ones((count, count)) + 0.05 * np.eye(count)])


@pytest.mark.parametrize("structure", ["PI", "PID", 4])
def test_the_sampled_fmu_without_compensation_is_the_recursion_of_a_plc(aso_ftc, tmp_path, structure):
    period = 0.1
    text = plant_text(PLANTS["cart"], structure, f"sample_time = {period}\n")
    design, report, _ = designed(aso_ftc, tmp_path, text, "--fmu", tmp_path / "Pid.fmu")
    assert design["estimator"] == "prediction"
    (pid,) = report["pid"]
    gains = np.array([pid["proportional"], *derivatives(pid)])
    # The rows of C give the filtered measurement and its derivatives from the states of the controller form.
    f, g, c, _ = tf2ss(*butter(len(gains), pid["corner"], analog=True))
    rows = [c[0]]
    while len(rows) < len(gains):
        rows.append(rows[-1] @ f)
    phi, gamma, *_ = cont2discrete((f, g, c, [[0.0]]), period)
    gains = gains @ np.array(rows)
    times = period * np.arange(200)
    y, r = np.sin(0.7 * times) + 0.2 * np.sign(np.sin(3 * times)), np.where(times > 5, 1.0, 0.0)
    # The first sample finds a filter at rest at the operating point.
    filtered, integral, expected = np.zeros(len(phi)), 0.0, []
    for measured, reference in zip(y, r, strict=True):
        expected.append(-gains @ filtered + pid["integral"] * integral)
        filtered = phi @ filtered + gamma[:, 0] * measured
        integral += period * (reference - measured)
    inputs = np.array(list(zip(times, y, r, strict=True)), dtype=[("time", float), ("y1", float), ("r_y1", float)])
    result = simulate_fmu(
        str(tmp_path / "Pid.fmu"),
        start_values={"compensate": False},
        input=inputs,
        output=["u1"],
        stop_time=times[-1],
        step_size=period,
        output_interval=period,
        fmi_type="CoSimulation",
    )
    # FMPy sets the inputs of t_k before the step to t_k+1, at whose end the controller takes its sample.
    np.testing.assert_allclose(result["u1"][1:], expected[: len(result) - 1], atol=1e-9 * max(map(abs, expected)))


def test_each_command_follows_its_own_measurement_only(aso_ftc, tmp_path):
    crossed = 'pairs = { u1 = "y2", u2 = "y1" }'
    plant = ([[-1, 0], [0, -1]], [[0.3, 1], [1, 0.5]], [[1, 0], [0, 1]], 1.0)
    design, report, _ = designed(aso_ftc, tmp_path, plant_text(plant, "PID", of_loop=crossed))
    names = [state["name"] for state in design["states"]]
    assert names[2:] == ["filtered y1", "rate of y1", "filtered y2", "rate of y2"]
    k_x, k_i = np.array(design["K_x"]), np.array(design["K_i"])
    assert (k_x != 0).tolist() == [[False] * 4 + [True] * 2, [False] * 2 + [True] * 2 + [False] * 2]
    assert (k_i != 0).tolist() == [[False, True], [True, False]]
    assert report["verdict"]["level"] == "green"
    assert all(abs(step["steady_state_error"]) < 1e-6 for step in report["references"])


@pytest.mark.parametrize("of_loop, expected", [("", 6.7), ("set_point = 0.05", 20.0)])
def test_a_reference_is_followed_within_some_time_constants_of_its_bandwidth(aso_ftc, tmp_path, of_loop, expected):
    """1 / set_point, 1 / (0.3 bandwidth) if missing, is the time constant; a step has settled after six of them."""
    for structure in ("", 'structure = "PID"'):
        text = plant_text(PLANTS["cart"], "PID", of_loop=of_loop).replace('structure = "PID"', structure)
        _, report, _ = designed(aso_ftc, tmp_path, text)
        (step,) = report["references"]
        assert step["settling_time"] < 6 * expected, step


def test_what_a_refusal_names_is_designed(aso_ftc, tmp_path):
    integrator = ([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 1.0)
    refused = attempt(aso_ftc, tmp_path, plant_text(integrator, "PI"))
    assert refused.returncode == 2 and "no stable loop with PI controllers was found" in refused.stderr
    assert '`structure = "PID"`' in refused.stderr
    assert designed(aso_ftc, tmp_path, plant_text(integrator, "PID"))[1]["verdict"]["level"] == "green"

    # s^4 + (K_d s^2 + K s + K_i) has no term s^3: no gains make it stable, by the necessary condition of Routh.
    triple = (np.eye(3, k=1).tolist(), [[0], [0], [1]], [[1, 0, 0]], 1.0)
    refused = attempt(aso_ftc, tmp_path, plant_text(triple, "PID"))
    assert refused.returncode == 2 and "no stable loop with PID controllers was found" in refused.stderr
    assert "`structure = 3`" in refused.stderr
    design, report, gamma = designed(aso_ftc, tmp_path, plant_text(triple, 3))
    largest, _ = Textbook(triple, design, report).largest(np.logspace(-4, 4, 3000))
    assert gamma == pytest.approx(largest, rel=3e-3)

    text = plant_text(PLANTS["cart"], "PID")
    no_reference = text.replace('[reference]\ntrack = [\'y1\']\n', "")
    refused = attempt(aso_ftc, tmp_path, no_reference).stderr
    remedy = re.search(r'expected `(reference\.track = \["y1"\])`', refused)
    assert remedy, refused
    designed(aso_ftc, tmp_path, f"{remedy[1]}\n{no_reference}")

    no_integral = text.replace("[loop]", "integral = false\n[loop]")
    refused = attempt(aso_ftc, tmp_path, no_integral).stderr
    remedy = re.search(r"expected `(integral = true)`", refused)
    assert remedy, refused
    designed(aso_ftc, tmp_path, no_integral.replace("integral = false", remedy[1]))

    more = ([[-1, 0], [0, -2]], [[1], [1]], [[1, 0], [0, 1]], 1.0)
    refused = attempt(aso_ftc, tmp_path, plant_text(more, "PI")).stderr
    remedy = re.search(r"expected `pairs`, a table from actuators to measurements, ({.*}) for example", refused)
    assert remedy, refused
    text = plant_text(more, "PI", of_loop=f"pairs = {remedy[1]}").replace("track = ['y1', 'y2']", "track = ['y1']")
    assert designed(aso_ftc, tmp_path, text)[1]["pid"][0]["measurement"] == "y1"


@pytest.mark.parametrize(
    "more, of_loop, message",
    [
        ('sample_time = 0.1\nestimator = "current"', "", "uses the measurements of the sample before"),
        ("filter = 3", "", "not possible together with `filter`"),
        ("", "structure = 7", "expected a whole number from 1 to 6, found 7"),
        ("", 'structure = "P"', 'expected "PI", "PID" or an order from 1 to 6, found "P"'),
        ("", "structure = [3]", 'expected "PI", "PID" or an order from 1 to 6'),
        ("", 'pairs = { u2 = "y1" }', 'no actuator is named "u2"; there are u1'),
        ("", 'pairs = { u1 = "y2" }', 'no measurement is named "y2"; there are y1'),
    ],
)
def test_entries_that_contradict_the_structure_are_refused_with_their_place(aso_ftc, tmp_path, more, of_loop, message):
    text = plant_text(PLANTS["cart"], "PID", more, of_loop)
    text = text.replace('structure = "PID"\n', "") if "structure" in of_loop else text
    refused = attempt(aso_ftc, tmp_path, text)
    assert refused.returncode == 2 and message in refused.stderr, refused.stderr
