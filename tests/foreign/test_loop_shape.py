"""`[loop]`: the weighted peaks of S and T by numpy, from the gains of the design file."""

import json
import re
import tomllib

import numpy as np
import pytest
from scipy.linalg import expm

from design_oracle import WITHOUT_PROOFS

PEAK, FLOOR, ROLL_OFF, EFFORT = 1.5, 0.01, 10.0, 100.0
PLANTS = {
    "double integrator with friction": ([[0, 1], [0, -0.5]], [[0], [0.5]], [[1, 0]], 0.5),
    "unstable": ([[0, 1], [1, 0]], [[0], [1]], [[1, 0]], 1.0),
    "two channels": ([[-1, 0], [0, -1]], [[1, 0.5], [0.3, 1]], [[1, 0], [0, 1]], 1.0),
}


def designed(aso_ftc, folder, plant, more=""):
    *matrices, bandwidth = plant
    rows = [f"{name} = {matrix}" for name, matrix in zip("ABC", matrices, strict=True)]
    text = "\n".join([*rows, 'actuator_faults = "all"', more, "[loop]", f"bandwidth = {bandwidth}"])
    (folder / "plant.toml").write_text(text, encoding="utf-8")
    done = aso_ftc("design", folder / "plant.toml", "--out", folder / "design.toml", "--json", "--force", *WITHOUT_PROOFS)
    assert (folder / "design.toml").exists(), done.stderr
    report = json.loads(done.stdout)
    stated = re.search(r"gamma = ([0-9.e+-]+[0-9])", json.dumps(report))
    return tomllib.loads((folder / "design.toml").read_text()), report, float(stated[1])


def default_effort(a, b, c, bandwidth):
    """EFFORT times the largest inverse gain at the ends of the bandwidth and at twice the speed of unstable modes."""
    speeds = [abs(pole) for pole in np.linalg.eigvals(a) if pole.real > 0]
    frequencies = [FLOOR * bandwidth, bandwidth, *(2 * speed for speed in speeds)]
    gains = [c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) for w in frequencies]
    return max(EFFORT / np.linalg.svd(gain, compute_uv=False)[-1] for gain in gains)


def weighted(design, plant, omega):
    """The largest of |W1 S| and |W3 T| at the commands and the measurements, and of |W2 K S|."""
    a, b, c = (np.array(one, float) for one in plant[:3])
    bandwidth, (n, m) = plant[3], b.shape
    effort = default_effort(a, b, c, bandwidth)
    k_x, l_x, l_f = (np.array(design[key], float) for key in ("K_x", "L_x", "L_f"))
    a_0 = np.block([[a, b], [np.zeros((m, n + m))]])
    b_0 = np.vstack([b, np.zeros((m, m))])
    c_0 = np.hstack([c, np.zeros((len(c), m))])
    gain, observer = np.hstack([k_x, -np.eye(m)]), np.vstack([l_x, l_f])
    a_k = a_0 + b_0 @ gain - observer @ c_0
    s, corner = 1j * omega[:, None, None], ROLL_OFF * bandwidth
    g = c @ np.linalg.solve(s * np.eye(n) - a, b)
    k = gain @ np.linalg.solve(s * np.eye(n + m) - a_k, observer)
    of_s = abs((s / PEAK + bandwidth) / (s + FLOOR * bandwidth))
    of_t = abs((s / corner + 1) / (s * FLOOR / corner + 1)) / PEAK
    peaks = []
    for opened in (k @ g, g @ k):
        unit = np.eye(opened.shape[-1])
        sensitivity = np.linalg.inv(unit - opened)
        peaks += [np.linalg.norm(one, 2, axis=(1, 2)).max() for one in (of_s * sensitivity, of_t * (unit - sensitivity))]
    peaks.append(np.linalg.norm(k @ sensitivity, 2, axis=(1, 2)).max() / effort)
    return max(peaks)


