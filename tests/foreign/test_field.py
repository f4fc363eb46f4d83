"""`scripts/reference/field` on our own FMUs, and with commands that have one fault each; FMPy is the reference."""

import json
import stat
import zipfile
from types import SimpleNamespace

import pytest

from field_compare import Judge, Trial


@pytest.fixture(scope="session")
def fmus(packed, tmp_path_factory):
    """A folder with the plant, a copy of it, and files to be ignored."""
    folder = tmp_path_factory.mktemp("fmus")
    plant = packed["plant"].read_bytes()
    (folder / "Plant.fmu").write_bytes(plant)
    (folder / "Copy.fmu").write_bytes(plant)
    (folder / "Text.fmu").write_text("no archive")
    with zipfile.ZipFile(folder / "Three.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription fmiVersion="3.0"/>')
    return folder


@pytest.fixture
def field(python, root, packed, tmp_path):
    """Runs the script; returns exit status, output and the written verdicts by the FMU's file name."""

    def run(folder, *options):
        out = tmp_path / "field.json"
        sink = f"{packed['controller']}:x_p"
        steps = ("--steps", "200", "--sink", sink, "--json", out)
        done = python(root / "scripts" / "reference" / "field", folder, *steps, *options, timeout=600)
        verdicts = json.loads(out.read_text())["fmus"] if out.exists() else {}
        return done.returncode, done.stdout + done.stderr, {path.rsplit("/", 1)[-1]: entry for path, entry in verdicts.items()}

    return run


@pytest.fixture
def faulty(root, tmp_path):
    """A command that calls ours with a change by lines of shell."""

    def make(before="", after=""):
        path = tmp_path / "faulty"
        command = root / "target" / "release" / "aso-ftc"
        path.write_text(f'#!/bin/bash\n{before}\n"{command}" "$@"\nstatus=$?\n{after}\nexit $status\n')
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return path

    return make


def words(verdicts):
    return {question: entry["verdict"] for question, entry in verdicts.items()}


def test_our_plant_gives_fmpys_values_alone_and_chained_and_keeps_settings(field, fmus):
    status, said, verdicts = field(fmus)
    assert status == 0, said
    assert list(verdicts) == ["Copy.fmu"], "of two copies the first"
    answers = words(verdicts["Copy.fmu"])
    assert answers.pop("values") in ("bits", "close"), verdicts
    assert answers == {"defaults": "ok", "chained": "same", "set": "kept", "check": "agrees"}, verdicts
    for reason in ("1 without a readable description", "1 that are copies of another", "1 of FMI 3.0"):
        assert reason in said, said


# The last argument of `--out FOLDER` is the folder of the results.
DIGIT = """case "$*" in *--stop-time*) sed -i -E '3,$s/(,-?[0-9]+[.])[0-9]/\\17/g' "${@: -1}/results.csv" ;; esac"""
LATE = 'case "$*" in *" s="*) status=1 ;; esac'
NO_SETTING = 'kept=(); while [ $# -gt 0 ]; do if [ "$1" = --set ]; then shift 2; else kept+=("$1"); shift; fi; done; set -- "${kept[@]}"'


@pytest.mark.parametrize(
    "before, after, expected",
    [
        ("", DIGIT, {"values": "differ"}),
        ("", LATE, {"chained": "lost"}),
        (NO_SETTING, "", {"set": "lost"}),
        ('[ "$1" = run ] && exit 2', "", {"defaults": "lost", "values": "lost", "set": "lost"}),
        ('[ "$1" = check ] && kill -SEGV $$', "", {"check": "failed"}),
    ],
)
def test_a_fault_of_the_command_is_reported_as_a_failure(field, fmus, faulty, before, after, expected):
    status, said, verdicts = field(fmus, "--command", faulty(before, after))
    assert status == 1, said
    answers = words(verdicts["Copy.fmu"])
    assert {question: answers[question] for question in expected} == expected, verdicts
    short = [line for line in said.splitlines() if "Copy.fmu: " in line]
    assert {line.split(":")[0] for line in short} == set(expected), said


def test_a_command_that_does_not_end_is_a_failure(faulty, tmp_path):
    judge = Judge(SimpleNamespace(command=faulty("sleep 1000"), time_limit=0.1, steps=1), None, tmp_path)
    trial = Trial(judge, SimpleNamespace(path="Any.fmu", start=0.0, stop=1.0, step=1.0), tmp_path)
    answer = trial.check()
    assert answer["verdict"] == "failed" and "no end within the time limit" in answer["detail"]


def test_an_explained_difference_is_no_failure(field, fmus, faulty, tmp_path):
    known = tmp_path / "known"
    known.write_text("# evidence: the test\nset: Copy.fmu: the command drops it\nvalues: Copy.fmu: not needed\n")
    status, said, verdicts = field(fmus, "--command", faulty(NO_SETTING), "--known", known)
    assert status == 0, said
    assert verdicts["Copy.fmu"]["set"]["known"] == "the command drops it"
    assert "values: Copy.fmu: is listed in" in said


def test_misuse_ends_with_status_2(field, tmp_path):
    known = tmp_path / "known"
    known.write_text("speed: x.fmu: slow\n")
    for arguments, words in [
        ((tmp_path / "nowhere",), "no such file or folder"),
        ((tmp_path,), "no FMI 2.0 co-simulation FMU"),
        ((tmp_path, "--known", known), "line 1: expected `question: end of the path: explanation`"),
    ]:
        status, said, _ = field(*arguments)
        assert status == 2 and words in said, said
