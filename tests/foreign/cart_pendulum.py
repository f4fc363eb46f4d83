"""Friction-free cart with inverted pendulum, exported with PythonFMU.

Equation (20) of Patton and Klinkhieo (2009), corrected, with f_fric = 0. Uses the standard library
only, see lqr_controller.py.
"""

from math import ceil, cos, sin

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real

CART_MASS, PENDULUM_MASS = 3.2, 0.535  # kg
INERTIA, LENGTH = 0.062, 0.365  # kg m^2, m
CART_DAMPING, JOINT_DAMPING = 6.2, 0.009  # kg/s, kg m^2/s
GRAVITY = 9.807  # m/s^2
LARGEST_SUBSTEP = 5e-4  # s
OUTPUTS = {"x_p": ("m", 0.1), "theta": ("rad", -0.1), "v_p": ("m/s", 0.0), "omega": ("rad/s", 0.0)}


def derivative(state, force):
    """Time derivative of (x_p, theta, v_p, omega) under a force in N on the cart."""
    _, angle, velocity, rate = state
    arm = PENDULUM_MASS * LENGTH
    mass, coupling = CART_MASS + PENDULUM_MASS, arm * cos(angle)
    cart = force - CART_DAMPING * velocity + arm * rate * rate * sin(angle)
    joint = arm * GRAVITY * sin(angle) - JOINT_DAMPING * rate
    determinant = mass * INERTIA - coupling * coupling
    acceleration = (INERTIA * cart - coupling * joint) / determinant
    return velocity, rate, acceleration, (mass * joint - coupling * cart) / determinant


def moved(state, slope, step):
    """The state after a step of `step` seconds with the derivative `slope`."""
    return tuple(value + step * rate for value, rate in zip(state, slope))


def runge_kutta_step(state, force, step):
    """The state after one classical Runge-Kutta step of fourth order with a constant force."""
    first = derivative(state, force)
    second = derivative(moved(state, first, step / 2), force)
    third = derivative(moved(state, second, step / 2), force)
    fourth = derivative(moved(state, third, step), force)
    slopes = zip(first, second, third, fourth)
    return moved(state, [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in slopes], step)


class CartPendulum(Fmi2Slave):
    """Input u, outputs x_p, theta, v_p, omega; the force is held over a communication step."""

    description = "Friction-free cart with inverted pendulum"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 0.0
        text = "force on the cart in N"
        self.register_variable(Real("u", causality=Fmi2Causality.input, description=text))
        for name, (unit, start) in OUTPUTS.items():
            self.declare_output(name, unit, start)

    def declare_output(self, name, unit, start):
        """Adds one state as an output whose initial value may be set."""
        setattr(self, name, start)
        self.register_variable(
            Real(
                name,
                causality=Fmi2Causality.output,
                variability=Fmi2Variability.continuous,
                initial=Fmi2Initial.exact,
                description=f"{name} in {unit}",
            )
        )

    def do_step(self, current_time, step_size):
        """Integrates over the communication step."""
        count = max(1, ceil(step_size / LARGEST_SUBSTEP - 1e-9))
        state = tuple(getattr(self, name) for name in OUTPUTS)
        for _ in range(count):
            state = runge_kutta_step(state, self.u, step_size / count)
        for name, value in zip(OUTPUTS, state):
            setattr(self, name, value)
        return True
