"""Feedforward beside integral action: N_r by the left eigenvectors of numpy, the FMU beside a simulation in numpy."""

import json
import tomllib

import numpy as np
import pytest
from scipy.linalg import expm

from design_oracle import WITHOUT_PROOFS
from matrices import zoh
from stepped import Stepped
from tracking_oracle import TrackingLoop

# Two carts on a spring; both positions are set by two forces.
A = np.array([[0.0, 0, 1, 0], [0, 0, 0, 1], [-2, 2, -0.3, 0], [2, -2, 0, -0.2]])
B = np.array([[0.0, 0], [0, 0], [1, 0], [0, 0.5]])
C = np.eye(2, 4)
STEP = np.array([0.4, -0.2])
PERIOD = 0.05
KINDS = {
    "continuous": "",
    "current": f"sample_time = {PERIOD}\n",
    "prediction": f'sample_time = {PERIOD}\nestimator = "prediction"\n',
}
FEEDBACK = 'feedback.eigenvalues = [-0.8, -1.0, { re = -1.5, im = 1.0 }, -2.5, -3.0]'
PLANT = f"""A = {A.tolist()}
B = {B.tolist()}
C = {C.tolist()}
measurements = ["p_1", "p_2"]
actuators = ["F_1", "F_2"]
faults = [{{ name = "f", actuator = "F_1" }}]
{FEEDBACK}
observer.eigenvalues = [-6, -6.5, -7, -7.5, -8]
reference = {{ track = ["p_1", "p_2"], feedforward = true }}
robustness = {{ cases = 3 }}
"""


def designed(aso_ftc, folder, text, *options):
    """Design file and report."""
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", folder / "plant.toml", "--out", folder / "design.toml", "--json", *options)
    assert done.returncode in (0, 1), done.stderr
    return tomllib.loads((folder / "design.toml").read_text(encoding="utf-8")), json.loads(done.stdout)


def silent(a, b, output, k, period):
    """The slowest left eigenvectors W of the feedback, and N_r with W' [B N_r; I] = 0."""
    n, t = len(a), len(output)
    integrator, factor = (np.eye(t), period) if period else (np.zeros((t, t)), 1.0)
    feedback = np.block([[a, np.zeros((n, t))], [-factor * output, integrator]]) + np.vstack([b, np.zeros((t, b.shape[1]))]) @ k
    values, vectors = np.linalg.eig(feedback.T)
    slowest = np.argsort(-(abs(values) if period else values.real))[:t]
    w = vectors[:, slowest]
    return w, (-np.linalg.pinv(w[:n].T @ b) @ (factor * w[n:].T)).real


@pytest.fixture(scope="module", params=KINDS)
def carts(request, aso_ftc, packed, tmp_path_factory):
    """Kind, design, report and FMU."""
    folder = tmp_path_factory.mktemp("carts")
    design, report = designed(aso_ftc, folder, KINDS[request.param] + PLANT, *WITHOUT_PROOFS, "--fmu", folder / "Carts.fmu")
    return request.param, design, report, folder / "Carts.fmu"


def test_n_r_is_that_of_the_left_eigenvectors(carts):
    kind, design, report, _ = carts
    period = None if kind == "continuous" else PERIOD
    a, b = zoh(A, B, PERIOD) if period else (A, B)
    _, expected = silent(a, b, C, np.hstack([design["K_x"], design["K_i"]]), period)
    assert np.allclose(design["N_r"], expected, rtol=1e-7, atol=1e-9)
    sentence = next(text for text in report["assumptions"] if "do not excite the slowest eigenvalues" in text)
    slow = [-0.8, -1.0] if period is None else np.exp([-0.8 * PERIOD, -1.0 * PERIOD])
    assert all(f"{value:.6g}" in sentence for value in slow), sentence


