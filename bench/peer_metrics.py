"""Metrics of every pair of masks by the packages whose conventions `glioscope measure --metrics` has, beside the program's.

Run: python peer_metrics.py PROGRAM [--data FOLDER] [--mask ID=FILE[:LABEL,LABEL…] …]

FOLDER: shared/data, whose glioma, sarcoma and degenerate masks are compared beside made ones; or the masks given, all on one grid.
Prints Markdown tables: by convention and metric how many values were compared and the largest difference; where packages
disagree with each other; raters; the BraTS challenges' own package; and times. Exit code 1 where a value differs by more than
1e-6 of it. Packages: requirements-metrics.txt.

Packages get the masks cut to the box around both and four voxels more, which changes no value and makes them faster; the program
reads files.
"""

import argparse
import itertools
import json
import math
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from importlib import metadata
from pathlib import Path

import numpy as np

import metric_masks
import metric_packages as packages
from peer_measure import parse_mask

TOLERANCE = 1e-6
# Below it a value is nought and what a sum of rounding leaves.
LEAST = 1e-9
# As many as dilations by the definition of BraTS can reach, and one.
MARGIN = packages.DILATIONS + 1
RUNS = 3
VERSIONS = ("surface-distance", "MedPy", "panoptica", "SimpleITK", "statsmodels", "SciPy", "NumPy", "brats-evaluation")


def difference(found, expected):
    """Relative; infinite where one is undefined or infinite and the other not."""
    found = math.inf if found == "infinity" else found
    if found is None or expected is None or math.isinf(found) or math.isinf(expected):
        return 0.0 if found == expected else math.inf
    return abs(found - expected) / max(abs(expected), LEAST)


def cpu_s(command):
    """What it prints, and the time of all its threads: the median of some runs."""
    times = []
    for _ in range(RUNS):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        printed = subprocess.run(command, check=True, capture_output=True).stdout
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return json.loads(printed)["time_points"][0], statistics.median(times)


def around(*masks):
    """Masks cut to the box around all of them and a margin."""
    places = np.argwhere(np.any(masks, axis=0))
    if not len(places):
        return masks
    box = tuple(slice(max(0, low - MARGIN), high + 1 + MARGIN) for low, high in zip(places.min(axis=0), places.max(axis=0)))
    return [np.ascontiguousarray(mask[box]) for mask in masks]


def value(pair, key):
    kind, _, name = key.rpartition(".")
    return pair[kind][name] if kind else pair[key]


class Found:
    """What is compared: `worst` and `counts` by convention and metric, `said` by metric and pair."""

    def __init__(self):
        self.worst, self.counts, self.said = defaultdict(float), defaultdict(int), defaultdict(lambda: defaultdict(dict))
        self.unequal, self.times, self.challenge = [], [], []

    def compare(self, convention, key, where, found, expected):
        off = difference(found, expected)
        self.worst[convention, key] = max(self.worst[convention, key], off)
        self.counts[convention, key] += 1
        if off > TOLERANCE:
            self.unequal.append(f"{convention} {key} of {where}: found {found}, expected {expected}")


def compared(program, given, found):
    """One set of masks by all conventions."""
    plain_s = cpu_s([program, "measure", *given.arguments, "--json"])[1]
    cut = {(a, b): around(given.masks[a], given.masks[b]) for a, b in itertools.combinations(given.masks, 2)}
    voxels = next(iter(given.masks.values())).size
    same = {pair: packages.shared(*masks, voxels) for pair, masks in cut.items()}
    for convention, (_, package) in packages.CONVENTIONS.items():
        answer, whole_s = cpu_s([program, "measure", *given.arguments, "--metrics", "--convention", convention, "--json"])
        pairs = {(pair["a"], pair["b"]): pair for pair in answer["pairs"]}
        if list(pairs) != list(cut):
            sys.exit(f"{given.title}: found the pairs {list(pairs)}, expected {list(cut)}")
        package_s = 0.0
        for (a, b), masks in cut.items():
            started = time.process_time()
            values = package(*masks, given.spacing)
            package_s += time.process_time() - started
            where = f"{given.title}: {a}, {b}"
            for key, expected in (values | same[a, b]).items():
                found.compare(convention, key, where, value(pairs[a, b], key), expected)
            for key, expected in values.items():
                found.said[key][where][convention] = expected
        found.times.append((given.title, convention, len(cut), package_s, max(whole_s - plain_s, 0.0), whole_s))
        print(f"{given.title}, {convention}: {len(cut)} pairs, {package_s:.1f} s", file=sys.stderr)


