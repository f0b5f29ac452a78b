"""Velocity commands in a scenario: the right plant, and a squat that does not fall."""

from dataclasses import replace

import pytest

from poise.apps.scenarios import load_scenario, parse_scenario, run_scenario
from poise.cli.main import main
from poise.control import CONTROLLERS, ControllerPlan, DifferentialIK, make_controller
from poise.errors import ConfigurationError, UnknownNameError

SQUAT = """
name: a quick squat
# Servos make the ZMP jump by centimetres as it is; the estimate's last bits make other jumps of it.
ground_truth: true
duration: 2.4
robot: {robot}
controller: {{name: differential_ik, strategy: {strategy}}}
plant: {{control_dt: 0.005}}
stack:
  contacts: [surface: {{frame: left_sole}}, surface: {{frame: right_sole}}]
  softening: 0.0
  levels:
    - - com: {{kp: 100}}
      - frame: {{frame: pelvis, axes: orientation, kp: 100, name: pelvis}}
    - - frame: {{frame: left_hand, axes: position, kp: 100, name: hand}}
    - - posture
motions:
  - {{task: com, at: 0.1, over: 1.0, by: [0.0, 0.0, -0.15]}}
  - {{task: com, at: 1.2, over: 1.0, by: [0.0, 0.0, 0.15]}}
checks:
  - {{metric: com_travel, axis: z, at_least: 0.145}}
  - {{metric: com_error_max, at_most: 0.01}}
  - {{metric: zmp_margin_min, at_least: 0.03, from: 0.1}}
"""


@pytest.mark.parametrize("strategy", CONTROLLERS["differential_ik"].strategies)
@pytest.mark.parametrize("robot", ["biped20", "humanoid33"])
def test_a_biped_squats_under_velocity_commands(robot, strategy, request):
    pytest.importorskip("mujoco")
    if (robot, strategy) == ("humanoid33", "closed_form"):
        # Servos that chase velocities jerk: the ZMP jumps by some 5 cm from tick to tick.
        request.applymarker(pytest.mark.xfail(reason="one sample of the ZMP has 22 mm of margin"))
    scenario = parse_scenario(SQUAT.format(robot=robot, strategy=strategy), "squat.yaml")
    run = run_scenario(scenario)
    assert isinstance(run.controller, DifferentialIK)
    assert run.controller.dt == 0.005
    assert run.plant.config.actuation == "velocity"
    assert [check.name for check in run.checks if not check.ok] == []


def test_a_file_that_says_nothing_about_actuation_takes_the_controllers(tmp_path):
    scenario = replace(load_scenario("stand"), duration=0.02, robot="biped20")
    for name, kind in CONTROLLERS.items():
        run = run_scenario(replace(scenario, controller=ControllerPlan(name=name)))
        assert run.plant.config.actuation == kind.actuation
        assert run.scenario.plant.actuation == kind.actuation
    out = tmp_path / "out"
    arguments = ["run", "stand", "--robot", "biped20", "--controller", "differential_ik"]
    short = tmp_path / "short.yaml"
    short.write_text("name: short\nduration: 0.05\n", encoding="utf-8")
    arguments[1] = str(short)
    assert main([*arguments, "--no-video", "--out", str(out)]) in (0, 1)
    assert (out / "summary.json").is_file()


@pytest.mark.parametrize(
    ("controller", "actuation", "choice"),
    [("differential_ik", "torque", "whole_body"), ("whole_body", "velocity", "differential_ik")],
)
def test_an_actuation_that_the_controller_does_not_command_is_refused(
    controller, actuation, choice
):
    text = f"name: s\nduration: 1\ncontroller: {controller}\nplant: {{actuation: {actuation}}}\n"
    with pytest.raises(
        ConfigurationError, match=f"{controller}.*'{actuation}'.*choices: .*{choice}"
    ):
        run_scenario(parse_scenario(text, "s.yaml"))


def test_plans_make_it_with_its_methods_and_nothing_else(get_robot):
    robot = get_robot("biped20")
    plan = ControllerPlan(name="differential_ik", strategy="hqp", dt=0.004)
    controller = make_controller(robot, plan=plan)
    assert isinstance(controller, DifferentialIK)
    assert (controller.strategy.name, controller.dt) == ("hqp", 0.004)
    with pytest.raises(UnknownNameError, match="closed_form, hqp"):
        make_controller(robot, plan=replace(plan, strategy="direct"))
    with pytest.raises(ConfigurationError, match="no backend"):
        make_controller(robot, plan=replace(plan, backend="daqp"))
