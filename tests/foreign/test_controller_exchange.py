"""The controller in model exchange, integrated by FMPy's CVODE.

FMPy sets inputs between integrator steps only, so the measurements are constant between their jumps.
CVODE evaluates the model beyond the end of its last step, so no stop time is defined (section
2.1.6).
"""

from ctypes import byref
from typing import NamedTuple

import numpy as np
import pytest
from fmpy import instantiate_fmu, simulate_fmu
from scipy.integrate import solve_ivp

from c_abi import MODEL_EXCHANGE, EventInfo, Fmu, Instance, reals
from design_file import design_text, redesigned, shipped_design, vector
from named_equations import evaluated, losses, state_names
from test_designs import LIMITED, SIZES, fmu_with, random_design

T_ON = 0.3037  # s, inside a communication step
STOP = 1.0  # s
JUMPS = [0.0, 0.15, 0.4, 0.75]  # s
TOLERANCE = 1e-10  # of CVODE, relative
FRACTION = 1e-7  # of a signal's range: how far results may be apart


class Run(NamedTuple):
    """A controller with its measurements after each of `JUMPS`; results are `step` s apart."""

    fmu: Fmu
    design: dict
    estimate: np.ndarray
    levels: np.ndarray
    step: float = 0.01
    compensate: tuple = ((0.0, True),)

    @property
    def inputs(self):
        """Names of the measurements."""
        return [signal["name"] for signal in self.design["measurements"]]

    @property
    def states(self):
        """Names of the continuous states."""
        return state_names(self.design)

    @property
    def signals(self):
        """Names of states, commands and losses of effectiveness."""
        outputs = [name for name, *_ in losses(self.design)]
        return self.states + vector("u", len(self.design["actuators"])) + outputs

    @property
    def start_values(self):
        """The initial estimates and measurements."""
        names = [name.replace("hat", "hat_0") for name in self.states if "hat" in name]
        return dict(zip([*names, *self.inputs], [*self.estimate, *self.levels[0]]))

    @property
    def times(self):
        """The times of the results."""
        return np.arange(round(STOP / self.step) + 1) * self.step

    @property
    def limits(self):
        """Limits of all commands."""
        return [a.get("limits", [-np.inf, np.inf]) for a in self.design["actuators"]]

    def level(self, time):
        """The measurements from `time` on."""
        return self.levels[np.searchsorted(JUMPS, time + 1e-9) - 1]

    def compensating(self, time):
        """Whether f_hat is part of the command from `time` on."""
        enabled = [on for since, on in self.compensate if time >= since][-1]
        return enabled and time >= self.design["t_on"]


