"""Designs: the command is the reference."""

import json
import multiprocessing
import pickle
import subprocess
from operator import attrgetter
from pathlib import Path

import aso_ftc as af
import numpy as np
import pytest
from aso_ftc._plant import of_system

ROOT = Path(__file__).resolve().parents[2]
PLANT = ROOT / "fmu-controller" / "pendulum.toml"


@pytest.fixture(scope="module")
def design():
    return af.design(PLANT)


def test_a_design_has_the_numbers_and_the_verdict_of_the_command(design, tmp_path):
    words = ["design", PLANT, "--out", tmp_path / "design.toml", "--report", tmp_path / "r.html", "--json"]
    done = subprocess.run([af.command(), *words], check=False, capture_output=True, text=True)
    # The paper's design is red: its peak of S at the measurements is above 4.
    assert done.returncode == 1 and design.verdict == "red" and not design.ok
    assert design.report == json.loads(done.stdout)
    assert design.design_file == (tmp_path / "design.toml").read_text(encoding="utf-8")
    assert design.page() == (tmp_path / "r.html").read_text(encoding="utf-8")
    assert all(check["holds"] for check in design.checks)
    assert {name: gain.shape for name, gain in design.gains.items()} == {
        "K_x": (1, 4),
        "K_f": (1, 1),
        "L_x": (4, 2),
        "L_f": (1, 2),
    }


def matrices():
    """The pendulum of the plant file."""
    tomllib = pytest.importorskip("tomllib")
    pendulum = tomllib.loads(PLANT.read_text(encoding="utf-8"))
    return pendulum, [np.array(pendulum[name]) for name in ("A", "B", "C")]


def test_a_dict_and_matrices_give_the_same_gains(design, tmp_path):
    pendulum, (a, b, c) = matrices()
    of_dict = af.design(pendulum)
    assert all(np.array_equal(of_dict.gains[name], design.gains[name]) for name in design.gains)
    rest = {name: value for name, value in pendulum.items() if name not in ("A", "B", "C", "F_a")}
    rest["F_a"] = np.array(pendulum["F_a"])
    np.savez(tmp_path / "plant.npz", A=a, B=b, C=c, F_a=rest["F_a"])
    for plant in ((a, b, c), tmp_path / "plant.npz"):
        of_matrices = af.design(plant, **rest)
        assert all(np.array_equal(of_matrices.gains[name], design.gains[name]) for name in design.gains)


def test_a_file_with_matrices_that_cannot_be_read_is_a_design_error(tmp_path):
    pytest.importorskip("scipy.io")
    (tmp_path / "text.npz").write_text("no archive", encoding="utf-8")
    (tmp_path / "text.mat").write_bytes(128 * b"no matrices")
    for name in ("missing.npz", "missing.mat", "text.npz", "text.mat"):
        with pytest.raises(af.DesignError, match=f"cannot read .*{name}: ") as caught:
            af.design(tmp_path / name)
        assert caught.value.path == str(tmp_path / name)


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


@pytest.mark.parametrize("kind", ["row", "column"])
def test_a_vector_in_a_mat_file_is_a_column_of_b_and_a_row_of_c(tmp_path, kind):
    io = pytest.importorskip("scipy.io")
    a, b, c = [[0.0, 1.0], [-2.0, -3.0]], [0.0, 1.0], [1.0, 0.0]
    requirements = {
        "feedback": {"eigenvalues": [-2.0, -4.0]},
        "observer": {"eigenvalues": [-8.0, -9.0, -10.0]},
        "actuator_faults": "all",
    }
    io.savemat(tmp_path / "plant.mat", {"A": a, "B": b, "C": c}, oned_as=kind)
    of_file = af.design(tmp_path / "plant.mat", **requirements)
    assert of_file.report["gains"] == af.design((a, b, c), **requirements).report["gains"]


