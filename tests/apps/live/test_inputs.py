"""From messages and gamepads to the newest sample: what counts, and what has to be let go first."""

import ctypes
from pathlib import Path
from unittest.mock import Mock

import pytest
from msgspec.structs import replace

pytest.importorskip("websockets")

from operators import gamepad

from poise.apps.live import _inputs as inputs
from poise.apps.live._gamepad import HostGamepad, NoGamepadError
from poise.apps.live._inputs import OperatorInputs
from poise.locomotion import LOST_AFTER, OperatorSample, TrackedPose

REST = OperatorSample()
PLACE = (0.1, 0.2, 0.3)


@pytest.fixture
def operator():
    return OperatorInputs()


@pytest.fixture
def clock(monkeypatch):
    """The time of this machine, which stands still unless it is set."""
    now = Mock(return_value=100.0)
    monkeypatch.setattr(inputs.clock, "monotonic", now)
    return now


def settled(operator):
    """The sample that the loop reads once it has read all that was taken hold of and let go."""
    for _ in range(9):
        sample = operator.read()
    return sample


def clutched(clutch):
    """A foot, a hand and a head as trackers see them."""
    part, head = TrackedPose(PLACE, clutch=clutch), TrackedPose(None, clutch, (0.0, 0.6, 0.0, 0.8))
    return OperatorSample(feet=(None, part), hands=(part, None), head=head)


@pytest.mark.parametrize("gap", ["silence", "reset"])
@pytest.mark.parametrize(
    ("held", "released"),
    [
        (OperatorSample(lift=(False, True)), REST),
        (OperatorSample(move=(1.0, 0.0)), REST),
        (OperatorSample(turn=0.5), REST),
        (OperatorSample(bend=(1.0, 0.0, 0.0, 0.0, 0.0)), REST),
        (OperatorSample(grip=(True, False), reach=(1.0, 0.0, 0.0)), REST),
        (OperatorSample(feet=(TrackedPose(PLACE), None)), REST),
        (clutched(True), clutched(False)),
    ],
    ids=["foot", "stick", "turn", "bend", "grip", "handle", "clutches"],
)
def test_what_is_held_when_somebody_comes_back_leads_nothing_until_it_is_let_go(
    operator, clock, held, released, gap
):
    operator.take(released)
    assert operator.take(held) == {}
    assert settled(operator) == held
    if gap == "silence":
        clock.return_value += LOST_AFTER + 0.01
    else:
        operator.clear()
    assert operator.read() is None
    for _ in range(3):
        assert operator.take(held) == {"again": True}
        assert settled(operator) == REST
    operator.take(released)
    assert settled(operator) == released
    assert operator.take(held) == {}
    assert settled(operator) == held


def test_a_clutch_that_is_closed_when_somebody_comes_first_leads_nothing_and_keys_do(operator):
    for sample, seen in ((clutched(True), REST), (REST, REST), (clutched(True), REST)):
        # Out of sight is not let go.
        operator.take(sample)
        assert operator.read() == seen
    other = OperatorInputs()
    other.take(OperatorSample(lift=(True, False)))
    assert other.read() == OperatorSample(lift=(True, False))


def test_each_of_several_things_that_are_held_is_let_go_by_itself(operator):
    place = TrackedPose(PLACE)
    held = OperatorSample(lift=(False, True), feet=(place, None), turn=0.5)
    operator.take(REST)
    operator.take(held)
    operator.clear()
    operator.take(held)
    operator.take(OperatorSample(lift=(False, True), turn=0.2))
    operator.take(held)
    assert settled(operator) == OperatorSample(feet=(place, None))


def test_what_was_open_within_a_burst_of_messages_is_seen_so_once(operator):
    for clutch in (False, True):
        operator.take(replace(clutched(clutch), turn=0.5))
    assert operator.read() == replace(clutched(False), turn=0.5)
    assert operator.read() == replace(clutched(True), turn=0.5)


def test_a_sample_counts_for_as_long_as_the_slowest_device_takes_to_the_next(operator, clock):
    operator.take(OperatorSample(lift=(True, False)))
    assert operator.read() is not None
    clock.return_value += 0.09
    assert operator.read() is not None
    clock.return_value += 0.02
    assert operator.read() is None


def test_messages_that_others_have_overtaken_are_dropped(operator):
    assert operator.take(OperatorSample(time=1.0, turn=0.1)) == {}
    assert operator.take(OperatorSample(time=1.03, turn=0.2)) == {}
    assert operator.take(OperatorSample(time=1.01, turn=0.3)) == {"old": pytest.approx(0.02)}
    assert operator.read().turn == 0.2
    operator.take(OperatorSample(turn=0.4))
    assert operator.read().turn == 0.4


@pytest.mark.parametrize(
    ("stamp", "why"),
    [
        (lambda s: 5e3 + 1e3 * s, "early"),
        (lambda s: 1.0 + 0.03 * s, "late"),
        (lambda s: 7.0, "old"),
    ],
    ids=["milliseconds", "slow", "frozen"],
)
def test_a_clock_that_is_none_in_seconds_is_told_of(operator, clock, stamp, why):
    told = set()
    for tick in range(60):
        clock.return_value = 100.0 + 0.033 * tick
        told |= operator.take(OperatorSample(time=stamp(0.033 * tick))).keys()
    assert told == {why}
    assert operator.take(OperatorSample()) == {}


def test_times_of_messages_that_the_loop_took_are_kept(operator):
    operator.take(OperatorSample())
    operator.commanded(1.0)
    assert not operator.stages
    operator.read()
    operator.commanded(1.0)
    assert len(operator.stages) == 1


