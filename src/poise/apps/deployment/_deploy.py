"""`deploy`: a scenario on a robot behind a link."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from msgspec import structs

from poise.apps.deployment._linked_plant import LinkedPlant
from poise.apps.scenarios import Progress, Run, Scenario, Stage, run_stage, stage_scenario
from poise.errors import ConfigurationError
from poise.hardware import RAMP, WARM, Gains, LastCheck, Link, LinkBody, TorqueSplit
from poise.locomotion import Device, OperatorSample, StepTeleoperator
from poise.robots import Robot
from poise.sim import Recorder, RecorderConfig, garbage_frozen, rollout

FLUSH = 4e-3
"""Time between two writings of the log [s]: two ticks of a G1. A killed run may lose 20 ms, and the
writer's thread waits for the tick."""

_TURN = 5e-4
"""Time after which a thread gets Python's interpreter from another [s]: a quarter of a tick. The
writer asks for it several times a chunk, and Python's default is 5 ms."""

_REHEARSAL = 0.1
"""Length of the rehearsal [s]: all of a tick runs in its first few, and is compiled then."""


def stage_deployment(
    scenario: Scenario,
    robot: Robot,
    link: Link,
    check: LastCheck,
    split: TorqueSplit | None = None,
    *,
    kp: Gains | None = None,
    kd: Gains | None = None,
    posture: bool = True,
    ramp: float = RAMP,
    ready: Callable[[], bool] | None = None,
    operator: Callable[[], float | None] | None = None,
) -> Stage:
    """Stage a scenario on a robot behind a link.

    A first stage is rehearsed on the scenario's own plant, so that nothing is compiled while the
    robot stands.

    Args:
        scenario: its pushes are left out; its plant gets the period of the link.
        robot: the robot.
        link: connection to it.
        check: the last check of the link.
        split: from torques to set-points of the drives; None for torque alone.
        kp: stiffness of position control in the ramp-in, as for `LinkBody` [N m/rad].
        kd: its damping [N m s/rad].
        posture: False for a robot that stands in its posture already.
        ramp: length of each ramp and of standing before the scenario begins [s].
        ready: returns True once the robot stands on its feet, as for `LinkBody`.
        operator: time of the operator's newest sample, as for `LinkBody`.

    Raises:
        PoiseError: the scenario does not fit the robot, or needs a simulator.
    """
    scenario = _without_simulator(scenario, 1.0 / link.info.rate).later(
        (WARM if ramp > 0.0 else 0.0) + 2.0 * ramp
    )
    rehearsed = stage_scenario(scenario, robot)
    if rehearsed.scenario.plant.commanded != "torque":
        raise ConfigurationError(
            f"scenario {scenario.name!r} commands velocities",
            got=rehearsed.scenario.plant.actuation,
            wanted="torque",
        )
    for _ in rollout(
        rehearsed.plant,
        rehearsed.controller,
        rehearsed.leader,
        estimator=rehearsed.estimator,
        duration=_REHEARSAL,
    ):
        pass
    stage = stage_scenario(scenario, robot)
    body = LinkBody(
        robot,
        link,
        check,
        split,
        kp=kp,
        kd=kd,
        q_start=stage.plant.true_state().q[-robot.nj :],
        posture=posture,
        ramp=ramp,
        stand=ramp,
        ready=ready,
        operator=operator,
    )
    if isinstance(stage.leader, StepTeleoperator) and stage.leader.device is not None:
        stage.leader.device = _LaterDevice(stage.leader.device, body.begin)
    plant = LinkedPlant(body, stage.scenario.plant)
    if stage.estimator is None:
        raise ConfigurationError(
            f"scenario {scenario.name!r} has no estimator", wanted="a robot with a floating base"
        )
    return replace(
        stage,
        plant=plant,
        leader=body.follow(stage.leader),
        estimator=plant.watch(stage.estimator),
    )


def deploy(
    stage: Stage,
    *,
    log: Path | None = None,
    view: bool = False,
    progress: Progress = lambda *_: None,
) -> Run:
    """Run a staged deployment; whatever ends it, the robot is damped.

    Ctrl-C damps; after the scenario the set-points fade to damping.

    Args:
        stage: of `stage_deployment`.
        log: MCAP file, written every 4 ms; that of the ramp-out has `_end` behind its name.
        view: show the estimate in a window.
        progress: called with the progress of the run.

    Returns:
        The run with its signals and checks; those of the simulator's truth compare the estimate
        with itself.
    """
    plant = stage.plant
    assert isinstance(plant, LinkedPlant)
    body, controller = plant.body, stage.controller

    def ramp_out() -> None:
        if plant.fallen or body.time < stage.scenario.duration - 0.5 * body.control_dt:
            return
        path = None if log is None else log.with_stem(f"{log.stem}_end")
        recorder = Recorder(path, config=RecorderConfig(flush_dt=FLUSH))
        body.end()
        for _ in rollout(plant, controller, None, [recorder], estimator=stage.estimator):
            pass

    turn = sys.getswitchinterval()
    sys.setswitchinterval(_TURN)
    try:
        with garbage_frozen():  # once: the ramp-out begins without a pause
            return run_stage(
                stage,
                log=log,
                view=view,
                progress=progress,
                flush_dt=FLUSH,
                at_end=ramp_out,
                on_interrupt=body.watchdog.stop,
            )
    finally:
        sys.setswitchinterval(turn)
        body.close()


class _LaterDevice:
    """Device whose time begins later."""

    def __init__(self, device: Device, begin: float) -> None:
        self._device, self._begin = device, begin

    def sample(self, time: float) -> OperatorSample | None:
        sample = self._device.sample(time - self._begin)
        return sample and structs.replace(sample, time=sample.time + self._begin)


def _without_simulator(scenario: Scenario, period: float) -> Scenario:
    """The scenario at another control period, without what only a simulator does."""
    plant = replace(scenario.plant, control_dt=period, sensors=type(scenario.plant.sensors)())
    return replace(scenario, plant=plant, pushes=(), ground_truth=False)
