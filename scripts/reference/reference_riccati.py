"""Writes crates/control/tests/data/riccati.txt: Riccati and discrete Lyapunov equations, holds, by SciPy and mpmath.

Each Riccati solution is SciPy's (solve_continuous_are, solve_discrete_are), polished by Newton's method with 60 digits,
and beside it stands how far SciPy's own was from it, entries relative to sqrt(P[i,i] P[j,j]). Discrete Lyapunov
equations are linear systems with 60 digits, with the distance of SciPy's solve_discrete_lyapunov. Holds are SciPy's
cont2discrete.

Needs Python with numpy, scipy and mpmath; writes to the path given as the first argument, or to the committed file.
"""

import tomllib

import mpmath as mp
import numpy as np
import scipy
from scipy import linalg, signal

from matrices import ROOT, target, write, zoh

SEED = 20091123
NEWTON_STEPS = 12


def high(m):
    return mp.matrix(np.asarray(m, dtype=float).tolist())


def low(m):
    return np.array([[float(m[i, j]) for j in range(m.cols)] for i in range(m.rows)])


def lyapunov(a, q, sampled):
    """P with A' P + P A = -Q or A' P A - P = -Q, the linear equations written out."""
    n = a.rows
    system, right = mp.zeros(n * n), mp.zeros(n * n, 1)
    for i in range(n):
        for j in range(n):
            row = i * n + j
            right[row] = -q[i, j]
            for k in range(n):
                if sampled:
                    for l in range(n):
                        system[row, k * n + l] += a[k, i] * a[l, j]
                else:
                    system[row, k * n + j] += a[k, i]
                    system[row, i * n + k] += a[k, j]
            if sampled:
                system[row, row] -= 1
    x = mp.lu_solve(system, right)
    return mp.matrix([[x[i * n + j] for j in range(n)] for i in range(n)])


def polished(p, a, b, q, r, n, sampled):
    """Newton's method for the Riccati equation, and the feedback u = K x."""
    p, a, b, q, r, n = (high(m) for m in (p, a, b, q, r, n))
    for _ in range(NEWTON_STEPS):
        k = gain(p, a, b, r, n, sampled)
        p = lyapunov(a + b * k, q + n * k + (n * k).T + k.T * r * k, sampled)
        p = (p + p.T) / 2
    return low(p), low(gain(p, a, b, r, n, sampled))


def gain(p, a, b, r, n, sampled):
    if sampled:
        return -((r + b.T * p * b) ** -1) * (b.T * p * a + n.T)
    return -(r**-1) * (b.T * p + n.T)


def distance(solution, exact):
    size = np.sqrt(np.abs(np.diag(exact)))
    size[size == 0] = 1
    return np.max(np.abs(solution - exact) / np.outer(size, size))


def pendulum():
    design = tomllib.loads((ROOT / "fmu-controller" / "pendulum.toml").read_text())
    return (np.array(design[name]) for name in ("A", "B", "C", "F_a"))


def riccati_cases(random):
    """Name, A, B, Q, R, N of the continuous equations."""
    for case in range(16):
        n, m = 1 + case % 7, 1 + case % 3
        a, b = random.standard_normal((n, n)), random.standard_normal((n, m))
        root = random.standard_normal((n if case % 2 else 1, n))
        r = np.eye(m) + (lambda x: x @ x.T)(random.standard_normal((m, m)))
        q, cross = root.T @ root, np.zeros((n, m))
        if case % 4 == 3:
            cross = 0.3 * random.standard_normal((n, m))
            q = q + cross @ np.linalg.inv(r) @ cross.T
        yield f"random {case}", a, b, (q + q.T) / 2, (r + r.T) / 2, cross
    for case in range(6):
        n = 4
        units = 10.0 ** random.uniform(-4, 4, n)
        a = np.diag(1 / units) @ random.standard_normal((n, n)) @ np.diag(units)
        b = np.diag(1 / units) @ random.standard_normal((n, 2)) * np.array([1e3, 1e-3])
        yield f"bad units {case}", a, b, np.diag(units**2), np.diag([1e6, 1e-6]), np.zeros((n, 2))
    a, b, c, f_a = pendulum()
    none = np.zeros((4, 1))
    yield "pendulum", a, b, np.diag([100.0, 100.0, 1.0, 1.0]), np.array([[0.01]]), none
    yield "pendulum, cheap", a, b, np.diag([1e6, 1e6, 1.0, 1.0]), np.array([[1e-4]]), none
    yield "pendulum, dear", a, b, np.zeros((4, 4)) + np.diag([1e-6, 0, 0, 0]), np.array([[1e3]]), none
    augmented = np.block([[a, -f_a], [np.zeros((1, 5))]])
    measured = np.hstack([c, np.zeros((2, 1))])
    noise = np.diag([1e-8, 1e-8, 1e-2, 1e-2, 1e10])
    yield "pendulum, filter", augmented.T, measured.T, noise, np.diag([1e-8, 1e-8]), np.zeros((5, 2))
    yield "stiff", np.diag([-1.0, -1e2, -1e4, -1e6]) + np.diag([1.0] * 3, 1), np.ones((4, 1)), np.eye(4), np.eye(1), none
    unseen = np.array([[2.0, 1.0], [0.0, -3.0]])
    yield "unstable and unweighted", unseen, np.ones((2, 1)), np.zeros((2, 2)), np.eye(1), np.zeros((2, 1))
    chain = np.diag([1.0] * 4, 1)
    yield "five integrators", chain, np.eye(5)[:, 4:], np.diag([1.0, 0, 0, 0, 0]), np.eye(1), np.zeros((5, 1))
    light = np.array([[0.0, 1.0], [-1e4, -1e-4]])
    yield "lightly damped", light, np.eye(2)[:, 1:], np.diag([1e-2, 1e-8]), np.eye(1), np.zeros((2, 1))