# Gamepads --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("buttons", "axes", "sample"),
    [
        ((), {}, REST),
        (
            ("LEFTSHOULDER",),
            {"LEFTX": -1.0, "LEFTY": -0.5},
            OperatorSample(lift=(True, False), move=(0.5, 1.0)),
        ),
        (
            ("A", "RIGHTSHOULDER"),
            {"LEFTX": 0.1, "LEFTY": -0.1},
            OperatorSample(lift=(False, True), upright=True),
        ),
        # Each stick moves its own foot where both are held, and the right one turns a walk.
        (
            ("LEFTSHOULDER", "RIGHTSHOULDER"),
            {"LEFTX": 0.5, "LEFTY": -1.0, "RIGHTX": -0.6, "RIGHTY": 0.4},
            OperatorSample(lift=(True, True), move=(1.0, -0.5), second=(-0.4, 0.6), turn=0.6),
        ),
        (("DPAD_LEFT", "DPAD_UP"), {}, OperatorSample(bend=(1.0, 0.0, 0.0, 0.0, 1.0))),
        (("B", "DPAD_RIGHT", "DPAD_DOWN"), {}, OperatorSample(bend=(0.0, 0.0, -1.0, -1.0, 0.0))),
        (("Y",), {}, OperatorSample(neutral=True)),
    ],
)
def test_what_buttons_and_sticks_of_a_gamepad_mean(buttons, axes, sample):
    assert gamepad(*buttons, **axes) == sample


class VirtualPad:
    """A gamepad in SDL itself, with its parts where Linux has those of one for the Xbox.

    Between the axes of its sticks stand triggers, which rest at the end of theirs.
    """

    PARTS = (
        "a:b0 b:b1 x:b2 y:b3 leftshoulder:b4 rightshoulder:b5 leftx:a0 lefty:a1 rightx:a3 righty:a4"
        " lefttrigger:a2 righttrigger:a5 dpup:h0.1 dpright:h0.2 dpdown:h0.4 dpleft:h0.8"
        # SDL writes its checksum behind the last part without a comma.
        " platform:Linux"
    )
    RESTING = (0, 0, -32768, 0, 0, -32768)
    LEFT_SHOULDER = 4

    def __init__(self):
        pygame = pytest.importorskip("pygame")
        from pygame._sdl2 import controller

        self._pygame, self._controller = pygame, controller
        pygame.display.init()
        pygame.joystick.init()
        controller.init()
        maps = Path("/proc/self/maps").read_text()
        library = next(line.split()[-1] for line in maps.splitlines() if "libSDL2-2" in line)
        self._sdl = ctypes.CDLL(library)
        self._sdl.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
        self.index = None

    def plug(self, *, known=True):
        self.index = self._sdl.SDL_JoystickAttachVirtual(int(known), 6, 11, 1)
        self._held = self._pygame.joystick.Joystick(self.index)
        if known:
            mapping = dict(part.split(":") for part in self.PARTS.split())
            self._controller.Controller(self.index).set_mapping(mapping)
        number = self._held.get_instance_id()
        self._stick = ctypes.c_void_p(self._sdl.SDL_JoystickFromInstanceID(number))
        self.push()

    def push(self, *, buttons=(), hat=0, axes=RESTING):
        for axis, value in enumerate(axes):
            self._sdl.SDL_JoystickSetVirtualAxis(self._stick, axis, ctypes.c_int16(value))
        for button in range(11):
            self._sdl.SDL_JoystickSetVirtualButton(self._stick, button, int(button in buttons))
        self._sdl.SDL_JoystickSetVirtualHat(self._stick, 0, hat)

    def pull(self):
        if self.index is not None:
            assert self._sdl.SDL_JoystickDetachVirtual(self.index) == 0
            self.index = None
            self._pygame.event.get()


@pytest.fixture
def virtual_pad(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    pad = VirtualPad()
    yield pad
    pad.pull()


def test_a_gamepad_of_the_robots_machine_leads_also_when_it_is_plugged_in_again(
    operator, virtual_pad, monkeypatch
):
    virtual_pad.plug()
    host = HostGamepad(operator)

    def polled():
        host.poll()
        return operator.read()

    assert polled() == REST
    virtual_pad.push(axes=(16384, -32768, 32767, -16384, 8192, 32767))
    assert polled() == OperatorSample(move=(1.0, -0.5), second=(-0.25, 0.5), turn=0.5)
    virtual_pad.push(buttons=[virtual_pad.LEFT_SHOULDER], hat=4 | 8)
    assert polled() == OperatorSample(lift=(True, False), bend=(-1.0, 0.0, 0.0, 0.0, 1.0))
    virtual_pad.pull()
    operator.clear()
    assert polled() is None
    virtual_pad.plug()
    assert polled() == REST
    # It shakes when a foot lands.
    monkeypatch.setattr(host, "_pad", Mock())
    host.shake(0)
    assert not host._pad.rumble.called
    host.shake(1)
    host.shake(1)
    host._pad.rumble.assert_called_once()


def test_without_a_gamepad_or_with_one_of_no_known_layout_that_is_said(operator, virtual_pad):
    with pytest.raises(NoGamepadError, match="no gamepad on this machine"):
        HostGamepad(operator)
    virtual_pad.plug(known=False)
    with pytest.raises(NoGamepadError, match="SDL_GAMECONTROLLERCONFIG"):
        HostGamepad(operator)
