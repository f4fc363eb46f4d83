"""One controller for a family of plants: the report's certificates and margins, computed again with numpy and scipy."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

SPRINGS = {"nominal": 1.0, "soft spring": 0.5, "stiff spring": 2.0}
B = np.array([[0.0], [0], [1], [0]])
C = np.eye(1, 4)
BOTH = [
    ("    [1, 0, 0, 0],\n]\nstates", "    [1, 0, 0, 0],\n    [0, 1, 0, 0],\n]\nstates"),
    ('measurements = [{ name = "y", unit = "m" }]', 'measurements = ["y_1", "y_2"]'),
    ("[0.01, 0.01, 1, 1, 1]", "[0.01, 0.01, 100, 100, 10]"),
    ("observer.V = [0.01]", "observer.V = [0.01, 0.01]"),
]


def spring(k):
    """A of two masses of 1 kg and a spring of the stiffness k."""
    return np.array([[0.0, 0, 1, 0], [0, 0, 0, 1], [-k, k, 0, 0], [k, -k, 0, 0]])


def gains(report):
    """The gains by name."""
    return {gain["name"]: np.array(gain["values"]) for gain in report["gains"]}


def controller(report):
    """A, B, C of the continuous controller of the nominal plant: z' = A z + B y, u = C z."""
    matrices = gains(report)
    k, l = np.hstack([matrices["K_x"], matrices["K_f"]]), np.vstack([matrices["L_x"], matrices["L_f"]])
    a_0 = np.block([[spring(1.0), -matrices["K_f"] * B], [np.zeros((1, 5))]])
    return a_0 + np.vstack([B, [[0]]]) @ k - l @ np.eye(l.shape[1], 5), l, k


def closed(report, a):
    """The loop of a member with the controller."""
    a_c, l, k = controller(report)
    return np.block([[a, B @ k], [l @ np.eye(l.shape[1], 4), a_c]])


def decrease(p, a):
    """The smallest eigenvalue of -(P A + A' P)."""
    return np.linalg.eigvalsh(-(p @ a + a.T @ p)).min()


@pytest.fixture(scope="module")
def report(aso_ftc, root, tmp_path_factory):
    out = tmp_path_factory.mktemp("family") / "design.toml"
    done = aso_ftc("design", root / "examples/plants/family/two-mass-spring.toml", "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture
def designed(aso_ftc, root, tmp_path):
    """The design of the example after replacements in its text."""

    def design(*replacements):
        text = (root / "examples/plants/family/two-mass-spring.toml").read_text()
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "plant.toml").write_text(text)
        return aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--json")

    return design


def test_one_p_proves_the_decay_of_the_state_feedback_for_all_members(report):
    p, k = np.array(report["family"]["feedback"]["p"]), gains(report)["K_x"]
    assert np.linalg.eigvalsh(p).min() > 0
    for stiffness in SPRINGS.values():
        assert decrease(p, spring(stiffness) + B @ k + 0.15 * np.eye(4)) > 0


@pytest.fixture
def certified(designed):
    """The report with both positions measured."""
    return json.loads(designed(*BOTH).stdout)


def test_with_one_measurement_the_members_are_stable_but_have_no_common_p(report):
    assert report["family"]["whole"]["reason"].endswith("soft spring, stiff spring")
    assert all(member["instability"] < 0 for member in report["family"]["members"])


def test_one_p_proves_stability_of_the_whole_loop_of_all_members(certified):
    report = certified
    p = np.array(report["family"]["whole"]["p"])
    assert np.linalg.eigvalsh(p).min() > 0
    for stiffness in [*SPRINGS.values(), 0.83, 1.61]:
        assert decrease(p, closed(report, spring(stiffness))) > 0


def test_v_decreases_while_the_spring_changes_fast(certified):
    report = certified
    p = np.array(report["family"]["whole"]["p"])
    energy = lambda x: x @ p @ x
    for frequency in (0.7, 1.5, 3.0, 40.0):
        stiffness = lambda t: 1.25 + 0.75 * np.sign(np.sin(frequency * t))
        right = lambda t, x: closed(report, spring(stiffness(t))) @ x
        run = solve_ivp(right, (0, 10), [1, -1, 0, 0, 0.3, 0, 0, 0, 1], max_step=0.3 / frequency, rtol=1e-8)
        values = np.array([energy(x) for x in run.y.T])
        assert (np.diff(values) < 1e-6 * values[:-1]).all()


def test_each_member_has_its_own_stability_and_peaks_of_s(report):
    members = {entry["name"]: entry for entry in report["family"]["members"]}
    assert set(members) == set(SPRINGS)
    a_c, l, k = controller(report)
    for name, stiffness in SPRINGS.items():
        member, a = members[name], spring(stiffness)
        assert member["instability"] == pytest.approx(np.linalg.eigvals(closed(report, a)).real.max(), rel=1e-6)
        peaks = {"input": 0.0, "output": 0.0}
        for w in 1j * np.logspace(-2, 2, 2000):
            plant = C @ np.linalg.solve(w * np.eye(4) - a, B)
            back = k @ np.linalg.solve(w * np.eye(5) - a_c, l)
            for point, loop in (("input", back @ plant), ("output", plant @ back)):
                s = np.linalg.inv(np.eye(len(loop)) - loop)
                peaks[point] = max(peaks[point], np.linalg.norm(s, 2))
        reported = {point["point"]: point["s_peak"] for point in member["margins"]["points"]}
        assert reported == pytest.approx(peaks, rel=2e-3)


def test_members_without_a_common_gain_are_named_with_the_largest_family_that_has_one(designed):
    reversed_ = '[[family]]\nname = "reversed"\nB = [[0], [0], [-1], [0]]\n\n[[family]]\nname = "soft spring"'
    done = designed(('[[family]]\nname = "soft spring"', reversed_))
    assert done.returncode == 2
    # B - 2 s B has the sign of B below s = 1/2.
    assert "nominal, reversed have none together" in done.stderr
    assert "0.49 of the" in done.stderr
    assert "feedback.region" in done.stderr


def test_a_member_that_the_controller_does_not_stabilise_makes_the_verdict_red(designed):
    weights = ("feedback.region = { decay = 0.15 }", "feedback.Q = [1, 1, 1, 1]\nfeedback.R = [1]")
    done = designed(weights, ("[-2, 2, 0, 0]", "[-2, 2, 3, 0]"))
    assert done.returncode == 1, done.stderr
    report = json.loads(done.stdout)
    member = {entry["name"]: entry for entry in report["family"]["members"]}["stiff spring"]
    assert member["instability"] > 0 and member["margins"] is None
    assert report["family"]["feedback"] is None
    assert "stiff spring" in report["family"]["whole"]["reason"]
    assert any("not stable with the member stiff spring" in reason for reason in report["verdict"]["reasons"])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[[family]]\nname", "[[family]]\nx = 1\nname", "unknown"),
        ('name = "soft spring"', 'name = "nominal"', "is there twice"),
        ('name = "soft spring"', 'name = "copy"\n\n[[family]]\nname = "soft spring"', "the plant of the file again"),
        ("[-0.5, 0.5, 0, 0],\n", "", "expected 4x4"),
    ],
)
def test_a_wrong_member_is_refused_at_its_line(designed, old, new, words):
    done = designed((old, new))
    assert done.returncode == 2
    assert words in done.stderr and "plant.toml:" in done.stderr