def sampled_cases(random):
    """The same for sampled time."""
    for name, a, b, q, r, cross in riccati_cases(random):
        if name.startswith("random"):
            yield name, a, b, q, r, cross
        elif not name.startswith(("stiff", "five", "pendulum, filter")):
            period = 1e-2
            yield name, *zoh(a, b, period), q * period, r * period, cross * period
    shift = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    yield "shift register", shift, np.eye(3)[:, 2:], np.eye(3), np.eye(1), np.zeros((3, 1))


def write_riccati(file, random):
    for kind, cases, solve, sampled in [
        ("continuous", riccati_cases(random), linalg.solve_continuous_are, False),
        ("sampled", sampled_cases(random), linalg.solve_discrete_are, True),
    ]:
        for name, a, b, q, r, cross in cases:
            first = solve(a, b, q, r, s=cross)
            p, k = polished(first, a, b, q, r, cross, sampled)
            closed = np.linalg.eigvals(a + b @ k)
            assert np.all(np.abs(closed) < 1 if sampled else closed.real < 0), name
            write(file, kind, name, A=a, B=b, Q=q, R=r, N=cross, P=p, K=k, scipy=[[distance(first, p)]])


def write_lyapunov(file, random):
    for case in range(12):
        n = 2 + case % 6
        a = random.standard_normal((n, n))
        a *= [0.5, 0.95, 0.9999][case % 3] / np.max(np.abs(np.linalg.eigvals(a)))
        if case % 4 == 3:
            units = 10.0 ** random.uniform(-5, 5, n)
            a = np.diag(1 / units) @ a @ np.diag(units)
        root = random.standard_normal((n, n))
        q = root @ root.T
        q = (q + q.T) / 2
        p = low(lyapunov(high(a), high(q), True))
        solution = linalg.solve_discrete_lyapunov(a.T, q)
        write(file, "lyapunov", f"random {case}", A=a, Q=q, P=p, scipy=[[distance(solution, p)]])


def write_holds(file, random):
    a, b, c, _ = pendulum()
    systems = [("pendulum", a, b, c, 1e-3), ("pendulum, slow", a, b, c, 1e-2)]
    for case in range(4):
        n, m = 2 + case, 1 + case % 2
        systems.append((f"random {case}", random.standard_normal((n, n)), random.standard_normal((n, m)), np.eye(n), 0.1 + 0.3 * case))
    for name, a, b, c, h in systems:
        d = np.zeros((c.shape[0], b.shape[1]))
        phi, gamma, _, _, _ = signal.cont2discrete((a, b, c, d), h, "zoh")
        _, first, _, through, _ = signal.cont2discrete((a, b, c, d), h, "foh")
        write(file, "hold", name, A=a, B=b, C=c, h=[[h]], phi=phi, gamma=gamma, foh_b=first, foh_d=through)


def main():
    mp.mp.dps = 60
    random = np.random.default_rng(SEED)
    with target("riccati.txt").open("w") as file:
        versions = f"scipy {scipy.__version__}, numpy {np.__version__}, mpmath {mp.__version__}"
        file.write(f"# scripts/reference/reference_riccati.py: {versions}\n")
        write_riccati(file, random)
        write_lyapunov(file, random)
        write_holds(file, random)


if __name__ == "__main__":
    main()
