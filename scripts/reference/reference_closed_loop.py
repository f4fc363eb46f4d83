"""Integrates the closed loop as one hybrid equation with scipy and writes the reference CSV files.

The friction pendulum (equations (20) and (21) of Patton and Klinkhieo, 2009, repaired, with
set-valued friction) and the augmented state observer controller are one ordinary differential
equation between the transitions of the friction and the activation of the compensation. Nothing
of the Rust code takes part: this is the independent integration the co-simulation is held against.

The cart creeps to rest exponentially, and rounding decides what it does once its velocity is down
to some 1e-27 m/s (7.7 s without compensation, 10 s with it): the integration refuses to go on.

Usage: python scripts/reference/reference_closed_loop.py [--design FILE] [--out FOLDER]
"""

import argparse
import tomllib
from pathlib import Path

import numpy as np
import scipy
from scipy.integrate import DOP853, LSODA
from scipy.optimize import brentq

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = "t x_p theta v_p omega f_fric u f_hat x_hat1 x_hat2 x_hat3 x_hat4".split()
INITIAL_PLANT_STATE = [0.1, -0.1, 0.0, 0.0]
ROW_INTERVAL = 0.01
STICK, FORWARD, BACKWARD = 0, 1, -1
UNDECIDED_FORCE = 1e-6  # N: closer to the static friction, rounding chooses slip or stick

# file name: (activation time of the compensation in s, stop time in s)
SCENARIOS = {"closed_loop_paper.csv": (40.0, 7.0), "closed_loop_compensated.csv": (1.0, 5.0)}
# The first setting is written to the file, the others show how accurate it is:
# (solver, relative tolerance, absolute tolerance, largest step in s)
SETTINGS = [
    (DOP853, 1e-12, 1e-13, 2.5e-4),
    (DOP853, 1e-10, 1e-11, 1e-3),
    (LSODA, 1e-12, 1e-13, 1e-3),
]


class Pendulum:
    """Cart with inverted pendulum and Stribeck friction; state x_p, theta, v_p, omega in SI."""

    cart_mass, pendulum_mass, inertia, length = 3.2, 0.535, 0.062, 0.365
    cart_damping, joint_damping, gravity = 6.2, 0.009, 9.807
    coulomb, static, stribeck_velocity, shape = 25.0, 30.0, 0.15, 2.0

    def generalised_forces(self, state, force):
        """Right sides of (20) in N and N m without friction, and the coupling m l cos(theta)."""
        _, angle, velocity, rate = state
        arm = self.pendulum_mass * self.length
        cart = force - self.cart_damping * velocity + arm * rate**2 * np.sin(angle)
        joint = arm * self.gravity * np.sin(angle) - self.joint_damping * rate
        return cart, joint, arm * np.cos(angle)

    def holding_friction(self, state, force):
        """Friction in N that keeps the cart's acceleration at zero."""
        cart, joint, coupling = self.generalised_forces(state, force)
        return cart - coupling * joint / self.inertia

    def friction(self, state, force, regime):
        """Friction in N: (21) while sliding, the balancing force while sticking."""
        if regime == STICK:
            return self.holding_friction(state, force)
        fading = np.exp(-((abs(state[2]) / self.stribeck_velocity) ** self.shape))
        return regime * (self.coulomb + (self.static - self.coulomb) * fading)

    def derivative(self, state, force, regime):
        """Time derivative of the state; a sticking cart has neither velocity nor acceleration."""
        cart, joint, coupling = self.generalised_forces(state, force)
        if regime == STICK:
            return np.array([0.0, state[3], 0.0, joint / self.inertia])
        cart -= self.friction(state, force, regime)
        mass = self.cart_mass + self.pendulum_mass
        determinant = mass * self.inertia - coupling**2
        acceleration = (self.inertia * cart - coupling * joint) / determinant
        angular_acceleration = (mass * joint - coupling * cart) / determinant
        return np.array([state[2], state[3], acceleration, angular_acceleration])


