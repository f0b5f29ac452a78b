"""`BalanceServer`: messages of the balance service over ZeroMQ, and its loop."""

import math
import time as clock
from collections.abc import Sequence
from typing import Any

import msgspec
import pinocchio as pin

from poise.apps.balance._leader import BalanceLeader
from poise.apps.balance._messages import BalanceState, read_targets
from poise.apps.deployment import LinkedPlant
from poise.errors import ConfigurationError, PoiseError, import_extra
from poise.hardware import LinkBody
from poise.sim import Body, Estimator, Observer, Tick, rollout

STATE_PERIOD = 0.02
"""From one state to the next [s]: five in a period of the slowest device that is followed."""

_LARGEST = 65_536
"""Largest message [B]: twenty times one with all joints of a humanoid."""

_LATE = 0.1
"""A simulation that is farther behind the clock gives up catching up [s]."""


class BalanceServer:
    """Server of a `BalanceLeader`: one socket for targets, one for states, JSON in both.

    Clients PUSH `Targets` to `targets`, of which the newest counts (CONFLATE), and SUBscribe to
    `BalanceState` at `states`:

        targets = zmq.Context.instance().socket(zmq.PUSH)
        targets.connect("tcp://127.0.0.1:5570")
        targets.send_json({"time": time.monotonic(), "joints": {"left_elbow_joint": 0.9}})

    A bad message is counted, and its fault published. Whoever reaches the ports commands the robot:
    they are on 127.0.0.1 unless another host is given.

    Args:
        leader: of the robot.
        port: of targets, and the one before that of states; 0 for any that are free.
        host: address of this machine on which it listens.

    Attributes:
        leader: of the robot.
        targets: address of clients' targets.
        states: address of the states.

    Raises:
        MissingExtraError: pyzmq is not installed.
        ConfigurationError: a port is taken, or the host is no address of this machine.
    """

    def __init__(self, leader: BalanceLeader, *, port: int = 5570, host: str = "127.0.0.1") -> None:
        self._zmq: Any = import_extra("zmq", "zmq", "The balance service", package="pyzmq")
        self.leader, zmq = leader, self._zmq
        self._context: Any = zmq.Context()
        self._inbox, self._outbox = self._context.socket(zmq.PULL), self._context.socket(zmq.PUB)
        self._inbox.set(zmq.MAXMSGSIZE, _LARGEST)
        for socket in (self._inbox, self._outbox):
            socket.set(zmq.CONFLATE, 1)
        ports = (port or "*", port + 1 if port else "*")
        try:
            self._inbox.bind(f"tcp://{host}:{ports[0]}")
            self._outbox.bind(f"tcp://{host}:{ports[1]}")
        except zmq.ZMQError as error:
            self.close()
            what = f"the balance service cannot listen ({error})"
            raise ConfigurationError(what, got=(host, *ports), wanted="free ports") from None
        self.targets: str = self._inbox.get(zmq.LAST_ENDPOINT).decode()
        self.states: str = self._outbox.get(zmq.LAST_ENDPOINT).decode()
        robot = leader.robot
        self._data, self._torso = robot.model.createData(), robot.frame_id(robot.torso)
        self._hands = {name: robot.frame_id(name) for name in robot.hands}
        self._due = -math.inf

    def __enter__(self) -> "BalanceServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close both sockets."""
        self._context.destroy(linger=0)

    def run(
        self,
        body: Body,
        *,
        observers: Sequence[Observer[Any]] = (),
        estimator: Estimator | None = None,
        duration: float | None = None,
        paced: bool = False,
    ) -> None:
        """Control a body until its time is up or it has fallen.

        Args:
            body: a plant, a `LinkBody` or a plant that shows one, with the leader's period.
            observers: as of `rollout`.
            estimator: as of `rollout`.
            duration: as of `rollout` [s].
            paced: keep to the clock; for a simulation, which does not by itself.
        """
        controller, due, leader = self.leader.controller(), clock.monotonic(), self.leader
        linked = body.body if isinstance(body, LinkedPlant) else body
        if isinstance(linked, LinkBody):
            leader = linked.follow(leader)
        if isinstance(body, LinkedPlant) and estimator is not None:
            estimator = body.watch(estimator)
        for tick in rollout(
            body, controller, leader, observers, estimator=estimator, duration=duration
        ):
            self.poll()
            self.publish(tick, fallen=body.fallen)
            if paced:
                due = max(due + body.control_dt, clock.monotonic() - _LATE)
                clock.sleep(max(0.0, due - clock.monotonic()))

    def poll(self) -> None:
        """Take the newest message, without waiting; one call a tick."""
        try:
            self.leader.take(read_targets(self._inbox.recv(self._zmq.NOBLOCK)))
        except self._zmq.Again:
            pass
        except PoiseError as error:
            self.leader.refuse(str(error))

    def publish(self, tick: Tick, *, fallen: bool) -> None:
        """Send the state, if one is due or the robot has fallen; one call a tick.

        Args:
            tick: of the rollout.
            fallen: the robot lies.
        """
        # Its clock may go back.
        if fallen or not 0.0 < self._due - tick.time <= STATE_PERIOD:
            self._due = tick.time + STATE_PERIOD
            self._outbox.send(msgspec.json.encode(self._state(tick, fallen=fallen)))

    def _state(self, tick: Tick, *, fallen: bool) -> BalanceState:
        leader, state, robot = self.leader, tick.estimate, self.leader.robot
        pin.forwardKinematics(robot.model, self._data, state.q)
        torso = pin.updateFramePlacement(robot.model, self._data, self._torso)
        hands = {
            name: torso.actInv(pin.updateFramePlacement(robot.model, self._data, frame))
            for name, frame in self._hands.items()
        }
        near, walker = leader.stack.self_collision_limit.near, leader.walker
        joints = zip(robot.joint_names, state.q[-robot.nj :].tolist(), strict=True)
        speeds = zip(robot.joint_names, state.v[-robot.nj :].tolist(), strict=True)
        return BalanceState(
            time=tick.time,
            command=tick.command.status.value,
            walk=walker.status.value,
            fallen=fallen,
            lost=leader.lost,
            velocity=walker.commands.velocity,
            joints=dict(joints),
            speeds=dict(speeds),
            hands={name: tuple(pose.translation.tolist()) for name, pose in hands.items()},
            nearest=(*near[0].links, near[0].distance) if near else None,
            refused=leader.refused,
            reason=leader.reason,
            notice=walker.notice,
        )
