"""Estimation laws: the FMU against own simulations of the equations of the papers; existence; comparison."""

import json

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from jsonschema import Draft202012Validator
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from conftest import ROOT
from design_loop import packed_plant
from design_oracle import WITHOUT_PROOFS

A = np.array([[0.5, 1.0, -1.0], [0.0, -1.0, 2.0], [1.0, 0.0, -2.0]])
B = np.array([[2.0], [0.0], [0.0]])
C = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
F_A = B
T = 0.1
PLANT = f"""A = {A.tolist()}
B = {B.tolist()}
C = {C.tolist()}
faults = [{{ name = "f", actuator = "u1", bound = 2.0 }}]
feedback.eigenvalues = [-1, -2, -3]
observer.eigenvalues = [-6, -7, -8, -9]
experiment = {{ stop_time = 4.0, step_size = 0.1 }}
"""
LIMITS = (-20.0, 0.8)
LIMITED = f'actuators = [{{ name = "u1", limits = {list(LIMITS)} }}]\n'
STEPS = 30


def measured():
    """Measurements at each communication point, without a pattern."""
    k = np.arange(STEPS + 1)
    return np.column_stack([np.sin(0.9 * k) + 0.1 * k, np.cos(0.37 * k)])


class Designed:
    """A design with its report and its FMU."""

    def __init__(self, aso_ftc, folder, text):
        (folder / "plant.toml").write_text(text, encoding="utf-8")
        self.fmu = folder / "Law.fmu"
        done = aso_ftc(
            "design", folder / "plant.toml", "--out", folder / "design.toml", "--fmu", self.fmu,
            "--from", ROOT / "dist/AsoController.fmu", "--json", *WITHOUT_PROOFS,
        )  # fmt: skip
        assert done.returncode in (0, 1), done.stderr
        self.report = json.loads(done.stdout)
        self.gains = {one["name"]: np.array(one["values"]) for one in self.report["gains"]}
        parameters = self.report["estimation"]["parameters"]
        self.parameters = {one["name"].removesuffix(" of f"): one["value"] for one in parameters}

    def run(self):
        """x_hat, f_hat and u at the communication points after the first one."""
        y = measured()
        names = ["x_hat[1]", "x_hat[2]", "x_hat[3]", "f_hat", "u1"]
        kinds = [("time", float), ("y1", float), ("y2", float)]
        rows = [(T * k, *y[k]) for k in range(STEPS + 1)]
        result = simulate_fmu(
            str(self.fmu), stop_time=T * STEPS, step_size=T, output_interval=T, output=names,
            input=np.array(rows, dtype=kinds), fmi_type="CoSimulation",
            start_values={"x_hat_0[1]": 0.3, "x_hat_0[2]": -0.2, "f_hat_0": 0.0},
        )  # fmt: skip
        return np.array([[row[name] for name in names] for row in result])


@pytest.fixture
def designed(aso_ftc, tmp_path):
    """Designs PLANT with a law, and more lines at its start."""
    return lambda law, start="", text=PLANT: Designed(
        aso_ftc, tmp_path, f'{start}{text}\n[estimation]\nlaw = "{law}"\n'
    )


def command(design, x, f, limits):
    u = (design.gains["K_x"] @ x + design.gains["K_f"] @ [f])[0]
    return np.clip(u, *limits)


