"""Builds the foreign FMUs of the tests with PythonFMU: LqrController.fmu and CartPendulum.fmu.

Usage: python tests/foreign/build.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np
from pythonfmu import FmuBuilder
from scipy.linalg import solve_continuous_are

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from cart_pendulum import derivative  # noqa: E402
from lqr_controller import GAINS, LARGEST_FORCE, LARGEST_STATES  # noqa: E402


def linearised_pendulum():
    """A and B of the upright pendulum, by central differences of the model itself."""
    step = 1e-6
    points = np.vstack([np.eye(5), -np.eye(5)]) * step
    values = np.array([derivative(point[:4], point[4]) for point in points])
    jacobian = (values[:5] - values[5:]).T / (2 * step)
    return jacobian[:, :4], jacobian[:, 4:]


def optimal_gains():
    """Gains of the linear quadratic regulator with the weights of lqr_controller.py."""
    a, b = linearised_pendulum()
    state_weight = np.diag(1 / np.square(LARGEST_STATES))
    force_weight = np.array([[1 / LARGEST_FORCE**2]])
    riccati = solve_continuous_are(a, b, state_weight, force_weight)
    return np.linalg.solve(force_weight, b.T @ riccati)[0]


def main():
    """Builds both FMUs into the folder given on the command line."""
    if len(sys.argv) != 2:
        sys.exit(__doc__.strip().splitlines()[-1])
    if not np.allclose(GAINS, optimal_gains(), rtol=1e-6):
        sys.exit(f"the gains in lqr_controller.py are not optimal, these are: {optimal_gains()}")
    for script in ("lqr_controller.py", "cart_pendulum.py"):
        print(FmuBuilder.build_FMU(HERE / script, dest=sys.argv[1]))


if __name__ == "__main__":
    main()