class Controller:
    """The controller of (2), (4), (5), (18) as d/dt [x_hat; f_hat] = Z [x_hat; f_hat] + N y."""

    def __init__(self, design):
        matrices = {name: np.array(design[name], dtype=float) for name in MATRIX_NAMES}
        a, b, c, f_a, k_x, k_f, l_x, l_f = (matrices[name] for name in MATRIX_NAMES)
        states, measurements, faults = len(a), len(c), len(l_f)
        self.measured = c
        held = np.zeros((faults, states + faults))
        nominal = a + b @ k_x - l_x @ c
        integral = np.hstack([-l_f @ c, np.zeros((faults, faults))])
        self.gain = {False: np.hstack([k_x, 0 * k_f]), True: np.hstack([k_x, k_f])}
        self.dynamics = {
            False: np.vstack([np.hstack([nominal, f_a]), held]),
            True: np.vstack([np.hstack([nominal, f_a + b @ k_f]), integral]),
        }
        self.injection = {
            False: np.vstack([l_x, np.zeros((faults, measurements))]),
            True: np.vstack([l_x, l_f]),
        }

    def force(self, estimate, compensating):
        """The actuator command u in N."""
        return (self.gain[compensating] @ estimate)[0]

    def derivative(self, estimate, plant_state, compensating):
        """Time derivative of [x_hat; f_hat]."""
        measurement = self.measured @ plant_state
        return self.dynamics[compensating] @ estimate + self.injection[compensating] @ measurement


MATRIX_NAMES = "A B C F_a K_x K_f L_x L_f".split()


class ClosedLoop:
    """Plant and controller in one regime at a time; state is [x; x_hat; f_hat]."""

    def __init__(self, design):
        self.plant, self.controller = Pendulum(), Controller(design)
        self.regime, self.compensating = STICK, False

    def force(self, state):
        """The actuator command u in N."""
        return self.controller.force(state[4:], self.compensating)

    def derivative(self, _time, state):
        """Right side of the differential equation in the present regime."""
        plant = self.plant.derivative(state[:4], self.force(state), self.regime)
        estimate = self.controller.derivative(state[4:], state[:4], self.compensating)
        return np.concatenate([plant, estimate])

    def margin(self, state):
        """Distance to the end of the present regime: negative once it is left."""
        if self.regime == STICK:
            needed = self.plant.holding_friction(state[:4], self.force(state))
            return self.plant.static - abs(needed)
        return self.regime * state[2]

    def choose_regime(self, state):
        """Decides what a cart at rest does, and sets the rest of its velocity in `state` to zero."""
        needed = self.plant.holding_friction(state[:4], self.force(state))
        static = self.plant.static
        released = self.regime == STICK and self.margin(state) < 0.0
        if not released and abs(abs(needed) - static) < UNDECIDED_FORCE:
            raise RuntimeError(f"the cart creeps to rest: holding it takes {needed} N")
        state[2] = 0.0
        if released or abs(needed) > static:
            self.regime = FORWARD if needed > 0.0 else BACKWARD
        else:
            self.regime = STICK

    def row(self, time, state):
        """One line of the file."""
        force = self.force(state)
        friction = self.plant.friction(state[:4], force, self.regime)
        return [time, *state[:4], friction, force, state[8], *state[4:8]]


def first_exit(loop, dense, start, end):
    """First time in (start, end] where the regime's margin is negative, or None.

    The margin is sampled at eight points of the step, so that a short excursion is seen too.
    """
    times = np.linspace(start, end, 9)
    for before, after in zip(times[:-1], times[1:]):
        if loop.margin(dense(after)) >= 0.0:
            continue
        if before == start and loop.margin(dense(before)) <= 0.0:
            raise RuntimeError(f"the friction chatters at t = {start} s")
        root = brentq(lambda t: loop.margin(dense(t)), before, after, xtol=1e-15, rtol=1e-15)
        beyond = np.spacing(root)
        while loop.margin(dense(root)) >= 0.0:
            root, beyond = min(root + beyond, after), 2 * beyond
        return root
    return None


class Trajectory:
    """Rows every `ROW_INTERVAL` and the times of the jumps of the friction force."""

    def __init__(self):
        self.rows, self.transitions, self.jumps = [], 0, []

    def fill(self, loop, dense, end):
        """Adds the rows that are due up to `end`."""
        while (time := len(self.rows) * ROW_INTERVAL) <= end:
            self.rows.append(loop.row(time, dense(time)))


