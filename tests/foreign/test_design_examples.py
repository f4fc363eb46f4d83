"""The examples, each from its plant file through `aso-ftc design --fmu` to a run in FMPy."""

import csv

import numpy as np
import pytest

from design_loop import Designed, changed, coupled, packed_plant
from design_oracle import WITHOUT_PROOFS

# Claims of the paper, and half of them where the velocity of the cart is measured as well: m, rad.
PENDULUMS = [("pendulum", 1e-3, 2e-3), ("pendulum-three-measurements", 0.5e-3, 1e-3)]
LEVELS = {"h_1": 0.4, "h_2": 0.2, "h_3": 0.3}  # m, the operating point of the tanks
BOTH = {"plant.f_1": 1e-5, "plant.f_2": -8e-6, "plant.t_fault_1": 300, "plant.t_fault_2": 300}
RESISTANCE, K = 4.0, 0.0274  # of the servo, SI


@pytest.fixture
def tanks(aso_ftc):
    """The FMU of the three tanks."""
    return packed_plant(aso_ftc, "ThreeTank")


@pytest.fixture
def servo(aso_ftc):
    """The FMU of the DC servo."""
    return packed_plant(aso_ftc, "DcServo")


def after(table, time):
    """The rows from `time` on."""
    return table["time"] >= time - 1e-9


def must_settle(table, designed, fault, value, begin, others=()):
    """Checks that the estimate reaches `value` within the time that the report predicts.

    The report's band is 2 %; here it is 4 %, because the plant is nonlinear and a communication step
    delays the command. `others` are faults that change at the same time; the band is relative to the
    largest.
    """
    band = 0.04 * max(map(abs, [value, *others]))
    error = table[designed.estimate(fault)] - value
    assert abs(error[after(table, begin + designed.settling_time(fault))]).max() < band
    assert abs(error[-1]) < 1e-5 * abs(value)


@pytest.mark.parametrize(("name", "cart", "angle"), PENDULUMS)
def test_the_pendulum_stays_within_1_mm_and_2_mrad_after_compensation(
    name, cart, angle, aso_ftc, python, packed, tmp_path
):
    designed = Designed(aso_ftc, f"fmu-controller/{name}.toml", tmp_path, WITHOUT_PROOFS)
    designed.must_be_sound()
    table, summary = coupled(python, designed, packed["plant"], {})
    uncompensated = (table["time"] > 10) & (table["time"] < 40)
    assert abs(table["plant.x_p"][uncompensated]).max() > 0.1
    assert summary["residual"]["x_p"] < cart and summary["residual"]["theta"] < angle
    settled = after(table, 60)
    friction, estimate = (table[name][settled] for name in ("plant.f_fric", "controller.f_hat"))
    assert np.ptp(friction) > 50, "it turns round"
    assert np.sqrt(np.mean((friction - estimate) ** 2)) < 0.01 * np.ptp(friction)
    assert np.corrcoef(friction, estimate)[0, 1] > 0.999


def test_two_simultaneous_pump_faults_are_estimated_and_compensated(
    aso_ftc, python, tanks, tmp_path
):
    designed = Designed(aso_ftc, "examples/three-tank/plant.toml", tmp_path, WITHOUT_PROOFS)
    designed.must_be_sound()
    table, _ = coupled(python, designed, tanks, BOTH)
    must_settle(table, designed, "f_1", 1e-5, 300, [8e-6])
    must_settle(table, designed, "f_2", -8e-6, 300, [1e-5])
    for level, operating in LEVELS.items():
        assert table[f"plant.{level}"][-1] == pytest.approx(operating, abs=1e-9)


def test_the_levels_move_as_the_report_predicts(aso_ftc, python, tanks, tmp_path):
    """The report is linear and the tanks are not: 12 % of the largest movement is allowed."""
    designed = Designed(aso_ftc, "examples/three-tank/plant.toml", tmp_path, WITHOUT_PROOFS)
    table, _ = coupled(python, designed, tanks, BOTH)
    times = np.arange(300.0)
    for level, operating in LEVELS.items():
        predicted = np.zeros(300)
        for fault in ("f_1", "f_2"):
            curve, size = designed.response(fault, level)
            part = np.interp(times, curve["times"], curve["values"], right=0.0)
            predicted += BOTH[f"plant.{fault}"] / size * part
        deviation = table[f"plant.{level}"][300:600] - operating
        assert abs(deviation - predicted).max() < 0.12 * abs(predicted).max(), level


def test_without_compensation_the_same_faults_move_the_levels_permanently(
    aso_ftc, python, tanks, tmp_path
):
    designed = Designed(aso_ftc, "examples/three-tank/plant.toml", tmp_path, WITHOUT_PROOFS)
    table, _ = coupled(python, designed, tanks, BOTH | {"controller.compensate": "false"})
    assert abs(table["plant.h_1"][-1] - LEVELS["h_1"]) > 1e-3


