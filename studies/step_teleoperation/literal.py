"""`LiteralTeleoperator`: the rules of Zhang and Kikuuwe word for word.

`zmp_as_measured`: without Poise's filter of the ZMP.
`PaperWeights` and `PaperDoubleWeights`: Poise's rules with the weights (39c) and (39d).
"""

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any, ClassVar
from unittest.mock import patch

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control import DifferentialIK
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import (
    ComShifter,
    Mode,
    OperatorSample,
    StepTeleoperator,
    TeleopStatus,
)
from poise.robots import Robot

_K1, _K2, _W_S2 = 4500.0, 7000.0, 100.0
"""k_1 and k_2 of (39c) and w_S2, as the paper has them."""

_K_V, _LANDED = 10.0, 0.047
"""k_v [1/s], and 30 N over the weight of the paper's robot."""


def zmp_as_measured() -> AbstractContextManager[object]:
    """Leave the measured ZMP unfiltered for a while, as in the paper; leaders are made inside."""
    return patch("poise.locomotion._stepping._estimator._ZMP_TIME", 1e-9)


def momentum_weights(error: Sequence[float], least: float) -> list[float]:
    """Eq. (39c): W_A of the angular momentum about x and y."""
    x, y = error
    return [max(_K1 * y * y, least), max(_K2 * x * x, least)]


def weigh_as_paper(teleoperator: StepTeleoperator, error: Sequence[float], *, single: bool) -> None:
    """Eqs (39c) in single support and (39d) otherwise, on the stack of a teleoperator."""
    p = teleoperator._numbers  # pyright: ignore[reportPrivateUsage]
    stack = teleoperator.stack
    foot = f"{teleoperator.soles[1 - teleoperator.estimator.stance]} place"
    for task, weight in (
        ("angular momentum", momentum_weights(error, p.epsilon) if single else p.epsilon),
        ("torso", p.epsilon if single else p.w_B),
        (foot, p.w_S1 if single else _W_S2),
    ):
        stack.task(task).set_weight(np.sqrt(np.array(weight) / DifferentialIK.ROW_WEIGHT))


