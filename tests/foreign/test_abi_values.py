"""Values: when each variable can be set, which values are refused, and start values against the XML."""

import math

import pytest

from c_abi import DISCARD, ERROR, OK, Instance, integers, reals

NOT_FINITE = [math.nan, math.inf, -math.inf]
# Parameter, values that break its rule, words of the rule.
RULES = [
    ("M", [0.0, -3.2], "> 0"),
    ("m", [-0.1], ">= 0"),
    ("J", [0.0, -1.0, 0.01], "(M + m) J > (m l)^2"),
    ("l", [0.9], "(M + m) J > (m l)^2"),
    ("F_x", [-1e-9], ">= 0"),
    ("F_theta", [-1.0], ">= 0"),
    ("F_c", [-1.0], ">= 0"),
    ("F_s", [24.9, -30.0], ">= F_c"),
    ("v_s", [0.0, -0.15], "> 0"),
    ("delta", [0.0, -2.0], "> 0"),
]
BREACHES = [(name, value, rule) for name, values, rule in RULES for value in values]
TUNABLE = [breach for breach in BREACHES if breach[0] in ("F_c", "F_s", "v_s", "delta")]


def is_number(text):
    """Whether the text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def names_value(text, value):
    """Whether one of the words of `text` is the number `value`."""
    words = text.replace(",", " ").replace(":", " ").split()
    return any(is_number(word) and float(word) == value for word in words)


def test_start_values_equal_those_of_the_description(fmu):
    for entered in (True, False):
        with Instance(fmu) as instance:
            instance.enter() if entered else instance.start()
            variables = {name: v for name, v in fmu.variables.items() if v.start is not None}
            assert set(fmu.names(causality="parameter")) <= set(variables)
            for name, variable in variables.items():
                start = variable.start
                flag = (
                    {"true": 1.0, "false": 0.0}.get(start) if variable.type == "Boolean" else None
                )
                assert instance.get(name) == [float(start) if flag is None else flag], name


def test_every_parameter_and_input_keeps_a_value_set_before_the_start(fmu):
    with Instance(fmu) as instance:
        names = fmu.names(causality="parameter", type="Real") + fmu.names(
            causality="input", type="Real"
        )
        values = {name: float(fmu.variables[name].start) * 1.0078125 + 2**-20 for name in names}
        instance.start(values)
        assert dict(zip(names, instance.get(*names))) == values


@pytest.mark.parametrize("value", NOT_FINITE)
def test_numbers_that_are_not_finite_are_discarded_and_change_nothing(fmu, value):
    with Instance(fmu) as instance:
        instance.setup()
        names = fmu.names(causality="parameter", type="Real") + fmu.names(
            causality="input", type="Real"
        )
        for name in names:
            assert instance.set_one(name, value) == DISCARD
            assert instance.last_message().startswith(f"fmi2SetReal: {name} = ")
            assert instance.messages[-1].category == "logStatusDiscard"
        instance.start()
        assert instance.get(*names) == [float(fmu.variables[name].start) for name in names]


def test_a_discarded_number_discards_its_whole_call(plant):
    with Instance(plant) as instance:
        instance.enter()
        refused = instance.call("SetReal", plant.references("u", "f_a"), 2, reals(5, math.nan))
        assert refused == DISCARD and "f_a" in instance.last_message()
        assert instance.get("u", "f_a") == [0, 0]


@pytest.mark.parametrize("value", NOT_FINITE)
def test_input_derivatives_that_are_not_finite_are_an_error(fmu, value):
    """Section 2.1.3 does not list the function among those that may discard."""
    name = fmu.names(causality="input", type="Real")[0]
    with Instance(fmu) as instance:
        instance.start()
        arguments = (fmu.references(name), 1, integers(1), reals(value))
        assert instance.call("SetRealInputDerivatives", *arguments) == ERROR
        assert name in instance.last_message()


def same_reference(fmu, name):
    """The variable and its aliases, which have the same value reference."""
    variable = fmu.variables[name]
    alike = lambda v: (v.type, v.valueReference) == (variable.type, variable.valueReference)
    return [other.name for other in fmu.variables.values() if alike(other)]


def refused_in_each_phase(fmu, name, phases):
    """Sets the variable to zero in each phase; each time the error must name it."""
    for phase in phases:
        with Instance(fmu) as instance:
            if phase == "initialization mode":
                instance.enter()
            elif phase == "stepping":
                instance.start()
                instance.step(0.0, 0.001)
            assert instance.set_one(name, 0) == ERROR, (name, phase)
            message = instance.last_message()
            assert message.startswith("fmi2Set"), message
            assert any(alias in message for alias in same_reference(fmu, name)), message


PHASES = ["instantiated", "initialization mode", "stepping"]


def test_outputs_locals_and_time_can_never_be_set(fmu):
    for causality in ("output", "local", "independent"):
        for name in fmu.names(causality=causality):
            refused_in_each_phase(fmu, name, PHASES)


def test_fixed_parameters_cannot_be_set_during_the_run(fmu):
    fixed = fmu.names(causality="parameter", variability="fixed")
    assert len(fixed) > 10
    for name in fixed:
        refused_in_each_phase(fmu, name, PHASES[2:])


def test_tunable_parameters_and_inputs_can_be_set_during_the_run(plant):
    with Instance(plant) as instance:
        instance.start({"v_p_0": 0.4})
        before = instance.get("f_fric")
        instance.set({"F_c": 12.0, "F_s": 12.0, "u": 3.0})
        instance.step(0.0, 1e-6)
        assert instance.get("F_c", "F_s", "u") == [12, 12, 3]
        assert before[0] > 25 and instance.get("f_fric") == [12]


@pytest.mark.parametrize(("name", "value", "rule"), BREACHES)
def test_parameters_out_of_range_are_refused_before_the_start(plant, name, value, rule):
    with Instance(plant) as instance:
        instance.setup()
        if instance.set_one(name, value) == OK:
            assert instance.call("EnterInitializationMode") == ERROR
        assert len(instance.messages) == 1
        message = instance.last_message()
        assert rule in message
        blamed = "J" if name == "l" else name
        assert f"{blamed} = " in message
        assert name == "l" or names_value(message, value)


@pytest.mark.parametrize(("name", "value", "rule"), TUNABLE)
def test_tunable_parameters_out_of_range_are_refused_by_the_next_step(plant, name, value, rule):
    with Instance(plant) as instance:
        instance.start()
        instance.step(0.0, 0.001)
        state = instance.get("x_p", "theta", "v_p", "omega")
        if instance.set_one(name, value) == OK:
            assert instance.call("DoStep", 0.001, 0.001, 1) == ERROR
        assert len(instance.messages) == 1
        message = instance.last_message()
        assert f"{name} = " in message and names_value(message, value) and rule in message
        assert instance.get("x_p", "theta", "v_p", "omega") == state


def test_parameters_that_break_a_rule_only_between_two_calls_are_accepted(plant):
    with Instance(plant) as instance:
        instance.setup()
        instance.set({"F_c": 40.0})
        instance.set({"F_s": 41.0})
        instance.start()
        instance.set({"F_s": 30.0})
        instance.set({"F_c": 25.0})
        instance.step(0.0, 0.001)
        assert not instance.messages


def test_derivatives_are_only_for_inputs_and_outputs_with_an_order_of_at_least_one(plant):
    wrong = [
        ("SetRealInputDerivatives", "x_p", 1),
        ("SetRealInputDerivatives", "F_c", 1),
        ("SetRealInputDerivatives", "u", 0),
        ("SetRealInputDerivatives", "u", -1),
        ("SetRealInputDerivatives", "time", 1),
        ("GetRealOutputDerivatives", "u", 1),
        ("GetRealOutputDerivatives", "x_p", 0),
        ("GetRealOutputDerivatives", "x_p", 2),
        ("GetRealOutputDerivatives", "time", 1),
    ]
    for function, name, order in wrong:
        with Instance(plant) as instance:
            instance.start()
            arguments = (plant.references(name), 1, integers(order), reals(0))
            assert instance.call(function, *arguments) == ERROR, (function, name, order)
            assert name in instance.last_message() and function in instance.last_message()


def test_the_slope_of_the_state_is_its_derivative(plant):
    with Instance(plant) as instance:
        instance.start({"v_p_0": 0.5, "omega_0": 0.2, "u": 7.0})
        before, slope = (
            instance.get("x_p", "theta", "v_p", "omega"),
            instance.slopes_of("x_p", "theta", "v_p", "omega"),
        )
        instance.step(0.0, 1e-5)
        after, last = (
            instance.get("x_p", "theta", "v_p", "omega"),
            instance.slopes_of("x_p", "theta", "v_p", "omega"),
        )
    for start, end, first, second in zip(before, after, slope, last):
        assert (end - start) / 1e-5 == pytest.approx((first + second) / 2, rel=1e-6)
