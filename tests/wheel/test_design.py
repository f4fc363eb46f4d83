"""Designs: the command is the reference."""

import json
import subprocess
from pathlib import Path

import aso_ftc as af
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
PLANT = ROOT / "fmu-controller" / "pendulum.toml"


@pytest.fixture(scope="module")
def made():
    return af.design(PLANT)


def test_a_design_has_the_numbers_and_the_verdict_of_the_command(made, tmp_path):
    words = ["design", PLANT, "--out", tmp_path / "design.toml", "--report", tmp_path / "r.html", "--json"]
    done = subprocess.run([af.command(), *words], check=False, capture_output=True, text=True)
    # The paper's design is red: its peak of S at the measurements is above 4.
    assert done.returncode == 1 and made.verdict == "red" and not made.ok
    assert made.report == json.loads(done.stdout)
    assert made.design_file == (tmp_path / "design.toml").read_text(encoding="utf-8")
    assert made.page() == (tmp_path / "r.html").read_text(encoding="utf-8")
    assert all(own["holds"] for own in made.checks)
    assert {name: gain.shape for name, gain in made.gains.items()} == {
        "K_x": (1, 4),
        "K_f": (1, 1),
        "L_x": (4, 2),
        "L_f": (1, 2),
    }


def matrices():
    """The pendulum of the plant file."""
    tomllib = pytest.importorskip("tomllib")
    own = tomllib.loads(PLANT.read_text(encoding="utf-8"))
    return own, [np.array(own[name]) for name in ("A", "B", "C")]


def test_a_dict_and_matrices_give_the_same_gains(made, tmp_path):
    own, (a, b, c) = matrices()
    of_dict = af.design(own)
    assert all(np.array_equal(of_dict.gains[name], made.gains[name]) for name in made.gains)
    rest = {name: value for name, value in own.items() if name not in ("A", "B", "C", "F_a")}
    rest["F_a"] = np.array(own["F_a"])
    np.savez(tmp_path / "plant.npz", A=a, B=b, C=c, F_a=rest["F_a"])
    for plant in ((a, b, c), tmp_path / "plant.npz"):
        of_matrices = af.design(plant, **rest)
        assert all(np.array_equal(of_matrices.gains[name], made.gains[name]) for name in made.gains)


def test_matrices_alone_get_names_and_a_linear_system_is_accepted():
    a, b, c = np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    requirements = {
        "feedback": {"eigenvalues": [-2.0, -4.0]},
        "observer": {"eigenvalues": [-8.0, -9.0, -10.0]},
        "F_a": -b,
        "faults": [{"name": "f", "unit": "N"}],
    }

    class Linear:
        A, B, C, D = a, b, c, 0.0

    first, second = af.design((a, b, c), **requirements), af.design(Linear(), **requirements)
    assert first.report["gains"] == second.report["gains"]
    closed = np.sort(np.linalg.eigvals(a + b @ first.gains["K_x"]).real)
    assert np.allclose(closed, [-4.0, -2.0])
    control = pytest.importorskip("control")
    third = af.design(control.StateSpace(a, b, c, 0), **requirements)
    assert all(np.array_equal(third.gains[name], first.gains[name]) for name in first.gains)


def test_the_controller_fmu_runs(made, tmp_path):
    path = made.controller.fmu(tmp_path / "Own.fmu")
    names = {own.name for own in af.read_model_description(path).variables}
    assert "f_hat" in names
    system = af.paper().add("controller", path)
    own, packed = system.run(stop_time=0.1), af.paper().run(stop_time=0.1)
    assert np.array_equal(own["plant.x_p"], packed["plant.x_p"])


def test_the_source_code_of_a_sampled_controller_is_written(tmp_path):
    own, _ = matrices()
    sampled = af.design({**own, "sample_time": 0.01})
    header, source, runtime = sampled.controller.c_code(tmp_path / "c", single=True)
    assert header.endswith(".h") and runtime.endswith("aso_controller.h") and "float" in Path(source).read_text(encoding="ascii")
    _, library, *_ = sampled.controller.rust_crate(tmp_path / "rust")
    assert "#![no_std]" in Path(library).read_text(encoding="ascii")
    with pytest.raises(af.DesignError, match="sample_time"):
        af.design(own).controller.c_code(tmp_path / "none")


def test_a_wrong_plant_is_a_design_error(tmp_path):
    own, _ = matrices()
    with pytest.raises(af.DesignError) as caught:
        af.design({**own, "feedback": {"eigenvalues": [1.0]}})
    assert isinstance(caught.value, ValueError)
    file = tmp_path / "plant.toml"
    file.write_text("A = 1\n", encoding="utf-8")
    with pytest.raises(af.DesignError) as caught:
        af.design(file)
    assert (caught.value.path, caught.value.line) == (str(file), 1)
    with pytest.raises(TypeError, match="found int"):
        af.design(3)