def test_the_controller_fmu_runs(design, tmp_path):
    path = design.controller.fmu(tmp_path / "Own.fmu")
    names = {variable.name for variable in af.read_model_description(path).variables}
    assert "f_hat" in names
    system = af.paper().add("controller", path, replace=True)
    results, packed = system.run(stop_time=0.1), af.paper().run(stop_time=0.1)
    assert np.array_equal(results["plant.x_p"], packed["plant.x_p"])


def test_the_source_code_of_a_sampled_controller_is_written(tmp_path):
    pendulum, _ = matrices()
    sampled = af.design({**pendulum, "sample_time": 0.01})
    header, source, runtime = sampled.controller.c_code(tmp_path / "c", single=True)
    assert header.endswith(".h") and runtime.endswith("aso_controller.h") and "float" in Path(source).read_text(encoding="ascii")
    _, library, *_ = sampled.controller.rust_crate(tmp_path / "rust")
    assert "#![no_std]" in Path(library).read_text(encoding="ascii")
    with pytest.raises(af.DesignError, match="sample_time"):
        af.design(pendulum).controller.c_code(tmp_path / "none")


def test_the_table_of_a_design_has_the_reasons_of_its_verdict(design):
    assert design.verdict == "red" and all(reason in design._repr_html_() for reason in design.reasons)
    assert design.reasons == ["the peak of S at the output is 5.583, above 4 (red)"]


def test_a_kalman_filter_needs_the_fmu_of_the_plant(design, tmp_path):
    with pytest.raises(af.DesignError, match="states an FMU"):
        design.controller.kalman_fmu(tmp_path / "Filter.fmu", base=af.fmus()["AsoController"])
    with pytest.raises(af.DesignError, match="states an FMU"):
        design.controller.feedback_fmu(tmp_path / "Filter.fmu")
    # Of entries in Python there is no file to name.
    with pytest.raises(af.DesignError, match="^no Kalman filter with the plant's FMU: .* states an FMU$") as caught:
        design.with_().controller.kalman_fmu(tmp_path / "Filter.fmu", base=af.fmus()["AsoController"])
    assert "path" not in caught.value.fields
    assert not (tmp_path / "Filter.fmu").exists()


def test_a_wrong_plant_is_a_design_error(tmp_path):
    pendulum, _ = matrices()
    with pytest.raises(af.DesignError) as caught:
        af.design({**pendulum, "feedback": {"eigenvalues": [1.0]}})
    assert isinstance(caught.value, ValueError)
    file = tmp_path / "plant.toml"
    file.write_text("A = 1\n", encoding="utf-8")
    with pytest.raises(af.DesignError) as caught:
        af.design(file)
    assert (caught.value.path, caught.value.line) == (str(file), 1)
    for content in (b"A = [\n", b"description = 'gr\xfcn'\n"):
        file.write_bytes(content)
        for entries in ({}, {"sample_time": 0.01}):
            with pytest.raises(af.DesignError, match="plant.toml") as caught:
                af.design(file, **entries)
            assert caught.value.path == str(file)
    with pytest.raises(TypeError, match="found int"):
        af.design(3)


SERVO = (np.array([[0.0, 1.0], [0.0, -0.5]]), np.array([0.0, 0.5]), np.array([1.0, 0.0]))
REQUIREMENTS = {
    "actuator_faults": "all",
    "feedback": {"eigenvalues": np.array([-1 + 1j, -1 - 1j])},
    "observer": {"eigenvalues": [-4.0, complex(-3, 2), complex(-3, -2)]},
}


@pytest.fixture(scope="module")
def servo():
    return af.design(SERVO, **REQUIREMENTS)


