"""The closed loop of both FMUs in model exchange, integrated in three ways.

FMPy's functions of FMI 2.0 couple the FMUs; the states of both are one vector. It is integrated by
FMPy's CVODE, by scipy's Radau, which locates events by a search of its own, and by Euler steps
of 0.2 ms, which detect an event at the end of a step and do not locate it. Each must give the
figures of the paper, as co-simulation does.
"""

from ctypes import c_double
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model
from fmpy.sundials import CVodeSolver
from scipy.integrate import solve_ivp

T_ON = 40.0  # s, when the compensation starts
STOP = 70.0  # s
ROW = 0.01  # s between recorded rows
SLIDE = 1e-3  # m that a slide between two rests has at least
EULER = 2e-4  # s, its step
LONGEST = 0.05  # s: implicit steps that are much longer keep a falling pendulum upright
NOMINALS = [0.1, 0.1, 0.1, 1.0, 0.1, 0.1, 0.1, 1.0, 10.0]


class Side:
    """One FMU and its parts of the common vectors."""

    def __init__(self, unpacked, states, slopes, indicators):
        self.names = unpacked.variables
        self.fmu = FMU2Model(
            guid=unpacked.description.guid,
            modelIdentifier=unpacked.identifier,
            unzipDirectory=str(unpacked.folder),
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.component = self.fmu.component
        place = lambda part: ((c_double * len(part)).from_buffer(part), len(part))
        self.states, self.slopes, self.indicators = map(place, (states, slopes, indicators))

    def value(self, name):
        """The value of one variable."""
        variable = self.names[name]
        get = getattr(self.fmu, f"get{variable.type}")
        return get([variable.valueReference])[0]


class Loop:
    """Plant and controller as one model with nine states and the indicators of both."""

    def __init__(self, plant, controller):
        self.states, self.slopes = np.zeros(9), np.zeros(9)
        self.indicators = np.ones(plant.indicators + controller.indicators)
        cut = lambda part: (self.states[part], self.slopes[part])
        self.plant = Side(plant, *cut(slice(4)), self.indicators[: plant.indicators])
        indicators = self.indicators[plant.indicators :]
        self.controller = Side(controller, *cut(slice(4, 9)), indicators)
        self.sides = (self.plant, self.controller)
        measured, command = (c_double * 2)(), (c_double * 1)()
        refer = lambda fmu, names, place: (fmu.references(*names), len(names), place)
        measurements = ("x_p", "theta")
        self.measured = refer(plant, measurements, measured)
        self.measures = refer(controller, measurements, measured)
        self.commanded, self.commands = (refer(x, ("u",), command) for x in (controller, plant))
        self.exchange()
        for side in self.sides:
            side.fmu.exitInitializationMode()
        self.events, self.rows, self.time = [], [], 0.0
        self.iterate()
        self.read_states()

    def exchange(self):
        """Measurements and command; the command depends on the estimate only."""
        plant, controller = self.plant, self.controller
        plant.fmu.fmi2GetReal(plant.component, *self.measured)
        controller.fmu.fmi2SetReal(controller.component, *self.measures)
        controller.fmu.fmi2GetReal(controller.component, *self.commanded)
        plant.fmu.fmi2SetReal(plant.component, *self.commands)

    def move(self, time, states):
        """Sets time and states of the loop."""
        self.time = time
        self.states[:] = states
        for side in self.sides:
            side.fmu.fmi2SetTime(side.component, time)
            side.fmu.fmi2SetContinuousStates(side.component, *side.states)
        self.exchange()

    def read_states(self):
        """`fmi2GetContinuousStates`."""
        for side in self.sides:
            side.fmu.fmi2GetContinuousStates(side.component, *side.states)
        return self.states

    def find_slopes(self):
        """`fmi2GetDerivatives`."""
        for side in self.sides:
            side.fmu.fmi2GetDerivatives(side.component, *side.slopes)
        return self.slopes

    def find_indicators(self):
        """`fmi2GetEventIndicators`."""
        for side in self.sides:
            side.fmu.fmi2GetEventIndicators(side.component, *side.indicators)
        return self.indicators

    def complete(self):
        """Calls `fmi2CompletedIntegratorStep`; no FMU may request an event."""
        for side in self.sides:
            assert side.fmu.completedIntegratorStep() == (False, False)

    def iterate(self):
        """Iterates the event and returns to continuous time; returns whether states changed."""
        changed, needed = False, True
        while needed:
            needed, self.next = False, np.inf
            for side in self.sides:
                self.exchange()
                more, ended, _, new_states, timed, time = side.fmu.newDiscreteStates()
                assert not ended
                needed, changed = needed or more, changed or new_states
                self.next = min(self.next, time) if timed else self.next
        self.exchange()
        for side in self.sides:
            side.fmu.enterContinuousTimeMode()
        return changed

    def handle_event(self):
        """Enters and leaves event mode at the present time and states."""
        before = self.plant.value("regime")
        for side in self.sides:
            side.fmu.enterEventMode()
        changed = self.iterate()
        self.read_states()
        self.events.append((self.time, before, self.plant.value("regime"), changed))

    def record(self):
        """One row of the recorded values."""
        values = (self.plant.value(name) for name in ("x_p", "theta", "v_p", "regime", "f_fric"))
        self.rows.append((self.time, *values, self.controller.value("f_hat")))


class AsInput:
    """The inputs for FMPy's CVODE: none, because the FMUs are connected."""

    def apply(self, time):
        """Sets nothing."""


def by_cvode(loop, tolerance):
    """FMPy's CVODE on the common vectors, driven as in FMPy's own loop."""

    def put(states, count):
        loop.move(loop.time, states[:count])

    def copy(find):
        def into(values, count):
            np.ctypeslib.as_array(values, (count,))[:] = find()

        return into

    def at(time):
        loop.time = time

    solver = CVodeSolver(
        *(len(loop.states), len(loop.indicators), copy(loop.read_states), put),
        *(copy(loop.find_slopes), copy(loop.find_indicators), copy(lambda: NOMINALS), at, AsInput(), 0.0),
        maxStep=LONGEST,
        relativeTolerance=tolerance,
        maxNumSteps=100_000,
    )
    time, row = 0.0, 1
    while time < STOP - 1e-9:
        crossed, _, time = solver.step(time, min(row * ROW, loop.next))
        loop.move(time, loop.states.copy())
        loop.complete()
        if crossed or time >= loop.next:
            loop.handle_event()
            solver.reset(time)
        if time >= row * ROW:
            loop.record()
            row += 1


def by_radau(loop, tolerance):
    """scipy's Radau, which stops at the first sign change of an event function."""

    def slopes(time, states):
        loop.move(time, states)
        return loop.find_slopes().copy()

    def indicator(k):
        def function(time, states):
            loop.move(time, states)
            return loop.find_indicators()[k]

        vars(function).update(terminal=True)
        return function

    functions = [indicator(k) for k in range(len(loop.indicators))]
    time, rows = 0.0, np.arange(1, round(STOP / ROW) + 1) * ROW
    while time < STOP:
        end = min(STOP, loop.next)
        part = solve_ivp(
            slopes,
            (time, end),
            loop.states.copy(),
            method="Radau",
            t_eval=[*rows[(rows > time) & (rows < end)], end],
            events=functions,
            rtol=tolerance,
            atol=1e-3 * tolerance,
            max_step=LONGEST,
        )
        assert part.success
        for at, states in zip(part.t, np.transpose(part.y)):
            loop.move(at, states)
            loop.record()
        time = end
        for times, states in zip(part.t_events, part.y_events):
            if len(times):
                time = times[0]
                loop.move(time, states[0])
        loop.handle_event()


def by_euler(loop, step):
    """Euler's method; the signs of the indicators are compared after each step."""
    signs = loop.find_indicators() > 0
    every = round(ROW / step)
    for k in range(1, round(STOP / step) + 1):
        time = k * step
        loop.move(time, loop.states + step * loop.find_slopes())
        loop.complete()
        now = loop.find_indicators() > 0
        if (now != signs).any() or time >= loop.next:
            loop.handle_event()
            now = loop.find_indicators() > 0
        signs = now
        if k % every == 0:
            loop.record()


IMPORTERS = {
    "CVODE, tolerance 1e-5": (by_cvode, 1e-5),
    "CVODE, tolerance 1e-8": (by_cvode, 1e-8),
    "Radau, tolerance 1e-6": (by_radau, 1e-6),
    "Euler, steps of 0.2 ms": (by_euler, EULER),
}


@pytest.fixture(scope="module", params=IMPORTERS)
def run(request, plant, controller):
    """The loop after a run, and the recorded rows by name."""
    loop = Loop(plant, controller)
    integrate, accuracy = IMPORTERS[request.param]
    integrate(loop, accuracy)
    names = ("time", "x_p", "theta", "v_p", "regime", "f_fric", "f_hat")
    return SimpleNamespace(loop=loop, **dict(zip(names, np.array(loop.rows).T)))


def amplitude(values):
    """Half of the peak-to-peak value."""
    return np.ptp(values) / 2


def slides(run, window):
    """Number of slides of more than a millimetre between two rests."""
    rests = run.x_p[window & (run.regime == 0)]
    return (abs(np.diff(rests)) > SLIDE).sum()


def test_before_the_compensation_the_loop_is_in_the_limit_cycle_of_the_paper(run):
    before = (run.time >= 10) & (run.time <= T_ON)
    assert amplitude(run.x_p[before]) == pytest.approx(0.1647, abs=1e-4)
    assert amplitude(run.theta[before]) == pytest.approx(0.112, abs=5e-4)
    assert slides(run, before) == 2


def test_the_residual_after_compensation_is_within_the_bounds_of_the_paper(run):
    after = run.time > T_ON + 20
    assert amplitude(run.x_p[after]) == pytest.approx(0.962e-3, rel=5e-3)
    assert amplitude(run.theta[after]) == pytest.approx(1.75e-3, rel=5e-3)
    difference = run.f_fric[after] - run.f_hat[after]
    assert np.sqrt(np.mean(difference**2)) == pytest.approx(0.29, abs=0.02)


def test_a_stopped_cart_is_held_and_does_not_creep(run):
    held = run.regime == 0
    assert 0.2 < held.mean() < 0.6
    assert (run.v_p[held] == 0.0).all()
    assert (abs(run.v_p[~held]) < 1e-9).mean() < 0.05


def test_each_event_is_handled_once(run):
    times, before, after, changed = np.array(run.loop.events).T
    assert np.count_nonzero((times >= 10) & (times < T_ON)) < 10
    assert len(times) < 150
    stops = (before != 0) & (after == 0)
    assert changed[stops].all() and not changed[~stops & (before == 0)].any()