def run(fmu, folder, plant, disturbance, is_sampled, end=20.0):
    """A plant under the FMU after a step of both references: states, commands, integrals at each communication step."""
    phi, gamma = zoh(plant[0], plant[1], PERIOD)
    _, xi = zoh(plant[0], disturbance[:, None], PERIOD)
    controller = Stepped(fmu, folder, [("r_p_1", STEP[0]), ("r_p_2", STEP[1])])
    x, rows = np.zeros(4), []
    for k in range(round(end / PERIOD) + 1):
        u = controller.get("F_1", "F_2")
        rows.append(np.concatenate([x, u, controller.get("x_i[1]", "x_i[2]")]))
        following = phi @ x + gamma @ u + xi[:, 0]
        # A sampled controller takes the measurements at the end of the step, a continuous one during it.
        x = following if is_sampled else x
        controller.set_reals(("p_1", "p_2"), x[:2])
        controller.step(k * PERIOD, PERIOD)
        x = following
    return np.array(rows)


def continuous(design, plant, disturbance, count):
    """The same for a continuous controller that holds its measurements during a step, by matrix exponentials."""
    names = ("A", "B", "C", "F_a", "K_x", "K_f", "K_i", "N_r", "H", "L_x", "L_f")
    matrices = {key: np.array(value, float) for key, value in design.items() if key in names}
    n, q, t = 4, 1, 2
    k = np.hstack([matrices["K_x"], matrices["K_f"], matrices["K_i"]])
    dynamics = np.zeros((n + q + t, n + q + t))
    dynamics[:n, : n + q] = np.hstack([matrices["A"] - matrices["L_x"] @ matrices["C"], matrices["F_a"]])
    dynamics[n : n + q, :n] = -matrices["L_f"] @ matrices["C"]
    dynamics[:n] += matrices["B"] @ k
    inputs = np.block([
        [matrices["L_x"], matrices["B"] @ matrices["N_r"]],
        [matrices["L_f"], np.zeros((q, t))],
        [-matrices["H"], np.eye(t)],
    ])
    step, entry = zoh(dynamics, inputs, PERIOD)
    phi, gamma = zoh(plant[0], plant[1], PERIOD)
    _, xi = zoh(plant[0], disturbance[:, None], PERIOD)
    z, x, rows = np.zeros(n + q + t), np.zeros(n), []
    for _ in range(count):
        u = k @ z + matrices["N_r"] @ STEP
        rows.append(np.concatenate([x, u, z[-t:]]))
        z = step @ z + entry @ np.concatenate([C @ x, STEP])
        x = phi @ x + gamma @ u + xi[:, 0]
    return np.array(rows)


def sampled(design, plant, disturbance, count):
    """The same for a sampled controller, by the oracle of references."""
    loop = TrackingLoop((*plant, C, disturbance[:, None], np.zeros((2, 1))), design)
    state, rows = np.zeros(loop.order), []
    for _ in range(count):
        after, u = loop.evaluate(state, STEP, np.ones(1))
        rows.append(np.concatenate([state[:4], u, state[-2:]]))
        state = after
    return np.array(rows)


OTHER = (A * (1 + 0.1 * np.sin(np.arange(16).reshape(4, 4))), 0.85 * B)
CASES = {
    "the plant of the model": ((A, B), np.zeros(4)),
    "a constant disturbance on a force without fault": ((A, B), np.array([0, 0, 0, 0.3])),
    "parameter errors and a disturbance": (OTHER, np.array([0, 0, 0.2, -0.1])),
}


@pytest.mark.parametrize("name", CASES)
def test_the_fmu_is_the_simulation_and_settles_without_error(carts, name, tmp_path):
    kind, design, _, fmu = carts
    plant, disturbance = CASES[name]
    rows = run(fmu, tmp_path, plant, disturbance, kind != "continuous")
    oracle = continuous if kind == "continuous" else sampled
    expected = oracle(design, plant, disturbance, len(rows))
    assert np.abs(expected[:, 4:6]).max() > 0.1, "the commands act"
    assert np.allclose(rows, expected, atol=1e-8)
    assert np.abs(rows[-1, :2] - STEP).max() < 1e-5
    if disturbance.any():
        assert np.abs(rows[-1, 6:]).max() > 1e-3, "the integrals hold the constant command"


