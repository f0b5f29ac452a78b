"""Targets far away, and orientations that turn on through half a turn."""

from dataclasses import dataclass

from studies.finding import Finding, Section
from studies.plan import Progress, StudyOptions
from studies.quiet.references_section import FAR_HANDS, TURNED, far_hand, turning_pelvis
from studies.trials import run_each


@dataclass(frozen=True, kw_only=True)
class Far:
    """One trial.

    Attributes:
        robot: its name.
        doing: "walking" or "standing"; "shared" or "below" for a pelvis that turns in the level of
            the CoM or below it.
        distance: of the hand's target [m]; 0 for a pelvis that turns.
    """

    robot: str
    doing: str
    distance: float = 0.0


def run_far(trial: Far) -> bool:
    """Run one trial; return whether the robot fell."""
    if trial.distance:
        found = far_hand(trial.robot, trial.doing, trial.distance)
    else:
        found = turning_pelvis(trial.robot, trial.doing == "shared")
    return bool(found["fell"])


def far_section(options: StudyOptions, progress: Progress) -> Section:
    """Lead hands to targets far away, and turn the target of a pelvis."""
    trials = [Far(robot=name, doing=doing, distance=far) for name, doing, far in FAR_HANDS]
    trials += [Far(robot=name, doing="shared" if shared else "below") for name, shared in TURNED]
    fell = run_each(run_far, bool, trials[:1] if options.quick else trials, progress, options)
    findings = tuple(
        Finding(
            name=f"{trial.robot}, {_words(trial)}: falls",
            paper=0,
            ours=int(fallen),
            ok=not fallen,
        )
        for trial, fallen in fell.items()
    )
    return Section(findings=findings)


def _words(trial: Far) -> str:
    if trial.distance:
        return f"{trial.doing}, left hand's target {trial.distance:g} m ahead"
    where = "in the level of the CoM" if trial.doing == "shared" else "below the CoM"
    return f"on one leg, pelvis turning at 0.5 rad/s, {where}"
