"""Design files with a schedule: the drive that the tests share, and the interpolation in numpy."""

import tomllib

import numpy as np

MATRICES = ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f", "P_f", "K_i", "L_w", "N_r"]
LISTS = ["x_op", "u_op", "y_op", "r_op"]

# A drive whose inertia, spring and friction are known; the angle that is measured has an operating point.
DRIVE = """A = [[0, 1], [-1.0, -0.5]]
B = [[0], [1]]
C = [[1, 0]]
states = ["phi", "w"]
actuators = [{ name = "torque", limits = [-3.0, 3.0] }]
measurements = [{ name = "angle", operating = 0.0 }]
actuator_faults = "all"
feedback.eigenvalues = [-1.2, -2.0, -2.5]
observer.eigenvalues = [-6.0, -7.0, -8.0]
robustness.cases = 3

[reference]
track = ["angle"]
feedforward = true

[schedule]
variable = "inertia"

[[schedule.points]]
at = 1.0

[[schedule.points]]
at = 2.0
A = [[0, 1], [-1.5, -0.15]]
B = [[0], [0.5]]
x_op = [0.4, 0]
u_op = [1.2]
y_op = [0.4]

[[schedule.points]]
at = 4.0
A = [[0, 1], [-0.375, -0.05]]
B = [[0], [0.25]]
x_op = [0.2, 0]
u_op = [0.3]
y_op = [0.2]
"""


class ScheduledDesign:
    """A design file with a schedule."""

    def __init__(self, text):
        self.file = tomllib.loads(text)
        self.points = self.file["schedule"]["points"]
        self.at = [point["at"] for point in self.points]
        free = [-np.inf, np.inf]
        self.limits = np.transpose([actuator.get("limits", free) for actuator in self.file["actuators"]])
        (self.n, self.q), self.t = np.shape(self.file["F_a"]), len(self.points[0].get("r_op", []))
        self.integrals = self.t if "K_i" in self.points[0] else 0

    def numbers(self, value):
        """Matrices and operating point at a value of the scheduling variable."""
        value = min(max(value, self.at[0]), self.at[-1])
        k = min(np.searchsorted(self.at, value, side="right"), len(self.at) - 1) - 1
        s = (value - self.at[k]) / (self.at[k + 1] - self.at[k])
        low, high = self.points[k], self.points[k + 1]
        names = [name for name in MATRICES + LISTS if name in low]
        return {name: (1 - s) * np.array(low[name]) + s * np.array(high[name]) for name in names}