def advance(loop, state, span, setting, trajectory):
    """Integrates to the end of the regime or of the span.

    Returns time and state there, and whether the regime was left.
    """
    solver_class, rtol, atol, max_step = setting
    options = {"rtol": rtol, "atol": atol, "max_step": max_step}
    solver = solver_class(loop.derivative, span[0], state, span[1], **options)
    while solver.status == "running":
        if (message := solver.step()) is not None:
            raise RuntimeError(f"{solver_class.__name__} at t = {solver.t} s: {message}")
        dense = solver.dense_output()
        exit_time = first_exit(loop, dense, solver.t_old, solver.t)
        if exit_time is None:
            trajectory.fill(loop, dense, solver.t)
            continue
        trajectory.fill(loop, dense, np.nextafter(exit_time, span[0]))
        return exit_time, np.array(dense(exit_time)), True
    return solver.t, solver.y.copy(), False


def simulate(design, activation, stop, setting):
    """The trajectory of the closed loop from 0 to `stop` in one solver setting."""
    loop, trajectory = ClosedLoop(design), Trajectory()
    time, state = 0.0, np.concatenate([INITIAL_PLANT_STATE, np.zeros(5)])
    for end in sorted({min(activation, stop), stop}):
        loop.compensating = time >= activation
        while time < end:
            time, state, left_regime = advance(loop, state, (time, end), setting, trajectory)
            if left_regime:
                sliding = loop.regime != STICK
                loop.choose_regime(state)
                trajectory.transitions += 1
                trajectory.jumps += [time] if sliding else []
    return trajectory


def disagreement(first, second):
    """Largest difference of each column as a fraction of the first trajectory's range."""
    first, second = np.array(first.rows), np.array(second.rows)
    spans = np.ptp(first, axis=0)
    spans[spans == 0.0] = 1.0
    return np.abs(first - second).max(axis=0) / spans


def header(design, scenario, trajectories):
    """Comment lines: the origin of the numbers, and how well the settings agree."""
    activation, stop = scenario
    written, *others = trajectories
    gap = min(abs(t - round(t / ROW_INTERVAL) * ROW_INTERVAL) for t in written.jumps)
    yield "closed loop of the friction pendulum and the ASO controller, SI units"
    yield f"written by scripts/reference/reference_closed_loop.py with scipy {scipy.__version__}"
    yield f"compensation from t = {activation} s, stop at {stop} s, x(0) = {INITIAL_PLANT_STATE}"
    yield "observer gains of the design file it was made with:"
    yield from (f"{name} = {design[name]}" for name in ("L_x", "L_f"))
    names = [f"{s.__name__} rtol {r:g} atol {a:g} max_step {h:g}" for s, r, a, h in SETTINGS]
    yield f"solver: {names[0]}; transitions located on its dense output"
    yield f"{written.transitions} transitions, {len(written.jumps)} of them with a jump of f_fric"
    yield f"the jump closest to a row is {gap:.2e} s away from it"
    yield "largest difference to other settings, as a fraction of each column's range:"
    for name, other in zip(names[1:], others):
        parts = [f"{c} {d:.1e}" for c, d in zip(COLUMNS, disagreement(written, other))]
        yield f"{name}: {', '.join(parts[1:])}"


def write_reference(path, design, scenario):
    """Runs one scenario in all settings and writes its file."""
    trajectories = [simulate(design, scenario[0], scenario[1], setting) for setting in SETTINGS]
    lines = [f"# {line}".rstrip() for line in header(design, scenario, trajectories)]
    lines.append(",".join(COLUMNS))
    for number, row in enumerate(trajectories[0].rows):
        values = [f"{number * ROW_INTERVAL:.2f}", *(f"{value:.15g}" for value in row[1:])]
        lines.append(",".join(values))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{path}: {len(trajectories[0].rows)} rows")


def main():
    """Writes every scenario's file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    shipped = ROOT / "fmu-controller" / "resources" / "design.toml"
    parser.add_argument("--design", type=Path, default=shipped, help="the controller's design file")
    parser.add_argument("--out", type=Path, default=ROOT / "tests" / "data", help="target folder")
    arguments = parser.parse_args()
    design = tomllib.loads(arguments.design.read_text(encoding="utf-8"))
    for name, scenario in SCENARIOS.items():
        write_reference(arguments.out / name, design, scenario)


if __name__ == "__main__":
    main()