def test_losses_of_effectiveness_of_both_pumps_are_estimated(aso_ftc, python, tanks, tmp_path):
    designed = Designed(aso_ftc, "examples/three-tank/loss-of-effectiveness.toml", tmp_path, WITHOUT_PROOFS)
    designed.must_be_sound()
    losses = {"E_1": 0.3, "E_2": 0.2}
    begin = {"plant.t_fault_1": 300, "plant.t_fault_2": 300}
    settings = {f"plant.{name}": value for name, value in losses.items()} | begin
    table, _ = coupled(python, designed, tanks, settings)
    slowest = -max(re for re, _ in plane(designed.report["feedback"]["required"]))
    for (name, loss), fault, pump in zip(losses.items(), ("f_1", "f_2"), ("Q_1", "Q_2")):
        estimate = table[designed.loss(fault)]
        assert estimate[after(table, 300 + 5 / slowest)] == pytest.approx(loss, rel=0.02), name
        command = table[f"controller.{pump}"][-1]
        # The excitation threshold reduces it by u_e^2 / (u^2 + u_e^2).
        expected = loss * command**2 / (command**2 + 1e-6**2)
        assert estimate[-1] == pytest.approx(expected, rel=1e-6)
    for level, operating in LEVELS.items():
        assert table[f"plant.{level}"][-1] == pytest.approx(operating, abs=1e-8)
    stable = designed.report["effectiveness"]
    assert all(entry["largest_stable_loss"] > losses[f"E_{k + 1}"] for k, entry in enumerate(stable))


def plane(eigenvalues, period=1.0):
    """Eigenvalues in 1/s of a loop that is sampled every `period` s."""
    return [
        (value.real, value.imag)
        for value in np.log([complex(*pair) for pair in eigenvalues]) / period
    ]


def test_a_sensor_fault_is_distinguished_from_a_pump_fault(aso_ftc, python, tanks, tmp_path):
    designed = Designed(aso_ftc, "examples/three-tank/sensor-fault.toml", tmp_path, WITHOUT_PROOFS)
    designed.must_be_sound()
    settings = {"plant.f_1": 1e-5, "plant.t_fault_1": 300, "plant.b_1": 0.02, "plant.t_bias": 1500}
    table, _ = coupled(python, designed, tanks, settings)
    bias, pump = table[designed.estimate("b_1")], table[designed.estimate("f_1")]
    before = after(table, 300 + 3 * designed.settling_time("f_1")) & (table["time"] < 1500)
    assert pump[before] == pytest.approx(1e-5, rel=0.01)
    assert abs(bias[before]).max() < 0.01 * 0.02
    late = after(table, 1500 + 3 * designed.settling_time("b_1"))
    assert pump[late] == pytest.approx(1e-5, rel=0.01)
    assert bias[late] == pytest.approx(0.02, rel=0.01)
    assert abs(table[designed.estimate("f_2")][late]).max() < 0.01 * 1e-5
    for level, operating in LEVELS.items():
        assert table[f"plant.{level}"][-1] == pytest.approx(operating, abs=1e-8), "the true level"
    assert table["plant.y_1"][-1] == pytest.approx(LEVELS["h_1"] + 0.02, abs=1e-8)


@pytest.mark.parametrize(
    ("extrapolation", "inputs"), [("limited", ()), ("hold", ("--hold",))]
)
def test_fmpy_and_the_rust_master_agree_on_the_tanks(
    extrapolation, inputs, aso_ftc, python, tanks, tmp_path
):
    designed = Designed(aso_ftc, "examples/three-tank/plant.toml", tmp_path, WITHOUT_PROOFS)
    steps = ("--step", 0.37, "--stop-time", 400)
    table, _ = coupled(python, designed, tanks, BOTH, *steps, *inputs)
    settings = [text for name, value in BOTH.items() for text in ("--set", f"{name}={value}")]
    options = ("--extrapolation", extrapolation, "--record-every", 0.37, "--out", tmp_path)
    fmus = ("--plant", tanks, "--controller", designed.fmu)
    done = aso_ftc("run", *fmus, *settings, *steps, *options)
    assert done.returncode == 0, done.stderr
    path = tmp_path / "results.csv"
    names = next(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    other = dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T))
    for name, column in table.items():
        assert (column == other[name]).all(), name


