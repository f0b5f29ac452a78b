"""`take_turns`: who is timed when, and which ticks count."""

from itertools import pairwise

from benchmarks.clocked import Turns, take_turns


class Listener:
    """Notes what it is asked to do."""

    def __init__(self, name, log):
        self.name, self.log = name, log

    def tick(self, index):
        self.log.append((self.name, index))

    def skip(self, index):
        self.log.append((f"{self.name} skips", index))


def asked(log, name):
    return [index for who, index in log if who == name]


def test_quick_methods_do_every_tick_in_turn_and_slow_ones_some_or_skip_it():
    log = []
    turns = Turns(ticks=25, batch=10, slow=2)
    quick, slow = [Listener(n, log) for n in "ab"], [Listener(n, log) for n in "st"]
    assert list(take_turns(quick, slow, turns)) == [10, 20, 25]
    for name in "ab":
        assert asked(log, name) == list(range(25))
    for name in "st":
        timed, skipped = asked(log, name), asked(log, f"{name} skips")
        assert timed == [0, 1, 2, 10, 11, 12, 20, 21, 22]
        assert sorted(timed + skipped) == list(range(25))
    # Each comes first as often as the other.
    first = [who for (who, i), (_, k) in pairwise(log) if who in "ab" and i == k]
    assert abs(first.count("a") - first.count("b")) <= 1
