"""The plants of examples/three-tank and examples/dc-servo, checked and simulated by FMPy.

Oracles: scipy's integration of the equations, with the events found by scipy, and linear models by
formula.
"""

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from any_fmu import referenced

PLANTS = {"three-tank": "ThreeTank", "dc-servo": "DcServo"}
EXACT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}

AREA, PIPE, MU, GRAVITY, LARGEST, BRIM = 0.0154, 5e-5, (0.5, 0.5, 0.675), 9.81, 1.2e-4, 0.62
RESISTANCE, K, INERTIA, VISCOUS, COULOMB, HOLDING = 4.0, 0.0274, 3.2284e-6, 3.5077e-6, 0.006, 0.008


@pytest.fixture(scope="module")
def plants(aso_ftc, root, tmp_path_factory):
    """The packed plants, by name of the model."""
    out = tmp_path_factory.mktemp("plants")
    done = aso_ftc("pack", *(root / "examples" / name for name in PLANTS), "--out", out)
    assert done.returncode == 0, done.stderr
    return {model: str(out / f"{model}.fmu") for model in PLANTS.values()}


def held(names, begins, values):
    """An input for FMPy that jumps to the next row at each start time."""
    rows = []
    for begin, end, row in zip(begins, [*begins[1:], 1e9], values):
        rows += [(begin, *row), (end, *row)]
    return np.array(rows, dtype=[(name, float) for name in ("time", *names)])


def table(result, names):
    """Columns of a result of FMPy."""
    return np.array([result[name] for name in names]).T


def jacobian(instance, names, unknowns, knowns):
    """The matrix of the directional derivatives."""
    references = [names[name] for name in unknowns]
    column = lambda known: instance.getDirectionalDerivative(references, [names[known]], [1.0])
    return np.array([column(known) for known in knowns]).T


@pytest.mark.parametrize("model", PLANTS.values())
def test_fmpy_finds_no_problem(plants, model, python):
    assert validate_fmu(plants[model]) == []
    done = python("-m", "fmpy", "validate", plants[model])
    assert done.returncode == 0 and "no problems found" in done.stdout.lower(), done


@pytest.mark.parametrize("model", PLANTS.values())
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_fmpy_simulates_it_with_its_default_options(plants, model, kind):
    result = simulate_fmu(plants[model], fmi_type=kind, output_interval=0.1)
    assert len(result) > 1 and all(np.isfinite(result[name]).all() for name in result.dtype.names)


def torricelli(mu, drop):
    return mu * PIPE * np.sign(drop) * np.sqrt(2 * GRAVITY * abs(drop))


def net_flows(h, pumps):
    """Inflow minus outflow of the tanks."""
    q_13, q_32 = torricelli(MU[0], h[0] - h[2]), torricelli(MU[1], h[2] - h[1])
    return np.array([pumps[0] - q_13, pumps[1] + q_32 - torricelli(MU[2], h[1]), q_13 - q_32])


COMMANDS = [
    (0.0, (3.5e-5, 3.2e-5)),
    (150.0, (9e-5, -1.0)),
    (420.0, (1e-5, 7e-5)),
    (700.0, (1.0, 5e-5)),
]
FAULTS = {"f_1": 8e-6, "t_fault_1": 100.5, "E_2": 0.45, "f_2": 4e-6, "t_fault_2": 333.3}
BIAS = {"b_1": 0.02, "b_3": -0.03, "t_bias": 500.25}


def delivered(time):
    """The flows that the pumps deliver for the commands and faults above."""
    command = [row for begin, row in COMMANDS if begin <= time][-1]
    first, second = np.clip(command, 0, LARGEST)
    if time >= FAULTS["t_fault_1"]:
        first = min(first + FAULTS["f_1"], LARGEST)
    if time >= FAULTS["t_fault_2"]:
        second = min((1 - FAULTS["E_2"]) * second + FAULTS["f_2"], LARGEST)
    return first, second


def levels(h, times, stop):
    """The levels at the times, by scipy; tank 1 spills while it is full."""
    edges = sorted({begin for begin, _ in COMMANDS} | {100.5, 333.3, stop})
    values, begin = np.empty((len(times), 3)), 0.0
    spills = np.array([0, 1, 1])
    full = lambda _, h: BRIM - h[0]
    vars(full).update(terminal=True, direction=-1)
    for edge in edges[1:]:
        while begin < edge:
            pumps = delivered(begin)
            at_brim = h[0] >= BRIM and net_flows(h, pumps)[0] > 0
            factor = (spills if at_brim else np.ones(3)) / AREA
            right_side = lambda _, h: net_flows(h, pumps) * factor
            events = None if at_brim else full
            part = solve_ivp(
                right_side, (begin, edge), h, dense_output=True, events=events, **EXACT
            )
            inside = (times >= begin) & (times <= part.t[-1])
            values[inside] = part.sol(times[inside]).T
            begin, h = part.t[-1], part.y[:, -1]
            if part.status == 1:
                h[0] = BRIM
    return values