@pytest.mark.parametrize("kind", ["matrices with D", "scipy", "scipy transfer function", "control", "control transfer function"])
def test_a_plant_of_any_package_gives_the_same_loop(servo, kind):
    signal, control = pytest.importorskip("scipy.signal"), pytest.importorskip("control")
    a, b, c = SERVO[0], SERVO[1].reshape(2, 1), SERVO[2].reshape(1, 2)
    plant = {
        "matrices with D": (a, b, c, [[0.0]]),
        "scipy": signal.StateSpace(a, b, c, [[0.0]]),
        "scipy transfer function": signal.TransferFunction([0.5], [1, 0.5, 0]),
        "control": control.ss(a, b, c, 0),
        "control transfer function": control.tf([0.5], [1, 0.5, 0]),
    }[kind]
    design = af.design(plant, **REQUIREMENTS)
    ours, theirs = servo.controller.system, design.controller.system
    at = 1j * np.logspace(-1, 2, 20)
    assert np.allclose(ours(at), theirs(at), rtol=1e-9)


def test_a_transfer_function_of_several_inputs_has_its_poles_once_and_its_response():
    control = pytest.importorskip("control")
    plant = control.tf([[[1], [2]], [[1, 1], [3]]], [[[1, 1], [1, 3, 2]], [[1, 5, 6], [1, 1]]])
    design = af.design(
        plant, actuator_faults="all", feedback={"region": {"decay": 1.5}}, observer={"region": {"decay": 3.0}}
    )
    # McMillan degree: -1 twice, -2 twice, -3 once (minors: 3 / (s + 1)^2 - 2 / ((s + 2)^2 (s + 3))).
    assert sorted(design.plant.poles().real.round(6)) == [-3.0, -2.0, -2.0, -1.0, -1.0]
    for s in 1j * np.logspace(-1, 1, 5):
        assert np.allclose(design.plant(s), plant(s), rtol=1e-8)


def test_transfer_functions_of_several_inputs_keep_slow_poles_beside_fast_ones():
    control = pytest.importorskip("control")
    slow = [[(1, 0.1), (2, 0.05)], [(3, 0.2), (5, 0.01)]]
    denominators = [[np.poly([-1e4, -first, -second]) for first, second in row] for row in slow]
    plant = control.tf([[[1e4], [2e4]], [[1e4], [3e4]]], denominators)
    a, b, c = (np.array(of_system(plant)[name]) for name in "ABC")
    # McMillan degree: each slow pole once, the fast one twice.
    assert len(a) == 10
    for s in 1j * np.logspace(-3, 3, 13):
        assert np.allclose(c @ np.linalg.solve(s * np.eye(10) - a, b), plant(s), rtol=1e-6)


def test_transfer_functions_keep_poles_eight_decades_slower_than_others():
    control = pytest.importorskip("control")
    numerators = [[[1e4], [1e-4]], [[1e4], [3e-4]]]
    plant = control.tf(numerators, [[[1, 1e4], [1, 1e-4]], [[1, 1e4], [1, 2e-4]]])
    a, b, c = (np.array(of_system(plant)[name]) for name in "ABC")
    for s in 1j * np.logspace(-6, 6, 13):
        assert np.allclose(c @ np.linalg.solve(s * np.eye(len(a)) - a, b), plant(s), rtol=1e-6)


def test_the_loop_is_that_of_python_control(servo):
    control = pytest.importorskip("control")
    plant, law = servo.plant, servo.controller.system
    ours = np.sort_complex(servo.closed_loop.poles())
    # u = K y: the loop of python-control has negative feedback.
    theirs = control.feedback(plant, law, sign=1)
    assert np.allclose(ours, np.sort_complex(theirs.poles()), rtol=1e-6)
    required = np.concatenate([servo.eigenvalues["feedback"], servo.eigenvalues["observer"]])
    assert np.allclose(ours, np.sort_complex(required), rtol=1e-6)
    s = 1j * servo.S.frequency
    expected = 1 / (1 - plant(s) * law(s))
    assert np.allclose(servo.S.complex, expected, rtol=1e-8) and np.allclose(servo.S_input.complex, expected, rtol=1e-8)
    assert np.allclose(servo.T.complex, 1 - expected, rtol=1e-8, atol=1e-10)
    peaks = [point["s_peak"] for point in servo.report["robustness"]["points"]]
    assert np.abs(expected).max() == pytest.approx(max(peaks), rel=1e-2)
    [at_command, at_measurement] = servo.margins
    assert (at_command["at"], at_measurement["at"]) == ("input", "output")
    _, phase, *_ = control.margin(-plant * law)
    assert phase == pytest.approx(at_command["phase"], rel=1e-3)


