"""Exits with 1 unless two outputs of `measure --json` have the same masks, regions and pairs.

Run before timing: only times of equal results are comparable.

Run: python same_numbers.py OURS.json THEIRS.json
"""

import json
import math
import sys


def numbers(path):
    """Counts, volumes and scores of an output as {entry: numbers}, independent of the order of its lists."""
    with open(path, encoding="utf-8") as file:
        points = json.load(file)["time_points"]
    entries = {}
    for number, point in enumerate(points):
        for mask in point["masks"]:
            entries[number, "mask", mask["id"]] = (mask["voxels"], mask["volume_ml"])
        for region in point["regions"]:
            if region["voxels"]:
                entries[number, "region", *sorted(region["masks"])] = (region["voxels"], region["volume_ml"])
        for pair in point["pairs"]:
            entries[number, "pair", *sorted((pair["a"], pair["b"]))] = (pair["dice"], pair["jaccard"])
    return entries


def is_same(a, b):
    if a is None or b is None:
        return a is b
    return a == b if isinstance(a, int) else math.isclose(a, b, rel_tol=1e-6)


def main():
    ours, theirs = (numbers(path) for path in sys.argv[1:3])
    differing = [
        f"{entry}: {ours.get(entry)} and {theirs.get(entry)}"
        for entry in sorted(ours.keys() | theirs.keys(), key=str)
        if entry not in ours or entry not in theirs or not all(map(is_same, ours[entry], theirs[entry]))
    ]
    if differing or not ours:
        sys.exit("the outputs differ:\n" + "\n".join(differing))
    print(f"Both outputs have the same {len(ours)} entries (masks, regions, pairs).")


if __name__ == "__main__":
    main()
