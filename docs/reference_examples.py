"""Examples and comments of the code in its reference: an extension of griffe, which reads the code.

`reference/examples/PACKAGE.py` has cells, `# %% NAME NAME`: the example of each of these names.
"""

import re
from pathlib import Path

import griffe

EXAMPLES = Path(__file__).parent / "reference" / "examples"
_CELL = re.compile(r"^# %%(.*)\n", re.MULTILINE)


def cells(text: str) -> dict[str, str]:
    """Return the code of the cell of each name."""
    _, *parts = _CELL.split(text)
    return {
        name: code.strip()
        for names, code in zip(parts[::2], parts[1::2], strict=True)
        for name in names.split()
    }


class ReferenceExamples(griffe.Extension):
    """Add an example to each public name, and comments of fields and values of enumerations."""

    def on_package(self, *, pkg: griffe.Module, **_: object) -> None:
        """Add the examples to the docstrings."""
        for file in EXAMPLES.glob("*.py"):
            face = pkg[file.stem] if file.stem in pkg.members else pkg["apps"][file.stem]
            for name, code in cells(file.read_text(encoding="utf-8")).items():
                thing = face[name].final_target if face[name].is_alias else face[name]
                block = "\n    ".join(["```python", *code.split("\n"), "```"])
                text = f"{thing.docstring.value if thing.docstring else ''}\n\nExample:\n"
                thing.docstring = griffe.Docstring(
                    f"{text}    {block}", parent=thing, parser="google"
                )

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: object) -> None:
        """Take the comments above a field and behind it as its docstring."""
        if attr.docstring or attr.lineno is None or not isinstance(attr.filepath, Path):
            return
        lines = attr.filepath.read_text(encoding="utf-8").splitlines()
        words = [lines[(attr.endlineno or attr.lineno) - 1].partition("  # ")[2]]
        above = attr.lineno - 2
        while lines[above].strip().startswith("# "):
            words.insert(0, lines[above].strip()[2:])
            above -= 1
        text = " ".join(words).strip()
        bases = attr.parent.bases if isinstance(attr.parent, griffe.Class) else ()
        if attr.value and not text and any(str(base).endswith("Enum") for base in bases):
            text = f"`{attr.value}`"
        if text:
            attr.docstring = griffe.Docstring(text, parent=attr)
