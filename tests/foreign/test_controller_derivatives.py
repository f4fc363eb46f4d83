"""Directional derivatives and ModelStructure of the controller, against complex steps.

The equations stand here once more, by the names of the variables, for complex numbers: the
imaginary part of f(x + 1e-30 i v) / 1e-30 is the derivative along v to the last digit.
"""

import numpy as np
import pytest

from c_abi import CO_SIMULATION, MODEL_EXCHANGE, Instance
from observer_oracle import element_name
from test_designs import LIMITED, SIZES, made, random_design, vector

STEP = 1e-30
T_ON = 0.25
SHIPPED = (4, 1, 2, 1)
KINDS = {"co-simulation": CO_SIMULATION, "model exchange": MODEL_EXCHANGE}
# Time, compensate, monitor: what decides which equations are in force.
SWITCHES = [(0.0, True, False), (0.5, True, False), (0.0, True, True), (0.5, False, False)]


def limited(values, j, command, count):
    """The command of channel j within its limits, where it has any."""
    low, high = (values.get(vector(name, count)[j]) for name in ("u_min", "u_max"))
    if low is None:
        return command
    below, above = command.real < low.real, command.real > high.real
    return low if below else high if above else command


def evaluated(values, sizes, switches, start=False):
    """All unknowns by name, from the values of all knowns by name."""
    n, m, p, q = sizes
    time, compensate, monitor = switches
    compensating = compensate and time >= T_ON
    estimating = compensating or monitor
    take = lambda names: np.array([values[name] for name in names])
    block = lambda name, rows, columns: take(
        [element_name(name, i, j) for i in range(rows) for j in range(columns)]
    ).reshape(rows, columns)
    x_hat = take(vector("x_hat_0" if start else "x_hat", n))
    f_hat = take(vector("f_hat_0" if start else "f_hat", q))
    free = block("K_x", m, n) @ x_hat + compensating * (block("K_f", m, q) @ f_hat)
    u = np.array([limited(values, j, command, m) for j, command in enumerate(free)])
    innovation = take(values["inputs"]) - block("C", p, n) @ x_hat
    slopes = block("A", n, n) @ x_hat + block("B", n, m) @ u + block("F_a", n, q) @ f_hat
    slopes = slopes + block("L_x", n, p) @ innovation
    fault_slopes = estimating * (block("L_f", q, p) @ innovation)
    estimates = vector("x_hat", n) + vector("f_hat", q)
    derivatives = [f"der({name})" for name in estimates]
    names = [*vector("u", m), *estimates, *derivatives]
    return dict(zip(names, [*u, *x_hat, *f_hat, *slopes, *fault_slopes]))


def rounding(values, direction, sizes, start):
    """What rounding may do to the derivatives, by name: 1e-13 of all terms, each taken positive."""
    size = {"inputs": values["inputs"]}
    for name, value in values.items():
        if name != "inputs" and not name.startswith(("u_min", "u_max")):
            sign = -1 if name.startswith("C[") else 1
            size[name] = sign * (abs(value) + abs(direction.get(name, 0.0)))
    terms = evaluated(size, sizes, (1.0, True, True), start)
    return {name: 1e-13 * (1 + value) for name, value in terms.items()}


def check(instance, unknowns, direction, sizes, switches, start=False):
    """The directional derivative is the complex step along that direction."""
    values = present_values(instance)
    moved = {name: values[name] + 1j * STEP * along for name, along in direction.items()}
    wanted = evaluated({**values, **moved}, sizes, switches, start)
    allowed = rounding(values, direction, sizes, start)
    for name, value in instance.directional(unknowns, direction).items():
        assert abs(value - np.imag(wanted[name]) / STEP) <= allowed[name], name


def real_names(fmu, **attributes):
    """Names of the Real variables with these attributes."""
    return fmu.names(type="Real", **attributes)


def present_values(instance):
    """Values of all Real variables by name, the names of the measurements under `inputs`."""
    names = real_names(instance.fmu)
    inputs = real_names(instance.fmu, causality="input")
    return {**dict(zip(names, instance.get(*names))), "inputs": inputs}


def designs(controller, folder):
    """FMUs of many sizes with their sizes: the shipped one, others without and with limits."""
    yield controller, SHIPPED
    cases = [(sizes, None) for sizes in SIZES] + LIMITED + [((2, 2, 2, 2), [[-9.0, 9.0]] * 2)]
    for k, (sizes, limits) in enumerate(cases):
        (folder / str(k)).mkdir()
        yield made(controller, random_design(sizes, limits), folder / str(k)), sizes


@pytest.fixture(scope="module")
def fmus(controller, tmp_path_factory):
    """All FMUs of these tests with their sizes."""
    return list(designs(controller, tmp_path_factory.mktemp("designs")))


def starts(fmu, sizes, switches):
    """Values to start with."""
    n, _, p, q = sizes
    _, compensate, monitor = switches
    names = vector("x_hat_0", n) + vector("f_hat_0", q) + real_names(fmu, causality="input")
    values = np.random.default_rng(11).normal(size=n + q + p)
    given = dict(zip(names, map(float, values)))
    return {**given, "t_on": T_ON, "compensate": compensate, "monitor": monitor}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("switches", SWITCHES, ids=str)
def test_at_initialization_they_are_exact_by_every_known(fmus, switches, kind):
    for fmu, sizes in fmus:
        knowns = real_names(fmu, initial="exact") + real_names(fmu, causality="input")
        unknowns = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
        seed = np.random.default_rng(3).normal(size=len(knowns))
        with Instance(fmu, kind=KINDS[kind]) as instance:
            instance.enter(starts(fmu, sizes, switches), start=switches[0])
            assert "t_on" in knowns and len(unknowns) == sizes[1] + 2 * (sizes[0] + sizes[3])
            for along in [{name: 1.0} for name in knowns] + [dict(zip(knowns, seed))]:
                check(instance, unknowns, along, sizes, switches, start=True)