@pytest.mark.parametrize("limited", [False, True])
def test_fast_adaptive_follows_the_law_with_the_derivative_of_the_error(designed, limited):
    design = designed("fast-adaptive", LIMITED if limited else "")
    limits = LIMITS if limited else (-np.inf, np.inf)
    f, sigma, gamma = np.linalg.pinv(C @ F_A), design.parameters["sigma"], design.parameters["gamma"]
    # Zhang, Jiang, Cocquempot (2008): f_hat' = -Gamma F (e_y' + sigma e_y), e_y = C x_hat - y.
    gain = design.gains["L_x"] - F_A @ (gamma * f)
    assert np.allclose(design.gains["P_f"], gamma * f) and np.allclose(design.gains["L_f"], sigma * gamma * f)

    def slopes(_, z, y):
        x, f_hat = z[:3], z[3]
        e_y = C @ x - y
        x_rate = A @ x + B[:, 0] * command(design, x, f_hat, limits) + F_A[:, 0] * f_hat - gain @ e_y
        return [*x_rate, *(-gamma * f @ (C @ x_rate + sigma * e_y))]

    y = measured()
    x = np.array([0.3, -0.2, 0.0])
    z = np.array([*x, *(gamma * f @ (y[0] - C @ x))])
    rows = []
    for k in range(STEPS):
        z = solve_ivp(slopes, (0, T), z, args=(y[k],), rtol=1e-10, atol=1e-12, max_step=T / 20).y[:, -1]
        rows.append([*z, command(design, z[:3], z[3], limits)])
        # e_y' at the jump of the measurements.
        z[3] += (gamma * f @ (y[k + 1] - y[k]))[0]
    commands = np.array(rows)[:, 4]
    assert not limited or set(LIMITS) <= set(commands) and len(set(commands)) > 5
    assert np.allclose(design.run()[1:], rows, rtol=1e-6, atol=1e-6)


def test_the_error_of_fast_adaptive_is_strictly_positive_real(designed):
    design = designed("fast-adaptive")
    f, gamma = np.linalg.pinv(C @ F_A), design.parameters["gamma"]
    a_l = A - (design.gains["L_x"] - F_A @ (gamma * f)) @ C
    # F C (j w I - A_L)^-1 F_a has a positive real part.
    for w in np.logspace(-3, 4, 200):
        response = f @ C @ np.linalg.solve(1j * w * np.eye(3) - a_l, F_A)
        assert response[0, 0].real > 0
    eigenvalues = np.array(design.report["observer"]["eigenvalues"])
    assert np.min(np.abs(eigenvalues[:, 0] + gamma)) < 1e-6 * gamma


def test_proportional_integral_follows_its_law_and_a_ramp_without_a_lag(designed):
    design = designed("proportional-integral")
    l_x, l_f, p_f = (design.gains[name] for name in ("L_x", "L_f", "P_f"))

    def slopes(_, z, y):
        x, integral = z[:3], z[3:]
        e = y - C @ x
        f_hat = integral + p_f @ e
        u = design.gains["K_x"] @ x + design.gains["K_f"] @ f_hat
        return [*(A @ x + B @ u + F_A @ f_hat + (l_x - F_A @ p_f) @ e), *(l_f @ e)]

    y = measured()
    z, rows = np.array([0.3, -0.2, 0.0, 0.0]), []
    for k in range(STEPS):
        z = solve_ivp(slopes, (0, T), z, args=(y[k],), rtol=1e-11, atol=1e-13).y[:, -1]
        f_hat = z[3:] + p_f @ (y[k] - C @ z[:3])
        rows.append([*z[:3], *f_hat, *(design.gains["K_x"] @ z[:3] + design.gains["K_f"] @ f_hat)])
    assert np.allclose(design.run()[1:], rows, rtol=1e-7, atol=1e-7)

    def loop(t, z):
        x, rest = z[:3], slopes(t, z[3:], C @ z[:3])
        f_hat = z[6:] + p_f @ C @ (x - z[3:6])
        u = design.gains["K_x"] @ z[3:6] + design.gains["K_f"] @ f_hat
        return [*(A @ x + B @ u + F_A[:, 0] * t), *rest]

    end = solve_ivp(loop, (0, 8), np.zeros(7), rtol=1e-9, atol=1e-11).y[:, -1]
    f_hat = end[6] + (p_f @ C @ (end[:3] - end[3:6]))[0]
    assert abs(f_hat - 8) < 1e-5
    assert design.report["estimation"]["errors"][0]["ramp"] < 1e-9


def sampled():
    """A, F_a (the same as B) and F of the sampled plant."""
    block = np.zeros((4, 4))
    block[:3, :3], block[:3, 3:] = A, F_A
    phi = expm(block * T)
    return phi[:3, :3], phi[:3, 3:], np.linalg.pinv(C @ phi[:3, 3:])


