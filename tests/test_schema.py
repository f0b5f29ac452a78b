"""Checked dataclasses: the same words from Python and from files, and the line of the file."""

import re
from dataclasses import FrozenInstanceError, dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field

from poise._schema import (
    NOT_IN_FILES,
    Bounds,
    Count,
    Number,
    Point,
    Positive,
    Text,
    Triple,
    checked,
    read,
)
from poise._yaml import read_yaml
from poise.errors import ConfigurationError, PoiseError, RobotError


@checked()
@dataclass(frozen=True, kw_only=True)
class Wheel:
    radius: Annotated[float, Bounds(positive=True, most=2.0, unit="m")]
    spokes: Count = 12

    def __post_init__(self):
        if self.spokes == 13:
            raise ConfigurationError("an unlucky wheel", got=13, wanted="another number")


@checked(RobotError)
@dataclass(frozen=True, kw_only=True)
class Cart:
    name: Text = "cart"
    kind: Literal["fast", "slow"] = "slow"
    wheels: tuple[Wheel, ...] = ()
    load: Positive | None = None
    offset: Triple = (0.0, 0.0, 0.0)
    center: Point = field(default_factory=lambda: np.zeros(3))
    begin: Annotated[Number, Field(alias="from")] = 0.0
    made_by: Text = field(default="hand", metadata=NOT_IN_FILES)


def cart(text):
    return read(
        Cart, read_yaml(text, "cart.yaml", error=ConfigurationError), "c", error=ConfigurationError
    )


