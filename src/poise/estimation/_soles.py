"""`see_soles`: position and velocity of the soles in an inertial unit's axes, from the joints."""

from poise._compiled import part
from poise.estimation._group import turn_back
from poise.estimation._memory import (
    OFFSET,
    SPEED,
    SPREAD,
    TURNING,
    TURNING_SPREAD,
    EstimatorMemory,
)


@part
def see_soles(m: EstimatorMemory) -> None:
    """Fill in `seen`: position, velocities and J J^T of each sole, about the unit's origin."""
    R, p, v, axes, frames, J = m.base_R_unit, m.base_p_unit, m.v, m.axes, m.frames, m.motion.columns
    for sole in range(len(m.seen)):
        out, place, local = (
            m.seen[sole],
            m.motion.placements[frames.joints[sole]],
            frames.placements[sole],
        )
        for i in range(len(out)):
            out[i] = 0.0
        x = place[9] + place[0] * local[9] + place[3] * local[10] + place[6] * local[11]
        y = place[10] + place[1] * local[9] + place[4] * local[10] + place[7] * local[11]
        z = place[11] + place[2] * local[9] + place[5] * local[10] + place[8] * local[11]
        out[OFFSET], out[OFFSET + 1], out[OFFSET + 2] = turn_back(R, x - p[0], y - p[1], z - p[2])
        for k in range(frames.starts[sole], frames.starts[sole + 1]):
            column = frames.columns[k]
            if column < 6:
                continue
            wx, wy, wz = J[column, 3], J[column, 4], J[column, 5]
            axes[0], axes[1], axes[2] = turn_back(
                R,
                J[column, 0] + wy * z - wz * y,
                J[column, 1] + wz * x - wx * z,
                J[column, 2] + wx * y - wy * x,
            )
            axes[3], axes[4], axes[5] = turn_back(R, wx, wy, wz)
            for i in range(3):
                out[SPEED + i] += axes[i] * v[column]
                out[TURNING + i] += axes[3 + i] * v[column]
                for j in range(3):
                    out[SPREAD + 3 * i + j] += axes[i] * axes[j]
                    out[TURNING_SPREAD + 3 * i + j] += axes[3 + i] * axes[3 + j]