def compared_raters(program, given, names, found):
    """Three raters or more of a set."""
    arguments = [part for one in zip(given.arguments[::2], given.arguments[1::2]) if one[1].split("=")[0] in names for part in one]
    answer, whole_s = cpu_s([program, "measure", *arguments, "--metrics", "--json"])
    ours, staple = answer["raters"], answer["raters"]["staple"]
    started = time.process_time()
    theirs = packages.raters([given.masks[name] for name in names])
    package_s = time.process_time() - started
    voxel_ml = math.prod(given.spacing) / 1000
    of_program = {
        **{f"staple.{key}": staple[key] if isinstance(staple[key], list) else [staple[key]] for key in ("sensitivity", "specificity", "iterations", "voxels")},
        **{key: [ours[key]] for key in ("fleiss_kappa_union_box", "fleiss_kappa_whole_grid")},
        "majority": [ours["majority_ml"] / voxel_ml],
    }
    for key, expected in theirs.items():
        if len(of_program[key]) != len(expected):
            sys.exit(f"{given.title}: {key}: found {len(of_program[key])} values, expected {len(expected)}")
        for one, other in zip(of_program[key], expected):
            found.compare("raters", key, given.title, one, other)
    found.times.append((given.title, f"raters ({len(names)}, with deepmind)", 1, package_s, None, whole_s))


def compared_challenge(program, data, glioma, folder, found):
    """The glioma's first mask and each other one by the package of the challenges, beside the conventions `brats` and `panoptica`."""
    reference, *predictions = metric_masks.relabelled(data, folder)
    theirs = packages.challenge(reference, predictions)
    rows = []
    for given, group in zip(glioma, ("wt", "tc")):
        ours = {}
        for convention in ("brats", "panoptica"):
            arguments = [*given.arguments, "--metrics", "--convention", convention, "--tau", "0.5", "--json"]
            pairs = cpu_s([program, "measure", *arguments])[0]["pairs"]
            ours[convention] = [pair for pair in pairs if pair["a"] == metric_masks.GLIOMA[0]]
        for one, brats, panoptica in zip(theirs, ours["brats"], ours["panoptica"], strict=True):
            said = one[group]
            where = f"{given.title}: {brats['a']}, {brats['b']}"
            found.compare("brats-evaluation", "dice", where, brats["dice"], said["global_bin_dsc"])
            for key, name in (("hd95_mm", "hd95"), ("nsd", "nsd")):
                found.compare("brats-evaluation", key, where, panoptica[key], said[f"global_bin_{name}"])
            lesions = brats["lesions"]
            counts = [f"{lesions['found']} / {lesions['missed']} / {lesions['false_positives']}", f"{said['tp']} / {said['fn']} / {said['fp']}"]
            of_lesions = [text(lesions["dice"]), text(said["sq_dsc"]), text(lesions["hd_percentile_mm"]), text(said["sq_hd95"])]
            rows.append([where, text(brats["dice"]), text(brats["hd95_mm"]), text(said["global_bin_hd95"]), *counts, *of_lesions])
    found.challenge = rows


def table(head, rows):
    for row in (head, ["---"] * len(head), *rows):
        print("| " + " | ".join(row) + " |")
    print()


def text(value):
    if value is None:
        return "undefined"
    return "∞" if math.isinf(value) else f"{value:.4g}"


