"""The controller's equations in the general form, by numpy, mpmath and scipy: the expected values.

x_hat' = A x_hat + B u + F_a f_hat + L_x (y - C x_hat)
f_hat' = L_f (y - C x_hat)              while estimating, else 0
u      = K_x x_hat + K_f f_hat          while compensating, else K_x x_hat; within its limits
"""

import numpy as np
from mpmath import mp
from scipy.integrate import solve_ivp

from design_file import MATRICES

DIGITS = 60


def element_name(name, row, column):
    """The structured name of a matrix element."""
    return f"{name}[{row + 1},{column + 1}]"


def read_matrices(instance):
    """The eight matrices, read element by element from the parameters of an instance."""
    parameters = [v for v in instance.fmu.names(causality="parameter") if "," in v]
    matrices = {}
    for name in MATRICES:
        indices = [p[len(name) + 1 : -1].split(",") for p in parameters if p.startswith(f"{name}[")]
        rows, columns = (max(int(index[k]) for index in indices) for k in (0, 1))
        names = [element_name(name, i, j) for i in range(rows) for j in range(columns)]
        assert len(indices) == rows * columns
        matrices[name] = np.array(instance.get(*names)).reshape(rows, columns)
    return matrices


def linear_system(design, compensating, estimating):
    """M and N of [x_hat; f_hat]' = M [x_hat; f_hat] + N y, no channel at a limit."""
    A, B, C, F_a, K_x, K_f, L_x, L_f = (np.asarray(design[name], float) for name in MATRICES)
    q = F_a.shape[1]
    M = np.block(
        [
            [A + B @ K_x - L_x @ C, F_a + compensating * (B @ K_f)],
            [-estimating * (L_f @ C), np.zeros((q, q))],
        ]
    )
    return M, np.vstack([L_x, estimating * L_f])


def propagated(design, z, y, slope, size, compensating, estimating):
    """[x_hat; f_hat] after `size` s of y + slope t: exp of [M N 0; 0 0 I; 0 0 0] times `size`."""
    M, N = linear_system(design, compensating, estimating)
    order, inputs = N.shape
    augmented = np.zeros((order + 2 * inputs,) * 2)
    augmented[:order, :order], augmented[:order, order : order + inputs] = M, N
    augmented[order : order + inputs, order + inputs :] = np.eye(inputs)
    with mp.workdps(DIGITS):
        end = mp.expm(mp.matrix(augmented.tolist()) * mp.mpf(size)) * mp.matrix([*z, *y, *slope])
        return np.array([float(value) for value in end[:order]])


def command(design, z, compensating, limits=None):
    """u at z."""
    x_hat, f_hat = np.split(np.asarray(z), [len(design["A"])])
    u = np.asarray(design["K_x"]) @ x_hat + compensating * (np.asarray(design["K_f"]) @ f_hat)
    return u if limits is None else np.clip(u, *np.transpose(limits))


def saturated(design, z, y, slope, times, limits):
    """[x_hat; f_hat] at each of `times`, from 0 s on, with limited commands, compensating."""
    A, B, C, F_a, K_x, K_f, L_x, L_f = (np.asarray(design[name], float) for name in MATRICES)
    y, slope = np.asarray(y), np.asarray(slope)

    def right(time, z):
        x_hat, f_hat = np.split(z, [len(A)])
        innovation = y + slope * time - C @ x_hat
        u = command(design, z, True, limits)
        return np.concatenate(
            [A @ x_hat + B @ u + F_a @ f_hat + L_x @ innovation, L_f @ innovation]
        )

    end = times[-1]
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13, "max_step": end / 500}
    done = solve_ivp(right, (0, end), z, t_eval=times, **options)
    assert done.success
    return done.y.T
