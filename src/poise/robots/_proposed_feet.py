"""What a robot that nobody has described stands on: `find_foot`, `ankle_relief`."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots._geometry import Balls, link_shapes, union
from poise.robots._robot import GRAVITY, ModelSource
from poise.robots._sole_fit import SoleFit, fit_sole

_ANKLE_PART = 0.35
"""An ankle should need no more of its torque to stand, so that it has some left to balance with."""

_MOST_BACK = 0.25
"""But the COM stays within this part of the sole's length from its middle."""


_MUCH_LARGER = 1.5
"""A visual shape is believed before contact geometry with so much less sole."""

_TOE = 0.02
"""A foot of two parts: the part behind the toes touches the ground within this height [m]."""


@dataclass(frozen=True)
class Foot:
    """What a leg stands on.

    Attributes:
        joint: that moves it.
        fit: its flat face.
        kind: which shapes have that, collision or visual.
    """

    joint: int
    fit: SoleFit
    kind: str

    @property
    def area(self) -> float:
        """Of the sole [m^2]."""
        return self.fit.length * self.fit.width


class FeetFinder:
    """Finds what legs stand on.

    Args:
        model: of the robot.
        source: of its shapes.
        where: it comes from, for messages.
        lost: meshes that are missing, for messages.
        data: with the frames of the posture in which feet are looked at.
        forward: where the robot looks.
    """

    def __init__(
        self,
        model: pin.Model,
        source: ModelSource,
        where: str,
        lost: Sequence[str],
        data: pin.Data,
        forward: Float64[np.ndarray, "3"],
    ) -> None:
        self._model, self._source, self._where, self._lost = model, source, where, lost
        self._data, self._forward = data, forward

    def find(self, leg: Sequence[int]) -> Foot:
        """The joint whose links a leg stands on, and its sole: the last one, or that before toes.

        Args:
            leg: its joints, from the hip on.

        Raises:
            RobotError: neither has a flat lower face.
        """
        found: list[Foot] = []
        problem: RobotError | None = None
        # Joints of two or three axes carry links with their last axis alone.
        for joint in [j for j in reversed(leg) if body_frames(self._model, j)][:2]:
            try:
                found.append(self._fit(joint))
            except RobotError as error:
                problem = problem or error
        if not found:
            assert problem is not None
            raise problem
        end = found[0]
        for foot in found[1:]:
            level = foot.fit.position[2] < end.fit.position[2] + _TOE
            if level and foot.area > end.area:
                return foot
        return end

    def _fit(self, joint: int) -> Foot:
        frames = body_frames(self._model, joint)
        names = [self._model.frames[i].name for i in frames]
        shapes = link_shapes(self._source, names, self._where)
        problem: RobotError | None = None
        fits: list[Foot] = []
        for kind in ("collision", "visual"):
            parts: list[Balls] = [
                balls.moved(self._data.oMf[i])
                for i, name in zip(frames, names, strict=True)
                for balls in getattr(shapes[name], kind)
            ]
            foot = union(parts)
            if foot is None:
                continue
            try:
                fit = fit_sole(foot, self._forward, f"foot {names[0]!r} of {self._where}")
            except RobotError as error:
                problem = error
                continue
            fits.append(Foot(joint=joint, fit=fit, kind=kind))
        if fits:
            # A few contact points can leave out most of a foot that has a whole flat face.
            larger = fits[-1].area > _MUCH_LARGER * fits[0].area
            level = abs(fits[-1].fit.position[2] - fits[0].fit.position[2]) < _TOE
            return fits[-1] if larger and level else fits[0]
        raise problem or RobotError(
            f"foot {names[0]!r} of {self._where} has no shape to read a sole from",
            got=f"links {names} with neither collision nor visual geometry"
            + (f"; missing meshes {self._lost[:4]}" if self._lost else ""),
            wanted="the meshes beside the file, or a sole under `soles` in a description",
        )

    def ankle_relief(self, feet: Sequence[Foot], legs: Sequence[Sequence[int]]) -> float:
        """How far the COM should stand behind the soles' middle, to spare weak ankles [m].

        Args:
            feet: left and right.
            legs: their joints, down to the sole.
        """
        model, back = self._model, 0.0
        weight = sum(float(i.mass) for i in model.inertias) * GRAVITY
        for foot, leg in zip(feet, legs, strict=True):
            dofs = [model.joints[j].idx_v for j in leg[-2:]]
            torque = float(min(model.effortLimit[d] for d in dofs))
            ankle = self._data.oMi[leg[-1]].translation
            before = float((foot.fit.position - ankle) @ self._forward)
            if 0.0 < torque < 1e300:
                back = max(back, before - _ANKLE_PART * torque / (0.5 * weight))
        return min(back, _MOST_BACK * min(foot.fit.length for foot in feet))


def part_legs(
    legs: Sequence[Sequence[int]], feet: Sequence[Foot]
) -> tuple[list[Sequence[int]], list[int]]:
    """The joints of each leg down to its sole, and those of toes beyond."""
    kept = [leg[: leg.index(foot.joint) + 1] for leg, foot in zip(legs, feet, strict=True)]
    return kept, [j for leg, part in zip(legs, kept, strict=True) for j in leg[len(part) :]]


def body_frames(model: pin.Model, joint: int) -> list[int]:
    """Links that a joint moves as one."""
    kind = pin.FrameType.BODY
    return [i for i, f in enumerate(model.frames) if f.type == kind and f.parentJoint == joint]


def main_frame(model: pin.Model, joint: int) -> int:
    """The heaviest of the links that a joint moves as one; the first where none says its mass."""
    return max(body_frames(model, joint), key=lambda i: (float(model.frames[i].inertia.mass), -i))
