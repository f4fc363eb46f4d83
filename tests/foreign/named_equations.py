"""The controller's equations by the names of its variables, for real and for complex numbers.

The imaginary part of f(x + 1e-30 i v) / 1e-30 is the derivative along v to the last digit.
"""

import numpy as np

from design_file import LISTS, vector
from observer_oracle import element_name


def size_of(design):
    """Numbers of states, actuators, measurements and faults."""
    return tuple(len(design[name]) for name in LISTS)


def losses(design):
    """For each loss of effectiveness: its output, the positions of fault and actuator, the least command."""
    actuators = [actuator["name"] for actuator in design["actuators"]]
    names = vector("E_hat", len(design["faults"]))
    for k, (name, fault) in enumerate(zip(names, design["faults"])):
        if "loss_of" in fault:
            yield name, k, actuators.index(fault["loss_of"]), fault["least_command"]


def limited(values, j, command, count):
    """The limit at which the command of channel j is; none if it is free or has no limits."""
    low, high = (values.get(vector(name, count)[j]) for name in ("u_min", "u_max"))
    if low is None or low.real <= command.real <= high.real:
        return None
    return low if command.real < low.real else high


class Named:
    """Values of variables, complex or not, as vectors and matrices."""

    def __init__(self, values, design):
        self.values, self.design = values, design

    def vector(self, name, count):
        """The channels of a signal; zeros if the controller has none."""
        names = vector(name, count)
        return np.array([self.values.get(name, 0.0) for name in names])

    def matrix(self, name, rows, columns):
        """The elements of a matrix; zeros if the controller has none."""
        names = [element_name(name, i, j) for i in range(rows) for j in range(columns)]
        return np.array([self.values.get(name, 0.0) for name in names]).reshape(rows, columns)


def evaluated(values, design, switches, start=False, minus=-1.0):
    """All unknowns by name, from the values of all knowns by name.

    `switches`: whether it compensates and whether it estimates. `minus` is the factor of subtracted
    terms, usually -1; with 1 and positive values the result is the sum of all terms.
    """
    n, m, p, q = size_of(design)
    named, (compensating, estimating) = Named(values, design), switches
    x_op, u_op, y_op = (named.vector(f"{s}_op", count) for s, count in zip("xuy", (n, m, p)))
    x_hat = named.vector("x_hat_0" if start else "x_hat", n)
    f_hat = named.vector("f_hat_0" if start else "f_hat", q)
    y = np.array([values[name] for name in values["inputs"]])
    y_f = y if start else named.vector("y_f", p)
    source = y_f if "filter" in design else y
    deviation = x_hat + minus * x_op
    innovation = source + minus * y_op + minus * (named.matrix("C", p, n) @ deviation)
    if design.get("estimator") == "current":
        x_hat = x_hat + named.matrix("L_x", n, p) @ innovation
        f_hat = f_hat + estimating * (named.matrix("L_f", q, p) @ innovation)
        deviation = x_hat + minus * x_op
    v = named.matrix("K_x", m, n) @ deviation
    v = v + compensating * (named.matrix("K_f", m, q) @ f_hat)
    at = [limited(values, j, command, m) for j, command in enumerate(v + u_op)]
    u = np.array([free if lim is None else lim for lim, free in zip(at, v + u_op)])
    v = np.array([free if lim is None else lim + minus * op for lim, free, op in zip(at, v, u_op)])
    x_slopes = named.matrix("A", n, n) @ deviation + named.matrix("B", n, m) @ v
    x_slopes = x_slopes + named.matrix("F_a", n, q) @ f_hat
    x_slopes = x_slopes + named.matrix("L_x", n, p) @ innovation
    f_slopes = named.matrix("A_f", q, q) @ f_hat + named.matrix("L_f", q, p) @ innovation
    y_slopes = named.vector("filter", p) * (y + minus * y_f)
    names = state_names(design)
    unknowns = dict(zip(names, [*x_hat, *f_hat, *y_f])) | dict(zip(vector("u", m), u))
    for name, k, j, least in losses(design):
        unknowns[name] = minus * u[j] * f_hat[k] / (u[j] ** 2 + least**2)
    slopes = [*x_slopes, *(estimating * f_slopes), *y_slopes]
    return unknowns | {f"der({name})": slope for name, slope in zip(names, slopes)}


def state_names(design):
    """Names of estimates and filtered measurements."""
    n, _, p, q = size_of(design)
    filtered = vector("y_f", p) if "filter" in design else []
    return vector("x_hat", n) + vector("f_hat", q) + filtered


def rounding(values, direction, design, start):
    """Bounds of rounding errors of the derivatives, by name: 1e-13 of the sum of absolute terms."""
    size = {"inputs": values["inputs"]}
    for name, value in values.items():
        if name != "inputs" and not name.startswith(("u_min", "u_max")):
            size[name] = abs(value) + abs(direction.get(name, 0.0))
    terms = evaluated(size, design, (True, True), start, minus=1.0)
    commands, faults = vector("u", len(design["actuators"])), vector("f_hat", len(design["faults"]))
    for name, k, j, least in losses(design):
        terms[name] = terms[faults[k]] / least * (1 + terms[commands[j]] / least)
    return {name: 1e-13 * (1 + value) for name, value in terms.items()}
