"""Directional derivatives and ModelStructure of the controller, against complex steps."""

import numpy as np
import pytest

from c_abi import CO_SIMULATION, MODEL_EXCHANGE, Instance
from design_file import shipped_design, vector
from named_equations import evaluated, losses, rounding, size_of
from test_designs import LIMITED, SIZES, fmu_with, random_design

STEP = 1e-30
T_ON = 0.25
KINDS = {"co-simulation": CO_SIMULATION, "model exchange": MODEL_EXCHANGE}
# Time, compensate, monitor: they decide which equations apply.
SWITCHES = [(0.0, True, False), (0.5, True, False), (0.0, True, True), (0.5, False, False)]
WIDE = [-9.0, 9.0]
# Sizes, limits and extras of `random_design`.
EXTENDED = [
    ((2, 1, 2, 2), None, "a"),
    ((2, 2, 2, 1), None, "w"),
    ((3, 1, 1, 2), None, "o"),
    ((2, 2, 1, 2), None, "e"),
    ((3, 2, 2, 3), [None, [-1.0, 1.5]], "awoe"),
    ((2, 2, 2, 2), [WIDE, WIDE], "coe"),
    ((3, 2, 1, 2), [WIDE, None], "cawe"),
    ((1, 1, 1, 1), None, "pawoe"),
    ((2, 2, 2, 1), [None, WIDE], "po"),
]


def check(instance, unknowns, direction, switches, start=False):
    """Checks that the directional derivative equals the complex step along the direction."""
    design, values = instance.fmu.design, present_values(instance)
    time, compensate, monitor = switches
    compensating = compensate and time >= T_ON
    on = (compensating, compensating or monitor)
    allowed = rounding(values, direction, design, start)
    if "sample_time" in design and not start:
        expected = dict.fromkeys(unknowns, 0.0)
    else:
        moved = {name: values[name] + 1j * STEP * along for name, along in direction.items()}
        expected = evaluated({**values, **moved}, design, on, start)
    for name, value in instance.directional(unknowns, direction).items():
        assert abs(value - np.imag(expected[name]) / STEP) <= allowed[name], name


def real_names(fmu, **attributes):
    """Names of the Real variables with these attributes."""
    return fmu.names(type="Real", **attributes)


def present_values(instance):
    """Values of all Real variables by name; `inputs` has the names of the measurements."""
    names = real_names(instance.fmu)
    inputs = real_names(instance.fmu, causality="input")
    return {**dict(zip(names, instance.get(*names))), "inputs": inputs}


def designs(controller, folder):
    """FMUs of many designs: the shipped one, others without and with limits and extras."""
    controller.design = shipped_design(controller)
    yield controller
    cases = [(sizes, None) for sizes in SIZES] + LIMITED + [((2, 2, 2, 2), [WIDE] * 2)]
    for k, case in enumerate(cases + EXTENDED):
        (folder / str(k)).mkdir()
        yield fmu_with(controller, random_design(*case), folder / str(k))


@pytest.fixture(scope="module")
def fmus(controller, tmp_path_factory):
    """All FMUs of these tests."""
    return list(designs(controller, tmp_path_factory.mktemp("designs")))


def starts(fmu, switches):
    """Start values."""
    n, _, p, q = size_of(fmu.design)
    _, compensate, monitor = switches
    names = vector("x_hat_0", n) + vector("f_hat_0", q) + real_names(fmu, causality="input")
    values = np.random.default_rng(11).normal(size=n + q + p)
    initial = dict(zip(names, map(float, values)))
    return {**initial, "t_on": T_ON, "compensate": compensate, "monitor": monitor}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("switches", SWITCHES, ids=str)
