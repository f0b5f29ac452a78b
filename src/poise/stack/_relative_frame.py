"""`RelativeFrameTask`: a frame as seen from another frame of the robot."""

from poise._checks import Numbers, checked_kind
from poise.dynamics import Dynamics
from poise.robots import Robot
from poise.stack._axes import ANGULAR_SPEED, Pose, parse_axes, split_rows, usual_speeds
from poise.stack._shipped import PoseTarget, ShippedTask
from poise.stack._tables import Kind


class RelativeFrameTask(ShippedTask[PoseTarget]):
    """A frame follows a target pose given in a second, moving frame of the robot.

    With root frame r and frame f, all along the root's axes,

        p = r_R_w (p_f - p_r)
        pdot = r_R_w (v_f - v_r - omega_r x (p_f - p_r))
        omega = r_R_w (omega_f - omega_r)

    and the drift carries the centripetal and Coriolis terms of the turning root. Near half a turn
    the feedback of the orientation error fades, as that of `FrameTask`.

    Args:
        frame: the frame that should move.
        root: the frame in which the target is given.
        axes: "pose", "position", "orientation", with letters, or joined by "+"; axes of the root.
        kp: stiffness, one number or one a row [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        speed: largest speeds that feedback asks for, one number or one for each of `blocks`:
            position [m/s], then orientation [rad/s]; 2.5 m/s and pi rad/s when None.
        name: what reports call it.
    """

    kind = Kind.RELATIVE_FRAME

    def __init__(
        self,
        frame: str,
        root: str,
        axes: str = "pose",
        *,
        kp: Numbers = 100.0,
        kd: Numbers | None = None,
        weight: Numbers = 1.0,
        speed: Numbers | None = None,
        name: str | None = None,
    ) -> None:
        super().__init__(
            name or f"{frame} in {root} {axes}", kp=kp, kd=kd, weight=weight, speed=speed
        )
        self.frame = checked_kind(frame, str, f"frame of task {self.name!r}")
        self.root = checked_kind(root, str, f"root of task {self.name!r}")
        mask = "position+orientation" if axes == "pose" else axes
        self.chosen = index = parse_axes(mask, {"position": 0, "orientation": 3})
        self._blocks = split_rows(index)
        self.turns = bool(index[-1] >= 3)
        self.unit = ("m, rad" if index[0] < 3 else "rad") if self.turns else "m"
        self._target = PoseTarget(f"task {self.name!r}")

    def set_target(self, position: Pose | None = None, rotation: Numbers | None = None) -> None:
        """Sets where the frame should be in the root; what is not given stays as it is.

        Args:
            position: root_p_frame [m]; or position and orientation in one, as `pinocchio.SE3`, a
                4 x 4 matrix, or a pair of a position and what `rotation` may be.
            rotation: root_R_frame, a matrix or a quaternion (x, y, z, w).

        Raises:
            TargetError: wrong shape, NaN, not a rotation, or a rotation beside a pose.
        """
        self._target.set(position, rotation)

    @property
    def blocks(self) -> tuple[int, ...]:
        """Position rows, then orientation rows."""
        return self._blocks

    def hold(self, dynamics: Dynamics) -> None:
        """Takes what was never set of its target from the robot.

        Args:
            dynamics: the state, up to date.
        """
        frame, root = (dynamics.frame(i) for i in self.frame_ids)
        root_R_world = root.rotation.T
        rotation = root_R_world @ frame.rotation if self.turns else None
        self._target.hold(root_R_world @ (frame.position - root.position), rotation)

    def _resolve(self, robot: Robot) -> int:
        self.frame_ids = (robot.frame_id(self.frame), robot.frame_id(self.root))
        return len(self.chosen)

    def _usual_speed(self, robot: Robot) -> Numbers:  # noqa: ARG002
        return usual_speeds(self.chosen, ANGULAR_SPEED)