def sampled_measurements():
    """The samples of the FMU: the one at the end of a step reads the measurements of its start."""
    y = measured()
    return np.vstack([y[:1], y[:-1]])


def recursion(design, law):
    """x_hat[k|k], f_hat[k] and u[k] of x_hat[k+1|k] = A x_hat[k|k-1] + B u + F_a f_hat + L e."""
    a, f_a, f = sampled()
    gain = a @ design.gains["L_x"]
    x, last, rows = np.array([0.3, -0.2, 0.0]), 0.0, []
    for y in sampled_measurements():
        e = y - C @ x
        last = law((f @ e)[0], last)
        corrected = x + design.gains["L_x"] @ e
        u = command(design, corrected, last, (-np.inf, np.inf))
        rows.append([*corrected, last, u])
        x = a @ x + f_a[:, 0] * (u + last) + gain @ e
    return rows


def test_sliding_mode_follows_its_law(designed):
    design = designed("sliding-mode", f"sample_time = {T}\n")
    rho, delta = design.parameters["rho"], design.parameters["delta"]
    assert rho == 4.0
    expected = recursion(design, lambda s, _: rho * s / (abs(s) + delta))
    assert np.allclose(design.run(), expected, rtol=1e-9, atol=1e-9)
    assert np.max(np.abs(expected), axis=0)[3] > 0.5 * rho, "beyond the boundary layer"