def test_references_leave_the_slowest_modes_at_rest_and_settle_faster(carts, tmp_path):
    kind, design, report, fmu = carts
    if kind == "continuous":
        loop = TrackingLoop((A, B, C, B[:, :1], np.zeros((2, 1))), design)
        M, N, _, _ = loop.matrices()
        states = [np.linalg.solve(M, (expm(M * time) - np.eye(len(M))) @ N[:, :2] @ STEP) for time in np.arange(0, 6, 0.3)]
        rows = np.array([[*state[:4], *state[-2:]] for state in states])
        a, b, period = A, B, None
    else:
        rows = run(fmu, tmp_path, (A, B), np.zeros(4), True)[:, [0, 1, 2, 3, 6, 7]]
        (a, b), period = zoh(A, B, PERIOD), PERIOD
    w, _ = silent(a, b, C, np.hstack([design["K_x"], design["K_i"]]), period)
    assert np.abs(rows @ w).max() < 1e-8
    without = TrackingLoop((A, B, C, B[:, :1], np.zeros((2, 1))), {key: value for key, value in design.items() if key != "N_r"})
    times = np.arange(0, 12, 0.05)
    for which, step in enumerate(report["references"]):
        states, _ = without.step(which, 1.0, times)
        assert step["settling_time"] < 0.8 * times[np.flatnonzero(abs(states[:, which] - 1) > 0.02)[-1]]


ONE = """A = [[0, 1], [0, -1]]
B = [[0], [1]]
C = [[1, 0]]
feedback.eigenvalues = [{ re = -1.0, im = 1.0 }, -3]
observer.eigenvalues = [-8, -9, -10]
measurements = ["h"]
actuator_faults = "all"
"""


@pytest.mark.parametrize(
    "table, line, parts",
    [
        ('reference = { track = ["h"], feedforward = true }', 8, ["half of a complex pair", "`feedforward = false`"]),
        ('reference = { track = ["h"], integral = false, feedforward = false }', 8, ["no reference acts on a command"]),
        ('reference = { track = ["h"], feedforward = 1 }', 8, ["feedforward"]),
    ],
)
def test_a_feedforward_that_cannot_be_is_refused_at_its_line(refusal, table, line, parts):
    message = refusal(ONE + table + "\n")
    for part in [f"plant.toml:{line}:", *parts]:
        assert part in message, message


def test_an_integral_action_needs_no_slow_real_eigenvalue_without_feedforward(aso_ftc, tmp_path):
    design, _ = designed(aso_ftc, tmp_path, ONE + 'reference.track = ["h"]\n', *WITHOUT_PROOFS)
    assert "N_r" not in design


# A cart with friction whose load is not known.
FAMILY = """A = [[0, 1], [0, -0.5]]
B = [[0], [1]]
C = [[1, 0]]
measurements = [{ name = "p", operating = 2.0 }]
actuators = ["u"]
actuator_faults = "all"
feedback.region = { decay = 1.0 }
observer.eigenvalues = [-12, -14, -16]
robustness = { cases = 3 }

[reference]
track = ["p"]
feedforward = true

[[family]]
name = "loaded"
A = [[0, 1], [0, -0.3]]
B = [[0], [0.6]]
"""
MEMBERS = {
    "nominal": ([[0, 1], [0, -0.5]], [[0], [1]]),
    "loaded": ([[0, 1], [0, -0.3]], [[0], [0.6]]),
}


def member_loop(name, design):
    a, b = MEMBERS[name]
    return TrackingLoop((a, b, [[1, 0]], b, [[0]]), design)


@pytest.fixture(scope="module", params=["", "sample_time = 0.02\n"], ids=["continuous", "sampled"])
def family(request, aso_ftc, packed, tmp_path_factory):
    folder = tmp_path_factory.mktemp("family")
    design, report = designed(aso_ftc, folder, request.param + FAMILY, "--fmu", folder / "Cart.fmu")
    return design, report, folder / "Cart.fmu"


def decreases(p, a, period):
    """Whether x' P x decreases."""
    scale = 1 / np.sqrt(np.diag(p))
    left = p - a.T @ p @ a if period else -(p @ a + a.T @ p)
    return np.linalg.eigvalsh(left * np.outer(scale, scale)).min() > 0