@pytest.mark.parametrize("estimator", ["current", "prediction"])
@pytest.mark.parametrize("step", [0.25, 0.37, 1.0, 2.5])
@pytest.mark.parametrize("inputs", [(), ("--hold",)], ids=["slopes", "held"])
def test_a_sampled_controller_tolerates_any_communication_step(
    estimator, step, inputs, aso_ftc, python, tanks, tmp_path
):
    """If the step does not divide the sample time, commands and held measurements jitter."""
    change = ("sample_time = 1.0", f'sample_time = 1.0\nestimator = "{estimator}"')
    file = changed("examples/three-tank/plant.toml", tmp_path, change)
    designed = Designed(aso_ftc, file, tmp_path, WITHOUT_PROOFS)
    assert designed.report["sampling"] == {"sample_time": 1.0, "estimator": estimator}
    options = ("--step", step, "--stop-time", 1000, *inputs)
    table, _ = coupled(python, designed, tanks, BOTH, *options)
    must_settle(table, designed, "f_1", 1e-5, 300 + step, [8e-6])
    must_settle(table, designed, "f_2", -8e-6, 300 + step, [1e-5])
    if step == 0.37:
        changes = np.flatnonzero(np.diff(table["controller.Q_1"]))
        assert set(np.diff(changes)) >= {2, 3}, "samples each 1 s, seen at steps of 0.37 s"


def test_without_friction_the_servo_moves_as_the_report_predicts(aso_ftc, python, servo, tmp_path):
    designed = Designed(aso_ftc, "examples/dc-servo/plant.toml", tmp_path, WITHOUT_PROOFS)
    designed.must_be_sound()
    settings = {"plant.friction": "false", "plant.f_u": 3, "plant.t_fault": 0.1}
    table, _ = coupled(python, designed, servo, settings, "--stop-time", 1, "--step", 1e-4)
    must_settle(table, designed, "f_u", 3, 0.1)
    times = table["time"] - 0.1
    for name, response in (
        ("theta", table["plant.theta"]),
        ("omega", table["plant.omega"]),
        ("error of f_u", table["controller.f_hat"] - 3),
    ):
        curve, size = designed.response("f_u", name)
        fine = (times >= 0) & (times <= curve["times"][-1])
        predicted = 3 / size * np.interp(times[fine], curve["times"], curve["values"])
        assert abs(response[fine] - predicted).max() < 0.01 * abs(predicted).max(), name
    assert abs(table["plant.theta"][-1]) < 1e-6


def test_the_servo_returns_despite_fault_and_friction(aso_ftc, python, servo, tmp_path):
    designed = Designed(aso_ftc, "examples/dc-servo/plant.toml", tmp_path, WITHOUT_PROOFS)
    settings = {"plant.f_u": 3, "plant.t_fault": 0.1}
    table, _ = coupled(python, designed, servo, settings, "--stop-time", 1, "--step", 1e-4)
    turned = abs(table["plant.theta"])
    assert turned[~after(table, 0.1)].max() == 0 and turned.max() > 0.1
    slowest = -max(re for re, _ in designed.report["feedback"]["required"])
    assert turned[after(table, 0.1 + 10 / slowest)].max() < 0.02 * turned.max()
    assert turned[-1] < 1e-3
    # To the observer friction is a fault: the voltage that gives the same torque.
    acting = 3 - table["plant.T_f"] * RESISTANCE / K
    late = after(table, 0.5)
    assert table["controller.f_hat"][late] == pytest.approx(acting[late], abs=0.01)
    uncompensated, _ = coupled(
        python,
        designed,
        servo,
        settings | {"controller.compensate": "false"},
        *("--stop-time", 1, "--step", 1e-4),
    )
    assert abs(uncompensated["plant.theta"][-1]) > 1


@pytest.mark.parametrize(("name", "lag"), [("ramp", 0.0), ("plant", 1 / 300 + 1 / 350 + 1 / 400)])
def test_only_the_ramp_model_follows_a_growing_fault_without_lag(
    name, lag, aso_ftc, python, servo, tmp_path
):
    """With a constant fault model the lag is the sum of the observer's time constants."""
    designed = Designed(aso_ftc, f"examples/dc-servo/{name}.toml", tmp_path)
    designed.must_be_sound()
    rate = 10.0  # V/s
    settings = {"plant.friction": "false", "plant.r_u": rate, "plant.t_fault": 0.05}
    table, _ = coupled(python, designed, servo, settings, "--stop-time", 0.6, "--step", 1e-4)
    error = table[designed.estimate("f_u")] - rate * np.maximum(table["time"] - 0.05, 0)
    late = after(table, 0.05 + 10 / 40)
    assert error[late] == pytest.approx(-rate * lag, abs=1e-4)
    (bound,) = (entry for entry in designed.report["bounds"] if entry["error"] == "error of f_u")
    assert abs(error).max() <= rate * bound["gain_of_rate"]
    assert (abs(table["plant.theta"][-1]) < 1e-4) == (lag == 0)
    if name == "ramp":
        estimate = table[designed.estimate("f_u_rate")][late]
        assert estimate == pytest.approx(rate, rel=1e-3)
