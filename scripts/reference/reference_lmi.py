"""Writes crates/control/tests/data/lmi.txt: norms and best bounds by other methods than the tested one.

Norms: H-infinity by bisection on the imaginary eigenvalues of the Hamiltonian (Boyd and Balakrishnan, 1990), of a sampled
system after the bilinear map; generalised H2 by Lyapunov equations. Best H-infinity bounds of a state feedback: bisection
on the Riccati equation of the game (Doyle, Glover, Khargonekar, Francis, 1989). Best bounds with regions, of generalised
H2 and in sampled time: semidefinite programs stated in CVXPY. The smallest radius of theorem 1: likewise.

Needs Python with numpy, scipy and cvxpy; writes to the path given as the first argument, or to the committed file.
"""

import cvxpy as cp
import numpy as np
import scipy
from scipy import linalg

from matrices import target, write

SEED = 19961999
STEPS = 60
LARGEST = 1e3


def hamiltonian_has_imaginary(a, b, c, d, gamma):
    r = gamma**2 * np.eye(b.shape[1]) - d.T @ d
    inner = np.linalg.solve(r, np.hstack([d.T @ c, b.T]))
    f = a + b @ inner[:, : a.shape[0]]
    h = np.block([
        [f, b @ np.linalg.solve(r, b.T)],
        [-c.T @ (np.eye(c.shape[0]) + d @ np.linalg.solve(r, d.T)) @ c, -f.T],
    ])
    values = np.linalg.eigvals(h)
    return np.min(np.abs(values.real)) < 1e-8 * np.max(np.abs(values))


def h_infinity(a, b, c, d):
    """The least gamma without imaginary eigenvalues; it cannot be below the largest gain on a fine grid."""
    low = max(np.linalg.norm(d, 2), 1e-12)
    for frequency in np.concatenate([[0.0], np.logspace(-4, 5, 4000)]):
        response = d + c @ np.linalg.solve(1j * frequency * np.eye(len(a)) - a, b)
        low = max(low, np.linalg.norm(response, 2))
    high = 2 * low
    low *= 1 - 1e-12
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if hamiltonian_has_imaginary(a, b, c, d, middle) else (low, middle)
    return high


def bilinear(a, b, c, d):
    """z = (1 + s) / (1 - s): the same gains on the unit circle as on the imaginary axis."""
    inverse = np.linalg.inv(a + np.eye(len(a)))
    root = np.sqrt(2)
    return inverse @ (a - np.eye(len(a))), root * inverse @ b, root * c @ inverse, d - c @ inverse @ b


def largest(m):
    return float(np.sqrt(np.linalg.eigvalsh((m + m.T) / 2)[-1]))


def norms(a, b, c, d, sampled):
    if sampled:
        x = linalg.solve_discrete_lyapunov(a, b @ b.T)
        y = linalg.solve_discrete_lyapunov(a.T, c.T @ c)
        peak, impulse = c @ x @ c.T + d @ d.T, b.T @ y @ b + d.T @ d
        return h_infinity(*bilinear(a, b, c, d)), largest(peak), largest(impulse)
    x = linalg.solve_continuous_lyapunov(a, -b @ b.T)
    y = linalg.solve_continuous_lyapunov(a.T, -c.T @ c)
    return h_infinity(a, b, c, d), largest(c @ x @ c.T), largest(b.T @ y @ b)


def feedback_exists(a, b, disturbance, c, d, gamma):
    """A stabilising X >= 0 of the game, D'[C D] = [0 R]."""
    n = len(a)
    s = disturbance @ disturbance.T / gamma**2 - b @ np.linalg.solve(d.T @ d, b.T)
    h = np.block([[a, s], [-c.T @ c, -a.T]])
    t, z, stable = linalg.schur(h, sort="lhp")
    if stable != n or np.min(np.abs(np.linalg.eigvals(h).real)) < 1e-9:
        return False
    x = z[n:, :n] @ np.linalg.inv(z[:n, :n])
    return np.linalg.eigvalsh((x + x.T) / 2)[0] > -1e-9


def best_feedback(a, b, disturbance, c, d):
    low, high = 1e-6, 1e4
    for _ in range(STEPS):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if feedback_exists(a, b, disturbance, c, d, middle) else (middle, high)
    return high


def solved(problem):
    problem.solve(solver=cp.CLARABEL)
    assert problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE), problem.status
    return problem.value


def within(q):
    """The infimum of the bound is often not attained by any Q."""
    return q >> np.eye(q.shape[0]) / LARGEST, q << LARGEST * np.eye(q.shape[0])


def symmetric(blocks):
    whole = cp.bmat(blocks)
    return (whole + whole.T) / 2