def test_the_plots_show_the_peaks_of_s_and_the_responses_to_a_fault(servo):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    lines = {line.get_label(): line.get_ydata() for line in servo.plot_bode().get_lines()}
    assert np.allclose(lines["S at the input"], np.abs(servo.S_input.complex).ravel(), rtol=1e-8)
    steps = {line.get_label(): line.get_ydata() for line in servo.plot_step(fault="f_u1").get_lines()}
    # The compensation takes the fault off: the position returns.
    assert abs(steps["x1"][-1]) < 0.01 * np.abs(steps["x1"]).max() > 0
    with pytest.raises(af.DesignError, match="expected one of f_u1"):
        servo.plot_step(fault="f")


def test_a_design_travels_and_is_changed(servo):
    copy = pickle.loads(pickle.dumps(servo))
    assert copy.report == servo.report and copy.design_file == servo.design_file
    assert np.array_equal(pickle.loads(pickle.dumps(servo.controller)).system.A, servo.controller.system.A)
    faster = servo.with_(observer={"eigenvalues": [-8, -9, -10]})
    assert np.allclose(np.sort(faster.eigenvalues["observer"].real), [-10, -9, -8])
    assert np.array_equal(faster.K_x, servo.K_x) and faster.L.shape == (3, 1)
    assert str(faster).startswith(faster.report["description"]) and "peak of S" in str(faster)
    of_file = af.design(PLANT)
    assert pickle.loads(pickle.dumps(of_file)).design_file == of_file.design_file


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="processes are not forked here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_computes_the_gains_of_its_parent(servo):
    with multiprocessing.get_context("fork").Pool(1) as pool:
        # A design that is pickled is computed again where it arrives.
        (gains,) = pool.map_async(attrgetter("gains"), [servo]).get(timeout=30)
    assert all(np.array_equal(gains[name], gain) for name, gain in servo.gains.items())


def test_matrices_alone_get_bandwidths_and_a_green_verdict():
    design = af.design(([[0, 1], [0, -0.5]], [0, 0.5], [1, 0]), actuator_faults="all")
    assert design.ok and design.verdict == "green"
    assert all("bandwidth" in design.report[part]["method"] for part in ("feedback", "observer"))


def test_a_sampled_system_gives_the_design_of_the_plant_that_was_sampled():
    signal = pytest.importorskip("scipy.signal")
    plant = signal.StateSpace([[0, 1], [0, -0.5]], [[0], [0.5]], [[1, 0]], [[0]])
    of_samples = af.design(plant.to_discrete(0.05), actuator_faults="all")
    of_plant = af.design(plant, actuator_faults="all", sample_time=0.05)
    for name, gain in of_plant.gains.items():
        assert np.allclose(of_samples.gains[name], gain, rtol=1e-8)


