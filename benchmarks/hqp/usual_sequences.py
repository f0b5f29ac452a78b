"""`USUAL_SEQUENCES`: what is raced on where nothing else is asked for."""

USUAL_SEQUENCES = (
    "stand-humanoid33",
    "squat-humanoid33",
    "reach-beyond-humanoid33",
    "push-humanoid33",
    "one-leg-humanoid33",
    "walk-lift-off-humanoid33",
    "walk-touch-down-humanoid33",
    "moving-20-double",
    "moving-45-double",
    "moving-60-double",
    "table1-33-double",
    "reduced-33-double",
    "velocity-reach-humanoid33",
    "random-rank",
    "random-condition",
    "random-conflict",
    "random-contradiction",
    "random-active",
    "random-drift-slow",
    "random-drift-fast",
    "ik-planar-7",
    "ik-arm6-wrist",
    "ik-arm6-elbow",
    "ik-humanoid-reach",
    "ik-humanoid-conflict",
)
"""Some of every family, from every scenario that is quickly simulated, on robots that need no
further package."""
