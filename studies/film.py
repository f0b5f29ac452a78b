"""`Film`: a video of a study, which lies beside its page."""

from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Film:
    """A video.

    Attributes:
        name: of its file, unique within the study.
        title: what it shows.
        data: the mp4 file's contents.
    """

    name: str
    title: str
    data: bytes = field(repr=False)

    @property
    def file_name(self) -> str:
        """Of the file beside the page."""
        return f"{self.name}.mp4"
