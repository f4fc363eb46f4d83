"""Bad input of `aso-ftc design`: exit status 2, one message with a position in the file."""

import re
import subprocess
import tomllib
import zipfile

import numpy as np
import pytest

from conftest import ROOT
from design_loop import packed_plant

MASS = """A = [[0, 1], [0, 0]]
B = [[0], [1]]
C = [[1, 0]]
actuator_faults = "all"
feedback.eigenvalues = [-1, -2]
observer.eigenvalues = [-5, -6, -7]
"""
SERVO = """plant = "Servo.fmu"
operating_point = { friction = 0 }
actuators = ["u"]
measurements = ["theta_m"]
actuator_faults = "all"
feedback.eigenvalues = [-40, -60]
observer.eigenvalues = [-300, -350, -400]
"""
NO_EXCHANGE = (r"<ModelExchange .*?/>", "")
NO_DERIVATIVES = ('providesDirectionalDerivative="true"', "")
NO_FMU_STATE = ('canGetAndSetFMUstate="true" canSerializeFMUstate="true"', "")


def poorer(source, target, *changes):
    """A copy of an FMU with parts of its description removed."""
    with zipfile.ZipFile(source) as whole, zipfile.ZipFile(target, "w") as copy:
        for entry in whole.infolist():
            content = whole.read(entry)
            if entry.filename == "modelDescription.xml":
                text = content.decode()
                for pattern, replacement in changes:
                    text, count = re.subn(pattern, replacement, text, flags=re.DOTALL)
                    assert count, pattern
                content = text.encode()
            copy.writestr(entry, content)


WRONG = [
    ("C = [[1, 0]]", "C = [[0, 1]]", "3:5: the measurements y1 show 1 of 2 states only"),
    ("B = [[0], [1]]", "B = [[1], [0]]", "2:5: the commands u1 reach 1 of 2 states only"),
    (
        'actuator_faults = "all"',
        'F_a = [[1], [0]]\nfaults = [{ name = "drift" }]',
        "5:11: 2 of 3 independent courses of faults and states are seen: the measurements y1 "
        "cannot tell a constant value of drift from a movement of x2",
    ),
    (
        'actuator_faults = "all"\n',
        'filter = 50\nfaults = [{ name = "bias", sensor = "y1" }]\n',
        "cannot tell a constant value of bias from a movement of x1",
    ),
    (
        'actuator_faults = "all"',
        'F_a = [[0, 0], [1, 0]]\nfaults = [{ name = "wind" }, { name = "slope" }]',
        "5:30: fault `slope` has no effect on the plant: its column of F_a is zero",
    ),
    ("[-5, -6, -7]", "[-5, -6]", "6:24: expected 3 eigenvalues"),
    ("[-5, -6, -7]", "[-5, -5, -7]", "6:24: the eigenvalue -5 is requested 2 times, expected at most 1"),
    (
        "observer.eigenvalues = [-5, -6, -7]",
        "observer.region = { decay = 10, disc = { center = -5, radius = 2 } }",
        "6:19: these requirements contradict each other: decay, disc",
    ),
    (
        "observer.eigenvalues = [-5, -6, -7]",
        "observer.h_infinity = 1e-9\nobserver.region = { disc = { center = -5, radius = 4 } }",
        "6:23: no gain with all eigenvalues in the disc keeps this bound: expected a bound above",
    ),
    (
        "feedback.eigenvalues = [-1, -2]",
        "feedback.Q = [1, 1]\nfeedback.R = [0]",
        "6:14: R is not positive definite",
    ),
    (
        "observer.eigenvalues = [-5, -6, -7]",
        "observer.W = [1, 1, 1]\nobserver.V = [0]",
        "7:14: V is not positive definite",
    ),
    ("[-1, -2]", "[1, -2]", "5:24: "),
    ("[-5, -6, -7]", "[-5, -6, 7]", "6:24: "),
    (
        'actuator_faults = "all"',
        'F_a = [[0, 0], [1, 1]]\nfaults = [{ name = "wind" }, { name = "slope" }]',
        "5:30: the faults `wind` and `slope` act on the plant in the same direction",
    ),
    ("feedback.eigenvalues = [-1, -2]", "feedback.Q = [1]\nfeedback.R = [1]", "5:14: Q is 1x1"),
    ("A = [[0, 1], [0, 0]]", "A = [[0, 1], [0, 0]", "plant.toml:2:1: "),
    ("A = [[0, 1], [0, 0]]", "A = [[0, 1], [0, 1e400]]", "1:18: A[2][2]: expected a finite"),
]


