"""The sampled controller by numpy: the recursion from sample to sample.

current:     z[k|k] = z[k|k-1] + L e[k],  u[k] = K z[k|k],  z[k+1|k] = Phi z[k|k] + Gamma u[k]
prediction:  u[k] = K z[k|k-1],  z[k+1|k] = Phi z[k|k-1] + Gamma u[k] + L e[k]

with z = [x_hat - x_op; f_hat], Phi = [A, F_a; 0, A_f], Gamma = [B; 0], e = y - y_op - C x_hat.
"""

import numpy as np

from design_file import MATRICES


class SampledController:
    """A design that always compensates; its signals are deviations from the operating point."""

    def __init__(self, design, z, y):
        A, B, C, F_a, K_x, K_f, L_x, L_f = (np.asarray(design[name], float) for name in MATRICES)
        (n, q), m = F_a.shape, B.shape[1]
        A_f = np.asarray(design.get("A_f", np.eye(q)))
        self.transition = np.block([[A, F_a], [np.zeros((q, n)), A_f]])
        self.entry = np.vstack([B, np.zeros((q, m))])
        self.view = np.hstack([C, np.zeros((len(C), q))])
        self.feedback, self.gain = np.hstack([K_x, K_f]), np.vstack([L_x, L_f])
        point = lambda name: np.array([signal.get("operating", 0.0) for signal in design[name]])
        self.x_op = np.concatenate([point("states"), np.zeros(q)])
        self.u_op, self.y_op = point("actuators"), point("measurements")
        free = [-np.inf, np.inf]
        self.limits = np.transpose([signal.get("limits", free) for signal in design["actuators"]])
        self.filter = design.get("filter")
        self.current = design["estimator"] == "current"
        self.predicted, self.filtered = np.asarray(z) - self.x_op, np.asarray(y)

    def sample(self, y):
        """Takes one sample; returns [x_hat; f_hat], y_f and u at it."""
        y, z, y_f = np.asarray(y), self.predicted, self.filtered
        source = y if self.filter is None else y_f
        correction = self.gain @ (source - self.y_op - self.view @ z)
        if self.current:
            z = z + correction
        u = np.clip(self.feedback @ z + self.u_op, *self.limits)
        self.predicted = self.transition @ z + self.entry @ (u - self.u_op)
        if not self.current:
            self.predicted = self.predicted + correction
        if self.filter is not None:
            self.filtered = y_f + np.asarray(self.filter) * (y - y_f)
        return z + self.x_op, y_f, u
