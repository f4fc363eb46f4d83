"""The equations of the friction pendulum for complex numbers, by the names of the variables.

The imaginary part of f(x + 1e-30 i v) / 1e-30 is the derivative along v to the last digit.
"""

import numpy as np

STATES = ["x_p", "theta", "v_p", "omega"]
DERIVATIVES = [f"der({name})" for name in STATES]


def trigonometry(values, angle, rate):
    """Sine, cosine and centrifugal term of the rigid body, linearised or not."""
    if values["linearised"]:
        return angle, 1.0, 0.0
    return np.sin(angle), np.cos(angle), rate**2 * np.sin(angle)


def held(values, angle, rate):
    """Friction and angular acceleration while the cart is held."""
    sine, cosine, centrifugal = trigonometry(values, angle, rate)
    moment = values["m"] * values["l"]
    turn = (moment * values["g"] * sine - values["F_theta"] * rate) / values["J"]
    needed = values["u"] + values["f_a"] - moment * (turn * cosine - centrifugal)
    limit = values["F_s"]
    return (limit * np.sign(needed.real) if abs(needed.real) > limit.real else needed), turn


def sliding(values, direction, angle, velocity, rate):
    """Friction and both accelerations while the cart slides in a direction."""
    sine, cosine, centrifugal = trigonometry(values, angle, rate)
    moment = values["m"] * values["l"]
    fall = np.exp(-((direction * velocity / values["v_s"]) ** values["delta"]))
    friction = direction * (values["F_c"] + (values["F_s"] - values["F_c"]) * fall)
    mass = [[values["M"] + values["m"], moment * cosine], [moment * cosine, values["J"]]]
    force = values["u"] + values["f_a"] - friction - values["F_x"] * velocity
    load = [
        force + moment * centrifugal,
        moment * values["g"] * sine - values["F_theta"] * rate,
    ]
    return friction, *np.linalg.solve(np.array(mass, complex), np.array(load, complex))


def evaluated(values, regime, start=False):
    """All unknowns by name, from the values of all knowns by name."""
    values = {name: np.complex128(value) for name, value in values.items()}
    state = [values[f"{name}_0" if start else name] for name in STATES]
    _, angle, velocity, rate = state
    if regime:
        friction, acceleration, turn = sliding(values, regime, angle, velocity, rate)
    else:
        (friction, turn), acceleration = held(values, angle, rate), 0.0
    slope = [velocity, rate, acceleration, turn]
    return dict(zip([*STATES, "f_fric", *DERIVATIVES], [*state, friction, *slope]))