def test_a_file_becomes_nested_dataclasses():
    made = cart(
        "name: ' x '\nwheels:\n  - {radius: 1}\nfrom: 2\noffset: [1, 2, 3]\ncenter: [1, 2, 3]"
    )
    assert made.wheels == (Wheel(radius=1.0),)
    assert isinstance(made.wheels[0].radius, float)
    assert (made.name, made.begin, made.offset) == ("x", 2.0, (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(made.center, [1.0, 2.0, 3.0])


IN_FILES = {
    "unknown": (
        "wheels:\n- radius: 1\n  spoks: 3",
        r"c:3: wheels\[0\] has an unknown key; got 'spoks'.*spokes",
    ),
    "missing": (
        "wheels:\n- spokes: 3",
        r"c:2: wheels\[0\] lacks the key 'radius'; got \['spokes'\]",
    ),
    "range": ("\n\nload: -1", "c:3: load is out of range; got -1; wanted a positive number up to"),
    "unit": ("wheels: [{radius: 3}]", r"radius is out of range; got 3; .* up to 2 \[m\]"),
    "kind": ("load: 5 kg", "c:1: load has the wrong kind; got '5 kg'; wanted a positive number"),
    "bool": ("load: true", "load has the wrong kind; got True"),
    "huge": (f"load: 1{'0' * 400}", "load is out of range"),
    "NaN": ("load: .nan", "load is out of range; got nan"),
    "whole": ("wheels: [{radius: 1, spokes: 2.5}]", "spokes is out of range.*2.5.*whole number"),
    "choices": ("kind: slo", "c:1: unknown kind; got 'slo'; choices: slow"),
    "list": ("wheels: {radius: 1}", "wheels has the wrong kind.*wanted a list"),
    "mapping": ("wheels: [3]", r"wheels\[0\] has the wrong kind; got 3; wanted keys with values"),
    "length": ("offset: [1, 2]", r"offset has the wrong kind; got \[1, 2\]; wanted 3 numbers"),
    "element": ("offset:\n- 1\n- x\n- 3", r"c:3: offset\[1\] has the wrong kind; got 'x'"),
    "alias": ("begin: 1", "c:1 has an unknown key; got 'begin'"),
    "hidden": ("made_by: me", "c:1 has an unknown key; got 'made_by'"),
    "key": ("1: 2", "c has an unknown key; got 1; choices: name, kind"),
    "own": (
        "wheels:\n- {radius: 1}\n- {radius: 1, spokes: 13}",
        r"c:3: wheels\[1\]: an unlucky wheel",
    ),
    "merged": ("wheels:\n- &a {radius: 1}\n- {<<: *a, spokes: 0}", r"c:3: wheels\[1\].spokes"),
}


@pytest.mark.parametrize("case", IN_FILES)
def test_what_is_wrong_in_a_file_is_said_with_its_line(case):
    text, message = IN_FILES[case]
    with pytest.raises(PoiseError, match=message) as error:
        cart(text)
    assert isinstance(error.value, ConfigurationError)
    assert "\n" not in str(error.value)


def test_python_gets_the_same_words_as_files():
    with pytest.raises(
        RobotError, match="Cart: load is out of range; got -1; wanted a positive"
    ) as here:
        Cart(load=-1)
    with pytest.raises(ConfigurationError) as there:
        cart("load: -1")
    assert str(here.value).split(": ", 1)[1] == str(there.value).split(": ", 1)[1]
    with pytest.raises(ConfigurationError, match="^an unlucky wheel; got 13"):
        Wheel(radius=1.0, spokes=13)
    with pytest.raises(TypeError, match="spoks"):
        Wheel(radius=1.0, spoks=3)


def test_a_checked_dataclass_stays_a_frozen_dataclass_that_can_be_replaced():
    made = Cart(begin=1.0, wheels=[Wheel(radius=np.float32(0.5))], made_by="me")
    assert replace(made, load=2).load == 2.0
    assert (made.wheels[0].radius, made.made_by, made.begin) == (0.5, "me", 1.0)
    with pytest.raises(FrozenInstanceError):
        made.load = 3.0
    with pytest.raises(RobotError, match="load"):
        replace(made, load=float("inf"))


@pytest.mark.parametrize(
    ("bounds", "inside", "outside"),
    [
        (Bounds(positive=True), [1e-300, 1e9], [0.0, -1.0, 1.1e9]),
        (Bounds(least=0.0), [0.0, 1e9], [-1e-300, np.inf]),
        (Bounds(least=-1.0, most=1.0), [-1.0, 1.0], [-1.01, 1.01]),
        (Bounds(most=2.0), [-2.0, 2.0], [-2.1, 2.1, np.nan]),
        (Bounds(positive=True, below=1.0), [0.5], [0.0, 1.0]),
    ],
)
def test_bounds_are_kept_to_the_end(bounds, inside, outside):
    @checked()
    @dataclass(frozen=True)
    class Held:
        x: Annotated[float, bounds]

    for value in inside:
        assert Held(value).x == value
    for value in outside:
        with pytest.raises(ConfigurationError, match=re.escape(f"wanted {bounds.wanted}")):
            Held(value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e9", 1e9),
        ("1.0e9", 1e9),
        ("1.0E9", 1e9),
        ("1.e9", 1e9),
        (".5e3", 500.0),
        ("-2.5e+3", -2500.0),
        ("+1e-3", 1e-3),
        ("1.0e-3", 1e-3),
        ("12", 12),
        ("0.5", 0.5),
    ],
)
def test_numbers_in_files_are_numbers_however_they_are_written(text, value):
    data = read_yaml(f"x: {text}", "x.yaml", error=ConfigurationError)
    assert data["x"] == value
    assert not isinstance(data["x"], str)


@pytest.mark.parametrize("text", ["e9", "1e", ".e9", "1e9x", "1.2.3e4", "'1e9'"])
def test_what_is_no_number_stays_text(text):
    data = read_yaml(f"x: {text}", "x.yaml", error=ConfigurationError)
    assert isinstance(data["x"], str)


@pytest.mark.parametrize(
    ("text", "read_as"),
    [("010", "8"), ("-017", "-15"), ("1:30", "90"), ("+1:00:00", "3600"), ("1:30.5", "90.5")],
)
def test_numbers_to_the_base_of_8_or_60_are_refused_with_their_line(text, read_as):
    wanted = rf"'{re.escape(text)}' would be read as {read_as}: .*leading zero.*line 3, column 4"
    with pytest.raises(ConfigurationError, match=wanted):
        read_yaml(f"a: 1\nb:\n - {text}", "x.yaml", error=ConfigurationError)
    quoted = read_yaml(f"x: '{text}'", "x.yaml", error=ConfigurationError)
    assert quoted["x"] == text


@pytest.mark.parametrize(
    ("text", "value"),
    [("0", 0), ("-0", 0), ("10", 10), ("0.5", 0.5), ("00.5", 0.5), ("1e-3", 1e-3), ("0x10", 16),
     ("08", "08"), ("a:b", "a:b"), ("0:30", "0:30")],
)  # fmt: skip
def test_other_numbers_and_texts_stay_what_they_are(text, value):
    assert read_yaml(f"x: {text}", "x.yaml", error=ConfigurationError)["x"] == value
