"""Messages and sentences: loggers, and the words of Python in errors."""

import logging
import re

import aso_ftc as af
import numpy as np
import pytest

# What belongs to the command, to Rust, or to files that nobody wrote.
FOREIGN = re.compile(r"--[a-z]|unknown (field|variant)|invalid type|`|plant\.toml|\bf64\b|struct |\n")
MATRICES = ([[0.0, 1.0], [-2.0, -3.0]], [[0.0], [1.0]], [[1.0, 0.0]])
ENTRIES = {
    "feedback": {"eigenvalues": [-2.0, -3.0]},
    "observer": {"eigenvalues": [-8.0, -9.0, -10.0]},
    "F_a": [[0.0], [-1.0]],
    "faults": [{"name": "f", "unit": "N"}],
}


def pendulum():
    return af.fmus()["FrictionPendulum"]


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: af.simulate(pendulum(), step="fast"), 'algorithm: step = "fast": expected a number'),
        (lambda: af.simulate(pendulum(), interface="model"), "expected co-simulation, model-exchange"),
        (lambda: af.simulate(pendulum(), solver="rk"), "expected automatic, explicit, stiff"),
        (lambda: af.paper().run(algorithm={"metod": 1}), "algorithm: unknown entry metod; similar: method"),
        (lambda: af.paper().run(algorithm={"method": "jacoby"}), "expected jacobi, gauss-seidel; similar: jacobi"),
        (lambda: af.System({"fmu": {}}), "unknown entry fmu; similar: fmus"),
        (lambda: af.System("[algorithm]\nmethod = 'x'"), "algorithm: method = 'x': expected jacobi"),
        (lambda: af.paper().run(faults=[af.fault("controller.x_p", "bais")]), "entry bais; similar: bias"),
        (lambda: af.paper().run(memory_limit="2GB"), "expected isolate=True"),
        (lambda: af.paper().run(start_values={"plant.x_p": 1.0}), "so it cannot be set"),
        (lambda: af.paper().add("plant", pendulum()), "replace=True"),
        (lambda: af.design(MATRICES, **{**ENTRIES, "feedback": {"eigenvalues": [1.0]}}), "^feedback.eigenvalues: "),
        (lambda: af.design(MATRICES, **{**ENTRIES, "F_a": [[1.0]]}), r"^F_a: expected 2x1 .*found 1x1"),
        (lambda: af.design(MATRICES, **{**ENTRIES, "F_a": [[0.0], [np.nan]]}), r"^F_a\[2\]\[1\]: .* found nan"),
        (lambda: af.design((MATRICES[0], [[1.0]], MATRICES[2]), **ENTRIES), "^B: expected 2x1"),
    ],
)  # fmt: skip
def test_a_sentence_has_the_words_of_python(call, text):
    with pytest.raises((af.ConfigurationError, af.DesignError), match=text) as caught:
        call()
    match = FOREIGN.search(str(caught.value))
    assert not match, f"{match[0]!r} in: {caught.value}"


@pytest.mark.parametrize("call", [af.simulate, lambda fmu, **other: af.paper().run(**other)])
def test_a_keyword_that_is_wrong_is_named_with_the_right_one(call):
    for name, text in [
        ("step_size", "use step"),
        ("output_interval", "use step, .* or record_every"),
        ("relative_tolerance", "use tolerance"),
        ("stop_tim", "similar: stop_time"),
        ("debug_logging", r'use logging.getLogger\("aso_ftc.fmu"\)'),
    ]:
        with pytest.raises(TypeError, match=rf"has no argument '{name}'; {text}"):
            call(pendulum(), **{name: 1})
    with pytest.raises(TypeError, match=r"^check\(\) has no argument 'stop_tim'; similar: stop_time"):
        af.paper().check(stop_tim=1)


def test_an_argument_of_another_type_is_named_with_the_expected_one(paper, tmp_path):
    path = tmp_path / "system.toml"
    path.write_text(paper.to_toml(), encoding="utf-8")
    for call, text in [
        (lambda: paper.run(faults=af.fault("controller.x_p", "bias", value=0.1)), "faults is a list of dicts"),
        (lambda: paper.run(algorithm="jacobi"), "algorithm is a dict, .* found the text 'jacobi'"),
        (lambda: af.System(str(path)), "System.from_toml reads files"),
        (lambda: af.System(path), "System.from_toml reads files"),
        (lambda: af.System("missing.toml"), "found the file missing.toml; System.from_toml reads files"),
    ]:
        with pytest.raises(TypeError, match=text):
            call()


def test_every_keyword_of_fmpy_that_is_missing_here_has_an_answer_or_is_unknown():
    import inspect

    fmpy = pytest.importorskip("fmpy")
    from aso_ftc._system import _FMPY

    theirs = set(inspect.signature(fmpy.simulate_fmu).parameters)
    ours = set(inspect.signature(af.simulate).parameters)
    assert set(_FMPY) <= theirs - ours
    # Switches of FMPy's own work, which have nothing to do here.
    rest = {
        "filename", "apply_default_start_values", "visible", "model_description", "set_input_derivatives",
        "remote_platform", "early_return_allowed", "use_event_mode", "initialize", "terminate", "set_stop_time",
    }  # fmt: skip
    assert theirs - ours - set(_FMPY) == rest


def test_each_fmu_has_a_logger_and_debugging_is_its_level(paper, caplog):
    def failing(level):
        caplog.clear()
        with caplog.at_level(level, logger="aso_ftc.fmu"), pytest.raises(af.RunError):
            paper.run(start_values={"plant.x_p_0": 1e300})
        return [record for record in caplog.records if record.name == "aso_ftc.fmu.plant"]

    quiet, loud = failing(logging.WARNING), failing(logging.DEBUG)
    assert quiet and all(record.fmu == "plant" and record.category for record in quiet)
    assert len(loud) >= len(quiet) and {record.name for record in loud} == {"aso_ftc.fmu.plant"}


def test_a_message_comes_once_and_in_the_words_of_python(caplog, monkeypatch, tmp_path):
    import zipfile

    # Without a default experiment, the stop time is a guess, which is a warning.
    source, target = pendulum(), tmp_path / "Bare.fmu"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            text = old.read(name)
            if name == "modelDescription.xml":
                text = re.sub(rb"<DefaultExperiment[^>]*/>", b"", text)
            new.writestr(name, text)
    with caplog.at_level(logging.WARNING, logger="aso_ftc"):
        af.simulate(target, step=0.01)
    texts = [record.getMessage() for record in caplog.records if "stop time" in record.getMessage()]
    assert len(texts) == 1 and texts[0].endswith("stop_time sets it"), texts


@pytest.mark.usefixtures("interruptible")
def test_an_interrupted_run_leaves_its_rows(paper):
    import _thread
    import threading

    timer = threading.Timer(0.2, _thread.interrupt_main)

    def started(fraction):
        if timer.ident is None:
            timer.start()

    with pytest.raises(KeyboardInterrupt) as caught:
        paper.run(stop_time=1e5, record_every=0.01, progress=started)
    results = vars(caught.value)["results"]
    assert results.end == "interrupted" and 10 < len(results.time) and results.end_time < 1e5
    again = paper.run(stop_time=results.time[-1] + 1e-6, record_every=0.01)
    assert np.array_equal(results["plant.x_p"], again["plant.x_p"][: len(results.time)])

    def stop(fraction):
        raise ArithmeticError("enough")

    with pytest.raises(ArithmeticError) as caught:
        paper.run(stop_time=1e5, record_every=0.01, progress=stop)
    assert vars(caught.value)["results"].end == "interrupted"
