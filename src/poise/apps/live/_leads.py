"""`FootLead`, `VelocityLead`: ways to lead a live robot."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import BodyLimits, Integrator, LiveFeet
from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    RecordedPush,
    Recording,
    TeleopRecorder,
    TeleopSetup,
    foot_forces,
)
from poise.control import Controller, WholeBodyController, is_usable
from poise.dynamics import RobotState
from poise.estimation import PayloadEstimator, StateEstimator
from poise.locomotion import (
    BodyCommand,
    Device,
    DeviceStatus,
    GazeLeader,
    HandLeader,
    Mode,
    OperatorGuard,
    StepEnd,
    StepTeleoperator,
    TeleopParameters,
    Walker,
    walking_stack,
)
from poise.robots import Robot
from poise.sim import Plant, PlantConfig, Recorder, RecorderConfig, Tick, check_period, rollout
from poise.stack import Stack

WALK_PLANT = PlantConfig(control_dt=0.002, self_contact=True)
# The writer's thread takes the interpreter from the robot: at 50 Hz a tick cost a fifth more
_RECORD = RecorderConfig(record_dt=0.05, scene_dt=0.1, keep=False)
# Signals of a teleoperator that are points
_PLACES = (
    "zmp_reference", "estimate/zmp", "estimate/cart_table_zmp", "estimate/com", "estimate/soles",
    "foot_target",
)  # fmt: skip


class _Lead:
    """Leader, controller, estimator and recorder of a run, constructed by `begin`."""

    body = BodyCommand()
    forces: list[list[float]] | None = None  # of the ground on the feet; None for a walk
    landings = 0  # of feet that had been in the air

    def __init__(self, robot: Robot, inputs: OperatorInputs, plant: PlantConfig, seed: int) -> None:
        self.robot, self.inputs, self.plant, self.seed = robot, inputs, plant, seed
        self.limits = BodyLimits()
        self.recording = _RECORD
        self.pushes: list[RecordedPush] = []  # of the run, in order; its recorder takes them out


class _DrawnTeleoperator(StepTeleoperator):
    """A teleoperator whose signals are in the drawn world."""

    offset = np.zeros(3)  # of the drawn world against the teleoperator's [m]

    def signals(self) -> Mapping[str, np.ndarray | float | str]:
        """Signals of the last tick for a recorder."""
        signals = dict(super().signals())
        for name, value in signals.items():
            if name in _PLACES or name.startswith("target/"):
                place = np.asarray(value)
                signals[name] = place + self.offset[: place.shape[-1]]
        return signals


class FootLead(_Lead):
    """Step teleoperation, by a person or a recording."""

    kind, takes = "feet", "take"

    def __init__(
        self,
        robot: Robot,
        inputs: OperatorInputs,
        plant: PlantConfig = TORQUE_TELEOP_PLANT,
        *,
        seed: int = 0,
        recording: Recording | None = None,
        parameters: TeleopParameters | None = None,
        solved_by: str | None = None,
    ) -> None:
        made = None if recording is None else recording.setup_for(robot, plant.actuation)
        super().__init__(robot, inputs, plant, seed if made is None else made.seed)
        self._recording, self._rotator = recording, made is None or made.rotator
        self._parameters = parameters or (made and made.parameters)
        self._solved_by = solved_by or (made and made.solved_by)
        self.begin()
        check_period(self.leader, plant.control_dt)

    def begin(self) -> None:
        """Construct a new teleoperator and its device."""
        self._mode = Mode.D
        self.leader = leader = _DrawnTeleoperator(
            self.robot,
            actuation=self.plant.commanded,
            parameters=self._parameters,
            rotator=self._rotator,
            solved_by=self._solved_by,
            servo_gains=(self.plant.servo.stiffness, self.plant.servo.damping),
        )
        self.hands, self.gaze, self.estimator = leader.hands, leader.gaze, leader.estimator
        self._feet = LiveFeet(self.inputs, leader)
        self.limits, leader.device = self._feet.limits, self._feet
        self.pushes = []
        if self._recording is not None:
            leader.device = device = self._recording.device(leader)
            self.pushes = [*device.pushes]

    @property
    def idle(self) -> bool:
        """True before the first sample or push."""
        status = self.leader.status
        return not self.pushes and (status is None or status.sample is None)

    def controller(self) -> Controller:
        """Return the teleoperator's own controller."""
        return self.leader.controller()

    def recorder(self, path: Path) -> Recorder:
        """Return a recorder of samples and pushes, too."""
        setup = TeleopSetup.of(self.leader, self.plant, seed=self.seed, rotator=self._rotator)
        about = {"controller": "step teleoperation"}
        return TeleopRecorder(
            path, self.leader, setup, pushes=self.pushes, config=self.recording, metadata=about
        )

    def take_in(self, tick: Tick, plant: Plant) -> None:
        """Note forces, body, landings, and the offset of dead reckoning, by the stance sole."""
        del tick
        status = self.leader.status
        if status is not None:
            landed = self._mode.single and not status.mode.single
            self.landings += landed and status.ended is not StepEnd.STUCK
            self._mode = status.mode
        stance = self.estimator.stance
        site = plant.data.site(self.leader.soles[stance])
        self._feet.offset = self.leader.offset = site.xpos - self.estimator.sole(stance)
        self.forces, self.body = foot_forces(self.leader), self._feet.body

    def shown(self) -> dict[str, Any]:
        """Return members of a `Snapshot`; the text is the cause of a failed step."""
        status, offset = self.leader.status, self._feet.offset
        assert status is not None
        failed = status.mode is Mode.D and status.ended not in (None, StepEnd.LANDED)
        return {
            "mode": status.mode,
            "mode_text": status.ended.value if failed and status.ended else status.mode.value,
            "device": status.device,
            "zmp_reference": status.zmp_reference + offset[:2],
            "handles": np.array(self._feet.places) + offset,
            "target": None if status.target is None else status.target + offset,
        }


