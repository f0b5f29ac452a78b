"""`Bench`: what the benchmarks of the command line have in common."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import arg
from tyro.constructors import PrimitiveConstructorSpec

from benchmarks.result import result_table
from poise.cli import Bar


def words_of(text: str) -> tuple[str, ...]:
    """Read `a,b,c`: words with commas between them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def read_by(read: Callable[[str], Any], metavar: str = "W,W") -> PrimitiveConstructorSpec[Any]:
    """Annotation of an option whose text a function reads."""
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda texts: read(texts[0]),
        is_instance=lambda _: True,
        str_from_instance=lambda value: [",".join(value or ("usual",))],
    )


Words = Annotated[tuple[str, ...], read_by(words_of)]
"""Option of words with commas between them."""

MaybeWords = Annotated[tuple[str, ...] | None, read_by(words_of)]
"""The same where none given are the usual ones."""


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Options that all benchmarks have."""

    out: Annotated[str | None, arg(metavar="DIR")] = None  # folder to write into
    json: bool = False  # print the figures as JSON

    def folder(self) -> Path | None:
        """Make the folder to write into if it is not there; None for none."""
        if self.out is None:
            return None
        Path(self.out).mkdir(parents=True, exist_ok=True)
        return Path(self.out)

    def show(
        self,
        bench: Callable[..., Any],
        figures: Callable[..., Any] | None = None,
        table: Callable[..., str] = result_table,
        unit: str = " ticks",
    ) -> int:
        """Time, print, and write `bench.json` where a folder is wanted."""
        folder = self.folder()
        with Bar("timing", unit) as bar:
            results = bench(self, bar)
        found = () if figures is None else figures(results)
        lines = "".join(json.dumps(one.to_json()) + "\n" for one in (*results, *found))
        words = "\n".join([table(results), *(figure.words() for figure in found)])
        print(lines if self.json else words, end="" if self.json else "\n")
        if folder is not None:
            (folder / "bench.json").write_text(lines, encoding="utf-8")
        return 0