def input_signals(run):
    """The inputs for FMPy: two rows at each jump. `compensate` has a row only where it switches."""
    instants = sorted({*JUMPS, *(since for since, _ in run.compensate), STOP})
    names, rows = [("time", float), *((name, float) for name in run.inputs)], []
    for begin, end in zip(instants, instants[1:]):
        rows += [(time, *run.level(begin)) for time in (begin, end)]
    if len(run.compensate) > 1:
        names.append(("compensate", bool))
        on = [run._replace(design={"t_on": 0.0}).compensating(time) for time in instants]
        rows = [(*row, on[k // 2]) for k, row in enumerate(rows)]
    return np.array(rows, dtype=names)


def integrated(run, **options):
    """FMPy's result for model exchange, a row for each time."""
    result = simulate_fmu(
        str(run.fmu.folder),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=STOP,
        output_interval=run.step,
        relative_tolerance=TOLERANCE,
        record_events=False,
        input=input_signals(run),
        output=run.signals,
        start_values=run.start_values,
        **options,
    )
    assert result["time"] == pytest.approx(run.times, abs=1e-9)
    return np.array([result[name] for name in run.signals]).T


def stepped(run):
    """The result of co-simulation."""
    with Instance(run.fmu) as instance:
        instance.start(run.start_values)
        rows = [instance.get(*run.signals)]
        for time in run.times[:-1]:
            instance.set(dict(zip(run.inputs, run.level(time))))
            instance.set({"compensate": [on for t, on in run.compensate if time > t - 1e-9][-1]})
            instance.step(time, run.step)
            rows.append(instance.get(*run.signals))
    return np.array(rows)


def solved(run):
    """scipy's solution of the equations, piece by piece between the times of switches."""
    parameters, states = constants(run), run.states

    def at(z, y, on):
        values = parameters | dict(zip([*run.inputs, *states], [*y, *z]))
        return evaluated(values, run.design, (on, on or run.design["monitor"]))

    def right(_, z, y, on):
        values = at(z, y, on)
        return [values[f"der({name})"] for name in states]

    filtered = run.levels[0] if "filter" in run.design else []
    z, rows = np.array([*run.estimate, *filtered]), []
    instants = sorted({*JUMPS, *(since for since, _ in run.compensate), run.design["t_on"], STOP})
    for begin, end in zip(instants, instants[1:]):
        here = run.times[(run.times >= begin - 1e-9) & (run.times < end - 1e-9)].clip(begin)
        arguments = (run.level(begin), run.compensating(begin))
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": run.step}
        part = solve_ivp(right, (begin, end), z, t_eval=[*here, end], args=arguments, **options)
        assert part.success
        z = part.y[:, -1]
        rows += [at(row, *arguments) for row in part.y.T[: len(here)]]
    return np.array([[row[name] for name in run.signals] for row in [*rows, at(z, *arguments)]])


def constants(run):
    """Values of all parameters, and the names of the measurements under `inputs`."""
    names = run.fmu.names(type="Real", causality="parameter")
    with Instance(run.fmu) as instance:
        values = dict(zip(names, instance.start().get(*names)))
    return values | {"inputs": run.inputs}


def check(run):
    """Model exchange, co-simulation and scipy must agree; returns their result.

    Not compared when `compensate` switches, because co-simulation follows with the next step.
    """
    model_exchange, oracle, co_simulated = integrated(run), solved(run), stepped(run)
    allowed = FRACTION * np.ptp(oracle, axis=0)
    assert (allowed > 0).all()
    assert (abs(model_exchange - oracle) <= allowed).all()
    stays = ~np.isclose(run.times[:, None], [time for time, _ in run.compensate[1:]]).any(axis=1)
    assert (abs(co_simulated - oracle)[stays] <= allowed).all()
    assert (abs(model_exchange - co_simulated)[stays] <= allowed).all()
    return oracle


# Sizes, limits that some command reaches or leaves, extras of `random_design`.
CASES = [
    *((sizes, None, "") for sizes in SIZES),
    *((*case, "") for case in [((1, 1, 1, 1), [[-0.3, 0.6]]), *LIMITED[1:]]),
    ((2, 1, 2, 2), None, "a"),
    ((2, 2, 2, 1), None, "w"),
    ((3, 1, 1, 2), None, "o"),
    ((2, 2, 1, 2), None, "e"),
    ((3, 2, 1, 1), [None, [-1.5, 1.0]], "awoe"),
]


def random_run(controller, folder, sizes, limits, extras="", **general):
    """A run of a random design."""
    n, _, p, q = sizes
    design = random_design(sizes, limits, extras) | {"t_on": T_ON, **general}
    levels = np.random.default_rng(17).normal(size=(len(JUMPS), p))
    return Run(fmu_with(controller, design, folder), design, np.linspace(-1, 1.5, n + q), levels)


def shipped_run(controller, folder, limits=None, **options):
    """A run of the shipped controller, activated early, with limits or without."""
    design = shipped_design(controller) | {"t_on": T_ON}
    if limits:
        design["actuators"][0]["limits"] = limits
    fmu = redesigned(controller, design_text(design), folder / "fmu")
    levels = 1e-3 * np.random.default_rng(17).normal(size=(len(JUMPS), 2))
    return Run(fmu, design, np.zeros(5), levels, step=1e-3, **options)


def leaves_and_reaches(run, table):
    """Whether a command is at a limit at some times and between its limits at others."""
    commands = table[:, len(run.states) :][:, : len(run.limits)]
    at_limit = (commands == np.transpose(run.limits)[0]) | (commands == np.transpose(run.limits)[1])
    return np.diff(at_limit, axis=0).any()


@pytest.mark.parametrize("monitor", [False, True])
@pytest.mark.parametrize(("sizes", "limits", "extras"), CASES, ids=str)
def test_cvode_gives_the_results_of_co_simulation_and_of_scipy(
    controller, tmp_path, sizes, limits, extras, monitor
):
    run = random_run(controller, tmp_path, sizes, limits, extras, monitor=monitor)
    assert leaves_and_reaches(run, check(run)) == bool(limits)


def test_cvode_gives_the_same_results_for_the_shipped_controller(controller, tmp_path):
    check(shipped_run(controller, tmp_path))


def test_cvode_gives_the_same_results_for_the_shipped_controller_with_limits(controller, tmp_path):
    run = shipped_run(controller, tmp_path, limits=[-0.4, 0.3])
    assert leaves_and_reaches(run, check(run))


def test_compensate_takes_effect_at_the_events_at_which_it_changes(controller, tmp_path):
    switches = ((0.0, True), (0.55, False), (0.75, True))
    for sizes in SIZES[:3]:
        (tmp_path / str(sizes)).mkdir()
        run = random_run(controller, tmp_path / str(sizes), sizes, None)
        check(run._replace(compensate=switches))


@pytest.mark.parametrize("limits", [None, [[-1.0, 1.0], [-0.2, 4.0]]], ids=str)
def test_after_a_reset_the_results_have_the_same_bits(controller, tmp_path, limits):
    run = random_run(controller, tmp_path, (2, 2, 2, 2), limits)
    instance = instantiate_fmu(str(run.fmu.folder), run.fmu.description, "ModelExchange")
    first = integrated(run, fmu_instance=instance)
    instance.reset()
    assert (integrated(run, fmu_instance=instance) == first).all()
    instance.freeInstance()


def new_discrete_states(instance):
    """The content of the event info."""
    info = EventInfo()
    instance.must("NewDiscreteStates", byref(info))
    return info


def test_the_activation_is_a_time_event_while_it_is_pending_and_enabled(controller):
    with Instance(controller, kind=MODEL_EXCHANGE) as instance:
        instance.start({"t_on": T_ON})
        info = new_discrete_states(instance)
        assert (info.next_event_time_defined, info.next_event_time) == (1, T_ON)
        instance.set({"compensate": False})
        assert not new_discrete_states(instance).next_event_time_defined
        instance.set({"compensate": True})
        instance.must("EnterContinuousTimeMode")
        instance.must("SetTime", T_ON)
        instance.must("EnterEventMode")
        info = new_discrete_states(instance)
        unchanged = info.values_of_continuous_states_changed, info.new_discrete_states_needed
        assert (info.next_event_time_defined, *unchanged) == (0, 0, 0)


@pytest.mark.parametrize(("sizes", "limits"), LIMITED, ids=str)
def test_each_limited_command_has_two_indicators_that_are_never_zero_after_an_event(
    controller, tmp_path, sizes, limits
):
    run = random_run(controller, tmp_path, sizes, limits)
    count = 2 * sum(map(bool, limits))
    assert run.fmu.indicators == count
    values, states = reals(*[0.0] * count), len(run.states)
    with Instance(run.fmu, kind=MODEL_EXCHANGE) as instance:
        instance.start_exchange(run.start_values)
        for scale in np.linspace(-2, 2, 41):
            instance.must("SetContinuousStates", reals(*scale * run.estimate), states)
            instance.must("EnterEventMode")
            new_discrete_states(instance)
            instance.must("GetEventIndicators", values, count)
            commands = zip(instance.get(*run.signals)[states:], limits)
            expected = [[u > pair[0], u < pair[1]] for u, pair in commands if pair]
            assert [value > 0 for value in values] == list(np.ravel(expected))
            assert 0 not in list(values)
            instance.must("EnterContinuousTimeMode")