class VelocityLead(_Lead):
    """Walker with arms and neck, as one leader."""

    kind, takes = "velocity", "drive"
    idle = False

    def __init__(
        self,
        robot: Robot,
        inputs: OperatorInputs,
        plant: PlantConfig = WALK_PLANT,
        *,
        seed: int = 0,
    ) -> None:
        super().__init__(robot, inputs, plant, seed)
        self.leader = self
        self.begin()

    def begin(self) -> None:
        """Construct a new walker, arms and neck."""
        robot, dt = self.robot, self.plant.control_dt
        self.hands, self.gaze = HandLeader(robot, dt=dt), GazeLeader(robot, dt=dt)
        self.stack: Stack = walking_stack(robot, self.hands.task, self.gaze.task)
        self.walker = Walker(robot, self.stack)
        self.estimator = StateEstimator(robot, payload=PayloadEstimator(robot))
        self._device = Integrator(self.inputs, dt, velocities=self.walker.limits)
        self._guard, self._offset = OperatorGuard(dt=dt), np.zeros(3)

    def controller(self) -> Controller:
        """Return a controller of torques."""
        return WholeBodyController(self.robot, self.stack)

    def recorder(self, path: Path) -> Recorder:
        """Return a recorder of signals."""
        return Recorder(path, config=self.recording, metadata={"controller": "whole_body"})

    def lead(self, state: RobotState) -> None:
        """Set the targets of the next tick; a state that cannot be used changes nothing."""
        if not is_usable(state, self.robot):
            return
        self._lead(self._device, state)

    def pause(self, state: RobotState) -> None:
        """Lead without the operator: come to rest."""
        if is_usable(state, self.robot):
            self._lead(None, state)

    def _lead(self, device: Device | None, state: RobotState) -> None:
        guard = self._guard
        guard.check(guard.read(device, state.time), state.time)
        self.walker.set_velocity(*guard.velocity)
        self.walker.lead(state)
        self.hands.lead(guard, state)
        self.gaze.lead(guard)

    def signals(self) -> dict[str, np.ndarray | float | str]:
        """Signals of the last tick for a recorder, in the drawn world."""
        return {**self.walker.signals(), "zmp_reference": self.walker.zmp + self._offset[:2]}

    def take_in(self, tick: Tick, plant: Plant) -> None:
        """Note the offset of the estimated base."""
        del plant
        assert tick.estimate is not None
        self._offset = tick.truth.q[:3] - tick.estimate.q[:3]

    def shown(self) -> dict[str, Any]:
        """Return members of a `Snapshot`: state and velocity of the walk, and what was cut."""
        walker = self.walker
        ahead, left, turn = walker.commands.velocity
        text = f"{walker.status.value}: {ahead:.2f} m/s ahead, {left:.2f} m/s to the left, "
        text += f"{turn:.2f} rad/s"
        lost = self._guard.status is DeviceStatus.LOST
        return {
            "mode": walker.mode,
            "mode_text": f"{text}; {walker.notice}" if walker.notice else text,
            "device": DeviceStatus.LOST if lost else DeviceStatus.OK,
            "zmp_reference": walker.zmp + self._offset[:2],
        }


Lead = FootLead | VelocityLead


def rehearse(lead: Lead, seconds: float = 0.1) -> None:
    """Run on a simulated plant what a tick needs, so that it is compiled, and begin anew."""
    plant = Plant(lead.robot, lead.plant, seed=lead.seed)
    for _ in rollout(
        plant, lead.controller(), lead.leader, estimator=lead.estimator, duration=seconds
    ):
        pass
    lead.begin()