@pytest.mark.parametrize("step", [0.5, 10.0])
def test_the_levels_are_those_of_scipy_including_faults_and_overflow(plants, step):
    signal = held(("Q_1", "Q_2"), *zip(*COMMANDS))
    result = simulate_fmu(
        plants["ThreeTank"],
        fmi_type="CoSimulation",
        stop_time=1200.0,
        output_interval=step,
        input=signal,
        start_values={**FAULTS, **BIAS},
        output=["h_1", "h_2", "h_3", "y_1", "y_2", "y_3", "q_over"],
    )
    times = result["time"]
    expected = levels(np.array([0.4, 0.2, 0.3]), times, 1200.0)
    simulated = table(result, ["h_1", "h_2", "h_3"])
    assert (expected[:, 0] == BRIM).any() and result["q_over"].max() > 0
    assert simulated == pytest.approx(expected, abs=1e-7)
    bias = np.outer(times >= BIAS["t_bias"], [BIAS["b_1"], 0, BIAS["b_3"]])
    assert table(result, ["y_1", "y_2", "y_3"]) == pytest.approx(simulated + bias, abs=1e-15)


def test_cvode_gives_the_levels_of_the_co_simulation(plants):
    names = ["h_1", "h_2", "h_3", "y_1", "y_2", "y_3", "q_01", "q_02", "q_over"]
    results = [
        simulate_fmu(
            plants["ThreeTank"],
            fmi_type=kind,
            solver="CVode",
            relative_tolerance=1e-10,
            stop_time=1200.0,
            output_interval=8.0,
            start_values={**FAULTS, **BIAS, "Q_1": 1.1e-4, "Q_2": 6e-5},
            output=names,
            record_events=False,
        )
        for kind in ("CoSimulation", "ModelExchange")
    ]
    simulated, integrated = (table(result, names) for result in results)
    assert (simulated[:, -1] > 0).any()
    apart = abs(integrated - simulated).max(axis=0)
    assert (apart < 1e-6 * np.ptp(simulated, axis=0)).all(), apart


def test_the_directional_derivatives_of_the_tanks_give_the_linear_model(plants, tmp_path):
    states, inputs = ["h_1", "h_2", "h_3"], ["Q_1", "Q_2"]
    slopes, measured = [f"der({name})" for name in states], ["y_1", "y_2", "y_3"]
    h = np.array([0.45, 0.15, 0.28])
    with referenced(plants["ThreeTank"], tmp_path, dict(zip(states, h))) as (instance, names):
        drops = [h[0] - h[2], h[2] - h[1], h[1]]
        a, b, c = np.array(MU) * PIPE * np.sqrt(GRAVITY / 2 / np.array(drops)) / AREA
        expected = [[-a, 0, a], [0, -b - c, b], [a, b, -a - b]]
        matrix = jacobian(instance, names, slopes, states)
        assert matrix == pytest.approx(np.array(expected), rel=1e-13)
        matrix = jacobian(instance, names, slopes, inputs)
        assert matrix == pytest.approx(np.array([[1, 0], [0, 1], [0, 0]]) / AREA, rel=1e-14)
        assert (jacobian(instance, names, measured, states) == np.eye(3)).all()


DRIVE = {"E": 0.2, "f_u": 0.5, "r_u": -6.0, "t_fault": 0.3137}
HOLD, STEPS = 0.01, 60
NAMES = ["theta", "omega"]


def command(begin):
    """The voltage that is held from `begin` on; it causes stick, slip and reversals."""
    return 3.0 * np.sin(20.0 * begin)


def voltage(time, held, faulty):
    """The voltage at the armature."""
    if not faulty:
        return held
    return (1 - DRIVE["E"]) * held + DRIVE["f_u"] + DRIVE["r_u"] * (time - DRIVE["t_fault"])


