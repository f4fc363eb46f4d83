"""Writes tests/data/plant_reference.csv: the friction pendulum integrated by SciPy.

An independent implementation of the repaired equations (20) and (21): the mass matrix is solved numerically, the
events are SciPy's, the integrator is DOP853. The force is the polygon through AMPLITUDE sin(2 pi FREQUENCY t) at the
multiples of HOLD: a straight line in each interval.

Needs Python with numpy and scipy; writes to the path given as the first argument, or to the committed file.
"""

import sys
from pathlib import Path

import numpy as np
import scipy
from scipy.integrate import solve_ivp

CART_MASS, PENDULUM_MASS, INERTIA, LENGTH = 3.2, 0.535, 0.062, 0.365
CART_DAMPING, PENDULUM_DAMPING, GRAVITY = 6.2, 0.009, 9.807
COULOMB, STATIC, STRIBECK_VELOCITY, EXPONENT = 25.0, 30.0, 0.15, 2.0
MOMENT = PENDULUM_MASS * LENGTH

AMPLITUDE, FREQUENCY, HOLD = 55.0, 1.0, 0.01
INITIAL = [0.1, 1.0, 0.0, 0.0]
ROWS, HOLDS_PER_ROW = 50, 8
# SciPy finds an event only by a sign change between steps: with short steps it does not miss a
# slide of a few ms.
OPTIONS = dict(method="DOP853", rtol=1e-12, atol=1e-14, max_step=2e-4)


def stribeck(speed):
    return COULOMB + (STATIC - COULOMB) * np.exp(-((abs(speed) / STRIBECK_VELOCITY) ** EXPONENT))


def sliding(t, state, force, direction):
    _, theta, v, omega = state
    mass = np.array([[CART_MASS + PENDULUM_MASS, MOMENT * np.cos(theta)], [MOMENT * np.cos(theta), INERTIA]])
    load = np.array([
        force - direction * stribeck(v) - CART_DAMPING * v + MOMENT * omega**2 * np.sin(theta),
        MOMENT * GRAVITY * np.sin(theta) - PENDULUM_DAMPING * omega,
    ])
    return np.concatenate([[v, omega], np.linalg.solve(mass, load)])


def sticking(t, state):
    _, theta, _, omega = state
    return [0.0, omega, 0.0, (MOMENT * GRAVITY * np.sin(theta) - PENDULUM_DAMPING * omega) / INERTIA]


def balancing(state, force):
    """The friction for which the resting cart has no acceleration."""
    _, theta, _, omega = state
    turn = sticking(0.0, state)[3]
    return force - MOMENT * (turn * np.cos(theta) - omega**2 * np.sin(theta))


def rest(state, force):
    """The regime of a cart at rest: 0 held, otherwise the direction in which it breaks away."""
    needed = balancing(state, force)
    return 0 if abs(needed) <= STATIC else int(np.sign(needed))


def node(k):
    return AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * (k * HOLD))


def interval(k, state, direction, events):
    """Integrates over one interval of the polygon from event to event."""
    start, end = k * HOLD, (k + 1) * HOLD
    begin = start

    def force(t): return node(k) + (node(k + 1) - node(k)) / HOLD * (t - start)

    if state[2] == 0.0:
        direction = rest(state, force(begin))
    while begin < end:
        if direction:
            def stop(t, y): return direction * y[2]
            vars(stop).update(terminal=True, direction=-1)
            run = solve_ivp(lambda t, y: sliding(t, y, force(t), direction), (begin, end), state, events=[stop], **OPTIONS)
        else:
            def away(t, y): return STATIC - abs(balancing(y, force(t)))
            vars(away).update(terminal=True, direction=-1)
            run = solve_ivp(sticking, (begin, end), state, events=[away], **OPTIONS)
        assert run.success, run.message
        begin, state = run.t[-1], run.y[:, -1].copy()
        if run.status == 1:
            if direction:
                state[2] = 0.0
                direction = rest(state, force(begin))
            else:
                direction = int(np.sign(balancing(state, force(begin))))
            events.append((begin, direction))
    return state, direction


def main():
    events, rows = [], []
    state, direction = np.array(INITIAL), 0
    for k in range(ROWS * HOLDS_PER_ROW):
        state, direction = interval(k, state, direction, events)
        if (k + 1) % HOLDS_PER_ROW == 0:
            friction = direction * stribeck(state[2]) if direction else balancing(state, node(k + 1))
            rows.append([(k + 1) * HOLD, *state, friction, direction])
    default = Path(__file__).resolve().parents[2] / "tests" / "data" / "plant_reference.csv"
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    with path.open("w") as file:
        file.write(f"# scripts/reference/reference_plant.py: scipy {scipy.__version__} solve_ivp, DOP853, rtol 1e-12, atol 1e-14,\n")
        file.write(f"# {len(events)} located events; x(0) = {INITIAL};\n")
        file.write(f"# u is the polygon through {AMPLITUDE} sin(2 pi {FREQUENCY} t) N at the multiples of {HOLD} s.\n")
        file.write("t,x_p,theta,v_p,omega,f_fric,regime\n")
        for row in rows:
            file.write(f"{row[0]:.2f}," + ",".join(f"{value:.15e}" for value in row[1:6]) + f",{row[6]}\n")
    for time, direction in events:
        print(f"{time:.9f} s -> {direction:+d}", file=sys.stderr)


if __name__ == "__main__":
    main()