@pytest.mark.parametrize("name", ["motor.fmu", "motor.MAT", "motor.csv"])
def test_a_plant_in_place_of_a_plant_file_is_refused_with_the_option_that_takes_it(aso_ftc, tmp_path, name):
    (tmp_path / name).write_bytes(b"PK\x03\xff")
    done = aso_ftc("design", tmp_path / name, "--out", tmp_path / "design.toml")
    assert done.returncode == 2 and f"`aso-ftc design --init {tmp_path / name}`" in done.stderr, done


@pytest.mark.parametrize(("old", "new", "expected"), WRONG, ids=lambda text: text[:40])
def test_a_plant_file_that_cannot_be_designed_is_refused_at_the_faulty_entry(refusal, old, new, expected):
    assert old in MASS
    message = refusal(MASS.replace(old, new))
    first, bar, line, underlined = message.splitlines()
    assert re.match(r"error: plant\.toml:\d+:\d+: ", first) and expected in first
    row, column = map(int, re.findall(r"plant\.toml:(\d+):(\d+)", first)[0])
    assert bar.strip() == "|" and line.startswith(f"{row} | ")
    assert underlined.index("^") == line.index("|") + 1 + column
    assert MASS.replace(old, new).splitlines()[row - 1] == line.split(" | ", 1)[1]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (None, "Other.fmu"),
        ("text", "Other.fmu is no ZIP archive that can be used"),
        ("DcServo", "Other.fmu is the FMU of DcServo; expected AsoController.fmu"),
    ],
)
def test_a_controller_can_be_made_from_a_packed_controller_only(aso_ftc, refusal, tmp_path, source, expected):
    other = tmp_path / "Other.fmu"
    if source == "text":
        other.write_text("no archive", encoding="utf-8")
    elif source:
        other.write_bytes(packed_plant(aso_ftc, source).read_bytes())
    assert expected in refusal(MASS, "--fmu", tmp_path / "Mine.fmu", "--from", other)


POORER = [
    ((), "1:9: cannot open Servo.fmu"),
    ((NO_EXCHANGE, NO_DERIVATIVES), "theta_m, T_f, i (`states` names them)"),
    ((NO_EXCHANGE, NO_DERIVATIVES, NO_FMU_STATE), "providesDirectionalDerivative"),
]


@pytest.mark.parametrize(("changes", "expected"), POORER, ids=["missing", "states", "nothing"])
def test_an_fmu_that_cannot_be_linearised_is_refused_with_the_missing_capability(
    aso_ftc, refusal, tmp_path, changes, expected
):
    if changes:
        poorer(packed_plant(aso_ftc, "DcServo"), tmp_path / "Servo.fmu", *changes)
    message = refusal(SERVO)
    assert message.startswith("error: plant.toml:1:9: ") and expected in message


def test_init_of_an_fmu_whose_states_are_not_listed_says_where_to_name_them(aso_ftc, tmp_path):
    poorer(packed_plant(aso_ftc, "DcServo"), tmp_path / "Servo.fmu", NO_EXCHANGE, NO_DERIVATIVES)
    done = aso_ftc("design", "--init", tmp_path / "Servo.fmu", "--out", tmp_path / "servo.toml")
    assert done.returncode == 2 and "`states` of a plant file states it" in done.stderr, done.stderr


def test_the_method_of_linearisation_does_not_change_the_design(aso_ftc, tmp_path):
    """By derivatives, by differences of the equations, by steps from an FMU state."""
    designs = []
    for changes, states in (
        ((), ""),
        ((NO_DERIVATIVES,), ""),
        ((NO_EXCHANGE, NO_DERIVATIVES), 'states = ["theta", "omega"]\n'),
    ):
        poorer(packed_plant(aso_ftc, "DcServo"), tmp_path / "Servo.fmu", *changes)
        (tmp_path / "plant.toml").write_text(states + SERVO, encoding="utf-8")
        done = aso_ftc("design", tmp_path / "plant.toml", "--out", tmp_path / "design.toml")
        assert done.returncode == 0, done.stderr
        designs.append(tomllib.loads((tmp_path / "design.toml").read_text(encoding="utf-8")))
    for name in ("K_x", "K_f", "L_x", "L_f"):
        for other in designs[1:]:
            assert np.array(other[name]) == pytest.approx(np.array(designs[0][name]), rel=1e-9)