def test_a_trade_off_shows_what_speed_costs(tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    speeds = [[-4, -5, -6], [-8, -10, -12], [-16, -20, -24], [1, 2, 3]]
    compared = af.trade_off(SERVO, {"observer.eigenvalues": speeds}, **REQUIREMENTS)
    assert [row["verdict"] == "refused" for row in compared] == [False, False, False, True]
    assert [row["observer_speed"] for row in compared][:3] == pytest.approx([4, 8, 16])
    for row, design in list(zip(compared, compared.designs))[:3]:
        assert row["peak_of_S"] == max(point["judged"] for point in design.report["robustness"]["points"])
    noise = [row["noise"] for row in compared][:3]
    assert noise == sorted(noise) and noise[2] > 2 * noise[0]
    assert compared.pareto("observer_speed", "noise") == [0, 1, 2]
    assert compared.plot("observer_speed", "noise").get_xlabel() == "observer_speed"
    assert len(compared.to_pandas()) == 4
    with pytest.raises(KeyError, match="expected one of speed"):
        compared.plot("speeds")


def test_a_trade_off_keeps_the_other_entries_of_a_table():
    plant = {name: matrix.reshape(shape) for name, matrix, shape in zip("ABC", SERVO, ((2, 2), (2, 1), (1, 2)))}
    plant |= {**REQUIREMENTS, "robustness": {"tolerance": 0.05, "amber": 2.5}}
    compared = af.trade_off(plant, {"robustness.amber": [1.8, 2.2]})
    limits = [design.report["verdict"]["limits"] for design in compared.designs]
    assert [(limit["amber"], limit["tolerance"]) for limit in limits] == [(1.8, [0.05] * 4), (2.2, [0.05] * 4)]


def test_a_trade_off_with_another_requirement_removes_that_of_the_plant():
    plant = {name: matrix.reshape(shape) for name, matrix, shape in zip("ABC", SERVO, ((2, 2), (2, 1), (1, 2)))}
    plant |= REQUIREMENTS
    with pytest.raises(af.DesignError):
        af.trade_off(plant, {"observer.bandwidth": [8.0]})
    (design,) = af.trade_off(plant, {"observer.bandwidth": [8.0]}, observer=None).designs
    assert design.entries["observer"] == {"bandwidth": 8.0} and "eigenvalues" in plant["observer"]
    # A number has no other entries; matrices that the table does not name are exact.
    plant["robustness"] = {"tolerance": 0.05}
    (design,) = af.trade_off(plant, {"robustness.tolerance.A": [0.1]}).designs
    assert design.report["verdict"]["limits"]["tolerance"] == [0.1, 0.0, 0.0, 0.0]


def test_a_delay_margin_without_a_limit_is_infinite():
    from aso_ftc._trade_off import measures

    design = af.design(SERVO, **REQUIREMENTS)
    stated = design.report["robustness"]["delay_margin"]
    assert measures(design)["delay_margin"] == stated and f"delay margin: {stated:.4g} s" in str(design)
    # JSON has no infinity.
    design.report["robustness"]["delay_margin"] = None
    assert measures(design)["delay_margin"] == np.inf and "delay margin: no limit" in str(design)


def test_a_wrong_system_says_what_is_expected():
    signal = pytest.importorskip("scipy.signal")
    with pytest.raises(af.DesignError, match="dt = True; expected the time of a sample"):
        af.design(signal.dlti([1.0], [1.0, -0.5]), **REQUIREMENTS)
    with pytest.raises(af.DesignError, match="C has 3 elements and A 2 rows"):
        af.design((SERVO[0], SERVO[1], [1.0, 0.0, 0.0]), **REQUIREMENTS)
    with pytest.raises(af.DesignError, match="^A: expected real numbers, found complex ones"):
        af.design((SERVO[0] + 1j, *SERVO[1:]), **REQUIREMENTS)
    with pytest.raises(af.DesignError, match="stands without its conjugate"):
        af.design(SERVO, **{**REQUIREMENTS, "feedback": {"eigenvalues": [-1 + 1j, -2]}})
    with pytest.raises(af.DesignError, match=r"\[1, 2\] = 0\.5 and \[2, 1\] = 0\.1"):
        af.design(SERVO, **{**REQUIREMENTS, "feedback": {"Q": [[1, 0.5], [0.1, 1]], "R": [1]}})
    q = np.array([[1, 0.1], [0.1 + 1e-16, 1]])
    rounded = af.design(SERVO, **{**REQUIREMENTS, "feedback": {"Q": q, "R": [1]}})
    exact = af.design(SERVO, **{**REQUIREMENTS, "feedback": {"Q": (q + q.T) / 2, "R": [1]}})
    assert np.array_equal(rounded.K_x, exact.K_x)
