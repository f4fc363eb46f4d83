"""The plant in model exchange: integrated by FMPy's CVODE, and event by event through the C interface."""

from ctypes import byref

import fmpy.sundials
import numpy as np
import pytest
from fmpy import simulate_fmu

from c_abi import MODEL_EXCHANGE, EventInfo, Instance, reals
from excitation import restore, serialized
from pendulum_oracle import DERIVATIVES, STATES

OUTPUTS = [*STATES, "f_fric"]
TOLERANCE = 1e-11  # of CVODE, relative
FRACTION = 1e-7  # of a signal's range: how far results may be apart
HOLD = 0.02  # s between jumps of the force
STOP = 2.0  # s
START = {"theta_0": 0.02, "v_p_0": 0.1}


class CvodeWithInput(fmpy.sundials.CVodeSolver):
    """FMPy's CVODE, changed to set inputs inside of integrator steps too, not only between them."""

    def f(self, t, y, ydot, user_data):
        """The right-hand side at the input of its time."""
        self.input.apply(t)
        return super().f(t, y, ydot, user_data)


def force(time):
    """A force that makes the cart stick, slip and turn."""
    return 45 * np.sin(10 * time) + 20 * np.sin(23 * time)


def held_force():
    """The force for FMPy, held between jumps: two rows at each."""
    jumps = np.arange(round(STOP / HOLD) + 1) * HOLD
    rows = [(time, force(begin)) for begin, end in zip(jumps, jumps[1:]) for time in (begin, end)]
    return np.array(rows, dtype=[("time", float), ("u", float)])


def integrated(plant, signal, stop, interval, start_values):
    """FMPy's result for model exchange, with the regime."""
    return simulate_fmu(
        str(plant.folder),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=stop,
        output_interval=interval,
        relative_tolerance=TOLERANCE,
        input=signal,
        output=[*OUTPUTS, "regime"],
        start_values=start_values,
        record_events=False,
    )


def stepped(plant):
    """The result of co-simulation in the middle of each hold."""
    with Instance(plant) as instance:
        instance.start(START)
        rows = []
        for k in range(round(STOP / HOLD)):
            instance.set({"u": force(k * HOLD)})
            instance.step(k * HOLD, HOLD / 2)
            rows.append(instance.outputs())
            instance.step((k + 0.5) * HOLD, HOLD / 2)
    return np.array(rows)


def table(result):
    """The columns of the outputs."""
    return np.array([result[name] for name in OUTPUTS]).T


def apart(one, other):
    """The largest difference of each signal as a fraction of its range."""
    return np.abs(one - other).max(axis=0) / np.ptp(other, axis=0)


def test_cvode_gives_the_results_of_co_simulation(plant):
    result = integrated(plant, held_force(), STOP, HOLD / 2, START)[1::2]
    changes = np.abs(np.diff(result["regime"]))
    assert set(result["regime"]) == {-1, 0, 1} and changes.sum() > 10
    assert (apart(table(result), stepped(plant)) < FRACTION).all()


def test_cvode_gives_the_results_of_scipy(plant, root, monkeypatch):
    monkeypatch.setattr(fmpy.sundials, "CVodeSolver", CvodeWithInput)
    lines = (root / "tests" / "data" / "plant_reference.csv").read_text().splitlines()
    rows = [line for line in lines if not line.startswith("#")]
    reference = np.array([[float(part) for part in row.split(",")] for row in rows[1:]])
    assert rows[0].split(",") == ["t", *OUTPUTS, "regime"]
    nodes = np.arange(401) * 0.01
    signal = np.array(
        [(time, 55.0 * np.sin(2 * np.pi * time)) for time in nodes],
        dtype=[("time", float), ("u", float)],
    )
    result = integrated(plant, signal, 4.0, 0.01, {"x_p_0": 0.1, "theta_0": 1.0})[8::8]
    assert result["time"] == pytest.approx(reference[:, 0], abs=1e-9)
    assert (apart(table(result), reference[:, 1:6]) < FRACTION).all()
    assert (result["regime"] == reference[:, 6]).all()


def event(instance):
    """Enters event mode, iterates, and returns; returns whether the states changed, and the regime."""
    instance.must("EnterEventMode")
    changed = iterated(instance)
    instance.must("EnterContinuousTimeMode")
    return changed, instance.get("regime")[0]


def iterated(instance):
    """Calls fmi2NewDiscreteStates as long as needed, then once more, which must change nothing."""
    changed = []
    for _ in range(2):
        info = EventInfo()
        instance.must("NewDiscreteStates", byref(info))
        assert not info.new_discrete_states_needed and not info.terminate_simulation
        assert not info.next_event_time_defined
        assert not info.nominals_of_continuous_states_changed
        changed.append(bool(info.values_of_continuous_states_changed))
    assert not changed[1], "the second call finds nothing to do"
    return changed[0]


