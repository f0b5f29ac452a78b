# %% Bar
from poise.cli import Bar

bar = Bar("episodes", "episode")
for done in range(3):
    bar(done + 1, 3)
bar.close()

# %% run_command
from dataclasses import dataclass

from poise.cli import run_command


@dataclass(frozen=True)
class Greet:
    """Greet."""

    name: str = "you"

    def act(self) -> int:
        print("hello", self.name)
        return 0


status = run_command("greet", Greet, ["--name", "me"])
