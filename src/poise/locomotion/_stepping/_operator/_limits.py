"""Bounds of an operator's samples: times, speeds and distances of the guard, in one table."""

SLOWEST = 0.1
"""Period of the slowest device that is followed without gaps [s]: hands move at 5 Hz at most, and
ten samples a second are the fewest that show it."""

SILENT_AFTER = SLOWEST
"""A device without a new sample for longer than its period is silent, and its velocity unknown
[s]."""

LOST_AFTER = 5 * SLOWEST
"""After so long without a good sample a device is lost [s]: a link that drops every fourth sample
drops five in a row once in a thousand."""

LATE = LOST_AFTER
"""A sample that comes this much later than the soonest did is as old as one of a lost device
[s]."""

DRIFT = 1e-3
"""Part of the time by which two clocks drift apart: ten times what quartz does."""

SPEED_MAX = 2.5
"""Largest speed at which a part is followed [m/s]: a foot in a brisk walk, a hand that reaches."""

BURST = 0.06
"""Distance that is followed without delay after rest [m]: what `SPEED_MAX` covers in one period of
a tracker of 40 Hz."""

JUMP = SPEED_MAX * SLOWEST + BURST
"""Largest distance of a sample from where its part is followed to [m]: what a part at `SPEED_MAX`
is away by after one period of the slowest device. Farther away is another thing."""

TURN_SPEED_MAX = 3.0
"""Largest speed at which a hand's turn is followed [rad/s]: what wrists of robots reach."""

TURN_BURST = TURN_SPEED_MAX / 25.0
"""Turn that is followed without delay after rest [rad]: one period of a tracker of 25 Hz, for a
wrist that is flicked runs ahead of what follows it."""

TURN_JUMP = 12.0 * SLOWEST
"""Largest turn from one sample to the next [rad]: a wrist that is flicked, at 12 rad/s."""

VELOCITY_DELAY = 0.02
"""Delay with which a device may read its own velocity [s]: two periods of a tracker of 100 Hz."""

VELOCITY_ERROR = SPEED_MAX * VELOCITY_DELAY
"""Distance by which a device may be elsewhere than its velocity has it [m]."""

VELOCITY_MEMORY = 2 * SILENT_AFTER
"""Time constant with which that distance is forgotten [s]: no less than a velocity counts, or it
would be forgotten before it is seen."""

STICK_REST = (0.01, 0.01, 0.02)
"""A commanded velocity that is no larger is none: sticks do not rest at exactly zero [m/s, m/s,
rad/s]."""

UNIT_ERROR = 0.01
"""By how much a quaternion's length may differ from one: messages round to two figures."""
