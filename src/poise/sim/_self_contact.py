"""The robot's own links as things that touch each other, and how hard they do."""

from collections import Counter
from collections.abc import Iterable
from itertools import combinations

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.robots import Robot
from poise.sim._mapping import StateMap

_OWN = 2  # collision bit of geometry that meets other links of the robot; the ground has bit 1

# Links with so many joints between them or fewer, or joints no further apart than this [m], do not
# meet: housings of compound joints run into each other in most models, and joint limits are what
# keeps such links apart.
_NEIGHBOURS, _COMPOUND = 2, 0.1

_NEAR_AT_HOME = 1e-3  # links no further apart than this in the home posture do not meet [m]

# Random postures, half way at most from home to the joints' limits, in the larger part of which
# links that touch are taken to be drawn into each other.
_POSTURES, _REACH, _MOST = 100, 0.5, 0.5

_FRICTION = 0.5  # of covers on covers

Pair = tuple[str, str]  # names of two links


def let_touch(geoms: Iterable[mujoco.MjsGeom], time_constant: float) -> None:
    """Let geometry of the robot touch that of other links, besides what it touches already."""
    for geom in geoms:
        geom.contype, geom.conaffinity = geom.contype | _OWN, geom.conaffinity | _OWN
        geom.friction = (_FRICTION, 0.005, 0.0001)
        geom.solref = (time_constant, 1.0)


def exclude_lasting_contacts(spec: mujoco.MjSpec, model: mujoco.MjModel, robot: Robot) -> None:
    """Keep those links from touching that are neighbours, or touch at home, or nearly always."""
    solid = {int(b) for b in model.geom_bodyid[(model.geom_contype & _OWN) > 0]}
    welds, lasting = model.body_weldid.tolist(), _lasting_contacts(model, robot)
    for i, j in combinations(sorted(solid), 2):
        if welds[i] == welds[j]:
            continue
        if _are_neighbours(model, welds[i], welds[j]) or frozenset((welds[i], welds[j])) in lasting:
            spec.add_exclude(bodyname1=model.body(i).name, bodyname2=model.body(j).name)


def _lasting_contacts(model: mujoco.MjModel, robot: Robot) -> set[frozenset[int]]:
    """Rigid groups of bodies that touch at home or in most postures."""
    data, places = mujoco.MjData(model), StateMap(robot, model)
    counts = Counter[frozenset[int]]()
    q, joints = robot.q_home.copy(), slice(robot.nq - robot.nj, None)
    lower, upper = robot.q_min - q[joints], robot.q_max - q[joints]
    for part in np.random.default_rng(0).uniform(0.0, 1.0, (_POSTURES, robot.nj)):
        q[joints] = robot.q_home[joints] + _REACH * (lower + part * (upper - lower))
        counts.update(_touching(model, data, places.qpos(q)))
    margins = model.geom_margin.copy()
    model.geom_margin[:] = _NEAR_AT_HOME
    at_home = _touching(model, data, places.qpos(robot.q_home))
    model.geom_margin[:] = margins
    return at_home | {pair for pair, count in counts.items() if count > _MOST * _POSTURES}


def _touching(
    model: mujoco.MjModel, data: mujoco.MjData, qpos: Float64[np.ndarray, " n"]
) -> set[frozenset[int]]:
    """Rigid groups of bodies that touch in a posture."""
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    groups = model.body_weldid[model.geom_bodyid[data.contact.geom[: data.ncon]]]
    return {frozenset(pair) for pair in groups.tolist()}


def _are_neighbours(model: mujoco.MjModel, one: int, other: int) -> bool:
    """Return True where two rigid groups are links of one compound joint, or next but one."""
    ways = [_way_to_world(model, group) for group in (one, other)]
    chains = [[g for g in way if g not in ways[1 - i]] for i, way in enumerate(ways)]
    joints = [*chains[0], *reversed(chains[1])]
    if len(joints) <= _NEIGHBOURS:
        return True
    places = [model.body_pos[group] for chain in chains for group in chain[:-1]]
    # The two joints nearest to what both chains hang on stand side by side there.
    roots = [model.body_pos[chain[-1]] for chain in chains if chain]
    apart = np.linalg.norm(roots[0] - roots[1]) if len(roots) == 2 else 0.0
    return float(sum(np.linalg.norm(p) for p in places) + apart) <= _COMPOUND


def _way_to_world(model: mujoco.MjModel, group: int) -> list[int]:
    way = [group]
    while way[-1] != 0:
        way.append(int(model.body_weldid[model.body_parentid[way[-1]]]))
    return way


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
