"""Exits with 1 unless two outputs of `measure --json` have the same masks, regions and pairs.

A time counts only for a correct result.

Run: python same_numbers.py OURS.json THEIRS.json
"""

import json
import math
import sys


def numbers(path):
    """Counts, volumes and scores of an output as {entry: numbers}, independent of the order of its lists."""
    with open(path, encoding="utf-8") as file:
        points = json.load(file)["time_points"]
    found = {}
    for nr, point in enumerate(points):
        for mask in point["masks"]:
            found[nr, "mask", mask["id"]] = (mask["voxels"], mask["volume_ml"])
        for region in point["regions"]:
            if region["voxels"]:
                found[nr, "region", *sorted(region["masks"])] = (region["voxels"], region["volume_ml"])
        for pair in point["pairs"]:
            found[nr, "pair", *sorted((pair["a"], pair["b"]))] = (pair["dice"], pair["jaccard"])
    return found


def same(a, b):
    if a is None or b is None:
        return a is b
    return a == b if isinstance(a, int) else math.isclose(a, b, rel_tol=1e-6)


def main():
    ours, theirs = (numbers(path) for path in sys.argv[1:3])
    differing = [
        f"{what}: {ours.get(what)} and {theirs.get(what)}"
        for what in sorted(ours.keys() | theirs.keys(), key=str)
        if what not in ours or what not in theirs or not all(map(same, ours[what], theirs[what]))
    ]
    if differing or not ours:
        sys.exit("the two answers differ:\n" + "\n".join(differing))
    print(f"Both gave the same {len(ours)} entries (masks, regions, pairs).")


if __name__ == "__main__":
    main()
