"""The tables of a made cohort (cohort_cases.py) beside NumPy's counts and SciPy's distances of the same masks: every mask, region, pair,
change and lesion of every case.
"""

import itertools
import sys

import numpy as np
import pandas as pd
from scipy import ndimage

from cohort_cases import DATES, REFERENCE

checks = 0


def same(what, found, expected, tolerance=0.0):
    """Ends the program where they differ; `tolerance`: relative."""
    global checks
    checks += 1
    is_same = np.allclose(found, expected, rtol=tolerance, atol=0) if tolerance else found == expected
    if not is_same:
        sys.exit(f"{what}: found {found}, expected {expected}")


def kappa(a, b):
    """Cohen's: agreement beyond what is expected of two masks of these sizes."""
    agreed, by_chance = (a == b).mean(), a.mean() * b.mean() + (1 - a.mean()) * (1 - b.mean())
    return (agreed - by_chance) / (1 - by_chance)


def corners(mask):
    """Corners of voxels around which the eight differ."""
    padded = np.pad(mask, 1)
    around = [padded[tuple(slice(step, n + step - 1) for step, n in zip(steps, padded.shape))] for steps in itertools.product((0, 1), repeat=3)]
    return np.any(around, axis=0) & ~np.all(around, axis=0)


def faced(mask):
    """Active voxels with an inactive one across a face."""
    return mask & ~ndimage.binary_erosion(mask)


def ways_mm(a, b, spacing):
    """From each place of a surface to the nearest of the other, both ways."""
    return [ndimage.distance_transform_edt(~to, spacing)[of] for of, to in ((a, b), (b, a))]


def farthest(*ways):
    return max(way.max() for way in ways)


# Of MetricsReloaded, all places of one weight: the larger of both ways, and means over both and of both ways' means.
BY_VOXELS = {
    "hd_mm": farthest,
    "hd95_mm": lambda *ways: max(np.percentile(way, 95) for way in ways),
    "assd_mm": lambda *ways: np.concatenate(ways).mean(),
    "masd_mm": lambda *ways: np.mean([way.mean() for way in ways]),
    "nsd": lambda *ways: (np.concatenate(ways) <= 1.0).mean(),
}


def by_case(out, kind):
    return {(case, time): rows for (case, time), rows in pd.read_parquet(out / "tables" / f"{kind}.parquet").groupby(["case", "time"])}


def distances(out, make, cases, surface, metrics):
    """Every pair of masks, by SciPy's distances between what a convention calls their surfaces."""
    tables = by_case(out, "pairs")
    for n in range(cases):
        made, spacing = make(n)
        for date, masks in made.items():
            found = tables[f"case-{n:04d}", date].set_index(["a", "b", "metric"]).value
            surfaces = {name: surface(mask) for name, mask in masks.items()}
            for a, b in itertools.combinations(masks, 2):
                ways = ways_mm(surfaces[a], surfaces[b], spacing)
                for metric, of in metrics.items():
                    same(f"case-{n:04d} {date} {a} {b} {metric}", found[a, b, metric], of(*ways), 1e-6)


def lesion_volumes(out, make, cases):
    """A lesion is what overlaps over the dates: here the parts of one component of both dates' union."""
    tables = by_case(out, "lesions")
    for n in range(cases):
        made, spacing = make(n)
        lesions, count = ndimage.label(np.any([made[date][REFERENCE] for date in DATES], axis=0), np.ones((3, 3, 3)))
        for date in DATES:
            voxels = ndimage.sum_labels(made[date][REFERENCE], lesions, range(1, count + 1))
            expected = sorted(voxels[voxels > 0] * np.prod(spacing) / 1000)
            found = sorted(tables[f"case-{n:04d}", date].volume_ml)
            same(f"case-{n:04d} {date} lesions", len(found), len(expected))
            same(f"case-{n:04d} {date} volumes of lesions", found, expected, 1e-6)


def against_numpy(out, make, cases):
    """Every mask, region and pair."""
    table = {kind: pd.read_parquet(out / "tables" / f"{kind}.parquet") for kind in ("masks", "regions", "pairs", "changes")}
    same("masks", len(table["masks"]), cases * 2 * 4)
    for n in range(cases):
        case, (made, spacing) = f"case-{n:04d}", make(n)
        voxel_ml = float(np.prod(spacing)) / 1000
        for date, masks in made.items():
            own = table["masks"][(table["masks"].case == case) & (table["masks"].time == date)].set_index("mask")
            for name, mask in masks.items():
                same(f"{case} {date} {name}", int(own.voxels[name]), int(mask.sum()))
                same(f"{case} {date} {name} ml", own.volume_ml[name], mask.sum() * voxel_ml, 1e-6)
            regions = table["regions"][(table["regions"].case == case) & (table["regions"].time == date)]
            names = list(masks)
            bits = sum(mask.astype(int) << k for k, mask in enumerate(masks.values()))
            expected = {
                "+".join(name for k, name in enumerate(names) if code >> k & 1): int(count)
                for code, count in zip(*np.unique(bits[bits > 0], return_counts=True))
            }
            same(f"{case} {date} regions", dict(zip(regions.region, map(int, regions.voxels))), expected)
            pairs = table["pairs"][(table["pairs"].case == case) & (table["pairs"].time == date)]
            pairs = pairs.set_index(["a", "b", "metric"]).value
            for a, b in itertools.combinations(names, 2):
                both, either = (masks[a] & masks[b]).sum(), (masks[a] | masks[b]).sum()
                same(f"{case} {a} {b} Jaccard", pairs[a, b, "jaccard"], both / either, 1e-12)
                same(f"{case} {a} {b} Dice", pairs[a, b, "dice"], 2 * both / (both + either), 1e-12)
                same(f"{case} {a} {b} kappa", pairs[a, b, "kappa"], kappa(masks[a], masks[b]), 1e-9)
        change = table["changes"][table["changes"].case == case].iloc[0]
        first, last = (made[date][REFERENCE] for date in DATES)
        same(f"{case} new", change.new_ml, (last & ~first).sum() * voxel_ml, 1e-6)
        same(f"{case} gone", change.gone_ml, (first & ~last).sum() * voxel_ml)
    lesions = pd.read_parquet(out / "tables" / "lesions.parquet")
    for n in range(cases):
        made, _ = make(n)
        for date in DATES:
            own = lesions[(lesions.case == f"case-{n:04d}") & (lesions.time == date)]
            _, count = ndimage.label(made[date][REFERENCE], np.ones((3, 3, 3)))
            same(f"case-{n:04d} {date} components", int(own.components.sum()), count)


def all_numbers(by_corners, by_voxels, make, cases):
    """What the results by the conventions deepmind and metrics-reloaded have of the first `cases` cases, and nothing else."""
    against_numpy(by_corners, make, cases)
    lesion_volumes(by_corners, make, cases)
    distances(by_corners, make, cases, corners, {"hd_mm": farthest})
    distances(by_voxels, make, cases, faced, BY_VOXELS)
