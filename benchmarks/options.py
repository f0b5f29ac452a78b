"""What the options of several benchmarks hold: lists of words, and the folder to write into."""

from pathlib import Path


def words_of(text: str) -> tuple[str, ...]:
    """Reads `a,b,c`: words with commas between them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def folder_of(given: str | None) -> Path | None:
    """The folder to write into, made if it is not there; None for none."""
    if given is None:
        return None
    folder = Path(given)
    folder.mkdir(parents=True, exist_ok=True)
    return folder
