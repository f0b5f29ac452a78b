"""States drawn at random: what the levels below, and the reference, cost a softened level."""

import numpy as np
import pinocchio as pin

from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.robots import Robot
from poise.stack import Stack, default_stack
from studies.finding import Finding, Section
from studies.plan import Progress, StudyOptions
from studies.quiet.reach import robot_named

ROBOTS = ("g1", "humanoid33")
STATES, FARTHER = 5000, 10.0
"""States of each robot, and how many times farther the hands' targets are the second time."""

ROUNDING = 1e-9
"""Largest rise of a relative residual that counts as none."""

_SPREAD, _SPEED, _FAR = 0.1, 0.3, 0.2
"""Spread of the joints [rad], of velocities [m/s, rad/s], and of targets [m]."""


def cost_section(options: StudyOptions, progress: Progress) -> Section:
    """Ask the hands for more, and compare what the level above them misses."""
    robots = ROBOTS[:1] if options.quick else ROBOTS
    count = options.count(STATES, 100)
    rise = beyond = 0.0
    softened = solved = 0
    for k, name in enumerate(robots):
        trials = _Trials(robot_named(name), options.seed)
        for i in range(count):
            found = trials.draw()
            if found is not None:
                solved += 1
                rise, beyond = max(rise, found[0]), max(beyond, found[1])
                softened += found[2]
            if i % 50 == 0:
                progress(float(k * count + i), float(len(robots) * count))
    findings = (
        Finding(
            name="softened CoM level: largest rise of its relative residual by the hands below",
            paper=ROUNDING,
            ours=rise,
            ok=rise <= ROUNDING,
            note=f"hands' targets {FARTHER:g} times farther, in {solved} states, in "
            f"{softened} of which the level was softened",
        ),
        Finding(
            name="softened CoM level: largest part of the bound that the reference costs",
            paper=1.0,
            ours=beyond,
            ok=beyond <= 1.0 + ROUNDING,
            note="|w|^2 over r^2 + mu^2 |dv_J - d|^2, r and dv of the strict levels",
        ),
    )
    return Section(findings=findings)


class _Trials:
    """States and targets of one robot, solved strictly and softened."""

    def __init__(self, robot: Robot, seed: int) -> None:
        self._robot, self._rng = robot, np.random.default_rng(seed)
        plain = default_stack(robot)
        self._strict, self._soft = (
            WholeBodyController(robot, Stack(s.contacts, s.levels, softening=softening))
            for s, softening in ((plain, 0.0), (default_stack(robot), plain.softening))
        )

    def draw(self) -> tuple[float, float, bool] | None:
        """Return rise, part of the bound, and whether the level was softened."""
        robot, rng = self._robot, self._rng
        step = np.concatenate([np.zeros(6), _SPREAD * rng.normal(size=robot.nj)])
        q = np.asarray(pin.integrate(robot.model, robot.q_home, step))
        state = RobotState(q, _SPEED * rng.normal(size=robot.nv))
        names = ["com", *(f"{hand} pose" for hand in robot.hands)]
        ways = {name: _FAR * rng.normal(size=3) for name in names}
        near, far, strict = (
            self._solve(controller, state, ways, scale)
            for controller, scale in (
                (self._soft, 1.0),
                (self._soft, FARTHER),
                (self._strict, 1.0),
            )
        )
        if near is None or far is None or strict is None:
            return None
        bound = strict[1] ** 2 + (near[2] * strict[3]) ** 2
        return far[0] - near[0], near[1] ** 2 / max(bound, 1e-12), near[2] > 0.0

    def _solve(
        self,
        controller: WholeBodyController,
        state: RobotState,
        ways: dict[str, np.ndarray],
        scale: float,
    ) -> tuple[float, float, float, float] | None:
        """Return the CoM level's relative and absolute residual, its weight, and the strain."""
        controller.reset()
        dynamics, stack = controller.dynamics, controller.stack
        dynamics.update(state)
        for name, way in ways.items():
            frame = name.removesuffix(" pose")
            start = (
                dynamics.com
                if name == "com"
                else dynamics.frame(self._robot.frame_id(frame)).position
            )
            stack.task(name).set_target(start + (way if name == "com" else scale * way))
        command = controller.step(state)
        if not command.status.ok or command.acceleration is None:
            return None
        program = controller.strategy.current
        solution = program.solution
        assert solution is not None
        level = len(solution.residuals) - len(stack.levels)
        terms = program.full.rows.softening.terms
        strain = np.linalg.norm(command.acceleration[6:] - terms.reference)
        residuals = command.residuals[2], float(solution.residuals[level])
        return *residuals, program.softened.get(0, 0.0), float(strain)
