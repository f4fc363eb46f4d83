"""The equations of continuous scheduled controllers in numpy, an FMU in model exchange, and the certificates computed again."""

from ctypes import byref

import numpy as np

from c_abi import MODEL_EXCHANGE, OK, WARNING, EventInfo, Instance, reals
from scheduled_design import ScheduledDesign


class Schedule(ScheduledDesign):
    """The equations of a continuous controller."""

    def __init__(self, text):
        super().__init__(text)
        assert "sample_time" not in self.file
        self.p = len(self.file["measurements"])
        self.filter = np.array(self.file["filter"]) if "filter" in self.file else None

    def start(self, at):
        """z at the operating point of a point, in the order of the FMU's states."""
        point = self.points[self.at.index(at)]
        filtered = [] if self.filter is None else point["y_op"]
        return np.concatenate([point["x_op"], np.zeros(self.q), filtered, np.zeros(self.integrals)])

    def equations(self, z, y, r, value, limited=True):
        """z' and the commands."""
        point = self.numbers(value)
        filters = 0 if self.filter is None else self.p
        x_hat, f_hat, y_f, x_i = np.split(z, np.cumsum([self.n, self.q, filters]))
        output = y if self.filter is None else y_f
        x, e, r = x_hat - point["x_op"], output - point["y_op"], r - point.get("r_op", np.zeros(0))
        e = e - point["C"] @ x
        # With a direct term the state is the integral part of the estimate.
        fault = f_hat + point["P_f"] @ e if "P_f" in point else f_hat
        v = point["u_op"] + point["K_x"] @ x + point["K_f"] @ fault
        if "N_r" in point:
            v = v + point["N_r"] @ r
        if self.integrals:
            v = v + point["K_i"] @ x_i
        u = np.clip(v, *self.limits) if limited else v
        parts = [point["A"] @ x + point["B"] @ (u - point["u_op"]) + point["F_a"] @ f_hat + point["L_x"] @ e, point["L_f"] @ e]
        if self.filter is not None:
            parts.append(self.filter * (y - y_f))
        if self.integrals:
            slope = r - np.array(self.file["H"]) @ (y - point["y_op"])
            if "F_i" in self.file:
                slope = slope + np.array(self.file["F_i"]) @ fault
            parts.append(slope + (point["L_w"] @ (u - v) if "L_w" in point else 0))
        return np.concatenate(parts), u

    def loop(self, value):
        """The dynamics of the interpolated plant with the controller without a filter, of [x; z]."""
        point, size = self.numbers(value), self.n + len(self.start(self.at[0]))
        rest = np.concatenate([point["x_op"], point["x_op"], np.zeros(self.q + self.integrals)])
        columns = []
        for unit in np.eye(size):
            x, z = np.split(rest + unit, [self.n])
            y = point["y_op"] + point["C"] @ unit[: self.n]
            slope, u = self.equations(z, y, point.get("r_op", np.zeros(0)), value, limited=False)
            columns.append(np.concatenate([point["A"] @ unit[: self.n] + point["B"] @ (u - point["u_op"]), slope]))
        return np.array(columns).T


def states_of(schedule):
    """Names of the FMU's continuous states, in the order of z."""
    names = [f"x_hat[{i + 1}]" for i in range(schedule.n)]
    fault = "f_hat_i" if "P_f" in schedule.points[0] else "f_hat"
    names += [fault] if schedule.q == 1 else [f"{fault}[{i + 1}]" for i in range(schedule.q)]
    if schedule.filter is not None:
        names += ["y_f"] if schedule.p == 1 else [f"y_f[{k + 1}]" for k in range(schedule.p)]
    if schedule.integrals:
        names += ["x_i"] if schedule.integrals == 1 else [f"x_i[{k + 1}]" for k in range(schedule.integrals)]
    return names


class Exchanged:
    """An FMU in model exchange as a function of time, states and inputs."""

    def __init__(self, fmu, values):
        self.instance = Instance(fmu, kind=MODEL_EXCHANGE)
        self.instance.start_exchange(values)

    def at(self, time, z, inputs):
        """The derivatives of the states."""
        instance = self.instance
        instance.must("SetTime", time)
        instance.must("SetContinuousStates", reals(*z), len(z))
        instance.set(inputs)
        slopes = reals(*([0.0] * len(z)))
        # The first value outside of the points is a warning.
        assert instance.call("GetDerivatives", slopes, len(z)) in (OK, WARNING)
        return np.array(slopes)

    def event(self, time):
        """Handles an event."""
        info = EventInfo(new_discrete_states_needed=1)
        self.instance.must("EnterEventMode")
        while info.new_discrete_states_needed:
            self.instance.must("NewDiscreteStates", byref(info))
        self.instance.must("EnterContinuousTimeMode")


def check_certificate(schedule, certificate):
    """Checks the inequalities of a report's schedule at 201 values between the points; returns the proven rate, 0 for any rate."""
    values = np.linspace(schedule.at[0], schedule.at[-1], 201)
    loops = [schedule.loop(value) for value in values]
    worst = max(np.linalg.eigvals(a).real.max() for a in loops)
    assert certificate["worst_instability"] >= worst - 1e-6 and worst < 0
    if "p" in certificate["any_rate"]:
        grid, fastest = [np.array(certificate["any_rate"]["p"])] * len(schedule.at), 0.0
    else:
        grid, fastest = [np.array(p) for p in certificate["bounded_rate"]["p"]], certificate["bounded_rate"]["rate"]
        assert fastest > 0
    for value, a in zip(values, loops):
        k = min(np.searchsorted(schedule.at, value, side="right"), len(schedule.at) - 1) - 1
        length = schedule.at[k + 1] - schedule.at[k]
        t = (value - schedule.at[k]) / length
        p, slope = (1 - t) * grid[k] + t * grid[k + 1], (grid[k + 1] - grid[k]) / length
        assert np.linalg.eigvalsh(p).min() > 0
        for move in (-fastest, fastest):
            left = -(a.T @ p + p @ a + move * slope)
            scale = 1 / np.sqrt(np.diag(left))
            assert np.linalg.eigvalsh(left * np.outer(scale, scale)).min() > 0, (value, move)
    return fastest
