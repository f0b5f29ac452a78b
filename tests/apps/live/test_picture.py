"""The robot's picture in a real browser: handles that are dragged, and where it is seen from."""

import math

import pytest

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from operators import says, wait_for
from pages import Page


@pytest.fixture
def drawn(browser, still_front, desk):
    """The operator's page with its picture."""
    with Page(browser, still_front.drive_url) as page:
        page.wait("view !== null && grips", "the picture")
        wait_for(lambda: desk.orders, "the first message")
        yield page
        assert page.errors == []


UP_THE_ARROW = 0.12
"""From the middle of a handle to a point of its upper arrow [m]."""


def move_to(page, of, which, above):
    """Move the mouse to a point above a handle of feet or hands [m]."""
    place = page.ask(
        f"""(() => {{
          const box = part("view").getBoundingClientRect();
          const point = view.{of}[{which}].object.position.clone();
          point.z += {above};
          point.project(view.stage.camera);
          return [box.left + 0.5 * box.width * (1 + point.x),
                  box.top + 0.5 * box.height * (1 - point.y)];
        }})()"""
    )
    page.page.mouse.move(*place)


@pytest.mark.parametrize(("of", "which"), [("handles", 0), ("grips", 0), ("grips", 1)])
def test_a_handle_is_drawn_only_where_the_pointer_is_and_leads_while_it_is_dragged(
    drawn, desk, of, which
):
    shown = "[...view.handles, ...view.grips].map((handle) => handle.getHelper().visible)"
    number = which + 2 * (of == "grips")
    assert drawn.ask(shown) == [False] * 4
    move_to(drawn, of, which, UP_THE_ARROW)
    drawn.wait(f"view.{of}[{which}].axis !== null", "the arrow under the mouse")
    assert drawn.ask(shown) == [i == number for i in range(4)]
    drawn.page.mouse.down()
    move_to(drawn, of, which, UP_THE_ARROW + 0.1)

    def led():
        parts = desk.orders[-1].get("feet" if of == "handles" else "hands")
        part = parts and parts[which]
        return part and part.get("clutch", True) and part["position"][2] > 0.05

    wait_for(led, "the handle to lead")
    drawn.page.mouse.up()
    wait_for(lambda: not led(), "letting go")
    drawn.page.mouse.move(5, 5)
    drawn.wait(f"{shown}.every((one) => !one)", "the handle to go")


def test_a_hands_handle_that_is_dragged_to_the_horizon_lets_go_of_nothing_else(drawn, desk):
    drawn.ask("keys.left = view.grips[1].dragging = true; 0")
    drawn.ask("view.grips[1].object.position.set(-3e5, 2e4, 0.5); 0")
    x, y, _ = drawn.ask("view.hands()[1].position")
    assert math.hypot(x, y) > 1e5
    says(desk, "the key", "lift", [True, False])
    assert drawn.text("said").strip() == ""


def test_the_view_goes_along_and_stays_behind_the_robot(drawn):
    def seen(x, y, heading):
        """Positions of camera and target against the robot."""
        return drawn.ask(
            f"""(() => {{
              const s = structuredClone(newest);
              s.com[0] = {x}; s.com[1] = {y}; s.heading = {heading};
              view.show(s);
              const from = (p) => [p.x - {x}, p.y - {y}];
              return [from(view.stage.camera.position), from(view.stage.controls.target)];
            }})()"""
        )

    # The status does not change any more.
    drawn.ask("socket.onmessage = null; 0")
    (behind, left), (ahead, _) = seen(0.0, 0.0, 0.0)
    assert behind < -1.0
    # Who only shifts the weight moves nothing.
    assert seen(0.1, 0.1, 0.2)[0] == pytest.approx([behind - 0.1, left - 0.1], abs=1e-6)
    camera, target = seen(30.0, -5.0, 0.0)
    assert camera == pytest.approx([behind, left], abs=0.3)
    assert target == pytest.approx([ahead, 0.0], abs=0.3)
    assert seen(30.0, -5.0, 3.0)[0][0] > 1.0
    drawn.ask("view.handles[0].dragging = true; 0")
    before = drawn.ask("view.stage.camera.position.x")
    seen(0.0, 0.0, 0.0)
    assert drawn.ask("view.stage.camera.position.x") == before
