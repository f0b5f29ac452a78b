"""Robots of the operational space tests: those of the catalog, and a humanoid on a stand."""

import pytest

pytest.importorskip("mujoco")

from osf_world import fixed_base


@pytest.fixture(scope="session")
def get_any(get_robot, tmp_path_factory):
    """A robot by name; "NAME fixed" is NAME with its root link welded to the world."""
    made = {}

    def get(name):
        base, _, fixed = name.partition(" ")
        if not fixed:
            return get_robot(base)
        if name not in made:
            made[name] = fixed_base(get_robot(base), tmp_path_factory.mktemp("fixed"))
        return made[name]

    return get
