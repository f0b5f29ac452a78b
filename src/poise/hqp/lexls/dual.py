"""Steps of the dual active-set method of `guess`: what is violated enters, what would pull leaves.

Where all multipliers of the active rows have the right sign, the one row that is violated most
enters, and its own multiplier grows from zero. Where another's turns on the way, that row leaves,
and the way goes on from there (Goldfarb, Idnani 1983).
"""

from math import sqrt

from poise._compiled import part
from poise.hqp.lexls.penalties import add_row, find_lambda, find_point, remove_row
from poise.hqp.lexls.system import System
from poise.hqp.lexls.tolerances import GUESS_TOLERANCE


@part
def converge(system: System, begin: int, end: int, count: int) -> int:
    """Goes on until no row is violated.

    Args:
        system: whose active rows push as they should.
        begin: the first bound or row that may enter.
        end: where those end that may.
        count: how many rows are active.

    Returns:
        How many are then.
    """
    for _ in range(2 * len(system.side)):
        find_point(system, count)
        index = _most_violated(system, begin, end)
        if index < 0 or count == len(system.G):
            break
        count = _enter(system, index, count)
    return count


@part
def drop_wrong(system: System, count: int) -> int:
    """Finds the multipliers, and lets go of rows until none of them has the wrong sign.

    Args:
        system: whose active rows are factored.
        count: how many they are.

    Returns:
        How many are left.
    """
    wrong = True
    while wrong:
        wrong = False
        find_lambda(system, count, system.push)
        for k in range(count - 1, -1, -1):
            row = system.order[k]
            if system.firm[row] == 0 and system.push[k] * system.side[row] < 0.0:
                _drop(system, k, count)
                count, wrong = count - 1, True
    return count


@part
def _most_violated(system: System, begin: int, end: int) -> int:
    """The inactive row that is violated most, relative to its length; or -1."""
    most, worst = 0.0, -1
    for j in range(len(system.y)):
        most += system.y[j] * system.y[j]
    most = GUESS_TOLERANCE * sqrt(most)
    for i in range(begin, end):
        if system.side[i] != 0 or not system.length[i] > 0.0:
            continue
        over = max(system.goal[i] - system.upper[i], system.lower[i] - system.goal[i])
        if over > most * system.length[i]:
            worst, most = i, over / system.length[i]
    return worst


@part
def _enter(system: System, index: int, count: int) -> int:
    """Makes a violated row active; returns how many are active then."""
    system.side[index] = 1 if system.goal[index] > system.upper[index] else -1
    system.order[count] = index
    system.push[count] = 0.0
    add_row(system, count)
    count += 1
    while True:
        find_lambda(system, count, system.aim)
        length, drop = 1.0, -1
        for k in range(count):
            row, now, new = system.order[k], system.push[k], system.aim[k]
            if system.firm[row] != 0 or row == index or not new * system.side[row] < 0.0:
                continue
            share = now / (now - new)
            if share < length:
                length, drop = share, k
        for k in range(count):
            system.push[k] += length * (system.aim[k] - system.push[k])
        if drop < 0:
            return count
        _drop(system, drop, count)
        count -= 1


@part
def _drop(system: System, place: int, count: int) -> None:
    """Lets go of a row."""
    row = system.order[place]
    system.side[row] = 0
    system.gap[row] = system.settled[row]
    remove_row(system, place, count)
