"""Writes crates/control/tests/data/robustness.txt: margins of loops by python-control, slycot and scipy.

Kind "loop": a plant A, B, C, a controller a, b, c, d with u = K y, and the period (0: continuous; the plant is
continuous in any case and discretised by scipy's matrix exponential). Peaks of S and T at input and output by
python-control's linfnorm (SLICOT AB13DD); the disk margin for all channels by SLICOT AB13MD on a grid that is refined
about its maximum; for each channel alone, the others closed, gain and phase margins by python-control's
stability_margins of the frequency response, and the disk margin by linfnorm; the effect of measurement noise by
python-control's H2 norm; the longest hold and the delay margin by simulating growth, that is, by eigenvalues of
scipy's discretisation on a fine grid and bisection.

The loops are two random plants with an LQG controller with integral action, continuous and sampled, and the pendulum
of fmu-controller/resources/design.toml. Needs Python with numpy, scipy, control and slycot; writes to the path given
as the first argument, or to the committed file.
"""

import tomllib

import control as ct
import numpy as np
import scipy
import scipy.linalg as sl
from scipy.optimize import brentq, minimize_scalar
from slycot import ab13md

from matrices import ROOT, target, write, zoh

SEED = 20261123


class Loop:
    def __init__(self, plant, controller, period):
        (self.a, self.b, self.c), self.k, self.period = plant, controller, period
        ad, bd = zoh(self.a, self.b, period) if period else (self.a, self.b)
        a, b, c, d = controller
        self.n, self.m, self.p = len(self.a), self.b.shape[1], self.c.shape[0]
        k = len(a)
        self.whole = np.block([[ad + bd @ d @ self.c, bd @ c], [b @ self.c, a]])
        self.points = {
            "in": (np.vstack([bd, np.zeros((k, self.m))]), np.hstack([d @ self.c, c])),
            "out": (np.vstack([bd @ d, b]), np.hstack([self.c, np.zeros((self.p, k))])),
        }
        spectrum = np.linalg.eigvals(self.whole)
        assert (abs(spectrum).max() < 1) if period else (spectrum.real.max() < 0)
        if period:
            self.grid = np.geomspace(1e-4 * np.pi / period, np.pi / period, 4000)
        else:
            self.grid = np.geomspace(abs(spectrum).min() / 100, abs(spectrum).max() * 100, 8000)

    def norm(self, point, d, channel=None):
        b, c = self.points[point]
        if channel is not None:
            b, c, d = b[:, [channel]], c[[channel]], d[[channel]][:, [channel]]
        return ct.linfnorm(ct.ss(self.whole, b, c, d, self.period or 0), tol=1e-9)[0]

    def response(self, point, w):
        b, c = self.points[point]
        s = np.exp(1j * w * self.period) if self.period else 1j * w
        return c @ np.linalg.solve(s * np.eye(len(self.whole)) - self.whole, b)

    def disk(self, point):
        k = self.points[point][0].shape[1]
        def mu(w):
            m = self.response(point, w) + np.eye(k) / 2
            return abs(m[0, 0]) if k == 1 else ab13md(m, np.ones(k, int), 2 * np.ones(k, int))[0]
        values = [mu(w) for w in self.grid[::10]]
        at = int(np.argmax(values))
        ends = self.grid[::10][max(at - 1, 0)], self.grid[::10][min(at + 1, len(values) - 1)]
        fine = minimize_scalar(lambda w: -mu(w), bounds=ends, method="bounded", options={"xatol": 1e-9 * ends[1]})
        return 1 / max(max(values), -fine.fun, 0.5)

    def channel(self, point, i):
        t = -np.array([self.response(point, w)[i, i] for w in self.grid])
        margins = ct.stability_margins(ct.frd(t / (1 - t), self.grid, smooth=True), returnall=True)
        gains, phases, _, _, frequencies, _ = margins
        gains = list(gains)
        if self.period:
            # python-control looks for crossings inside the grid; at the Nyquist frequency L is real.
            end = -self.response(point, np.pi / self.period)[i, i].real
            gains += [(end - 1) / end]
        low = max([g for g in gains if 0 < g < 1], default=0.0)
        high = min([g for g in gains if g > 1], default=np.inf)
        phase = min(abs((p + 180) % 360 - 180) for p in phases) if len(phases) else np.inf
        delay = np.inf
        for w in frequencies:
            t = -self.response(point, w)[i, i]
            delay = min(delay, np.angle(-t / (1 - t)) % (2 * np.pi) / w)
        half = np.eye(self.points[point][0].shape[1]) / 2
        return [low, high, np.radians(phase), delay, 1 / self.norm(point, half, i)]

    def noise(self):
        _, _, c, d = self.k
        b, _ = self.points["out"]
        rows = np.hstack([d @ self.c, c])
        def h2(i, j):
            system = ct.ss(self.whole, b[:, [j]], rows[[i]], d[[i]][:, [j]], self.period or 0)
            return ct.norm(system, 2)
        return [[h2(i, j) for j in range(self.p)] for i in range(self.m)]

    def held(self, h):
        """Spectral radius with all signals held over h (continuous), or with the clock at h (sampled)."""
        ad, bd = zoh(self.a, self.b, h)
        a, b, c, d = self.k
        if not self.period:
            a, b = zoh(a, b, h)
        return abs(np.linalg.eigvals(np.block([[ad + bd @ d @ self.c, bd @ c], [b @ self.c, a]]))).max()

    def hold(self):
        h = self.period or 1e-4 / abs(np.linalg.eigvals(self.whole)).max()
        while self.held(h * 1.02) < 1:
            h *= 1.02
        return brentq(lambda x: self.held(x) - 1, h, 1.02 * h, xtol=1e-13 * h, rtol=1e-12)

    def delayed(self, tau):
        """Spectral radius of the sampled loop whose commands arrive later by tau."""
        whole = int(tau // self.period)
        part = tau - whole * self.period
        m, n = self.m, self.n
        early, old = zoh(self.a, self.b, part)
        late, new = zoh(self.a, self.b, self.period - part)
        a, b, c, d = self.k
        k = len(a)
        size = n + k + m * (whole + 1)
        f = np.zeros((size, size))
        u = np.zeros((m, size))
        u[:, :n], u[:, n:n + k] = d @ self.c, c
        past = [u] + [np.eye(size)[n + k + j * m:n + k + (j + 1) * m] for j in range(whole + 1)]
        f[:n] = late @ old @ past[whole + 1] + new @ past[whole]
        f[:n, :n] += late @ early
        f[n:n + k, :n], f[n:n + k, n:n + k] = b @ self.c, a
        for j in range(whole + 1):
            f[n + k + j * m:n + k + (j + 1) * m] = past[j]
        return abs(np.linalg.eigvals(f)).max()

    def delay(self):
        """Sampled: first instability on a fine grid. Continuous: eigenvalues of L of modulus one."""
        if self.period:
            step = self.period / 50
            tau = step
            while self.delayed(tau) < 1:
                tau += step
            return brentq(lambda x: self.delayed(x) - 1, tau - step, tau, rtol=1e-12)
        def loci(w):
            t = -self.response("in", w)
            return np.array(sorted(np.linalg.eigvals(t @ np.linalg.inv(np.eye(self.m) - t)), key=abs))
        values = np.array([abs(loci(w)) - 1 for w in self.grid])
        best = np.inf
        for r in range(self.m):
            for at in np.nonzero(values[:-1, r] * values[1:, r] < 0)[0]:
                w = brentq(lambda x: abs(loci(x)[r]) - 1, self.grid[at], self.grid[at + 1], rtol=1e-13)
                best = min(best, np.angle(-loci(w)[r]) % (2 * np.pi) / w)
        return best


def lqg(a, b, c, period):
    """An LQG controller with a constant disturbance at each command estimated and cancelled."""
    n, m, p = len(a), b.shape[1], len(c)
    w = np.block([[a, b], [np.zeros((m, n + m))]])
    output_matrix, input_matrix = np.hstack([c, np.zeros((p, m))]), np.vstack([b, np.zeros((m, m))])
    if period:
        w, input_matrix = zoh(w, input_matrix, period)
        solve = sl.solve_discrete_are
    else:
        solve = sl.solve_continuous_are
    ad, bd = w[:n, :n], input_matrix[:n]
    x = solve(ad, bd, np.eye(n), np.eye(m))
    y = solve(w.T, output_matrix.T, 10 * np.eye(n + m), np.eye(p))
    if period:
        k = np.linalg.solve(np.eye(m) + bd.T @ x @ bd, bd.T @ x @ ad)
        l = w @ y @ output_matrix.T @ np.linalg.inv(np.eye(p) + output_matrix @ y @ output_matrix.T)
    else:
        k, l = bd.T @ x, y @ output_matrix.T
    k = -np.hstack([k, np.eye(m)])
    return w + input_matrix @ k - l @ output_matrix, l, k, np.zeros((m, p))


def pendulum():
    d = tomllib.loads((ROOT / "fmu-controller/resources/design.toml").read_text())
    a, b, c, f, kx, kf, lx, lf = (np.array(d[key]) for key in ("A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"))
    dynamics = np.block([[a + b @ kx - lx @ c, f + b @ kf], [-lf @ c, np.zeros((1, 1))]])
    return Loop((a, b, c), (dynamics, np.vstack([lx, lf]), np.hstack([kx, kf]), np.zeros((1, 2))), 0.0)


def main():
    rng = np.random.default_rng(SEED)
    loops = {"pendulum": pendulum()}
    for name, (n, m, p), period in (("two by two", (4, 2, 2), 0.0), ("three by three", (5, 3, 3), 0.0),
                                    ("two by three, sampled", (4, 2, 3), 0.3)):
        a, b, c = rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(p, n))
        loops[name] = Loop((a, b, c), lqg(a, b, c, period), period)
    with target("robustness.txt").open("w") as file:
        versions = f"python-control {ct.__version__}, slycot 0.7.1, scipy {scipy.__version__}"
        file.write(f"# scripts/reference/reference_robustness.py: {versions}\n")
        for name, loop in loops.items():
            (a, b, c, d), m, p = loop.k, loop.m, loop.p
            out = {"A": loop.a, "B": loop.b, "C": loop.c, "a": a, "b": b, "c": c, "d": d, "period": loop.period}
            for point, k in (("in", m), ("out", p)):
                out[f"s_{point}"] = loop.norm(point, np.eye(k))
                out[f"t_{point}"] = loop.norm(point, np.zeros((k, k)))
                out[f"disk_{point}"] = loop.disk(point)
                out[f"channels_{point}"] = [loop.channel(point, i) for i in range(k)]
            out["noise"], out["hold"], out["delay"] = loop.noise(), loop.hold(), loop.delay()
            write(file, "loop", name, **out)


if __name__ == "__main__":
    main()
