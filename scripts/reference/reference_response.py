"""Writes crates/control/tests/data/response.txt: norms, singular values and fault responses by python-control and mpmath.

Kind "norms": H-infinity norm and H2 norm of random systems by python-control with SLICOT, the largest singular value
on a few frequencies by numpy. Kind "peak": peak-to-peak gains. Kind "loop": the pendulum with its controller
(fmu-controller/resources/design.toml) driven by the fault: peak-to-peak gains from f and from f' to [x; e; f_hat - f],
peaks after a step of 1 and after a ramp of 60 at 521 per second. All of "peak" and "loop" by modal decomposition with
40 digits: the gain is the total variation of the step response from turning point to turning point.

Needs Python with numpy, scipy, mpmath, control and slycot; writes to the path given as the first argument, or to the
committed file.
"""

import tomllib

import control
import mpmath as mp
import numpy as np
import slycot

from matrices import ROOT, target, write

SEED = 20091124
POINTS = 3000
CHANGE, RATE = 60.0, 521.0


class Modes:
    """h(t) = C e^(A t) b by eigenvalues, one input at a time."""

    def __init__(self, a, b, c):
        values, vectors = mp.eig(mp.matrix(a.tolist()))
        start = mp.lu_solve(vectors, mp.matrix(b.tolist()))
        rows = mp.matrix(c.tolist()) * vectors
        self.values = values
        self.residues = [[rows[i, k] * start[k] for k in range(len(values))] for i in range(rows.rows)]

    def outputs(self, function, times):
        """The sum of residue * function(value, t), outputs x times."""
        table = [[function(value, t) for value in self.values] for t in times]
        return np.array([[float(mp.re(mp.fdot(row, line))) for line in table] for row in self.residues])

    def step(self, times):
        return self.outputs(lambda s, t: mp.expm1(s * t) / s, times)

    def ramp(self, duration, times):
        """The response to an input that rises from 0 to 1 over the duration."""
        def risen(s, t):
            return (mp.expm1(s * t) / s - t) / s if t > 0 else mp.mpf(0)
        return self.outputs(lambda s, t: (risen(s, t) - risen(s, t - duration)) / duration, times)

    def variation(self, output):
        """The total variation of the step response of one output, from its located turning points."""
        row = self.residues[output]
        def impulse(t): return mp.re(mp.fdot(row, [mp.exp(s * t) for s in self.values]))
        def step(t): return mp.re(mp.fdot(row, [mp.expm1(s * t) / s for s in self.values]))
        grid = self.grid()
        values = [impulse(t) for t in grid]
        turns = [mp.mpf(0)]
        for k in range(len(grid) - 1):
            if values[k] * values[k + 1] < 0:
                turns.append(mp.findroot(impulse, (grid[k], grid[k + 1]), solver="anderson", tol=1e-30, verify=False))
        steps = [step(t) for t in turns + [grid[-1]]]
        return float(sum(abs(b - a) for a, b in zip(steps, steps[1:])))

    def grid(self):
        slowest, fastest = (f(abs(mp.re(s)) for s in self.values) for f in (min, max))
        oscillation = max(abs(s) for s in self.values)
        if oscillation < 20 * slowest:
            return [mp.mpf(0)] + [30 / slowest * k / POINTS for k in range(1, POINTS + 1)]
        return [mp.mpf(0)] + [mp.exp(x) for x in mp.linspace(mp.log(0.001 / fastest), mp.log(30 / slowest), POINTS)]


def gains(a, b, c, d):
    """Peak-to-peak gains of all channels."""
    peak_gains = np.zeros((c.shape[0], b.shape[1]))
    for j in range(b.shape[1]):
        modes = Modes(a, b[:, j], c)
        for i in range(c.shape[0]):
            peak_gains[i, j] = abs(d[i, j]) + modes.variation(i)
    return peak_gains


def random_system(random, case, sampled):
    n, m, p = 2 + case % 5, 1 + case % 2, 1 + case % 3
    a = random.standard_normal((n, n))
    values = np.linalg.eigvals(a)
    a = a * 0.95 / np.max(np.abs(values)) if sampled else a - np.eye(n) * (np.max(values.real) + 0.05)
    return a, random.standard_normal((n, m)), random.standard_normal((p, n)), random.standard_normal((p, m))


