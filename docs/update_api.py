"""Writes api.md: every public name, with the first line of what it says of itself.

python docs/update_api.py
"""

import inspect
from importlib import import_module
from pathlib import Path

PAGE = Path(__file__).with_name("api.md")
MODULES = (
    "poise",
    "poise.stack",
    "poise.estimation",
    "poise.control",
    "poise.locomotion",
    "poise.sim",
    "poise.apps.scenarios",
    "poise.apps.report",
    "poise.apps.pages",
    "poise.apps.teleoperation",
    "poise.apps.campaigns",
    "poise.apps.scorecard",
    "poise.apps.live",
    "poise.apps.onboarding",
    "poise.robots",
    "poise.dynamics",
    "poise.hqp",
    "poise.errors",
    "poise.cli",
)
"""What users may import from; everything else is private."""

HEAD = """# Public names

What a program may rely on stands here. Modules and names with a leading underscore are private and
may change with any version, but for the two that a `Task` of one's own has, `_resolve` and
`_evaluate`. Packages hand out some names more, which pages of these documents use where they are
needed, such as `ContactBelief`, `DeviceStatus`, `ImuNoise`, `StampedPredictor` and
`read_recording`; those may change, too. `python docs/update_api.py` writes this page; a test
compares it with the code.
"""


def page() -> str:
    """The page as the code has it now."""
    parts = [HEAD]
    for name in MODULES:
        module = import_module(name)
        parts.append(f"## `{name}`\n\n{first_line(module.__doc__)}\n")
        rows = [f"| `{public}` | {about(module, public)} |" for public in module.__all__]
        parts.append("\n".join(["| name | what it is |", "| --- | --- |", *rows]) + "\n")
    return "\n".join(parts)


def about(module: object, name: str) -> str:
    """The first line that says what a name is; a constant says its value's kind."""
    thing = getattr(module, name)
    if inspect.ismodule(thing) or inspect.isclass(thing) or inspect.isroutine(thing):
        return first_line(thing.__doc__).replace("|", "\\|")
    return f"a constant: {type(thing).__name__}"


def first_line(text: str | None) -> str:
    """The summary of a docstring."""
    return inspect.cleandoc(text or "").partition("\n\n")[0].replace("\n", " ")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