@pytest.mark.parametrize("name", PLANTS)
def test_gamma_is_the_largest_weighted_peak_and_all_that_is_asked_for_is_met(aso_ftc, tmp_path, name):
    plant = PLANTS[name]
    design, _, gamma = designed(aso_ftc, tmp_path, plant)
    largest = weighted(design, plant, plant[3] * np.logspace(-4, 4, 3000))
    assert gamma == pytest.approx(largest, rel=2e-3)
    assert gamma <= 1.0


def test_a_loop_that_no_exchange_of_signals_can_follow_is_amber(aso_ftc, tmp_path):
    plant = ([[-1, 0, 0], [1, -1, 0], [0, 1, -1]], [[1], [0], [0]], [[0, 0, 1]], 1.0)
    _, report, _ = designed(aso_ftc, tmp_path, plant)
    assert report["verdict"]["level"] == "green"
    assert report["robustness"]["longest_hold"] > 0.01 * report["robustness"]["delay_margin"]
    (tmp_path / "effort").mkdir()
    design, report, gamma = designed(aso_ftc, tmp_path / "effort", (*plant[:3], "1.0\neffort = 1e5"))
    assert gamma <= 1 and report["verdict"]["level"] == "amber"
    assert "may hold their signals for" in report["verdict"]["reasons"][0]
    # The loop with held signals, by matrix exponentials.
    a, b, c = (np.array(one, float) for one in plant[:3])
    k_x, l_x, l_f = (np.array(design[key], float) for key in ("K_x", "L_x", "L_f"))
    gain = np.hstack([k_x, [[-1.0]]])
    a_k = np.block([[a + b @ k_x - l_x @ c, np.zeros((3, 1))], [-l_f @ c, np.zeros((1, 1))]])

    def radius(hold):
        def held(a, b):
            n, m = b.shape
            whole = expm(hold * np.block([[a, b], [np.zeros((m, n + m))]]))
            return whole[:n, :n], whole[:n, n:]

        (phi, gamma), (phi_k, gamma_k) = held(a, b), held(a_k, np.vstack([l_x, l_f]))
        return max(abs(np.linalg.eigvals(np.block([[phi, gamma @ gain], [gamma_k @ c, phi_k]]))))

    # One of the three changes that the reason names; another is the default of `effort`, above.
    (tmp_path / "sampled").mkdir()
    _, sampled, _ = designed(aso_ftc, tmp_path / "sampled", (*plant[:3], "1.0\neffort = 1e5"), "sample_time = 0.01")
    assert sampled["verdict"]["level"] == "green"
    longest = report["robustness"]["longest_hold"]
    assert radius(0.97 * longest) < 1 < radius(1.03 * longest)


def test_a_sampled_loop_meets_the_peak_that_it_is_tuned_for(aso_ftc, tmp_path):
    _, report, gamma = designed(aso_ftc, tmp_path, PLANTS["two channels"], "sample_time = 0.05")
    peaks = [[point["s_peak"], point["t_peak"]] for point in report["robustness"]["points"]]
    assert gamma <= 1.0
    assert np.max(peaks) <= 1.001 * gamma * PEAK


def test_a_plant_whose_gain_depends_on_the_direction_gets_nearly_the_least_gamma(aso_ftc, tmp_path):
    """The column of S. Skogestad, M. Morari and J. C. Doyle (1988). S is 1 at high frequencies: gamma is at least 1 / peak."""
    gain = np.array([[0.878, -0.864], [1.082, -1.096]])
    plant = ((-np.eye(2) / 75).tolist(), (gain / 75).tolist(), np.eye(2).tolist(), 1 / 75)
    design, _, gamma = designed(aso_ftc, tmp_path, plant)
    assert gamma == pytest.approx(weighted(design, plant, plant[3] * np.logspace(-4, 4, 3000)), rel=2e-3)
    assert 1 / PEAK <= gamma <= 1.05 / PEAK
    # Sampled every 11.25 min, gains that decouple the plant (K_x = -k G^-1, L_f = f G^-1) reach 1.04.
    _, _, sampled = designed(aso_ftc, tmp_path, plant, "sample_time = 11.25")
    assert sampled < 1.1


