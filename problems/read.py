"""Reads a file of problems with NumPy alone: `python read.py random-rank.npz` lists them."""

import sys

import numpy as np


def part(data, key, k, *shape):
    """What problem `k` has under `key`."""
    start = data[f"{key}_start"][k]
    return data[key][start : start + np.prod(shape, dtype=int)].reshape(shape)


def read(path):
    """Yield every problem of a file as a dictionary."""
    data = dict(np.load(path, allow_pickle=False))
    for k, (n, levels) in enumerate(zip(data["n"], data["levels"], strict=True)):
        rows = part(data, "rows", k, levels)
        m = rows.sum()
        problem = {"rows": rows, "bounds_level": data["bounds_level"][k]}
        problem |= {"A": part(data, "A", k, m, n), "H": part(data, "H", k, n, n)}
        problem |= {key: part(data, key, k, n + m) for key in ("lower", "upper", "weights")}
        yield problem | {"g": part(data, "g", k, n)}


if __name__ == "__main__":
    for problem in read(sys.argv[1]):
        print(f"{len(problem['g'])} variables, rows by level: {problem['rows'].tolist()}")
