"""Robots: immutable descriptions, loaders, and the catalog of names."""

from poise.robots._capsules import (
    LinkCapsules as LinkCapsules,
    are_neighbours as are_neighbours,
    capsules_of as capsules_of,
    random_postures as random_postures,
)
from poise.robots._catalog import (
    CatalogEntry as CatalogEntry,
    catalog,
    find_entry as find_entry,
)
from poise.robots._describe import describe
from poise.robots._document import free_name as free_name
from poise.robots._geometry import is_binary_stl as is_binary_stl, load_mesh as load_mesh
from poise.robots._inputs import description_of as description_of, files_digest as files_digest
from poise.robots._inverse_kinematics import (
    frame_error as frame_error,
    inverse_kinematics as inverse_kinematics,
)
from poise.robots._joint_order import JointOrder
from poise.robots._limbs import swings as swings
from poise.robots._limits import joint_kind as joint_kind
from poise.robots._loader import description_template, load_robot
from poise.robots._mesh_files import mesh_path as mesh_path
from poise.robots._mjcf_compile import (
    compile_spec as compile_spec,
    drop_meshes as drop_meshes,
    make_spec as make_spec,
    settled_spec as settled_spec,
)
from poise.robots._posture import FULL_TILT as FULL_TILT, standing_posture as standing_posture
from poise.robots._proposal import Proposal as Proposal
from poise.robots._robot import (
    GRAVITY as GRAVITY,
    FrameRole as FrameRole,
    ModelSource as ModelSource,
    Robot,
    Sole as Sole,
    once_a_robot as once_a_robot,
)

__all__ = ["JointOrder", "Robot", "catalog", "describe", "description_template", "load_robot"]
