"""`LinkedPlant`: a robot behind a link with the interface of a plant."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.hardware import LinkBody, robot_state
from poise.sim import Estimator, Plant, PlantConfig, Push, Value


class LinkedPlant(Plant):
    """Robot behind a link, with the interface of a plant for records, pages and viewers.

    Its simulator does no physics: it shows the estimate. True state, CoM and ZMP are those of the
    estimate, the applied torque is that of the motors as measured.

    Args:
        body: the robot.
        config: floor and blocks to draw.

    Attributes:
        body: the robot.
    """

    def __init__(self, body: LinkBody, config: PlantConfig) -> None:
        self.body = body
        # Not the body's own state, which begins the run.
        self._estimate, self._made = robot_state(body.robot, body.link.info, body.measured), False
        super().__init__(body.robot, config)
        self._sites = {name: self.model.site(name).id for name in body.robot.soles}
        self.show(self._estimate)
        self._made = True

    def watch(self, estimator: Estimator) -> Estimator:
        """Return the estimator, whose estimates the plant shows."""
        return _Watched(estimator, self)

    @property
    def time(self) -> float:
        """Time of the body [s]."""
        return self.body.time

    @property
    def fallen(self) -> bool:
        """True where the run has ended."""
        return self.body.fallen

    @property
    def trouble(self) -> str:
        """Reason of the watchdog for an end; "" for none."""
        return self.body.verdict.reason if self.body.fallen else ""

    @property
    def applied_torque(self) -> Float64[np.ndarray, " nj"]:
        """Torques of the joints as measured [N m]."""
        return np.nan_to_num(self.body.measured.tau)

    def state(self) -> RobotState:
        """Return the measured state."""
        return self.body.state() if self._made else self._estimate

    def step(self, command: Command | None, position: Any = None) -> None:
        """Send a command and wait for the next state."""
        del position
        if command is not None:
            self.body.step(command)

    def push(self, *_: Any, **__: Any) -> Push:
        """Refuse a push."""
        raise ConfigurationError("a robot behind a link cannot be pushed", wanted="no pushes")

    def signals(self) -> Mapping[str, Value | str]:
        """Return what was received and sent in the last tick, for a recorder."""
        return self.body.signals()

    def show(self, estimate: RobotState) -> None:
        """Show an estimate."""
        unknown = dict.fromkeys(self.robot.soles, np.full(6, np.nan))
        self._estimate = replace(estimate, contacts=unknown | dict(estimate.contacts))
        self.place(estimate.q, estimate.v)

    def zmp(self, height: float = 0.0) -> Float64[np.ndarray, "2"]:
        """ZMP of the estimated sole wrenches on the plane z = height [m]; NaN without load."""
        data, load, roll, pitch = self.data, 0.0, 0.0, 0.0
        for name, wrench in self._estimate.contacts.items():
            site = self._sites[name]
            turned = data.site_xmat[site].reshape(3, 3) @ wrench.reshape(2, 3).T
            (fx, nx), (fy, ny), (fz, _) = turned.tolist()
            x, y, z = data.site_xpos[site].tolist()
            load += fz
            roll += nx + y * fz - (z - height) * fy
            pitch += ny + (z - height) * fx - x * fz
        return np.array([-pitch, roll]) / load if load > 0.0 else np.full(2, np.nan)

    @property
    def _true(self) -> RobotState:
        return self._estimate


class _Watched:
    """Estimator that shows its estimates."""

    def __init__(self, estimator: Estimator, plant: LinkedPlant) -> None:
        self._estimator, self._plant = estimator, plant

    def update(self, state: RobotState) -> RobotState:
        estimate = self._estimator.update(state)
        self._plant.show(estimate)
        return estimate

    def __getattr__(self, name: str) -> Any:
        return getattr(self._estimator, name)