def at_a_point(instance, fmu, sizes, switches):
    """Takes the instance to a point of its run; the equations that are in force there."""
    time, compensate, monitor = switches
    if instance.kind == CO_SIMULATION:
        instance.start(starts(fmu, sizes, switches), start=time)
        instance.step(time, 2e-4)
        instance.set({name: 0.3 - k for k, name in enumerate(real_names(fmu, causality="input"))})
        return time + 2e-4, compensate, monitor
    instance.start_exchange(starts(fmu, sizes, switches), start=time)
    instance.must("SetTime", time + 0.01)
    return time + 0.01, compensate, monitor


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("switches", SWITCHES, ids=str)
def test_during_the_run_they_are_exact_by_every_input_and_state(fmus, switches, kind):
    for fmu, sizes in fmus:
        states = [unknown.variable.derivative.name for unknown in fmu.description.derivatives]
        unknowns = [u.variable.name for u in fmu.description.outputs + fmu.description.derivatives]
        knowns = states + real_names(fmu, causality="input")
        seed = np.random.default_rng(3).normal(size=len(knowns))
        with Instance(fmu, kind=KINDS[kind]) as instance:
            point = at_a_point(instance, fmu, sizes, switches)
            for along in [{name: 1.0} for name in knowns] + [dict(zip(knowns, seed))]:
                check(instance, unknowns, along, sizes, point)
            time = instance.directional(unknowns, {"time": 1.0})
            assert set(time.values()) == {0.0}


def test_these_tests_meet_commands_at_both_limits_and_between(fmus):
    met = set()
    for fmu, sizes in fmus:
        for switches in SWITCHES:
            with Instance(fmu, kind=MODEL_EXCHANGE) as instance:
                at_a_point(instance, fmu, sizes, switches)
                values = present_values(instance)
            for j, name in enumerate(vector("u", sizes[1])):
                low, high = (vector(side, sizes[1])[j] for side in ("u_min", "u_max"))
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


def factors(fmu, sizes, parameters):
    """Each entry of the Jacobian in one situation after the other."""
    found = []
    for time, compensate, monitor in SWITCHES:
        for limit in (-1e6, 0.0, 1e6):
            limits = {
                name: limit + (name.startswith("u_max") or -1) * 5e5
                for name in fmu.names(variability="tunable")
            }
            values = starts(fmu, sizes, (time, compensate, monitor)) | limits | parameters
            with Instance(fmu, kind=MODEL_EXCHANGE) as instance:
                instance.start_exchange(values, start=time)
                found.append(jacobian(instance, fmu))
    return {pair: [each[pair] for each in found] for pair in found[0]}


def kind_of(own, other, cut_off):
    """The kind that factors show, with one set of parameters and with another one; with a limit
    that may cut the unknown off or without."""
    if not any(own):
        return None
    if len(set(own)) > 1:
        return "dependent" if cut_off else "discrete"
    return "constant" if own == other else "fixed"


def listed_kinds(fmu):
    """Kinds of dependencies by the names of both variables, as the description states them."""
    found = {}
    for unknown in fmu.description.outputs + fmu.description.derivatives:
        kinds = unknown.dependenciesKind or ["dependent"] * len(unknown.dependencies)
        for known, kind in zip(unknown.dependencies, kinds, strict=True):
            found[unknown.variable.name, known.name] = kind
    return found


def test_outputs_and_derivatives_depend_on_what_is_listed_in_the_way_listed(fmus):
    for fmu, sizes in fmus:
        n, m, _, _ = sizes
        matrices = {name: "," in name and 0.5 + k for k, name in enumerate(fmu.variables)}
        first = {name: value for name, value in matrices.items() if value}
        second = {name: value + 0.125 for name, value in first.items()}
        own, other = factors(fmu, sizes, first), factors(fmu, sizes, second)
        cut_off = {
            unknown
            for name, unknown in zip(vector("u_min", m), vector("u", m))
            if name in fmu.variables
        }
        if cut_off:
            cut_off |= {f"der({name})" for name in vector("x_hat", n)}
        found = {pair: kind_of(own[pair], other[pair], pair[0] in cut_off) for pair in own}
        assert {pair: kind for pair, kind in found.items() if kind} == listed_kinds(fmu)


def test_each_initial_value_depends_on_the_listed_variables_and_on_no_other(fmus):
    for fmu, sizes in fmus:
        unknowns = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
        full = {name: 0.5 + k / 64 for k, name in enumerate(fmu.variables) if "," in name}
        found = {unknown: set() for unknown in unknowns}
        for switches in SWITCHES:
            for limit in (-1e4, 0.0, 1e4):
                for unknown, known in initial_influences(fmu, sizes, switches, limit, full):
                    found[unknown].add(known)
        listed = {
            unknown.variable.name: {variable.name for variable in unknown.dependencies}
            for unknown in fmu.description.initialUnknowns
        }
        assert found == listed


def initial_influences(fmu, sizes, switches, limit, parameters):
    """Pairs of an initial unknown and a known that changes it."""
    unknowns = [unknown.variable.name for unknown in fmu.description.initialUnknowns]
    limits = {
        name: limit + (name.startswith("u_max") or -1) * 5e3
        for name in fmu.names(variability="tunable")
    }
    with Instance(fmu) as instance:
        base = starts(fmu, sizes, switches) | limits | parameters
        instance.enter(base, start=switches[0])
        before = instance.get(*unknowns)
        for known, value in base.items():
            change = not value if isinstance(value, bool) else value + 1.0
            change = 1.0 - value if known == "t_on" else change
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
