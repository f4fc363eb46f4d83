"""The paper's pendulum as an environment for gymnasium: the agent pushes the cart.

    python -m pip install gymnasium
    python python/examples/pendulum_env.py

An episode starts from the state that the FMU had after its initialization, which `Simulation.restore`
brings back, so that a reset costs as much as a step.
"""

from __future__ import annotations

from typing import Any

import aso_ftc as af
import gymnasium
import numpy as np

OBSERVED = ["pendulum.x_p", "pendulum.theta", "pendulum.v_p", "pendulum.omega"]


class PendulumEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Keeps the pendulum upright against friction.

    Observation: cart position in m, angle in rad, their rates. Action: force on the cart in N. Reward:
    1 for each step in which the pendulum stays within 0.2 rad, less a little for position and force.
    """

    def __init__(self, step: float = 0.02, length: float = 10.0, largest_force: float = 60.0) -> None:
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4,), np.float64)
        self.action_space = gymnasium.spaces.Box(-largest_force, largest_force, (1,), np.float64)
        self._largest_force = largest_force
        self._system = af.System().add("pendulum", af.fmus()["FrictionPendulum"])
        self._system.start_values.update({"pendulum.x_p_0": 0.0, "pendulum.theta_0": 0.02})
        self._simulation = self._system.simulation(stop_time=length, step=step)
        self._start = self._simulation.save()

    def _observe(self) -> np.ndarray:
        return np.array(self._simulation.get(OBSERVED))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Return to the start of an episode."""
        super().reset(seed=seed)
        self._simulation.restore(self._start)
        return self._observe(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Push the cart for one communication step."""
        force = max(-self._largest_force, min(self._largest_force, float(action[0])))
        self._simulation.set("pendulum.u", force)
        self._simulation.step()
        observed = self._observe()
        fallen = bool(abs(observed[1]) > 0.2)
        reward = float(not fallen) - 0.1 * float(observed[0]) ** 2 - 1e-5 * force**2
        return observed, reward, fallen, self._simulation.finished, {"time": self._simulation.time}

    def close(self) -> None:
        """Free the FMU."""
        self._simulation.close()


def main() -> None:
    """Runs one episode with the paper's state feedback."""
    env = PendulumEnv()
    gain = np.array([184.08812631, 365.72139802, 123.65428482, 63.86566569])
    observed, _ = env.reset(seed=1)
    total, ended = 0.0, False
    while not ended:
        observed, reward, fallen, finished, _ = env.step(np.array([gain @ observed]))
        total, ended = total + reward, fallen or finished
    print(f"reward {total:.1f}, cart at {observed[0]:.3f} m")
    env.close()


if __name__ == "__main__":
    main()
