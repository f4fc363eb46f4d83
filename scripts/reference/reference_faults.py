"""Writes crates/control/tests/data/faults.txt: invariant zeros, distances, sampled plants and loss of effectiveness by SciPy.

* zeros: finite generalised eigenvalues of the system pencil, scipy.linalg.eig (QZ);
* distances: the smallest singular value of [A - s I, B] minimised over a grid of the plane, then by Nelder and Mead,
  A balanced and of norm one, B of norm one;
* sampled plants: scipy.signal.cont2discrete, zero-order hold, with the fault model as part of the states;
* loss of effectiveness: gains by scipy.signal.place_poles, the loss at which the spectral abscissa is zero, or
  the spectral radius of the sampled loop one, by brentq.

Each matrix stands below a line with its name, rows and columns. Needs Python with numpy and scipy; writes to the path
given as the first argument, or to the committed file.
"""

import numpy as np
import scipy
from scipy.linalg import eig
from scipy.optimize import brentq, minimize
from scipy.signal import cont2discrete, place_poles

from matrices import numbers, target

RANDOM = np.random.default_rng(20)


def integers(rows, cols):
    return RANDOM.integers(-4, 5, (rows, cols)).astype(float)


def zeros(a, b, c):
    n, m, p = len(a), b.shape[1], len(c)
    pencil = np.block([[a, b], [c, np.zeros((p, m))]])
    values = eig(pencil, np.diag([1.0] * n + [0.0] * m), right=False)
    finite = np.sort_complex(values[np.abs(values) < 1e6])
    return np.array([finite.real, finite.imag])


def levelled(a):
    """Scales A diagonally until rows and columns have equal sums without the diagonal: it is balanced."""
    for _ in range(200):
        for i in range(len(a)):
            others = np.delete(np.arange(len(a)), i)
            scale = np.sqrt(np.abs(a[i, others]).sum() / np.abs(a[others, i]).sum())
            a[:, i] *= scale
            a[i, :] /= scale
    return a


def distance(a, b):
    def least(s):
        return np.linalg.svd(np.hstack([a - complex(*s) * np.eye(len(a)), b]), compute_uv=False)[-1]

    side = np.linspace(-2.0, 2.0, 161)
    starts = sorted((least((x, y)), x, y) for x in side for y in side if y >= 0.0)[:40]
    options = dict(xatol=1e-12, fatol=1e-14, maxiter=4000)
    minima = [minimize(least, start[1:], method="Nelder-Mead", options=options) for start in starts]
    best = min(minima, key=lambda result: result.fun)
    return np.array([[best.fun, best.x[0], abs(best.x[1])]])


def sampled(a, b, f_a, a_f, period):
    n, q, m = len(a), len(a_f), b.shape[1]
    whole = np.block([[a, f_a], [np.zeros((q, n)), a_f]])
    inputs = np.vstack([b, np.zeros((q, m))])
    phi, gamma, *_ = cont2discrete((whole, inputs, np.eye(n + q), np.zeros((n + q, m))), period, method="zoh")
    return np.hstack([phi, gamma])


def pendulum():
    cart, mass, inertia, length, damping, joint, gravity = 3.2, 0.535, 0.062, 0.365, 6.2, 0.009, 9.807
    total, moment = cart + mass, mass * length
    d = total * inertia - moment**2
    a = np.array([
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [0, -moment**2 * gravity / d, -damping * inertia / d, moment * joint / d],
        [0, total * moment * gravity / d, moment * damping / d, -total * joint / d],
    ])
    return a, np.array([[0], [0], [inertia / d], [-moment / d]])


def loss(data):
    """Two carts connected by a spring on an unstable slope, a force on each; both forces lose effectiveness."""
    a = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [3.0, 1, -0.2, 0], [1, 2.0, 0, -0.1]])
    b = np.array([[0, 0], [0, 0], [1.0, 0], [0, 0.5]])
    c = np.eye(2, 4)
    k_x = -place_poles(a, b, [-1.0, -1.5, -2.0, -2.5]).gain_matrix
    k_f = -np.eye(2)
    a_0 = np.block([[a, -b], [np.zeros((2, 6))]])
    c_0 = np.hstack([c, np.zeros((2, 2))])
    poles = [-6.0, -7.0, -8.0, -9.0, -10.0, -11.0]
    l_0 = place_poles(a_0.T, c_0.T, poles).gain_matrix.T
    l_x, l_f = l_0[:4], -l_0[4:]

    def abscissa(e):
        left = b @ np.diag(1.0 - np.asarray(e))
        x_hat = np.hstack([l_x @ c, a + b @ k_x - l_x @ c, b @ k_f + b])
        f_hat = np.hstack([l_f @ c, -l_f @ c, np.zeros((2, 2))])
        loop = np.vstack([np.hstack([a, left @ k_x, left @ k_f]), x_hat, f_hat])
        return np.linalg.eigvals(loop).real.max()

    data.update(loss_a=a, loss_b=b, loss_k_x=k_x, loss_l_x=l_x, loss_l_f=l_f, loss_limits=limits(abscissa))
    sampled_loss(data, a, b, c)