def test_at_initialization_they_are_exact_for_every_known(fmus, switches, kind):
    for fmu in fmus:
        knowns = real_names(fmu, causality="parameter") + real_names(fmu, causality="input")
        unknowns = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
        seed = np.random.default_rng(3).normal(size=len(knowns))
        with Instance(fmu, kind=KINDS[kind]) as instance:
            instance.enter(starts(fmu, switches), start=switches[0])
            outputs = len(fmu.description.outputs)
            assert "t_on" in knowns and len(unknowns) == outputs + fmu.states
            for along in [{name: 1.0} for name in knowns] + [dict(zip(knowns, seed))]:
                check(instance, unknowns, along, switches, start=True)


def at_a_point(instance, fmu, switches):
    """Steps the instance to a point of its run; returns the equations that apply there."""
    time, compensate, monitor = switches
    if instance.kind == CO_SIMULATION:
        instance.start(starts(fmu, switches), start=time)
        instance.step(time, 2e-4)
        instance.set({name: 0.3 - k for k, name in enumerate(real_names(fmu, causality="input"))})
        return time + 2e-4, compensate, monitor
    instance.start_exchange(starts(fmu, switches), start=time)
    instance.must("SetTime", time + 0.01)
    return time + 0.01, compensate, monitor


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("switches", SWITCHES, ids=str)
def test_during_the_run_they_are_exact_for_every_input_and_state(fmus, switches, kind):
    for fmu in fmus:
        states = [unknown.variable.derivative.name for unknown in fmu.description.derivatives]
        unknowns = [u.variable.name for u in fmu.description.outputs + fmu.description.derivatives]
        knowns = states + real_names(fmu, causality="input")
        seed = np.random.default_rng(3).normal(size=len(knowns))
        with Instance(fmu, kind=KINDS[kind]) as instance:
            point = at_a_point(instance, fmu, switches)
            for along in [{name: 1.0} for name in knowns] + [dict(zip(knowns, seed))]:
                check(instance, unknowns, along, point)
            time = instance.directional(unknowns, {"time": 1.0})
            assert set(time.values()) == {0.0}


def test_these_tests_cover_commands_at_both_limits_and_between(fmus):
    met = set()
    for fmu in fmus:
        for switches in SWITCHES:
            with Instance(fmu, kind=MODEL_EXCHANGE) as instance:
                at_a_point(instance, fmu, switches)
                values = present_values(instance)
            for j, name in enumerate(vector("u", size_of(fmu.design)[1])):
                low, high = (vector(side, size_of(fmu.design)[1])[j] for side in ("u_min", "u_max"))
                if low in values:
                    met.add((values[name] > values[low]) + (values[name] >= values[high]))
    assert met == {0, 1, 2}


def jacobian(instance, fmu):
    """Derivatives of outputs and state derivatives by inputs and states: entries by two names."""
    unknowns = [u.variable.name for u in fmu.description.outputs + fmu.description.derivatives]
    states = [unknown.variable.derivative.name for unknown in fmu.description.derivatives]
    return {
        (unknown, known): value
        for known in states + real_names(fmu, causality="input")
        for unknown, value in instance.directional(unknowns, {known: 1.0}).items()
    }


def factors(fmu, parameters):
    """Each entry of the Jacobian in several situations."""
    jacobians = []
    for time, compensate, monitor in SWITCHES:
        for limit in (-1e6, 0.0, 1e6):
            limits = {
                name: limit + (name.startswith("u_max") or -1) * 5e5
                for name in fmu.names(variability="tunable")
            }
            values = starts(fmu, (time, compensate, monitor)) | limits | parameters
            with Instance(fmu, kind=MODEL_EXCHANGE) as instance:
                instance.start_exchange(values, start=time)
                jacobians.append(jacobian(instance, fmu))
    return {pair: [each[pair] for each in jacobians] for pair in jacobians[0]}


def kind_of(entries, other, cut_off):
    """The kind of a dependency, from its factors with two sets of parameters, for an unknown with or
    without limits."""
    if not any(entries):
        return None
    if len(set(entries)) > 1:
        return "dependent" if cut_off else "discrete"
    return "constant" if entries == other else "fixed"


