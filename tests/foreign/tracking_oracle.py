"""The whole loop of a plant and a controller with references, by numpy: linear matrices, or step by step with limits.

The state is [x; x_hat; f_hat; y_f; x_i], the input [r; f], all as deviations from the operating point. The controller
follows docs/reference/fmus.md, its matrices come from the design file; the plant x' = A x + B u + F f, y = C x + F_s f
does not.
"""

import numpy as np
from scipy.linalg import expm
from scipy.signal import cont2discrete

OPTIONAL = ("H", "K_i", "F_i", "L_w", "N_r")


class TrackingLoop:
    """`plant`: A, B, C, F, F_s in continuous time; `design`: a design file."""

    def __init__(self, plant, design, limits=None):
        self.A, self.B, self.C, self.F, self.F_s = (np.asarray(one, float) for one in plant)
        self.design = {key: np.asarray(design[key], float) for key in design if isinstance(design[key], list) and key[0].isupper()}
        self.period, self.current = design.get("sample_time"), design.get("estimator") == "current"
        self.filter = np.asarray(design["filter"]) if "filter" in design else None
        (self.n, m), (p, q) = self.B.shape, self.F_s.shape
        matrices = self.design
        self.t = (matrices["K_i"] if "K_i" in matrices else matrices["N_r"]).shape[1]
        shapes = {"H": (self.t, p), "K_i": (m, self.t), "F_i": (self.t, q), "L_w": (self.t, m), "N_r": (m, self.t)}
        for name in OPTIONAL:
            matrices.setdefault(name, np.zeros(shapes[name]))
        self.limits = limits
        if self.period is not None:
            inputs = np.hstack([self.B, self.F])
            held = cont2discrete((self.A, inputs, self.C, np.zeros((p, m + q))), self.period)
            self.Phi, self.Gamma, self.Xi = held[0], held[1][:, :m], held[1][:, m:]
        self.sizes = [self.n, len(matrices["A"]), q, p if self.filter is not None else 0, self.t if "K_i" in design else 0]
        self.order, self.q = sum(self.sizes), q

    def parts(self, state):
        return np.split(state, np.cumsum(self.sizes)[:-1])

    def evaluate(self, state, r, f):
        """The derivative of the state, or the next state, and u."""
        matrices = self.design
        x, x_hat, f_hat, y_f, x_i = self.parts(state)
        y = self.C @ x + self.F_s @ f
        e = (y if self.filter is None else y_f) - matrices["C"] @ x_hat
        if self.current:
            x_hat, f_hat = x_hat + matrices["L_x"] @ e, f_hat + matrices["L_f"] @ e
        integral = matrices["K_i"] @ x_i if len(x_i) else 0.0
        free = matrices["K_x"] @ x_hat + matrices["K_f"] @ f_hat + integral + matrices["N_r"] @ r
        u = free if self.limits is None else np.clip(free, *self.limits)
        e = 0.0 * e if self.current else e
        after = matrices["A"] @ x_hat + matrices["B"] @ u + matrices["F_a"] @ f_hat + matrices["L_x"] @ e
        A_f = matrices.get("A_f", np.zeros((self.q, self.q)) if self.period is None else np.eye(self.q))
        fault = A_f @ f_hat + matrices["L_f"] @ e
        filtered = y_f if self.filter is None else self.filter * (y - y_f)
        error = r - matrices["H"] @ y + matrices["F_i"] @ f_hat
        back = matrices["L_w"] @ (u - free)
        if self.period is None:
            moved = self.A @ x + self.B @ u + self.F @ f
            integrals = (error + back)[: len(x_i)]
        else:
            moved = self.Phi @ x + self.Gamma @ u + self.Xi @ f
            filtered = y_f + filtered if self.filter is not None else y_f
            integrals = x_i + (self.period * error + back)[: len(x_i)]
        return np.concatenate([moved, after, fault, filtered, integrals]), u

    def matrices(self):
        """M, N of state' = M state + N [r; f], and U, V of u = U state + V [r; f]."""
        zero = (np.zeros(self.order), np.zeros(self.t), np.zeros(self.q))
        column = lambda state, r, f: self.evaluate(state, r, f)
        states = [column(unit, *zero[1:]) for unit in np.eye(self.order)]
        inputs = [column(zero[0], unit, zero[2]) for unit in np.eye(self.t)]
        inputs += [column(*zero[:2], unit) for unit in np.eye(self.q)]
        stack = lambda all_, at: np.array([one[at] for one in all_]).T
        return stack(states, 0), stack(inputs, 0), stack(states, 1), stack(inputs, 1)

    def constant(self):
        """The state for constant inputs [r; f], a column each."""
        M, N, _, _ = self.matrices()
        return np.linalg.solve((np.zeros_like(M) if self.period is None else np.eye(len(M))) - M, N)

    def step(self, which, size, times):
        """x and u at `times` after a step of input `which` of [r; f]; a sampled loop also between samples."""
        M, N, U, V = self.matrices()
        entry = size * N[:, [which]]
        direct = size * V[:, which]
        rows = []
        if self.period is None:
            whole = np.block([[M, entry], [np.zeros((1, len(M) + 1))]])
            state, before, steps = np.append(np.zeros(len(M)), 1.0), 0.0, {}
            for time in times:
                size = round(time - before, 12)
                if size not in steps:
                    steps[size] = expm(whole * size)
                state, before = steps[size] @ state, before + size
                rows.append((state[: self.n], U @ state[:-1] + direct))
            return [np.array(one) for one in zip(*rows)]
        held = np.block([[self.A, self.B], [np.zeros((self.B.shape[1], self.n + self.B.shape[1]))]])
        state, k, steps = np.zeros(len(M)), 0, {}
        for time in times:
            while (k + 1) * self.period <= time * (1 + 1e-12):
                state, k = M @ state + entry[:, 0], k + 1
            u = U @ state + direct
            size = round(time - k * self.period, 12)
            if size not in steps:
                steps[size] = expm(held * size)
            rows.append(((steps[size] @ np.append(state[: self.n], u))[: self.n], u))
        return [np.array(one) for one in zip(*rows)]
