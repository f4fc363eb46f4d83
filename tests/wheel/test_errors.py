"""Errors: their classes, sentences and fields."""

import copy
import os
import pickle
import subprocess
import sys

import aso_ftc as af
import pytest
from aso_ftc import _core


@pytest.mark.parametrize(
    ("change", "kind", "fields"),
    [
        ({"start_values": {"plant.F": 1}}, "UnknownVariable", {"name": "plant.F", "variable": "F"}),
        ({"start_values": {"wheel.F": 1}}, "UnknownSlave", {"fmu": "wheel", "known": "plant, controller"}),
        ({"start_values": {"plant.M": "heavy"}}, "Value", {"expected": "a number"}),
        ({"record": ["plant.z*"]}, "Selection", {}),
        ({"faults": [af.fault("plant.M", "bias", value=1.0)]}, "Scenario", {}),
        ({"faults": [{"connection": "controller.x_p", "bais": {}}]}, "Entry", {}),
        ({"step": -1.0}, "Invalid", {}),
        ({"step": "fast"}, "Entry", {}),
        ({"algorithm": {"metod": "jacobi"}}, "Entry", {}),
        ({"stop_time": -5.0}, "Time", {}),
    ],
)
def test_a_wrong_argument_is_a_configuration_error_before_the_run(paper, change, kind, fields):
    for call in (paper.run, paper.check):
        with pytest.raises(af.ConfigurationError) as caught:
            call(**change)
        error = caught.value
        assert error.kind == kind and isinstance(error, ValueError)
        assert {name: getattr(error, name) for name in fields} == fields
        assert "\n" not in str(error)


def test_a_message_about_the_outermost_value_has_no_place():
    with pytest.raises(TypeError, match="^the key 1 is not a text"):
        _core.render_toml({1: 2})
    with pytest.raises(TypeError, match="^a: the key 1 is not a text"):
        _core.render_toml({"a": {1: 2}})


def test_values_of_wrong_types_are_refused(paper):
    for wrong, error in [
        ({"start_values": {"plant.M": object()}}, TypeError),
        ({"start_values": {"plant.M": 10**30}}, ValueError),
        ({"start_values": {"plant.M": b"25"}}, af.ConfigurationError),
        ({"start_values": {"plant.M": float("nan")}}, af.ConfigurationError),
        ({"record": "plant.x_p"}, TypeError),
        ({"time_limit": float("nan")}, ValueError),
        ({"file": "results.txt"}, af.ResultsError),
    ]:
        with pytest.raises(error):
            paper.run(**wrong)
    for wrong in (3, [], {"fmus": {"a": object()}}):
        with pytest.raises(TypeError):
            af.System(wrong)
    with pytest.raises(TypeError, match="a path or an object with a function step, found int"):
        af.System().add("a", 3)


def test_an_error_in_a_file_has_its_line_and_column(tmp_path):
    file = tmp_path / "system.toml"
    file.write_text('[fmus]\nplant = "a.fmu"\n[algorithm]\nstep = "fast"\n', encoding="utf-8")
    with pytest.raises(af.ConfigurationError) as caught:
        af.System.from_toml(file)
    assert (caught.value.path, caught.value.line, caught.value.column) == (str(file), 4, 8)


def test_an_error_in_a_text_names_its_table_not_a_row_of_a_list():
    text = '[algorithm]  # how, and how fast\npower-bonds = [\n["a.p", "b.p"],\n]\nstep = "fast"\n'
    with pytest.raises(af.ConfigurationError, match=r', in \[algorithm\]  # how, and how fast: step = "fast"$'):
        af.System(text)


def test_terminals_that_do_not_match_are_a_configuration_error(packed):
    system = af.System().add("node", packed("examples/can-node"))
    system.add("plant", af.fmus()["FrictionPendulum"]).connect("node.CanChannel", "plant.x_p")
    with pytest.raises(af.ConfigurationError, match="plant.x_p is no terminal") as caught:
        system.run(stop_time=0.1)
    error = caught.value
    assert (error.kind, error.name, error.source) == ("Terminals", "plant.x_p", "node.CanChannel")


def test_a_text_with_a_nul_character_is_refused(packed):
    system = af.System().add("node", packed("examples/can-node"))
    with pytest.raises(af.ConfigurationError, match="^node.node = .*: expected a text without the character NUL"):
        system.check(start_values={"node.node": "one\0two"})


def test_results_in_a_file_that_the_run_reads_are_a_configuration_error(paper, tmp_path):
    file = tmp_path / "signal.csv"
    file.write_text("time,plant.d\n0,0\n", encoding="utf-8")
    paper.scenario["table"] = [{"csv": str(file)}]
    with pytest.raises(af.ConfigurationError, match="signal.csv") as caught:
        paper.run(file=file)
    assert caught.value.kind == "Outputs" and file.read_text(encoding="utf-8") == "time,plant.d\n0,0\n"


def test_a_missing_fmu_is_an_fmu_error(tmp_path):
    for call in (af.simulate, af.read_model_description, af.check):
        with pytest.raises(af.FmuError, match="missing.fmu"):
            call(tmp_path / "missing.fmu")
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"no archive")
    with pytest.raises(af.FmuError, match="broken.fmu") as caught:
        af.System().add("wheel", broken).run()
    assert caught.value.fmu == "wheel"
    with pytest.raises(af.FmuError) as caught:
        af.read_model_description(broken)
    assert caught.value.fmu is None


def test_the_command_is_read_in_its_encoding_in_every_locale():
    program = """
import os, aso_ftc as af
path = os.fsdecode("pr\\xfcfen.fmu".encode())
for call in (af.check, af.report):
    try:
        call(path)
    except af.Error as error:
        print(ascii(str(error)))
"""
    words = [sys.executable, "-I", "-X", "utf8=0", "-c", program]
    variables = {**os.environ, "LC_ALL": "C"}
    done = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    # As in Windows, where the encoding of the system is not UTF-8 either.
    assert ["pr\\xfcfen.fmu" in line for line in done.stdout.splitlines()] == [True, True], done.stderr


def test_errors_survive_pickle_with_their_fields(paper):
    with pytest.raises(af.TimeLimitError) as caught:
        paper.run(stop_time=1e6, record_every=1.0, time_limit=0.0)
    for error in (pickle.loads(pickle.dumps(caught.value)), copy.copy(caught.value)):
        assert type(error) is af.TimeLimitError
        assert (str(error), error.kind, error.time) == (str(caught.value), "TimeLimit", caught.value.time)
    for name in af.__all__:
        member = getattr(af, name)
        if isinstance(member, type) and issubclass(member, af.Error):
            error = pickle.loads(pickle.dumps(member("a sentence", "Kind", {"what": 1})))
            assert (str(error), error.kind, error.what) == ("a sentence", "Kind", 1)


def test_a_missing_package_is_named_with_the_command_that_installs_it(paper, monkeypatch):
    import importlib

    def refuse(name):
        raise ImportError(name)

    results = paper.run()
    monkeypatch.setattr(importlib, "import_module", refuse)
    for call in (results.to_arrow, results.to_pandas, results.to_polars, results.to_xarray, results.plot):
        with pytest.raises(
            af.MissingPackageError, match=r"needs the package (\w+): python -m pip install \1$"
        ):
            call()