def listed_kinds(fmu):
    """Kinds of dependencies by the names of both variables, from the description."""
    dependencies = {}
    for unknown in fmu.description.outputs + fmu.description.derivatives:
        kinds = unknown.dependenciesKind or ["dependent"] * len(unknown.dependencies)
        for known, kind in zip(unknown.dependencies, kinds, strict=True):
            dependencies[unknown.variable.name, known.name] = kind
    return dependencies


def test_outputs_and_derivatives_have_exactly_the_listed_dependencies_with_their_kinds(fmus):
    for fmu in fmus:
        n, m, _, _ = size_of(fmu.design)
        matrices = {name: 0.5 + k for k, name in enumerate(fmu.variables) if "," in name}
        filters = {name: 0.5 for name in fmu.variables if name.startswith("filter")}
        first = matrices | filters
        second = {name: value + 0.125 for name, value in first.items()}
        entries, other = factors(fmu, first), factors(fmu, second)
        cut_off = {
            unknown
            for name, unknown in zip(vector("u_min", m), vector("u", m))
            if name in fmu.variables
        }
        if cut_off:
            cut_off |= {f"der({name})" for name in vector("x_hat", n)}
        cut_off |= {name for name, *_ in losses(fmu.design)}
        kinds = {pair: kind_of(entries[pair], other[pair], pair[0] in cut_off) for pair in entries}
        assert {pair: kind for pair, kind in kinds.items() if kind} == listed_kinds(fmu)


def test_each_initial_value_depends_on_exactly_the_listed_variables(fmus):
    for fmu in fmus:
        unknowns = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
        full = {name: 0.5 + k / 64 for k, name in enumerate(fmu.variables) if "," in name}
        free = ("filter", "x_op", "u_op", "y_op")
        full |= {name: 0.4 for name in fmu.variables if name.startswith(free)}
        influences = {unknown: set() for unknown in unknowns}
        for switches in SWITCHES:
            for limit in (-1e4, 0.0, 1e4):
                for unknown, known in initial_influences(fmu, switches, limit, full):
                    influences[unknown].add(known)
        listed = {
            unknown.variable.name: {variable.name for variable in unknown.dependencies}
            for unknown in fmu.description.initialUnknowns
        }
        assert influences == listed


def initial_influences(fmu, switches, limit, parameters):
    """Pairs of an initial unknown and a known that changes it."""
    unknowns = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
    limits = {
        name: limit + (name.startswith("u_max") or -1) * 5e3
        for name in fmu.names(variability="tunable")
    }
    with Instance(fmu) as instance:
        base = starts(fmu, switches) | limits | parameters
        instance.enter(base, start=switches[0])
        before = instance.get(*unknowns)
        for known, value in base.items():
            change = not value if isinstance(value, bool) else value + 1.0
            change = 1.0 - value if known == "t_on" or known.startswith("filter") else change
            instance.set({known: change})
            after = instance.get(*unknowns)
            instance.set({known: value})
            yield from ((u, known) for u, a, b in zip(unknowns, after, before) if a != b)
    with Instance(fmu) as instance:
        instance.enter(base, start=0.5 - switches[0])
        after = instance.get(*unknowns)
        yield from ((u, "time") for u, a, b in zip(unknowns, after, before) if a != b)


def test_the_derivatives_of_the_estimates_are_listed_with_their_units(controller):
    units = {}
    for unknown in controller.description.derivatives:
        variable = unknown.variable
        assert variable.name == f"der({variable.derivative.name})"
        assert (variable.causality, variable.variability) == ("local", "continuous")
        units[variable.derivative.name] = variable.derivative.unit, variable.unit
    assert units == {
        "x_hat[1]": ("m", "m/s"),
        "x_hat[2]": ("rad", "rad/s"),
        "x_hat[3]": ("m/s", "m/s2"),
        "x_hat[4]": ("rad/s", "rad/s2"),
        "f_hat": ("N", "N/s"),
    }