@pytest.mark.parametrize(("name", "line"), [("friction", 2), ("u", 3), ("theta_m", 4)])
def test_a_misspelt_variable_of_the_fmu_is_named_with_the_most_similar_one(
    aso_ftc, refusal, tmp_path, name, line
):
    poorer(packed_plant(aso_ftc, "DcServo"), tmp_path / "Servo.fmu")
    text = re.sub(rf"\b{name}\b", f"{name}x", SERVO, count=1)
    message = refusal(text)
    assert message.startswith(f"error: plant.toml:{line}:")
    assert f'has no variable "{name}x", it has {name}, ' in message


def test_a_plant_held_by_friction_is_refused_as_uncontrollable(aso_ftc, refusal, tmp_path):
    poorer(packed_plant(aso_ftc, "DcServo"), tmp_path / "Servo.fmu")
    message = refusal(SERVO.replace("friction = 0", "friction = 1"))
    assert "plant.toml:3:13: the commands u reach 0 of 2 states only" in message


def test_an_operating_point_that_is_no_equilibrium_is_a_check_that_fails(aso_ftc, tmp_path):
    poorer(packed_plant(aso_ftc, "DcServo"), tmp_path / "Servo.fmu")
    file = tmp_path / "plant.toml"
    file.write_text(SERVO.replace("friction = 0", "friction = 0, u = 1"), encoding="utf-8")
    done = aso_ftc("design", file, "--out", tmp_path / "design.toml")
    assert done.returncode == 1
    assert "does not hold: the operating point is an equilibrium" in done.stdout


@pytest.mark.parametrize("output", ["--out", "--report", "--fmu"])
def test_if_an_output_cannot_be_written_no_files_are_left(aso_ftc, tmp_path, output):
    (tmp_path / "plant.toml").write_text(MASS, encoding="utf-8")
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    paths = {name: tmp_path / f"made{name}.fmu" for name in ("--out", "--report", "--fmu")}
    paths[output] = tmp_path / "file" / "made.fmu"
    options = [part for pair in paths.items() for part in pair]
    done = aso_ftc("design", tmp_path / "plant.toml", *options)
    assert done.returncode == 2 and done.stdout == "" and "cannot write" in done.stderr
    assert (tmp_path / "file").read_text(encoding="utf-8") == "in the way"
    assert {path.name for path in tmp_path.iterdir()} == {"plant.toml", "file"}


def test_an_old_output_survives_a_refusal(aso_ftc, tmp_path):
    outputs = ("--out", tmp_path / "design.toml", "--fmu", tmp_path / "M.fmu")
    arguments = (tmp_path / "plant.toml", *outputs)
    (tmp_path / "plant.toml").write_text(MASS, encoding="utf-8")
    assert aso_ftc("design", *arguments).returncode == 0
    files = ["design.toml", "plant-report.html", "M.fmu"]
    before = [(tmp_path / name).read_bytes() for name in files]
    (tmp_path / "plant.toml").write_text(MASS.replace("[[1, 0]]", "[[0, 1]]"), encoding="utf-8")
    assert aso_ftc("design", *arguments).returncode == 2
    assert [(tmp_path / name).read_bytes() for name in files] == before
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*files, "plant.toml"])


def test_the_files_are_the_same_every_time(aso_ftc, tmp_path):
    runs = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        arguments = ("--out", folder / "design.toml", "--fmu", folder / "Mine.fmu")
        done = aso_ftc("design", ROOT / "fmu-controller" / "pendulum.toml", *arguments)
        assert done.returncode == 1 and "verdict: red" in done.stdout, done.stderr
        runs.append([path.read_bytes() for path in sorted(folder.iterdir())])
    assert len(runs[0]) == 3 and runs[0] == runs[1]