def saturate(limit: float, value: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Eq. (18): limit value / max(limit, |value|)."""
    return value * (limit / max(limit, math.sqrt(float(value.dot(value)))))


class LiteralTeleoperator(StepTeleoperator):
    """Leads the same stack on the same estimate, by the paper's rules and no others.

    It differs from `StepTeleoperator` in the departures that docs/teleoperation_paper.md lists,
    within `zmp_as_measured`. It keeps bounds of joints, and passes samples over that are no
    numbers, which the paper leaves open.
    """

    def __init__(self, robot: Robot, *, rotator: bool = True, **options: Any) -> None:
        self._rotator = rotator
        super().__init__(robot, rotator=rotator, **options)

    def reset(self) -> None:
        """Forgets the past."""
        super().reset()
        estimator, weight = self.estimator, self.robot.weight
        self._paper_mode, self._last_status = Mode.D, None
        self._landed_load = _LANDED * weight
        self._nominal = float(estimator.dynamics.com[2] - estimator.anchors[0][2])
        kp, most = self.parameters.kp, self._numbers.acceleration_max
        self._shifter = ComShifter(self._nominal, kp=kp, acceleration_max=most)
        self._newest = self.resting_sample
        self._was_up = [True, True]
        self._velocity, self._acceleration, self._momentum = np.zeros((3, 2))

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        return self._paper_mode

    @property
    def status(self) -> TeleopStatus | None:
        """How the last tick stood; None before the first."""
        return self._last_status

    def lead(self, state: RobotState) -> None:
        """One tick of (14) to (17), (37) and (39)."""
        dynamics = self.estimator.dynamics
        if state is not dynamics.state or self.device is None:
            return
        sample = self.device.sample(state.time)
        if sample is not None and np.isfinite([sample.place(0), sample.place(1)]).all():
            self._newest = sample
        self._move_on()
        reference = self._zmp_reference()
        self._drive(reference, dynamics)
        self._ask(reference, dynamics)
        self._last_status = self._paper_status(reference, sample, dynamics)

    # Modes -------------------------------------------------------------------------------------

    def _move_on(self) -> None:
        """Eq. (14)."""
        lifted, before = self._lifted(), self._paper_mode
        support, loads, estimator = before.support, self.estimator.sense.loads, self.estimator
        if support is None:
            after = Mode.TL if lifted[1] else Mode.TR if lifted[0] else Mode.D
        elif before.single:
            after = Mode.D if loads[1 - support] > self._landed_load else before
        else:
            off = np.linalg.norm(self.estimator.sense.zmp - self._zmp_reference())
            single = Mode.SL if support == 0 else Mode.SR
            after = single if off <= self._numbers.r_lift else before
        if after is before:
            return
        self._paper_mode = after
        if after is Mode.D and support is not None:
            estimator.put_down(1 - support)
        estimator.stand_on(after.support or 0)

    def _lifted(self) -> list[bool]:
        """Eqs (14a) and (14b): which devices have been lifted since the last tick."""
        rising = [False, False]
        for foot in (0, 1):
            height = self._newest.place(foot)[2] - self.estimator.anchors[foot][2]
            is_up = bool(height > self.parameters.lift_height)
            rising[foot] = is_up and not self._was_up[foot]
            self._was_up[foot] = is_up
        return rising

    # References --------------------------------------------------------------------------------

    def _zmp_reference(self) -> Float64[np.ndarray, "2"]:
        """Eq. (15a)."""
        support = self._paper_mode.support
        soles = [self.estimator.sole(foot)[:2] for foot in (0, 1)]
        return 0.5 * (soles[0] + soles[1]) if support is None else soles[support]

    def _drive(self, reference: Float64[np.ndarray, "2"], dynamics: Dynamics) -> None:
        """Eqs (37), (39a) and (39b), integrated."""
        com, dt = dynamics.com[:2], self.parameters.dt
        velocity = dynamics.com_velocity[:2]
        self._acceleration = self._shifter.acceleration(reference, com, velocity)
        self._velocity = self._velocity + dt * self._acceleration
        if self._rotator and self._paper_mode.single:
            x, y = (reference - self._cart_table_zmp(dynamics)).tolist()
            self._momentum = self._momentum + dt * (self.robot.weight * np.array([y, -x]))

    def _cart_table_zmp(self, dynamics: Dynamics) -> Float64[np.ndarray, "2"]:
        """Eq. (26)."""
        return dynamics.com[:2] - self._acceleration / self.driver.omega**2

    def _ask(self, reference: Float64[np.ndarray, "2"], dynamics: Dynamics) -> None:
        """Eqs (15) to (17), and (39c) and (39d)."""
        p, stack, estimator = self._numbers, self.stack, self.estimator
        fastest = self._biped.tall  # v_lim: 1 m/s for the paper's robot
        stance, other = estimator.stance, 1 - estimator.stance
        stack.contact(self.soles[stance]).engage(0.0)
        stack.contact(self.soles[other]).release(0.0)
        # Nothing in the paper keeps one leg off the other.
        stack.self_collision_limit.rest(True)
        height = self._nominal + float(estimator.anchors[stance][2])
        up = saturate(fastest, np.array([_K_V * (height - dynamics.com[2])]))
        stack.task("com").set_velocity(np.array([*self._velocity, *up]))
        stack.task("angular momentum").set_velocity(self._momentum)
        for task, frame in (("torso", self.robot.torso), (f"{self.soles[other]} level", None)):
            rotation = dynamics.frame(self.robot.frame_id(frame or self.soles[other])).rotation
            turn = p.k_omega * pin.log3(rotation.T)
            stack.task(task).set_velocity(saturate(p.omega_lim, turn))
        foot, here = stack.task(f"{self.soles[other]} place"), estimator.sole(other)
        single = self._paper_mode.single
        place = np.array(self._newest.place(other)) if single else here
        foot.set_velocity(saturate(fastest, _K_V * (place - here)))
        error = (reference - self.estimator.sense.zmp).tolist()
        weigh_as_paper(self, error, single=single)

    def _paper_status(
        self, reference: Float64[np.ndarray, "2"], sample: OperatorSample | None, dynamics: Dynamics
    ) -> TeleopStatus:
        torso = dynamics.placement(self.robot.frame_id(self.robot.torso))
        other = 1 - self.estimator.stance
        return TeleopStatus(
            mode=self._paper_mode,
            sample=sample,
            zmp=self.estimator.sense.zmp,
            zmp_reference=reference,
            cart_table_zmp=self._cart_table_zmp(dynamics),
            com=dynamics.com,
            soles=(self.estimator.sole(0), self.estimator.sole(1)),
            target=np.array(self._newest.place(other)) if self._paper_mode.single else None,
            loads=self.estimator.sense.loads.copy(),
            tilt=float(np.arccos(np.clip(torso[1][2, 2], -1.0, 1.0))),
            hands=tuple(self.hands.status),
            hand_targets=self.hands.targets(*torso),
            hand_rotations=self.hands.orientations(torso[1]),
        )


class PaperWeights(StepTeleoperator):
    """Poise's rules, but weights as the paper has them, (39c) and (39d).

    And nothing keeps one leg off the other: where that held the foot the ZMP would be compared for
    another swing than the paper's.
    """

    # Whether (39c) holds in single support; otherwise (39d) does in every mode
    weighs_single: ClassVar[bool] = True

    def lead(self, state: RobotState) -> None:
        """One tick."""
        super().lead(state)
        self.stack.self_collision_limit.rest(True)
        status = self.status
        if status is not None:
            error = (status.zmp_reference - status.zmp).tolist()
            weigh_as_paper(self, error, single=self.weighs_single and status.mode.single)


class PaperDoubleWeights(PaperWeights):
    """Poise's rules, but (39d) in every mode: our reading of the disabled body rotator."""

    weighs_single = False
