"""Writes a plant file with many states: a chain of masses between two walls.

    python scripts/study/large_plants.py STATES [--placement] [--sample-time H] [--seed N] > chain.toml

Masses 1, springs 1, the damping matrix 0.01 times the stiffness matrix; 4 commands (forces) and 10 measurements (positions), with fewer
masses one of each, spread over the masses; faults of 2 actuators. With --seed the springs are random,
between 0.8 and 1.2. The gains are those of weights
of ones (V of 0.01), with --placement those of eigenvalues that lie 0.2 (feedback) and 0.5 (observer) to the left of the plant's.
Needs Python 3.11 with numpy. `aso-ftc design chain.toml --certificate-time 0` then shows the time for such a plant.
"""

import argparse

import numpy as np

COMMANDS, MEASUREMENTS, FAULTS = 4, 10, 2


def chain(states, seed=None, commands=COMMANDS, measurements=MEASUREMENTS):
    """A, B and C."""
    masses = states // 2
    rng = np.random.default_rng(seed)
    springs = np.ones(masses + 1) if seed is None else rng.uniform(0.8, 1.2, masses + 1)
    stiffness = np.diag(springs[:-1] + springs[1:])
    stiffness -= np.diag(springs[1:-1], 1) + np.diag(springs[1:-1], -1)
    a = np.block([[np.zeros((masses, masses)), np.eye(masses)], [-stiffness, -0.01 * stiffness]])
    measurements = min(measurements, masses)
    b, c = np.zeros((states, commands)), np.zeros((measurements, states))
    for at in range(commands):
        b[masses + (at * masses // commands + 3) % masses, at] = 1
    for at in range(measurements):
        c[at, (at * masses // measurements + 2) % masses] = 1
    return a, b, c


def shifted(a, left):
    """The eigenvalues of A above the real axis, moved to the left."""
    values = np.linalg.eigvals(a)
    return sorted((value - left for value in values[values.imag > 0]), key=abs)


def plant_file(states, placement=False, sample_time=None, seed=None):
    """The text of a plant file."""
    a, b, c = chain(states, seed)
    lines = [f"{name} = {matrix.tolist()}" for name, matrix in zip("ABC", (a, b, c))]
    if sample_time is not None:
        lines.append(f"sample_time = {sample_time}")
    if placement:
        feedback, observer = (
            [f"{{ re = {value.real}, im = {value.imag} }}" for value in shifted(a, left)]
            for left in (0.2, 0.5)
        )
        observer += [str(-1.0 - 0.2 * fault) for fault in range(FAULTS)]
        lines.append(f"feedback.eigenvalues = [{', '.join(feedback)}]")
        lines.append(f"observer.eigenvalues = [{', '.join(observer)}]")
    else:
        lines.append(f"feedback.Q = {[1.0] * states}\nfeedback.R = {[1.0] * COMMANDS}")
        lines.append(f"observer.W = {[1.0] * (states + FAULTS)}")
        lines.append(f"observer.V = {[0.01] * len(c)}")
    for fault in range(1, FAULTS + 1):
        lines.append(f'[[faults]]\nname = "f{fault}"\nactuator = "u{fault}"')
        lines.append("bound = 1.0\nrate_bound = 1.0")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("states", type=int, help=f"an even number, {2 * COMMANDS} or more")
    parser.add_argument("--placement", action="store_true")
    parser.add_argument("--sample-time", type=float)
    parser.add_argument("--seed", type=int)
    options = parser.parse_args()
    if options.states % 2 or options.states < 2 * COMMANDS:
        parser.error(f"expected an even number of states, {2 * COMMANDS} or more, found {options.states}")
    print(plant_file(options.states, options.placement, options.sample_time, options.seed), end="")