def test_a_bandwidth_beyond_a_zero_in_the_right_half_plane_is_a_warning_with_gamma(aso_ftc, tmp_path):
    # (1 - s) / (s^2 + s) with a bandwidth of 1 rad/s.
    (tmp_path / "plant.toml").write_text(
        'A = [[0, 1], [0, -1]]\nB = [[0], [1]]\nC = [[1, -1]]\nactuator_faults = "all"\n[loop]\nbandwidth = 1.0\npeak = 1.2\n',
        encoding="utf-8",
    )
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", *WITHOUT_PROOFS)
    warning = re.search(r"gamma = ([0-9.]+[0-9]), limited by .*expected at most 1", done.stdout)
    assert warning and float(warning[1]) > 1.2, done.stdout


# (1 - s) / (s^2 + s), twice; (s - 26) / (s^2 + 14 s - 120), as a forward-swept wing has it; two integrators; the wing
# with a fault of its sensor only, so that no estimate acts as an integral, and `bandwidth` is in no weight.
LIMITED = {
    "zero": ([[0, 1], [0, -1]], [[0], [1]], [[1, -1]], {"bandwidth": 1.0, "peak": 4.0}),
    "low peak": ([[0, 1], [0, -1]], [[0], [1]], [[1, -1]], {"bandwidth": 0.25, "peak": 1.1}),
    "roll-off": ([[0, 1], [120, -14]], [[0], [1]], [[-26, 1]], {"bandwidth": 9.0, "roll_off": 30.0}),
    "effort": ([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], {"bandwidth": 1.0, "effort": 0.5}),
    "flat": ([[0, 1], [120, -14]], [[0], [1]], [[-26, 1]], {"bandwidth": 40.0, "roll_off": 300.0}),
}
FAULTS = {"flat": 'filter = 200.0\nfaults = [{ name = "s", sensor = "y1" }]'}


@pytest.mark.parametrize("name", LIMITED)
def test_the_entries_that_the_warning_names_lower_gamma(aso_ftc, tmp_path, name):
    a, b, c, shape = LIMITED[name]

    def printed(shape):
        rows = "".join(f"{key} = {value}\n" for key, value in shape.items())
        faults = FAULTS.get(name, 'actuator_faults = "all"')
        text = f"A = {a}\nB = {b}\nC = {c}\n{faults}\n[loop]\n{rows}"
        (tmp_path / "plant.toml").write_text(text, encoding="utf-8")
        outputs = ("--out", tmp_path / "design.toml", "--force")
        return aso_ftc("design", tmp_path / "plant.toml", *outputs, *WITHOUT_PROOFS).stdout

    before = printed({"peak": 1.5, "roll_off": 10 * shape["bandwidth"], **shape})
    changes = re.findall(r"a (lower|higher) `(\w+)`", re.search(r"expected at most 1: (.*) helps?", before)[1])
    other = {"peak": 1.5, "roll_off": 10 * shape["bandwidth"], **shape}
    for change, entry in changes:
        other[entry] *= 0.5 if change == "lower" else 2.0
    one, other = (float(re.search(r"gamma = ([0-9.e+-]+[0-9])", text)[1]) for text in (before, printed(other)))
    assert one > 1.0 and other < 0.95 * one, (changes, one, other)


def test_requirements_on_the_gains_are_refused_beside_it(refusal):
    text = 'A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = "all"\nfeedback.bandwidth = 1\n[loop]\nbandwidth = 1\n'
    assert "not possible together with `feedback`" in refusal(text)


def test_a_set_point_is_followed_with_its_bandwidth(aso_ftc, tmp_path):
    """A third of the bandwidth; without a term of its own the integral took 390 s."""
    plant = ([[0, 1], [0, -0.5]], [[0], [0.5]], [[1, 0]], 0.8)
    design, _, gamma = designed(aso_ftc, tmp_path, plant, 'reference = { track = ["y1"], integral = true }')
    a, b, c = (np.array(one, float) for one in plant[:3])
    k_x, k_i = np.array(design["K_x"]), np.array(design["K_i"])
    # x_i' = r - y.
    whole = np.block([[a + b @ k_x, b @ k_i], [-c, np.zeros((1, 1))]])
    assert max(np.linalg.eigvals(whole).real) < -0.2 * plant[3] and gamma <= 1
