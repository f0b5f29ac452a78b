"""Contact between links of the robot, and its forces."""

from collections import Counter
from collections.abc import Iterable
from itertools import combinations

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.robots import Robot, are_neighbours, random_postures
from poise.sim._mapping import StateMap

_OWN = 2  # collision bit of geometry that meets other links of the robot; the ground has bit 1


Pair = tuple[str, str]  # names of two links


def let_touch(geoms: Iterable[mujoco.MjsGeom], time_constant: float, friction: float = 0.5) -> None:
    """Let geometry of the robot touch that of other links, besides what it touches already."""
    for geom in geoms:
        geom.contype, geom.conaffinity = geom.contype | _OWN, geom.conaffinity | _OWN
        geom.friction = (friction, 0.005, 0.0001)
        geom.solref = (time_constant, 1.0)


def exclude_lasting_contacts(spec: mujoco.MjSpec, model: mujoco.MjModel, robot: Robot) -> None:
    """Keep those links from touching that are neighbours, or touch at home, or nearly always."""
    solid = {int(b) for b in model.geom_bodyid[(model.geom_contype & _OWN) > 0]}
    places = StateMap(robot, model)
    joints, lasting = places.movers(), _lasting_contacts(model, robot, places)
    for i, j in combinations(sorted(solid), 2):
        one, other = joints[i], joints[j]
        lasts = frozenset((one, other)) in lasting
        if one != other and (lasts or are_neighbours(robot, one, other)):
            spec.add_exclude(bodyname1=model.body(i).name, bodyname2=model.body(j).name)


def _lasting_contacts(
    model: mujoco.MjModel, robot: Robot, places: StateMap, near: float = 1e-3
) -> set[frozenset[int]]:
    """Pairs of joints whose links are near at home or touch in three of four postures."""
    data, counts, count = mujoco.MjData(model), Counter[frozenset[int]](), 100
    joints = np.zeros(model.nbody, dtype=np.int64)
    joints[[*places.movers()]] = [*places.movers().values()]

    def touching(q: Float64[np.ndarray, " nq"]) -> set[frozenset[int]]:
        data.qpos[:] = places.qpos(q)
        mujoco.mj_fwdPosition(model, data)
        pairs = joints[model.geom_bodyid[data.contact.geom[: data.ncon]]]
        return {frozenset(pair) for pair in pairs.tolist()}

    for q in random_postures(robot, count):
        counts.update(touching(q))
    margins = model.geom_margin.copy()
    model.geom_margin[:] = near
    at_home = touching(robot.q_home)
    model.geom_margin[:] = margins
    return at_home | {pair for pair, times in counts.items() if times > 0.75 * count}


class SelfContacts:
    """Contacts between links of the robot in a control period."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._bodies: list[int] = model.geom_bodyid.tolist()
        self._names = [model.body(i).name for i in range(model.nbody)]
        self._roots: list[int] = model.body_rootid.tolist()
        self._wrench: Float64[np.ndarray, "6"] = np.zeros(6)
        self.forces: dict[Pair, float] = {}  # largest normal ones of the last period [N]

    def look(self, data: mujoco.MjData) -> None:
        """Take in the contacts of a physics step."""
        now: dict[Pair, float] = {}
        for i, (one, other) in enumerate(data.contact.geom[: data.ncon].tolist()):
            a, b = sorted((self._bodies[one], self._bodies[other]))
            # The ground belongs to the world.
            if a == 0 or self._roots[a] != self._roots[b]:
                continue
            mujoco.mj_contactForce(self._model, data, i, self._wrench)
            pair = self._names[a], self._names[b]
            now[pair] = now.get(pair, 0.0) + float(self._wrench[0])
        for pair, force in now.items():
            self.forces[pair] = max(force, self.forces.get(pair, 0.0))
