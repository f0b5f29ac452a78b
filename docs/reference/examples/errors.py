import numpy as np

import poise

robot = poise.load_robot("biped20")

# %% PoiseError UnknownNameError
from poise.errors import PoiseError, UnknownNameError

try:
    poise.load_robot("walker")
except UnknownNameError as error:  # a PoiseError, as all of these
    print(error)  # what was got, and the names that there are

# %% ConfigurationError
from poise.errors import ConfigurationError

try:
    poise.ComTask(kp=-1.0)
except ConfigurationError as error:
    print(error)

# %% TargetError
from poise.errors import TargetError

try:
    poise.ComTask().set_target([0.0, np.nan, 0.8])
except TargetError as error:
    print(error)

# %% RobotError
from poise.errors import RobotError

try:
    poise.load_robot("<robot name='empty'/>")
except RobotError as error:
    print(error)

# %% ProblemError
from poise.errors import ProblemError

try:
    poise.solve(poise.HierarchicalProblem([poise.Level(np.eye(2), 1.0, 0.0)]))
except ProblemError as error:
    print(error)

# %% MissingExtraError
from poise.errors import MissingExtraError

try:
    poise.load_robot("g1")  # of the extra `robots`
except MissingExtraError as error:
    print(error)  # the command that installs it

# %%
assert issubclass(MissingExtraError, PoiseError)