def write_norms(file, random):
    for case in range(16):
        sampled = case % 2 == 1
        a, b, c, d = random_system(random, case, sampled)
        if case == 8:
            a, b, c = np.diag([1, 1e3]) @ a[:2, :2] @ np.diag([1, 1e-3]), np.diag([1, 1e3]) @ b[:2], c[:, :2] @ np.diag([1, 1e-3])
        period = 0.1 if sampled else 0.0
        system = control.ss(a, b, c, d, 0.1) if sampled else control.ss(a, b, c, d)
        peak, frequency = control.linfnorm(system, tol=1e-12)
        strict = control.ss(a, b, c, 0 * d, 0.1) if sampled else control.ss(a, b, c, 0 * d)
        frequencies = np.array([0.01, 0.3, 1.0, 5.0, 30.0])
        at = np.exp(1j * frequencies * period) if sampled else 1j * frequencies
        sizes = [np.linalg.svd(system(s, squeeze=False), compute_uv=False)[0] for s in at]
        write(file, "norms", f"random {case}", A=a, B=b, C=c, D=d, period=[[period]], hinf=[[peak]],
              h2=[[control.norm(strict, 2)]], frequencies=frequencies, sizes=sizes)


def write_peaks(file, random):
    for case in range(8):
        a, b, c, d = random_system(random, case, False)
        write(file, "peak", f"random {case}", A=a, B=b, C=c, D=d, gain=gains(a, b, c, d))
    stiff = np.diag([-1.0, -1e2, -1e6]) + np.diag([30.0, 1e4], 1)
    b, c = np.array([[1.0], [-2.0], [500.0]]), np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    write(file, "peak", "stiff", A=stiff, B=b, C=c, D=np.zeros((2, 1)), gain=gains(stiff, b, c, np.zeros((2, 1))))


def write_loop(file):
    design = tomllib.loads((ROOT / "fmu-controller" / "resources" / "design.toml").read_text())
    names = "A B C F_a K_x K_f L_x L_f".split()
    a, b, c, f_a, k_x, k_f, l_x, l_f = matrices = [np.array(design[name], dtype=float) for name in names]
    error = np.block([[a - l_x @ c, -f_a], [l_f @ c, np.zeros((1, 1))]])
    loop = np.block([[a + b @ k_x, np.hstack([-b @ k_x, b @ k_f])], [np.zeros((5, 4)), error]])
    fault = np.vstack([f_a, f_a, [[0.0]]])
    through = np.vstack([np.zeros((8, 1)), [[-1.0]]])
    rate = np.vstack([np.zeros((8, 1)), [[-1.0]]])
    modes = Modes(loop, fault[:, 0], np.eye(9))
    duration = mp.mpf(CHANGE / RATE)
    times = sorted(modes.grid()[::3] + [duration + t for t in modes.grid()[::3]] + [duration * k / 1000 for k in range(1000)])
    steps = modes.step(modes.grid()) + through
    ramps = modes.ramp(duration, times) - np.array([[0.0]] * 8 + [[1.0]]) * np.array([float(min(t / duration, 1)) for t in times])
    write(file, "loop", "pendulum", **dict(zip(names, matrices)), gain_f=gains(loop, fault, np.eye(9), through),
          gain_r=gains(loop, rate, np.eye(9), 0 * rate), step=np.max(np.abs(steps), axis=1),
          ramp=CHANGE * np.max(np.abs(ramps), axis=1))


def main():
    mp.mp.dps = 40
    random = np.random.default_rng(SEED)
    with target("response.txt").open("w") as file:
        versions = f"python-control {control.__version__}, slycot {slycot.__version__}, mpmath {mp.__version__}"
        file.write(f"# scripts/reference/reference_response.py: {versions}\n")
        write_norms(file, random)
        write_peaks(file, random)
        write_loop(file)


if __name__ == "__main__":
    main()