def slid(begin, end, drive, state, direction):
    """Slides until the end or a stop; returns the time and the state at that point."""

    def right_side(time, state):
        current = (voltage(time, *drive) - K * state[1]) / RESISTANCE
        torque = K * current - VISCOUS * state[1] - direction * COULOMB
        return [state[1], torque / INERTIA]

    stop = lambda _, state: state[1]
    vars(stop).update(terminal=True, direction=-direction)
    part = solve_ivp(right_side, (begin, end), state, events=stop, **EXACT)
    omega = 0.0 if part.status == 1 else part.y[1, -1]
    return part.t[-1], np.array([part.y[0, -1], omega])


def moved(begin, end, drive, state):
    """The state at the end of an interval in which the voltage is linear in time."""
    torque = lambda time: K / RESISTANCE * voltage(time, *drive)
    while begin < end:
        direction = np.sign(state[1] or torque(begin))
        if state[1] == 0 and abs(torque(begin)) <= HOLDING:
            if abs(torque(end)) <= HOLDING:
                return state
            direction = np.sign(torque(end))
            part = (direction * HOLDING - torque(begin)) / (torque(end) - torque(begin))
            begin += part * (end - begin)
        begin, state = slid(begin, end, drive, state, direction)
    return state


def servo_by_scipy():
    """Angle and velocity at the multiples of the hold time."""
    state, values, onset = np.zeros(2), [np.zeros(2)], DRIVE["t_fault"]
    for k in range(STEPS):
        begin, end = k * HOLD, (k + 1) * HOLD
        middle = np.clip(onset, begin, end)
        state = moved(begin, middle, (command(begin), False), state)
        state = moved(middle, end, (command(begin), True), state)
        values.append(state)
    return np.array(values)


def servo_by_fmpy(plants, **options):
    begins = HOLD * np.arange(STEPS)
    return simulate_fmu(
        plants["DcServo"],
        stop_time=STEPS * HOLD,
        input=held(["u"], begins, [(command(begin),) for begin in begins]),
        start_values=DRIVE,
        output=[*NAMES, "T_f", "regime"],
        record_events=False,
        **options,
    )


def test_the_servo_moves_as_by_scipy_including_stick_slip_and_faults(plants):
    expected = servo_by_scipy()
    for interval in (HOLD, HOLD / 5):
        result = servo_by_fmpy(plants, fmi_type="CoSimulation", output_interval=interval)
        assert set(result["regime"]) == {-1, 0, 1}
        simulated = table(result, NAMES)[:: round(HOLD / interval)]
        assert np.ptp(expected, axis=0)[1] > 50
        assert (abs(simulated - expected).max(axis=0) < 1e-9 * np.ptp(expected, axis=0)).all()


def test_cvode_gives_the_motion_of_the_servo_in_co_simulation(plants):
    options = {"output_interval": HOLD / 2, "relative_tolerance": 1e-11, "solver": "CVode"}
    simulated = servo_by_fmpy(plants, fmi_type="CoSimulation", **options)[1::2]
    integrated = servo_by_fmpy(plants, fmi_type="ModelExchange", **options)[1::2]
    assert (simulated["regime"] == integrated["regime"]).all()
    one, other = (table(result, [*NAMES, "T_f"]) for result in (simulated, integrated))
    assert (abs(one - other).max(axis=0) < 1e-6 * np.ptp(one, axis=0)).all()


def test_a_torque_below_the_static_friction_does_not_move_the_servo(plants):
    for fraction, moves in ((0.999, False), (1.001, True)):
        start = {"u": fraction * HOLDING * RESISTANCE / K, "theta": 0.7}
        for kind in ("CoSimulation", "ModelExchange"):
            result = simulate_fmu(plants["DcServo"], fmi_type=kind, start_values=start)
            assert (result["theta"][-1] > 0.7) == moves
            friction = COULOMB if moves else fraction * HOLDING
            assert result["T_f"][-1] == pytest.approx(friction, rel=1e-12)


def test_the_directional_derivatives_of_the_servo_without_friction_give_the_linear_motor(
    plants, tmp_path
):
    damping = VISCOUS + K**2 / RESISTANCE
    with referenced(plants["DcServo"], tmp_path, {"friction": False}) as (instance, names):
        slopes = ["der(theta)", "der(omega)"]
        matrix = jacobian(instance, names, slopes, NAMES)
        assert matrix == pytest.approx(np.array([[0, 1], [0, -damping / INERTIA]]), rel=1e-14)
        matrix = jacobian(instance, names, slopes, ["u"])
        assert matrix == pytest.approx(np.array([[0], [K / RESISTANCE / INERTIA]]), rel=1e-14)
        assert (jacobian(instance, names, ["theta_m"], NAMES) == [[1, 0]]).all()
