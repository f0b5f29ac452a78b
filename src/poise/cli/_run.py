"""`poise run`: one scenario to a report."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from poise._progress import Bar
from poise.cli._command import Output, output_folder
from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class RunVerb(Output):
    """Run a scenario in simulation and write report.html, video.mp4, log.mcap and summary.json.

    They lie in runs/SCENARIO-ROBOT, or in the folder of --out. Exit status: 0 all checks hold, 1 a
    check failed or the robot fell, 2 bad input.

    example: poise run push --robot g1 --out runs/push

    Attributes:
        scenario: a shipped scenario or a YAML file; --list shows those shipped.
        list: list the shipped scenarios and stop.
        robot: another robot than the file's: a name that `poise robots` lists, or a file.
        controller: another controller than the file's: whole_body, reduced, osf, differential_ik,
            or step_teleoperation where an operator leads the robot's feet.
        strategy: how the controller solves, in place of the file's: direct, cascade, weighted
            (whole_body, reduced); fused (osf); closed_form, hqp (differential_ik).
        seed: another seed than the file's of everything random: noise of sensors, bad operators,
            poor links.
        replay_states: log of `poise deploy`: feed its states to the controller, and show where it
            would have commanded otherwise, in replay.png.
        view: show the robot in a window.
        no_video: leave the video out.
    """

    scenario: Annotated[Positional[str], arg(metavar="SCENARIO")] = "over_an_obstacle"
    list: bool = False
    robot: str | None = None
    controller: str | None = None
    strategy: str | None = None
    seed: int | None = None
    replay_states: str | None = None
    view: bool = False
    no_video: bool = False

    def act(self) -> int:
        """Run the scenario."""
        from poise.apps.scenarios import load_scenario, shipped_scenarios

        if self.list:
            about = {name: load_scenario(name).description for name in shipped_scenarios()}
            width = max(map(len, about)) + 2
            return self.show(about, *(f"{name:{width}}{text}" for name, text in about.items()))
        scenario = load_scenario(self.scenario)
        controller = _changed(scenario.controller, name=self.controller, strategy=self.strategy)
        scenario = _changed(scenario, robot=self.robot, seed=self.seed, controller=controller)
        if self.replay_states is not None:
            return self._replay(scenario, self.replay_states)
        default = f"runs/{scenario.name}-{Path(scenario.robot).stem}"
        with output_folder(self.out, default) as folder:
            run, summary = run_and_report(
                scenario, folder, self, video=not self.no_video, view=self.view
            )
        self.show(summary)
        return 0 if run.ok else 1

    def _replay(self, scenario: Any, log: str) -> int:
        from poise.apps import deployment as d
        from poise.robots import load_robot

        robot = load_robot(scenario.robot)
        gains = d.g1_gains(robot)
        with (
            output_folder(self.out, f"runs/replay-{scenario.name}-{robot.name}") as folder,
            Bar("replaying", " states", lines=not self.json) as bar,
        ):
            found = d.replay_states(
                log,
                scenario,
                robot,
                gains.check,
                gains.split,
                kp=gains.kp,
                kd=gains.kd,
                progress=bar,
            )
            found.plot().savefig(folder / "replay.png")
        time, joint, share = found.worst
        figures = {"states": len(found.time), "time": time, "joint": joint, "difference": share}
        about = f"largest difference {share:.2%} of the limit of {joint} at {time:.3f} s"
        return self.show(figures, f"{len(found.time)} states: {about}", f"{folder / 'replay.png'}")


def _changed(settings: Any, **changes: Any) -> Any:
    return replace(settings, **{k: v for k, v in changes.items() if v is not None})


def run_and_report(
    scenario: Any, folder: Path, output: Output, *, video: bool, view: bool = False
) -> tuple[Any, dict[str, Any]]:
    """Run a scenario, write everything that a run leaves behind, and print its verdict."""
    from poise.apps import scenarios

    with Bar("simulating", " s", lines=not output.json) as bar:
        run = scenarios.run_scenario(scenario, log=folder / scenarios.LOG, view=view, progress=bar)
    return run, report_run(run, folder, output, video=video)


def report_run(run: Any, folder: Path, output: Output, *, video: bool) -> dict[str, Any]:
    """Write everything that a run leaves behind, and print its verdict."""
    from poise.apps import scenarios

    # Until there is something in its place, the report of an earlier run keeps its video.
    scenarios.discard_video(folder)
    summary = scenarios.summarise(run)
    scenarios.write_summary(summary, folder)
    no_video = None
    if video:
        try:
            with Bar("drawing the video", " frames", lines=not output.json) as bar:
                no_video = scenarios.write_video(run, folder, bar)
        except KeyboardInterrupt:
            no_video = "No video: interrupted by the user"
    page = scenarios.write_page(run, summary, folder, no_video)
    if not output.json:
        print(*_rows(run, summary), f"report: {page}", sep="\n")
        if run.ended_early:
            print(f"ended early: {run.ended_early}", file=sys.stderr)
        if no_video:
            print(no_video, file=sys.stderr)
    return summary


def replay(
    folder: Path, number: str, replay_job: Any, output: Output, *, video: bool
) -> tuple[Any, ...]:
    """Run an episode of a campaign's folder again; its job, run and summary."""
    from poise.apps.campaigns import CampaignFolder

    if not number.isdecimal():
        raise ConfigurationError("not the number of an episode", got=number, wanted="0, 1, 2, ...")
    job = replay_job(CampaignFolder(folder), int(number))
    with output_folder(output.out, folder / "replays" / number) as out:
        return job, *run_and_report(job.make(), out, output, video=video)


def _rows(run: Any, summary: dict[str, Any]) -> Iterator[str]:
    verdict = "all checks hold" if run.ok else "FAILED"
    yield f"{run.scenario.name} on {run.robot.name}: {verdict}"
    for check in run.checks:
        mark = "ok  " if check.ok else "FAIL"
        bound = f"{check.relation} {check.bound:g} {check.unit}".rstrip()
        worst = "" if check.ok or check.time is None else f" at {check.time:.2f} s"
        yield f"  {mark}  {check.name}: {check.value:.3g} ({bound}){worst}"
        if check.mechanism:
            yield f"        {check.mechanism}"
    tick = summary["tick_us"]
    if tick["p50"] is not None:
        yield (
            f"tick {tick['p50']:.0f} us median, {tick['p99']:.0f} us p99; "
            f"{summary['real_time_factor']:.1f} times real time"
        )