def vector(instance, function, count):
    """The values that a function of model exchange writes."""
    place = reals(*[np.nan] * count)
    instance.must(function, place, count)
    return np.array(place)


def states(instance):
    """`fmi2GetContinuousStates`."""
    return vector(instance, "GetContinuousStates", 4)


def slopes(instance):
    """`fmi2GetDerivatives`."""
    return vector(instance, "GetDerivatives", 4)


def indicators(instance):
    """`fmi2GetEventIndicators`."""
    return vector(instance, "GetEventIndicators", 3)


def put(instance, values):
    """`fmi2SetContinuousStates`."""
    instance.must("SetContinuousStates", reals(*values), 4)


def begun(plant, values=None):
    """A new instance in continuous-time mode."""
    return Instance(plant, kind=MODEL_EXCHANGE).start_exchange(values)


def test_states_derivatives_and_nominal_values_equal_those_of_the_description(plant):
    listed = [unknown.variable for unknown in plant.description.derivatives]
    assert [variable.derivative.name for variable in listed] == STATES
    nominals = [float(plant.variables[name].nominal) for name in STATES]
    with begun(plant, {"theta_0": 0.3, "v_p_0": 0.5, "omega_0": -0.2}) as instance:
        assert (states(instance) == instance.get(*STATES)).all()
        assert (slopes(instance) == instance.get(*DERIVATIVES)).all()
        assert (slopes(instance)[:2] == states(instance)[2:]).all()
        assert (vector(instance, "GetNominalsOfContinuousStates", 4) == nominals).all()
        assert plant.indicators == len(indicators(instance))


def test_a_jump_of_the_force_is_an_event_that_frees_the_cart(plant):
    for u, regime in ((40.0, 1), (-40.0, -1), (20.0, 0)):
        with begun(plant, {"theta_0": 0.0}) as instance:
            assert instance.get("regime") == [0] and (indicators(instance) > 0).all()
            instance.set({"u": u})
            assert ((indicators(instance) <= 0).any()) == (regime != 0)
            assert instance.get("regime") == [0] and slopes(instance)[2] == 0
            assert event(instance) == (False, regime)
            assert (indicators(instance) > 0).all()
            assert np.sign(slopes(instance)[2]) == regime


def test_a_jump_of_the_force_in_event_mode_frees_the_cart_too(plant):
    with begun(plant, {"theta_0": 0.0}) as instance:
        instance.must("EnterEventMode")
        instance.set({"u": 40.0})
        assert not iterated(instance) and instance.get("regime") == [1]
        instance.set({"u": 0.0, "F_s": 60.0, "F_c": 50.0})
        assert not iterated(instance) and instance.get("regime") == [0]
        instance.must("EnterContinuousTimeMode")
        assert (slopes(instance) == 0).all()


def test_a_cart_that_crosses_zero_velocity_stops_there_or_turns(plant):
    for u, regime in ((0.0, 0), (-60.0, -1)):
        with begun(plant, {"v_p_0": 0.1, "u": u}) as instance:
            assert event(instance) == (False, 1)
            x_p, theta, _, omega = states(instance)
            put(instance, [x_p, theta, -1e-9, omega])
            assert instance.get("regime") == [1] and (indicators(instance) <= 0).any()
            assert event(instance) == (True, regime)
            assert (states(instance) == [x_p, theta, 0.0, omega]).all()
            assert (indicators(instance) > 0).all()
            assert np.sign(slopes(instance)[2]) == regime


def follow(instance, begin, count, size=1e-3):
    """Heun steps, each followed by an event if an indicator requires one; returns the states."""
    rows = []
    for k in range(begin, begin + count):
        start = states(instance)
        first = slopes(instance)
        instance.must("SetTime", (k + 1) * size)
        instance.set({"u": force((k + 1) * size)})
        put(instance, start + size * first)
        put(instance, start + size / 2 * (first + slopes(instance)))
        if (indicators(instance) <= 0).any():
            event(instance)
        rows.append([*states(instance), *slopes(instance), *instance.get("regime")])
    return rows


def test_a_restored_state_continues_with_the_same_bits(plant):
    with begun(plant, START) as one, Instance(plant, kind=MODEL_EXCHANGE) as other:
        follow(one, 0, 333)
        data = serialized(one)
        expected = follow(one, 333, 500)
        assert {row[-1] for row in expected} == {-1, 0, 1}
        restore(one, data)
        assert follow(one, 333, 500) == expected
        restore(other, data)
        assert follow(other, 333, 500) == expected


def test_after_a_reset_the_results_are_the_same(plant):
    with begun(plant, START) as instance:
        expected = follow(instance, 0, 500)
        instance.must("Reset")
        instance.start_exchange(START)
        assert follow(instance, 0, 500) == expected