def test_one_p_proves_the_loops_of_all_members_with_their_integrals(family):
    design, report, _ = family
    period = design.get("sample_time")
    whole, feedback = (np.array(report["family"][key]["p"]) for key in ("whole", "feedback"))
    assert len(whole) == 6 and len(feedback) == 3
    k = np.hstack([design["K_x"], design["K_i"]])
    for a, b in MEMBERS.values():
        a, b = zoh(np.array(a, float), np.array(b, float), period) if period else (np.array(a, float), np.array(b, float))
        extended = np.block([[a, np.zeros((2, 1))], [-(period or 1.0) * np.eye(1, 2), np.eye(1) if period else np.zeros((1, 1))]])
        matrix = extended + np.vstack([b, [[0]]]) @ k
        shifted = matrix * np.exp(period) if period else matrix + np.eye(3)
        assert decreases(feedback, shifted, period), "the decay rate 1/s of the region"
    for share in (0.0, 0.3, 1.0):
        mixed = [(1 - share) * np.array(MEMBERS["nominal"][k], float) + share * np.array(MEMBERS["loaded"][k]) for k in range(2)]
        if not period or share in (0.0, 1.0):
            loop = TrackingLoop((*mixed, [[1, 0]], mixed[1], [[0]]), design)
            assert decreases(whole, loop.matrices()[0], period)
    assert report["verdict"]["level"] != "red"
    assert not any("is not proven" in reason for reason in report["verdict"]["reasons"])


@pytest.mark.parametrize("name", MEMBERS)
def test_each_member_settles_on_its_reference(family, name, tmp_path):
    design, report, fmu = family
    assert member_loop(name, design).constant()[0, :2] == pytest.approx([1, 0], abs=1e-9)
    (instability,) = [member["instability"] for member in report["family"]["members"] if member["name"] == name]
    values = np.linalg.eigvals(member_loop(name, design).matrices()[0])
    assert instability == pytest.approx(abs(values).max() - 1 if "sample_time" in design else values.real.max(), rel=1e-5)
    a, b = (np.array(matrix, float) for matrix in MEMBERS[name])
    phi, gamma = zoh(a, b, 0.02)
    controller = Stepped(fmu, tmp_path, [("p", 2.0), ("r_p", 2.5)])
    x = np.array([2.0, 0.0])
    for k in range(1000):
        x = phi @ x + gamma[:, 0] * (controller.get("u")[0] + 0.1)
        controller.set("p", x[0])
        controller.step(k * 0.02, 0.02)
    assert x[0] == pytest.approx(2.5, abs=1e-6)


def test_a_family_without_a_common_p_is_not_green_and_says_so(aso_ftc, tmp_path):
    # The observer is that of the nominal plant, so that a member far from it has no P together with it.
    changes = [("feedforward = true\n", ""), ("[0.6]", "[0.25]"), ("-0.3]]", "-0.05]]")]
    changes += [("feedback.region = { decay = 1.0 }", "feedback.Q = [4, 1, 9]\nfeedback.R = [0.1]")]
    text = FAMILY
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    _, report = designed(aso_ftc, tmp_path, text, *WITHOUT_PROOFS)
    assert "reason" in report["family"]["whole"]
    assert report["verdict"]["level"] in ("amber", "red")
    assert any("is not proven; only the members themselves were checked" in reason for reason in report["verdict"]["reasons"])


@pytest.mark.parametrize(
    "old, new, line, parts",
    [
        ("feedforward = true", "integral = false", 13, ["the other members of the family would miss", "`integral = true`"]),
        (
            "A = [[0, 1], [0, -0.3]]\nB = [[0], [0.6]]",
            "A = [[0, 1], [-1, -1]]\nB = [[0], [1]]\nC = [[0, 1]]",
            15,
            ["no integral action exists for the member `loaded`"],
        ),
    ],
)
def test_a_family_that_cannot_follow_is_refused_at_its_line(refusal, old, new, line, parts):
    assert old in FAMILY
    message = refusal(FAMILY.replace(old, new))
    for part in [f"plant.toml:{line}:", *parts]:
        assert part in message, message