def test_no_output_is_an_input_by_path_link_or_case(aso_ftc, tmp_path):
    file, packed, linked = (tmp_path / name for name in ("plant.toml", "Packed.fmu", "link.toml"))
    file.write_text(MASS, encoding="utf-8")
    packed.write_bytes((ROOT / "dist" / "AsoController.fmu").read_bytes())
    linked.symlink_to(file)
    (tmp_path / "hard.toml").hardlink_to(file)
    (tmp_path / "inner").mkdir()
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    for name in ("plant.toml", "inner/../plant.toml", "link.toml", "hard.toml", "PLANT.toml"):
        for option in ("--out", "--report", "--fmu", "--worst-case"):
            done = aso_ftc("design", file, "--force", option, tmp_path / name)
            assert done.returncode == 2 and "would overwrite the plant file" in done.stderr, done
    done = aso_ftc("design", file, "--fmu", packed, "--from", packed, "--force")
    assert done.returncode == 2 and "would overwrite --from" in done.stderr
    done = aso_ftc("design", file, "--out", tmp_path / "one", "--report", tmp_path / "inner" / ".." / "one")
    assert done.returncode == 2 and "--out and --report name the same file" in done.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_files_of_another_design_are_overwritten_by_force_only(aso_ftc, tmp_path):
    (tmp_path / "plant.toml").write_text(MASS, encoding="utf-8")
    (tmp_path / "other.toml").write_text(MASS, encoding="utf-8")
    outputs = ("--out", tmp_path / "d.toml", "--report", tmp_path / "r.html", "--fmu", tmp_path / "M.fmu")
    outputs += ("--worst-case", tmp_path / "w.toml")
    written = lambda: {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert aso_ftc("design", tmp_path / "plant.toml", *outputs).returncode == 0
    first = written()
    assert aso_ftc("design", tmp_path / "plant.toml", *outputs).returncode == 0
    assert written() == first
    for name, option in (
        ("d.toml", "--out"),
        ("r.html", "--report"),
        ("M.fmu", "--fmu"),
        ("w.toml", "--worst-case"),
    ):
        done = aso_ftc("design", tmp_path / "other.toml", option, tmp_path / name)
        assert done.returncode == 2 and f"{name} exists and was not written by" in done.stderr, done
        assert written() == first
    assert aso_ftc("design", tmp_path / "other.toml", *outputs, "--force").returncode == 0
    assert written() != first and set(written()) == set(first)


def test_outputs_are_named_after_the_plant_file(aso_ftc, tmp_path):
    (tmp_path / "mass.toml").write_text(MASS, encoding="utf-8")
    assert aso_ftc("design", tmp_path / "mass.toml", "--out", tmp_path / "d.toml").returncode == 0
    assert {path.name for path in tmp_path.iterdir()} == {"mass.toml", "d.toml", "mass-report.html"}
    command = [ROOT / "target" / "release" / "aso-ftc", "design", "mass.toml"]
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, check=False).returncode == 0
    assert (tmp_path / "mass-design.toml").read_bytes() == (tmp_path / "d.toml").read_bytes()


def test_the_worst_case_is_a_plant_file(aso_ftc, tmp_path):
    (tmp_path / "plant.toml").write_text(MASS.replace("[0], [1]", "[0], [2]"), encoding="utf-8")
    done = aso_ftc(
        "design", tmp_path / "plant.toml", "--worst-case", tmp_path / "w.toml", "--out", tmp_path / "d.toml"
    )
    assert done.returncode == 0, done.stderr
    worst = tomllib.loads((tmp_path / "w.toml").read_text(encoding="utf-8"))
    assert worst["A"] == [[0, 1], [0, 0]] and abs(worst["B"][1][0] - 2) == pytest.approx(0.2)
    assert aso_ftc("design", tmp_path / "w.toml", "--out", tmp_path / "again.toml").returncode == 0


@pytest.mark.parametrize("option", ["--certificate-time", "--gain-time"])
def test_a_negative_time_is_refused_with_what_is_expected(aso_ftc, option):
    done = aso_ftc("design", "plant.toml", option, "-1")
    assert done.returncode == 2 and "expected a time in s, 0 or more, found -1" in done.stderr
