"""`Scene`: the robot and what balances it, drawn by viser."""

import contextlib
import io
import math
import secrets
import threading
from typing import Any

import numpy as np
import viser
from jaxtyping import Float64, Int
from trimesh import creation

from poise.apps.live._loop import Snapshot
from poise.apps.report import Geometry
from poise.apps.scenarios import drawn_shapes
from poise.errors import PoiseError
from poise.sim import Plant

HANDLES = ("/hands/left", "/hands/right")
"""Names of the handles that an operator drags, left and right."""
HANDLE_SCALE = 0.22
"""Length of a handle's arrows [m]."""
HANDLE_ABOVE = np.array([0.0, 0.0, 0.06])
"""A handle is drawn this far above the sole that it moves [m], in the middle of the foot."""
CAMERA = (np.array([-2.3, 1.1, 1.3]), np.array([0.0, 0.0, 0.65]))
"""Where a page looks from at first, and at what [m]: from behind, so that left is left and the
arrow up goes away from the eye."""

SECRET_HEADER, ROLE_HEADER = "X-Poise-Secret", "X-Poise-Role"
OPERATOR = "operator"

_Colour = tuple[int, int, int]
_ZMP, _COM, _TARGET, _GROUND = (214, 51, 132), (13, 110, 253), (253, 126, 20), (40, 167, 69)
_PALE = 0.45
_POLE = 0.3
"""Height of the poles at the ZMP and its reference [m]."""
_LINE, _LINE_Z = 0.008, 0.004
"""How thick lines on the ground are, and how far above it they are drawn [m]."""