def print_equality(found):
    compared_with = {name: what for name, (what, _) in packages.CONVENTIONS.items()}
    compared_with |= {"raters": "SimpleITK, statsmodels, NumPy", "brats-evaluation": "global Dice; `panoptica`'s HD95 and NSD at 0.5 mm"}
    compared_with = {name: what for name, what in compared_with.items() if any(name == other for other, _ in found.counts)}
    rows = []
    for convention, what in compared_with.items():
        keys = [key for name, key in found.counts if name == convention]
        worst = max(keys, key=lambda key: found.worst[convention, key])
        count = sum(found.counts[convention, key] for key in keys)
        rows.append([convention, what, str(len(keys)), str(count), f"{found.worst[convention, worst]:.1e} ({worst})"])
    table(["convention", "compared with", "metrics", "values", "largest relative difference"], rows)
    keys = list(dict.fromkeys(key for _, key in found.counts))
    rows = []
    for key in keys:
        names = [name for name in compared_with if (name, key) in found.counts]
        counts = " ".join(f"{name} {found.counts[name, key]}" for name in names)
        rows.append([f"`{key}`", counts, f"{max(found.worst[name, key] for name in names):.1e}"])
    table(["metric", "values compared", "largest relative difference"], rows)


def print_disagreement(found):
    rows = []
    for key, of_pair in found.said.items():
        of_pair = {where: values for where, values in of_pair.items() if len(values) > 1}
        apart = {where: max(difference(x, y) for x, y in itertools.permutations(values.values(), 2)) for where, values in of_pair.items()}
        apart = {where: far for where, far in apart.items() if far > TOLERANCE}
        if not of_pair:
            continue
        finite = {where: far for where, far in apart.items() if not math.isinf(far)}
        example = ""
        if apart:
            where = max(finite or apart, key=apart.get)
            example = f"{where}: " + ", ".join(f"{name} {text(value)}" for name, value in of_pair[where].items())
        rows.append([f"`{key}`", f"{len(apart)} of {len(of_pair)}", str(len(apart) - len(finite)), example])
    table(["metric", "pairs on which packages disagree", "of them, one has no finite value", "largest finite disagreement"], rows)


def print_challenge(found):
    head = ["pair", "Dice, both", "HD95: `brats`", "brats-evaluation", "found / missed / false: `brats`", "brats-evaluation",
            "lesions' Dice: `brats`", "brats-evaluation", "lesions' HD95: `brats`", "brats-evaluation"]
    if found.challenge:
        table(head, found.challenge)


def print_times(found):
    rows = []
    for title, convention, pairs, package_s, metrics_s, whole_s in found.times:
        own = ["–", "–"] if metrics_s is None else [f"{metrics_s:.3f}", f"{metrics_s / package_s:.3f}"]
        rows.append([title, convention, str(pairs), f"{package_s:.2f}", own[0], f"{whole_s:.3f}", own[1], f"{whole_s / package_s:.3f}"])
    table(["masks", "convention", "pairs", "package, CPU s", "program's metrics, CPU s", "its whole process, CPU s", "ratio", "ratio of the whole process"], rows)


def given_sets(arguments, folder):
    if arguments.mask:
        masks = [parse_mask(one) for one in arguments.mask]
        yield metric_masks.Masks("masks", {name: (file, labels) for name, file, labels in masks})
        return
    if arguments.data:
        yield from metric_masks.real(arguments.data, folder)
    yield from metric_masks.made(folder)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--data", type=Path)
    parser.add_argument("--mask", action="append")
    arguments = parser.parse_args()
    found, glioma = Found(), []
    with tempfile.TemporaryDirectory() as temporary:
        for given in given_sets(arguments, Path(temporary)):
            compared(arguments.program, given, found)
            names = metric_masks.RATERS.get(given.title.split(",")[0])
            if names:
                compared_raters(arguments.program, given, names, found)
            if given.title in metric_masks.REGIONS:
                glioma.append(given)
        if glioma:
            compared_challenge(arguments.program, arguments.data, glioma, Path(temporary), found)
    print(", ".join(f"{name} {metadata.version(name)}" for name in VERSIONS) + "\n")
    print_equality(found)
    print_disagreement(found)
    print_challenge(found)
    print_times(found)
    for one in found.unequal:
        print(f"unequal: {one}")
    return 1 if found.unequal else 0


if __name__ == "__main__":
    sys.exit(main())