def test_learning_follows_its_law(designed):
    design = designed("learning", f"sample_time = {T}\n")
    k_1 = design.parameters["K_1"]
    slope = design.gains["L_f"] @ np.linalg.pinv(sampled()[2])
    expected = recursion(design, lambda s, last: k_1 * last + slope[0, 0] * s)
    assert np.allclose(design.run(), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("law", ["proportional-integral", "fast-adaptive"])
def test_a_sampled_law_with_a_direct_term_reads_the_corrected_estimate(designed, law):
    design = designed(law, f"sample_time = {T}\n")
    a, f_a, f = sampled()
    x, integral, rows = np.array([0.3, -0.2, 0.0]), 0.0, []
    gamma = 1 - np.exp(-T * design.parameters.get("gamma", 0))
    for y in sampled_measurements():
        e = y - C @ x
        # The law in terms of the error before the correction.
        before = integral + gamma * (f @ e)[0]
        corrected, integral = x + design.gains["L_x"] @ e, integral + (design.gains["L_f"] @ e)[0]
        f_hat = integral + (design.gains["P_f"] @ (y - C @ corrected))[0]
        assert law != "fast-adaptive" or abs(f_hat - before) < 1e-9
        u = command(design, corrected, f_hat, (-np.inf, np.inf))
        rows.append([*corrected, f_hat, u])
        x = a @ corrected + f_a[:, 0] * (u + integral)
    assert np.allclose(design.run(), rows, rtol=1e-9, atol=1e-9)


def test_the_fmu_names_the_direct_dependence_of_its_command(designed):
    description = read_model_description(str(designed("proportional-integral").fmu))
    unknown = {one.variable.name: one for one in description.outputs}
    assert {"y1", "y2"} <= {one.name for one in unknown["u1"].dependencies}
    assert {"f_hat", "f_hat_i"} <= unknown.keys()
    assert "der(f_hat_i)" in {one.name for one in description.modelVariables}


@pytest.mark.parametrize(
    ("changes", "law", "expected"),
    [
        (
            [("C = " + str(C.tolist()), "C = [[0.0, 1.0, 0.0]]")],
            "fast-adaptive",
            "rank C F_a is 0, expected 1; possible are augmented, proportional-integral",
        ),
        ([("C = " + str(C.tolist()), "C = [[1.0, 0.0, -3.0]]")], "fast-adaptive", "invariant zeros that are not stable"),
        (
            [],
            "sliding-mode",
            "sampled controllers only: expected `sample_time`; possible are augmented, proportional-integral, fast-adaptive",
        ),
        ([], "learning", "sampled controllers only"),
        ([("A = ", 'sample_time = 0.1\nestimator = "prediction"\nA = ')], "fast-adaptive", 'expected estimator = "current"'),
        ([("A = ", "sample_time = 0.1\nA = "), (", bound = 2.0", "")], "sliding-mode", "it needs `rho`, or `bound` of fault `f`"),
        ([("bound = 2.0", 'kind = "ramp"'), ("-9]", "-9, -10]")], "fast-adaptive", 'expected kind = "constant" for fault `f`'),
        ([], "super-twisting", "expected one of augmented, proportional-integral, fast-adaptive, sliding-mode, learning"),
        ([], 'augmented"\nsigma = 3\nx = "', "estimation.sigma: it belongs to the law fast-adaptive, not to augmented"),
    ],
)  # fmt: skip
def test_a_law_that_does_not_exist_is_refused_at_its_line(refusal, changes, law, expected):
    text = PLANT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    message = refusal(f'{text}[estimation]\nlaw = "{law}"\n')
    line = text.count("\n") + 2 + ("sigma" in law)
    assert expected in message and f"plant.toml:{line}:" in message, message


def test_the_reports_of_all_laws_have_the_documented_form(designed, subtests):
    schema = json.loads((ROOT / "docs/reference/design.schema.json").read_text(encoding="utf-8"))
    for law in ["augmented", "proportional-integral", "fast-adaptive", "sliding-mode", "learning"]:
        for start in ["", f"sample_time = {T}\n"]:
            if start or law not in ("sliding-mode", "learning"):
                with subtests.test(law=law, start=start):
                    report = designed(law, start).report
                    Draft202012Validator(schema).validate(report)
                    noise = report["estimation"]["errors"][0]["noise"]
                    direct = law in ("proportional-integral", "fast-adaptive") and not start
                    assert (noise is None) == direct


def compared(aso_ftc, file, page):
    done = aso_ftc("design", file, "--compare", "--report", page, "--json")
    assert done.returncode == 0, done.stderr
    return {one["law"]: one for one in json.loads(done.stdout)["laws"]}


def test_all_laws_of_the_three_tanks_are_compared_on_one_page(aso_ftc, tmp_path):
    page = tmp_path / "laws.html"
    packed_plant(aso_ftc, "ThreeTank")
    comparison = compared(aso_ftc, ROOT / "examples/three-tank/plant.toml", page)
    assert len(comparison) == 5 and all(one["result"] for one in comparison.values())
    errors = {law: one["result"]["estimation"]["errors"][0] for law, one in comparison.items()}
    assert errors["proportional-integral"]["ramp"] < 1e-6 < errors["augmented"]["ramp"]
    assert 0.009 < errors["sliding-mode"]["constant"] < 0.011
    text = page.read_text(encoding="utf-8")
    assert all(law in text for law in comparison) and "disk margin" in text


def test_on_the_pendulum_the_laws_that_need_direct_faults_do_not_exist(aso_ftc, tmp_path):
    comparison = compared(aso_ftc, ROOT / "fmu-controller/pendulum.toml", tmp_path / "laws.html")
    missing = {law for law, one in comparison.items() if one["reason"]}
    assert missing == {"fast-adaptive", "sliding-mode", "learning"}
    assert all("rank C F_a is 0, expected 1" in comparison[law]["reason"] for law in missing)


def test_a_comparison_overwrites_nothing_of_others(aso_ftc, tmp_path):
    (tmp_path / "plant.toml").write_text(PLANT, encoding="utf-8")
    page = tmp_path / "notes.html"
    page.write_text("mine", encoding="utf-8")
    command = ["design", tmp_path / "plant.toml", "--compare", "--report", page]
    assert aso_ftc(*command).returncode == 2 and page.read_text(encoding="utf-8") == "mine"
    assert aso_ftc(*command, "--force").returncode == 0
    assert aso_ftc(*command).returncode == 0
    done = aso_ftc("design", tmp_path / "plant.toml", "--compare", "--report", tmp_path / "plant.toml")
    assert done.returncode == 2 and "would overwrite" in done.stderr