def best_with_disc(a, b, disturbance, c, d, center, radius):
    """H-infinity in continuous time, the poles in a disc, Q the inverse of P."""
    n, m, k, r = len(a), b.shape[1], disturbance.shape[1], c.shape[0]
    q, w, gamma = cp.Variable((n, n), symmetric=True), cp.Variable((m, n)), cp.Variable()
    f, z = a @ q + b @ w, c @ q + d @ w
    bounded = symmetric([
        [f + f.T, disturbance, z.T],
        [disturbance.T, -gamma * np.eye(k), np.zeros((k, r))],
        [z, np.zeros((r, k)), -gamma * np.eye(r)],
    ])
    moved = f - center * q
    disc = symmetric([[radius * q, moved], [moved.T, radius * q]])
    return solved(cp.Problem(cp.Minimize(gamma), [*within(q), bounded << 0, disc >> 0]))


def best_sampled(a, b, disturbance, c, d):
    n, m, k, r = len(a), b.shape[1], disturbance.shape[1], c.shape[0]
    q, w, gamma = cp.Variable((n, n), symmetric=True), cp.Variable((m, n)), cp.Variable()
    f, z = a @ q + b @ w, c @ q + d @ w
    bounded = symmetric([
        [q, f, disturbance, np.zeros((n, r))],
        [f.T, q, np.zeros((n, k)), z.T],
        [disturbance.T, np.zeros((k, n)), gamma * np.eye(k), np.zeros((k, r))],
        [np.zeros((r, n)), z, np.zeros((r, k)), gamma * np.eye(r)],
    ])
    return solved(cp.Problem(cp.Minimize(gamma), [*within(q), bounded >> 0]))


def best_peak(a, b, disturbance, c, d):
    n, m, r = len(a), b.shape[1], c.shape[0]
    q, w, square = cp.Variable((n, n), symmetric=True), cp.Variable((m, n)), cp.Variable()
    f, z = a @ q + b @ w, c @ q + d @ w
    decay = f + f.T + disturbance @ disturbance.T
    peak = symmetric([[q, z.T], [z, square * np.eye(r)]])
    return np.sqrt(solved(cp.Problem(cp.Minimize(square), [*within(q), decay << 0, peak >> 0])))


def smallest_radius(f, g):
    n = len(f)
    p = cp.Variable((n, n), symmetric=True)
    decay = f.T @ p + p @ f + np.eye(n)
    return 2 * solved(cp.Problem(cp.Minimize(cp.sigma_max(p @ g)), [decay << 0, p >> 0]))


def write_norms(file, random):
    for count in range(12):
        n, k, r, sampled = 1 + count // 2, 1 + count % 3, 1 + count % 2, count % 2 == 1
        a = random.standard_normal((n, n))
        values = np.linalg.eigvals(a)
        if sampled:
            a *= 0.9 / np.max(np.abs(values))
        else:
            a -= (np.max(values.real) + 0.2) * np.eye(n)
        b, c = random.standard_normal((n, k)), random.standard_normal((r, n))
        d = random.standard_normal((r, k)) if sampled else np.zeros((r, k))
        infinity, peak, impulse = norms(a, b, c, d, sampled)
        kind = "sampled norms" if sampled else "norms"
        write(file, kind, count, A=a, B=b, C=c, D=d, infinity=infinity, peak=peak, impulse=impulse)


def write_syntheses(file, random):
    for count in range(4):
        n, m = 2 + count, 1 + count % 2
        a, b = random.standard_normal((n, n)), random.standard_normal((n, m))
        disturbance = random.standard_normal((n, 1))
        c = np.vstack([random.standard_normal((1, n)), np.zeros((m, n))])
        d = np.vstack([np.zeros((1, m)), np.eye(m)])
        riccati = best_feedback(a, b, disturbance, c, d)
        disc = best_with_disc(a, b, disturbance, c, d, -3.0, 2.0)
        write(
            file, "feedback", count, A=a, B=b, disturbance=disturbance, output=c, feed=d, infinity=riccati, disc=disc,
            sampled=best_sampled(a, b, disturbance, c, d), peak=best_peak(a, b, disturbance, c, d),
        )


def write_radii(file, random):
    for count in range(4):
        n = 2 + count
        f = random.standard_normal((n, n))
        f -= (np.max(np.linalg.eigvals(f).real) + 0.5) * np.eye(n)
        g = random.standard_normal((n, 1 + count % 2))
        printed = linalg.solve_continuous_lyapunov(f.T, -np.eye(n))
        write(file, "radius", count, F=f, G=g, printed=2 * np.linalg.norm(printed @ g, 2), free=smallest_radius(f, g))


def main():
    random = np.random.default_rng(SEED)
    with target("lmi.txt").open("w") as file:
        versions = f"numpy {np.__version__}, scipy {scipy.__version__}, cvxpy {cp.__version__}"
        file.write(f"# scripts/reference/reference_lmi.py: {versions}\n")
        write_norms(file, random)
        write_syntheses(file, random)
        write_radii(file, random)


if __name__ == "__main__":
    main()