class Scene:
    """A viser server on this machine that only `Front` can talk to.

    It answers a connection only when that shows `secret`, and it takes no command from anybody:
    handles are drawn for operators, but what they do with them is read by `Front`.

    Args:
        plant: what to draw.

    Raises:
        PoiseError: another viser than the one this was written for.

    Attributes:
        secret: value of `SECRET_HEADER`.
    """

    def __init__(self, plant: Plant) -> None:
        self.secret = secrets.token_urlsafe(16)
        # viser announces addresses that nobody else shall use.
        with contextlib.redirect_stdout(io.StringIO()):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self._roles: dict[int, str] = {}
        self._clients: dict[int, _Handles] = {}
        self._lock = threading.Lock()
        self._guard()
        self._draw_world()
        self._bodies = self._draw_robot(plant)
        self._draw_marks()
        self._polygon = np.zeros((0, 3))

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._server.get_port()

    def stop(self) -> None:
        """Ends the server."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def show(self, now: Snapshot, held: tuple[bool, bool]) -> None:
        """Draws a moment.

        Args:
            now: what to draw.
            held: whether the operator holds the left and the right handle: it stays in the hand.
        """
        if not self._server.get_clients():
            return
        with self._server.atomic():
            for body, handle in self._bodies:
                handle.position, handle.wxyz = now.bodies[body], now.turns[body]
            self._zmp.position = (*now.zmp, 0.5 * _POLE)
            self._zmp_reference.position = (*now.zmp_reference, 0.5 * _POLE)
            self._com.position = now.com
            ground = _ground(now) + _LINE_Z
            self._com_ground.position = (*now.com[:2], ground)
            self._com_reference.position = (*now.zmp_reference, now.com[2])
            self._target.visible = now.target is not None
            if now.target is not None:
                self._target.position = now.target
            self._show_polygon(np.insert(now.polygon, 2, ground, axis=1))
            with self._lock:
                clients = list(self._clients.values())
            for client in clients:
                client.show(now.hands, held)

    def _show_polygon(self, corners: Float64[np.ndarray, "h 3"]) -> None:
        if corners.shape == self._polygon.shape and np.allclose(
            corners, self._polygon, rtol=0.0, atol=1e-3
        ):
            return
        self._polygon = corners
        self._edges.points = np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)

    # Who comes -----------------------------------------------------------------------------------

    def _guard(self) -> None:
        """Turns away who does not come through `Front`, and learns who is an operator."""
        # viser offers no public way to see a connection's headers; its version is bounded.
        inner: Any = getattr(self._server, "_websock_server", None)
        live: Any = getattr(inner, "_live_connections", None)
        if live is None:
            raise PoiseError(
                "this version of viser is not the one that the page was made for",
                got=viser.__version__,
                wanted="viser 1.1",
            )

        async def check(connection: Any) -> None:
            headers = live[connection.client_id].request.headers
            if not secrets.compare_digest(headers.get(SECRET_HEADER, ""), self.secret):
                await live[connection.client_id].close(1008, "use the page")
                return
            self._roles[connection.client_id] = headers.get(ROLE_HEADER, "")

        inner.on_client_connect(check)

        @self._server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            if self._roles.get(client.client_id) == OPERATOR:
                with self._lock:
                    self._clients[client.client_id] = _Handles(client)

        @self._server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._roles.pop(client.client_id, None)
            with self._lock:
                self._clients.pop(client.client_id, None)

    # What there is -------------------------------------------------------------------------------

    def _draw_world(self) -> None:
        scene = self._server.scene
        # No shadows: most of the time of a picture where there is no graphics card.
        scene.configure_default_lights(cast_shadow=False)
        scene.add_grid(
            "/floor", width=20.0, height=20.0, cell_size=0.1, section_size=1.0, shadow_opacity=0.0
        )
        position, look_at = CAMERA
        self._server.initial_camera.position = position
        self._server.initial_camera.look_at = look_at
        self._server.initial_camera.fov = math.radians(45.0)

    def _draw_robot(self, plant: Plant) -> list[tuple[int, Any]]:
        scene = self._server.scene
        bodies: dict[int, Any] = {}
        for index, shape in enumerate(drawn_shapes(plant.model)):
            if shape.body not in bodies:
                bodies[shape.body] = scene.add_frame(f"/robot/{shape.body}", show_axes=False)
            self._draw_shape(f"/robot/{shape.body}/{index}", shape)
        return list(bodies.items())

    def _draw_shape(self, name: str, shape: Geometry) -> None:
        vertices, faces = mesh_of(shape)
        x, y, z, w = shape.quaternion
        red, green, blue, opacity = shape.rgba
        self._server.scene.add_mesh_simple(
            name,
            vertices.astype(np.float32),
            faces.astype(np.uint32),
            color=(round(255 * red), round(255 * green), round(255 * blue)),
            opacity=None if opacity == 1.0 else float(opacity),
            flat_shading=shape.shape == "box",
            cast_shadow=False,
            receive_shadow=False,
            wxyz=(w, x, y, z),
            position=shape.position,
        )

    def _draw_marks(self) -> None:
        scene = self._server.scene

        def ball(
            name: str, colour: tuple[int, int, int], radius: float, opacity: float | None = None
        ):
            return scene.add_icosphere(
                f"/marks/{name}",
                radius=radius,
                color=colour,
                subdivisions=2,
                opacity=opacity,
                cast_shadow=False,
                receive_shadow=False,
            )

        def pole(name: str, colour: _Colour, radius: float, opacity: float | None) -> Any:
            # Standing up, so that a foot does not hide it.
            return scene.add_cylinder(
                f"/marks/{name}",
                radius=radius,
                height=_POLE,
                color=colour,
                radial_segments=8,
                opacity=opacity,
                cast_shadow=False,
                receive_shadow=False,
            )

        self._zmp = pole("zmp", _ZMP, 0.006, None)
        self._zmp_reference = pole("zmp_reference", _ZMP, 0.012, _PALE)
        self._com = ball("com", _COM, 0.03)
        self._com_ground = ball("com_ground", _COM, 0.015)
        self._com_reference = ball("com_reference", _COM, 0.04, _PALE)
        self._target = ball("target", _TARGET, 0.018)
        self._edges = scene.add_line_segments(
            "/marks/polygon", np.zeros((1, 2, 3)), colors=_GROUND, thickness=_LINE
        )


def _ground(now: Snapshot) -> float:
    """Height of the higher foot that stands: marks shall not be inside the block below it [m]."""
    both = now.mode.support is None or not now.mode.single
    return float(now.soles[:, 2].max() if both else now.soles[now.mode.support, 2])


class _Handles:
    """The two handles in one operator's page."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._controls = [
            client.scene.add_transform_controls(
                name, scale=HANDLE_SCALE, disable_rotations=True, depth_test=False
            )
            for name in HANDLES
        ]
        connection: Any = getattr(client, "_websock_connection")  # noqa: B009
        self._buffer: Any = connection.get_message_buffer()

    def show(self, hands: Float64[np.ndarray, "2 3"], held: tuple[bool, bool]) -> None:
        # A page that goes right now must not make viser warn of what it will never get.
        with self._buffer.sanctioned_dead_writes():
            for control, hand, is_held in zip(self._controls, hands, held, strict=True):
                if not is_held:
                    control.position = hand + HANDLE_ABOVE


def mesh_of(shape: Geometry) -> tuple[Float64[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]:
    """A shape as triangles, in its own frame.

    Args:
        shape: of any kind.

    Returns:
        Corners [m], and triangles as rows of them.
    """
    if shape.vertices is not None and shape.faces is not None:
        return shape.vertices, shape.faces
    size = np.array(shape.size, dtype=np.float64)
    match shape.shape:
        case "box":
            made = creation.box(extents=2.0 * size)
        case "cylinder":
            made = creation.cylinder(radius=size[0], height=2.0 * size[1], sections=24)
        case "capsule":
            made = creation.capsule(radius=size[0], height=2.0 * size[1], count=[16, 16])
        case _:
            # A sphere has one radius, an ellipsoid three.
            made = creation.icosphere(subdivisions=2)
            made.apply_scale(np.broadcast_to(size, 3) if len(size) == 1 else size)
    return np.asarray(made.vertices, dtype=np.float64), np.asarray(made.faces, dtype=np.int64)