def limits(instability):
    """The loss up to which the loop is stable: of both inputs alike, of the first alone, of the second alone."""
    def limit(direction):
        end = next(t for t in np.linspace(0.01, 1.0, 100) if instability(t * np.array(direction)) > 0.0)
        return brentq(lambda t: instability(t * np.array(direction)), end - 0.01, end, xtol=1e-14)

    return np.array([[limit(direction) for direction in ([1.0, 1.0], [1.0, 0.0], [0.0, 1.0])]])


def sampled_loss(data, a, b, c):
    """The same with a current estimator at 0.1 s; the loop is one step of the algorithm as a matrix."""
    phi, gamma, *_ = cont2discrete((a, b, c, np.zeros((2, 2))), 0.1, method="zoh")
    k_x = -place_poles(phi, gamma, np.exp([-0.1, -0.15, -0.2, -0.25])).gain_matrix
    a_0 = np.block([[phi, -gamma], [np.zeros((2, 4)), np.eye(2)]])
    c_0 = np.hstack([c, np.zeros((2, 2))])
    poles = np.exp([-0.6, -0.7, -0.8, -0.9, -1.0, -1.1])
    m_0 = place_poles(a_0.T, (c_0 @ a_0).T, poles).gain_matrix.T
    m_x, m_f = m_0[:4], -m_0[4:]

    def step(state, e):
        x, x_hat, f_hat = state[:4], state[4:8], state[8:]
        residual = c @ (x - x_hat)
        x_hat, f_hat = x_hat + m_x @ residual, f_hat + m_f @ residual
        u = k_x @ x_hat - f_hat
        return np.concatenate([phi @ x + gamma @ ((1.0 - e) * u), phi @ x_hat + gamma @ (u + f_hat), f_hat])

    def radius(e):
        return np.abs(np.linalg.eigvals(np.array([step(unit, e) for unit in np.eye(10)]).T)).max() - 1.0

    data.update(sampled_loss_a=phi, sampled_loss_b=gamma, sampled_loss_k_x=k_x, sampled_loss_m_x=m_x)
    data.update(sampled_loss_m_f=m_f, sampled_loss_limits=limits(radius))


def main():
    data = {}
    for case, (n, m) in enumerate([(5, 2), (6, 3), (7, 2)]):
        a, b, c = integers(n, n), integers(n, m), integers(m, n)
        if case == 2:
            c = c @ np.diag([1.0] * 4 + [0.0] * 3)
        data.update({f"zeros_{case}_a": a, f"zeros_{case}_b": b, f"zeros_{case}_c": c, f"zeros_{case}": zeros(a, b, c)})
    for case, n in enumerate([3, 5, 4, 4, 4]):
        a = RANDOM.standard_normal((n, n))
        b = RANDOM.standard_normal((n, 1))
        if case == 4:
            a = 0.2 * a + np.kron(np.diag([1.0, 0.5]), [[0.0, 1.0], [-1.0, 0.0]])
            b[:2] *= 0.05
        a = levelled(a)
        a /= np.linalg.norm(a, 2)
        b /= np.linalg.norm(b)
        data.update({f"distance_{case}_a": a, f"distance_{case}_b": b, f"distance_{case}": distance(a, b)})
    a, b = pendulum()
    for name, period in [("0", 1e-4), ("1", 1e-2)]:
        data["pendulum_" + name] = sampled(a, b, -b, np.zeros((1, 1)), period)
    a, b, f_a = integers(3, 3), integers(3, 2), integers(3, 2)
    ramps = np.block([[np.zeros((2, 2)), np.eye(2)], [np.zeros((2, 4))]])
    data.update(ramp_a=a, ramp_b=b, ramp_f_a=f_a, ramp=sampled(a, b, np.hstack([f_a, 0 * f_a]), ramps, 0.25))
    loss(data)
    with target("faults.txt").open("w") as file:
        file.write(f"# scripts/reference/reference_faults.py: numpy {np.__version__}, scipy {scipy.__version__}\n")
        for name, matrix in data.items():
            file.write(f"{name} {matrix.shape[0]} {matrix.shape[1]}\n")
            for row in matrix:
                file.write(numbers(row) + "\n")


if __name__ == "__main__":
    main()
