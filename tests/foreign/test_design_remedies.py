"""Each remedy that a message of `aso-ftc design` names is tried: the refused plant file, with the remedy, is designed."""

import pytest

from design_oracle import COLUMN, design_and_report

# They are tried in the time for proofs: on an idle machine, in up to 15 of its 30 s.
WITH_REMEDIES = ("--certificate-time", "600")

TROLLEY = """A = [[0, 1], [0, -1]]
B = [[0], [1]]
C = [[1, 0]]
actuator_faults = "all"
feedback.eigenvalues = [-1, -2]
observer.eigenvalues = [-5, -6, -7]
"""
FEEDBACK, OBSERVER = "feedback.eigenvalues = [-1, -2]\n", "observer.eigenvalues = [-5, -6, -7]\n"
SAMPLED = f"sample_time = 0.05\n{TROLLEY}"
LEAST = {name: f'{name}.h_infinity = "least"\n' for name in ("feedback", "observer")}
DISC = "region = { disc = { center = -5, radius = 4 } }\n"

# What is replaced in the plant file; the message; what the remedy replaces.
CASES = {
    "least norm of a feedback": (
        (TROLLEY, FEEDBACK, LEAST["feedback"]),
        '"least" needs a `region` with a disc',
        (LEAST["feedback"], LEAST["feedback"] + f"feedback.{DISC}"),
    ),
    "least norm of an observer, noise": (
        (TROLLEY, OBSERVER, LEAST["observer"]),
        '"least" needs `noise`, or a `region` with a disc',
        (LEAST["observer"], LEAST["observer"] + "observer.noise = 0.01\n"),
    ),
    "least norm of an observer, disc": (
        (TROLLEY, OBSERVER, LEAST["observer"]),
        '"least" needs `noise`, or a `region` with a disc',
        (LEAST["observer"], LEAST["observer"] + f"observer.{DISC}"),
    ),
    "disc of a sampled design": (
        (SAMPLED, FEEDBACK, f"{LEAST['feedback']}feedback.{DISC}"),
        "a sampled design has a region by `decay` only",
        (DISC, "region = { decay = 1.0 }\n"),
    ),
    "sensor fault": (
        (TROLLEY, 'actuator_faults = "all"\n', 'faults = [{ name = "bias", sensor = "y1" }]\n'),
        "needs `filter`",
        ("C = [[1, 0]]", "C = [[1, 0], [1, 0]]\nfilter = 50"),
        ("[-5, -6, -7]", "[-5, -6, -7, -8, -9]"),
    ),
    "law that does not exist": (
        (TROLLEY, OBSERVER, f'{OBSERVER}estimation.law = "sliding-mode"\n'),
        "possible are augmented, proportional-integral",
        ('"sliding-mode"', '"proportional-integral"'),
    ),
    "entry of an FMU's matrices": (
        (TROLLEY, "C = ", 'robustness.tolerance = { entries = { k = 0.5 } }\nC = '),
        'expected an entry of A, B, C or D such as "A[2][1]"',
        ("{ k = 0.5 }", '{ "A[2][2]" = 0.5 }'),
    ),
    "entry that is zero": (
        (TROLLEY, "C = ", 'robustness.tolerance = { entries = { "A[1][1]" = 0.5 } }\nC = '),
        "A[1][1] is 0, of which a fraction is nothing",
        ('"A[1][1]"', '"A[2][2]"'),
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_refused_plant_file_with_the_remedy_of_its_message_is_designed(aso_ftc, tmp_path, case):
    (text, old, new), message, *remedies = case
    assert old in text
    refused = text.replace(old, new)
    design, error = design_and_report(aso_ftc, tmp_path, refused)
    assert design is None and message in error, error
    for old, new in remedies:
        assert old in refused
        refused = refused.replace(old, new)
    design, report = design_and_report(aso_ftc, tmp_path, refused)
    assert design is not None, report


def test_a_sampled_feedback_of_the_least_norm_needs_no_region(aso_ftc, tmp_path):
    for region in ("", "feedback.region = { decay = 1.0 }\n"):
        design, report = design_and_report(aso_ftc, tmp_path, SAMPLED.replace(FEEDBACK, LEAST["feedback"] + region))
        assert design is not None, report
        norm = report["feedback"]["norm"]
        assert norm["norm"] >= 0.999 * norm["lower_bound"]


REMEDIED = """A = [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 1, 0, 0], [1, -1, 0, 0]]
B = [[0], [0], [1], [0]]
C = [[0, 1, 0, 0]]
actuator_faults = "all"
feedback.eigenvalues = [-1, -1.1, -1.2, -1.3]
observer.eigenvalues = [-4, -5, -6, -7, -8]
robustness.tolerance = 0.0
"""


# Longitudinal motion of a Boeing 747: B. Etkin and L. D. Reid, Dynamics of Flight (1996); measured are pitch and vertical speed.
AIRCRAFT = """A = [[-0.00643, 0.0263, 0, -32.2], [-0.0941, -0.624, 820, 0], [-0.000222, -0.00153, -0.668, 0], [0, 0, 1, 0]]
B = [[0], [-32.7], [-2.08], [0]]
C = [[0, 0, 0, 1], [0, 1, 0, 0]]
actuator_faults = "all"
feedback.bandwidth = 0.13
observer.bandwidth = 0.52
"""


# A magnetic tape drive: J. H. Chow and P. V. Kokotovic, IEEE Trans. Autom. Control 21 (1976); far faster than its slow states.
TAPE = """A = [[0, 0.4, 0, 0], [0, 0, 0.345, 0], [0, -0.524e6, -0.465e6, 0.262e6], [0, 0, 0, -1e6]]
B = [[0], [0], [0], [1e6]]
C = [[1, 0, 0, 0], [0, 0, 1, 0]]
actuator_faults = "all"
feedback.bandwidth = 120000
observer.bandwidth = 930000
"""


@pytest.mark.parametrize("plant, level", [(AIRCRAFT, "green"), (TAPE, "amber")], ids=["below both limits", "below the red limit"])
def test_units_remove_a_peak_that_comes_from_signals_without_units(aso_ftc, tmp_path, plant, level):
    _, report = design_and_report(aso_ftc, tmp_path, plant, WITH_REMEDIES)
    (remedy,) = report["verdict"]["remedies"]
    assert report["verdict"]["level"] == "red" and remedy["change"].startswith("state the unit of each measurement")
    units = 'measurements = [{ name = "pitch", unit = "rad" }, { name = "speed", unit = "ft/s" }]\n'
    _, report = design_and_report(aso_ftc, tmp_path, plant + units)
    output = report["robustness"]["points"][1]
    assert report["verdict"]["level"] == level and remedy["change"].endswith(f", {output['judged']:.5g}")


# A rotor that moves a mass on a spring (TORA): C.-J. Wan, D. S. Bernstein and V. T. Coppola, Nonlinear Dynamics 10 (1996).
# The command chooses both bandwidths, and no other ones are better than the shape of the loop.
ROTOR = """A = [[0, 1, 0, 0], [-1.0416667, 0, 0, 0], [0, 0, 0, 1], [0.2083333, 0, 0, 0]]
B = [[0], [-0.2083333], [0], [1.0416667]]
C = [[1, 0, 0, 0], [0, 0, 1, 0]]
actuator_faults = "all"
"""

STATED = "feedback.bandwidth = 0.26\nobserver.bandwidth = 1\n"
# A flexible satellite (FS of COMPleib, F. Leibfritz 2004) with a triple eigenvalue 0.
SATELLITE = """A = [[0, 0, 1, 0, 0], [0, 0, 0, 1, 0], [0, 1.53449139238936e-3, 0, 3.55730354400062e-5, 0],
    [0, -0.479403314451799, 0, -0.0111136700926655, 0], [1, 0, 0, 0, 0]]
B = [[0], [0], [6.26668897607942e-5], [-0.015547655349653], [0]]
C = [[1, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1]]
actuator_faults = "all"
"""


# (2 - s) / (s + 1)^2, three times as fast as its zero.
SHAPED = """A = [[0, 1], [-1, -2]]
B = [[0], [1]]
C = [[2, -1]]
actuator_faults = "all"
loop.bandwidth = 6
"""


@pytest.mark.parametrize(
    "plant",
    [REMEDIED, ROTOR, ROTOR + STATED, SATELLITE, SHAPED],
    ids=["eigenvalues", "shape of the loop", "shape in place of bandwidths", "chosen bandwidths", "slower shape"],
)
def test_the_lines_that_follow_a_reason_of_the_verdict_give_the_stated_peaks(aso_ftc, tmp_path, plant):
    _, report = design_and_report(aso_ftc, tmp_path, plant, WITH_REMEDIES)
    verdict = report["verdict"]
    assert verdict["level"] != "green" and [one["reason"] for one in verdict["remedies"]] == verdict["reasons"]
    remedies = [remedy for remedy in verdict["remedies"] if remedy["lines"]]
    assert len(remedies) == 2
    for remedy in remedies:
        names = {line.split(" = ")[0] for line in remedy["lines"]}
        if names == {"loop.bandwidth"} and plant is not SHAPED:
            assert "in place of feedback and observer" in remedy["change"]
            names |= {"feedback.bandwidth", "observer.bandwidth"}
        changed = [line for line in plant.splitlines() if line.split(" = ")[0] not in names]
        _, other = design_and_report(aso_ftc, tmp_path, "\n".join([*remedy["lines"], *changed]))
        peaks = [point["judged"] for point in other["robustness"]["points"]]
        for peak in peaks:
            assert f"{peak:.3f}"[:4] in remedy["change"], (peak, remedy)
        assert max(peaks) < max(point["judged"] for point in report["robustness"]["points"])
    done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml", "--force")
    assert done.returncode in (0, 1)


# A lag behind a delay of 2 s, with an observer that is too fast for it.
DELAYED = """A = [[-1]]
B = [[1]]
C = [[1]]
actuators = [{ name = "u", delay = 2.0 }]
actuator_faults = "all"
feedback.bandwidth = 3.0
observer.bandwidth = 10.0
"""


def test_a_loop_that_is_not_stable_has_a_remedy_that_makes_it_green(aso_ftc, tmp_path):
    _, report = design_and_report(aso_ftc, tmp_path, DELAYED, WITH_REMEDIES)
    (remedy,) = report["verdict"]["remedies"]
    assert report["robustness"] is None and remedy["reason"] in report["verdict"]["reasons"]
    names = {line.split(" = ")[0] for line in remedy["lines"]}
    unchanged = [line for line in DELAYED.splitlines() if line.split(" = ")[0] not in names]
    _, other = design_and_report(aso_ftc, tmp_path, "\n".join([*remedy["lines"], *unchanged]))
    assert other["verdict"]["level"] == "green"
    for point in other["robustness"]["points"]:
        assert f"{point['judged']:.3f}"[:4] in remedy["change"], remedy


def test_fewer_faults_make_a_plant_robust_whose_stationary_gain_is_nearly_singular(aso_ftc, tmp_path):
    _, report = design_and_report(aso_ftc, tmp_path, COLUMN, WITH_REMEDIES)
    assert report["robustness"]["tolerance"]["stable"] < 0.9
    (remedy,) = report["verdict"]["remedies"]
    names = {line.split(" = ")[0] for line in remedy["lines"]}
    assert names == {"actuator_faults", "feedback.bandwidth", "observer.bandwidth"}
    unchanged = [line for line in COLUMN.splitlines() if line.split(" = ")[0] not in names]
    _, other = design_and_report(aso_ftc, tmp_path, "\n".join([*remedy["lines"], *unchanged]))
    assert other["verdict"]["level"] == "green" and len(other["plant"]["faults"]) == 1
    for point in other["robustness"]["points"]:
        assert f"{point['judged']:.3f}"[:4] in remedy["change"], remedy
