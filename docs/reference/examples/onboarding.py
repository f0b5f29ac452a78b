import tempfile
from pathlib import Path

import poise

MODEL = Path(poise.__file__).parents[2] / "examples" / "models" / "walker12.urdf"
FOLDER = Path(tempfile.mkdtemp())

# %% try_out write_page
from poise.apps.onboarding import try_out, write_page
from poise.robots import describe

proposal = describe(MODEL)
robot = poise.load_robot(MODEL, proposal.facts)
write_page(robot, proposal, try_out(robot), FOLDER / "robot.html")
