"""FMPy's own scripts and notebooks, after the changes that docs/how-to/fmpy.md states, give the numbers of FMPy."""

import functools
import importlib.util
import re
import shutil
import zipfile
from pathlib import Path

import aso_ftc as af
import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy")
util = pytest.importorskip("fmpy.util")
pytest.importorskip("matplotlib").use("Agg")

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "fmpy.md"
HEAD = "| FMPy | aso_ftc |\n|---|---|\n"
# Text with balanced parentheses, for the dots of a table.
SAME = r"((?:[^()]|\((?:[^()]|\([^()]*\))*\))*?)"
# The FMUs of the scripts cannot be downloaded in a test: the pendulum stands in, with the names of their variables.
CLUTCHES = {"u": "inputs", "F_c": "CoupledClutches1_freqHz"}
CLUTCHES |= {name: f"outputs[{k}]" for k, name in enumerate(("x_p", "theta", "v_p", "omega"), 1)}


def table(number):
    """The rows of a table of the page."""
    lines = PAGE.read_text(encoding="utf-8").split(HEAD)[number].partition("\n\n")[0].splitlines()
    rows = [re.fullmatch(r"\| `(.+?)` \| (?:`(.+)` )?\|", line) for line in lines]
    assert len(lines) == len(list(filter(None, rows))) > 15
    return [(row[1], row[2] or "") for row in rows]


def changed(text, rows):
    """The text after the changes of a table, and the rows that had an effect."""
    used = set()
    for theirs, ours in rows:
        # Dots at the end go on to the end of the line.
        pattern = r"\b" + SAME.join(map(re.escape, theirs.split("..."))) + ("$" if theirs.endswith("...") else "")

        def put(match, ours=ours):
            same = iter(match.groups())
            return re.sub(r"\.\.\.", lambda _: next(same), ours)

        text, count = re.subn(pattern, put, text, flags=re.MULTILINE)
        used |= {theirs} if count else set()
    assert "fmpy" not in text
    return text, used


def script(name):
    """The source of a script of FMPy."""
    return Path(importlib.util.find_spec(f"fmpy.examples.{name}").origin).read_text(encoding="utf-8")


def execute(text, function=None):
    """Runs a script and one of its functions; returns its names, and what the function returns."""
    names = {"__name__": "script"}
    exec(compile(text, "script", "exec"), names)
    return names[function]() if function else names


def pendulum_as(path, names, stop_time="10"):
    """Writes the FMU of the pendulum with other names of variables, and another default stop time."""
    with zipfile.ZipFile(af.fmus()["FrictionPendulum"]) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                text = content.decode()
                for variable, other in names.items():
                    text, count = re.subn(f'(<ScalarVariable name=)"{variable}"', rf'\1"{other}"', text)
                    assert count == 1, variable
                content = re.sub(r'stopTime="\S+"', f'stopTime="{stop_time}"', text).encode()
            new.writestr(name, content)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A current folder with the files that the scripts would download."""
    monkeypatch.chdir(tmp_path)
    pendulum_as("CoupledClutches.fmu", CLUTCHES)
    pendulum_as("VanDerPol.fmu", {"F_theta": "mu"}, stop_time="0.5")
    # A staircase: FMPy holds inputs within a step.
    Path("CoupledClutches_in.csv").write_text("time,inputs\n0,0\n0.5,0\n0.5,20\n1,20\n1,-5\n2,-5\n", encoding="utf-8")
    monkeypatch.setattr(util, "download_test_file", lambda *names: None)
    monkeypatch.setattr(util, "download_file", lambda *names: "VanDerPol.fmu")
    for module in (fmpy, util):
        monkeypatch.setattr(module, "plot_result", lambda *results, **options: None)
    return tmp_path


@pytest.fixture
def recorded(monkeypatch):
    """The results of all runs, in the order of FMPy's and of ours."""
    runs = {"theirs": [], "ours": []}

    def record(run, results, *words, **options):
        results.append(run(*words, **options))
        return results[-1]

    for name, module, function in (("theirs", fmpy, "simulate_fmu"), ("ours", af, "simulate")):
        recorder = functools.partial(record, getattr(module, function), runs[name])
        monkeypatch.setattr(module, function, recorder)
    return runs


def test_coupled_clutches_gives_the_rows_of_fmpy(folder):
    text, _ = changed(script("coupled_clutches"), table(1))
    theirs = execute(script("coupled_clutches"), "simulate_coupled_clutches")
    ours = execute(text, "simulate_coupled_clutches")
    assert list(ours) == list(theirs.dtype.names) and len(ours.time) == 76
    for name in ours:
        assert np.allclose(ours[name], theirs[name], rtol=1e-9, atol=1e-12), name


def test_efficient_loops_ends_each_of_its_100_runs_where_fmpy_does(folder, recorded):
    text, _ = changed(script("efficient_loops"), table(1))
    execute(script("efficient_loops"), "run_efficient_loop")
    execute(text, "run_efficient_loop")
    assert len(recorded["ours"]) == len(recorded["theirs"]) == 100
    ours, theirs = ([run["theta"][-1] for run in recorded[name]] for name in ("ours", "theirs"))
    # The solvers differ.
    assert np.ptp(ours) > 0.1 and np.allclose(ours, theirs, rtol=1e-4)


def test_custom_input_reaches_its_threshold_when_fmpy_does(folder):
    text, _ = changed(script("custom_input"), table(2))
    theirs = execute(script("custom_input"), "simulate_custom_input")
    assert execute(text, "simulate_custom_input") == pytest.approx(theirs, abs=1e-9) and 1.0 < theirs < 1.5


@pytest.mark.parametrize("model", ["FrictionPendulum", "examples/van-der-pol"])
def test_a_notebook_of_fmpy_gives_the_rows_of_fmpy(model, folder, packed):
    nbformat = pytest.importorskip("nbformat")
    shutil.copy(af.fmus()[model] if model in af.fmus() else packed(model), folder / "model.fmu")
    util.create_jupyter_notebook("model.fmu")
    cells = nbformat.read("model.ipynb", as_version=4).cells
    (text,) = (cell.source for cell in cells if cell.cell_type == "code")
    theirs, ours = (execute(code)["result"] for code in (text, changed(text, table(1))[0]))
    assert list(ours) == list(theirs.dtype.names)
    # FMPy doubles the step until a run has at most 1000 of them.
    rows = np.searchsorted(ours.time, theirs["time"] - 1e-6)
    assert len(rows) > 500
    for name in ours:
        assert np.allclose(ours[name][rows], theirs[name], rtol=1e-6, atol=1e-6), name


def test_each_row_of_the_tables_is_of_a_script():
    names = {1: ("coupled_clutches", "efficient_loops"), 2: ("custom_input",)}
    notebook = "import fmpy\n"
    for number, scripts in names.items():
        used = [changed(text, table(number))[1] for text in (*map(script, scripts), *([notebook] if number == 1 else []))]
        assert set().union(*used) == {theirs for theirs, _ in table(number)}
