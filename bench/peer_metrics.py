"""Metrics of every pair of masks by the packages whose conventions `glioscope measure --metrics` has, beside the program's.

Run: python peer_metrics.py PROGRAM --mask ID=FILE[:LABEL,LABEL…] --mask …

All masks must be on one grid. Prints one row per pair and package: how many values were compared, the largest relative
difference, and the time of the package and of the program's process for all pairs together. Exit code 1 where a value differs
by more than 1e-6. Packages: requirements-metrics.txt; MetricsReloaded and the script of BraTS are on no index (docs/metrics.md).
"""

import argparse
import itertools
import json
import math
import subprocess
import sys
import time
import warnings

import numpy as np

from peer_measure import load, parse_mask

warnings.filterwarnings("ignore")
TOLERANCE = 1e-6


def deepmind(a, b, spacing):
    import surface_distance as package

    found = package.compute_surface_distances(a, b, spacing)
    areas = [found["surfel_areas_gt"], found["surfel_areas_pred"]]
    lengths = [found["distances_gt_to_pred"], found["distances_pred_to_gt"]]
    return {
        "dice": package.compute_dice_coefficient(a, b),
        "hd_mm": package.compute_robust_hausdorff(found, 100),
        "hd95_mm": package.compute_robust_hausdorff(found, 95),
        "assd_mm": sum((d * s).sum() for d, s in zip(lengths, areas)) / sum(s.sum() for s in areas),
        "masd_mm": np.mean(package.compute_average_surface_distance(found)),
        "nsd": package.compute_surface_dice_at_tolerance(found, 1.0),
    }


def medpy(a, b, spacing):
    from medpy.metric import binary as package

    return {
        "dice": package.dc(b, a),
        "jaccard": package.jc(b, a),
        "sensitivity": package.sensitivity(b, a),
        "precision": package.precision(b, a),
        "relative_volume_difference": package.ravd(b, a),
        "hd_mm": package.hd(b, a, voxelspacing=spacing),
        "hd95_mm": package.hd95(b, a, voxelspacing=spacing),
        "assd_mm": package.assd(b, a, voxelspacing=spacing),
    }


PACKAGES = {"deepmind": deepmind, "medpy": medpy}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--mask", action="append", required=True)
    arguments = parser.parse_args()
    masks = [parse_mask(text) for text in arguments.mask]
    images = {name: load(file, labels) for name, file, labels in masks}
    spacing = [float(mm) for mm in next(iter(images.values()))[0].header.get_zooms()[:3]]
    failed = False
    print("| convention | pairs | values | largest difference | package s | program s, whole process |")
    print("|---|---|---|---|---|---|")
    for convention, package in PACKAGES.items():
        masks_given = [part for text in arguments.mask for part in ("--mask", text)]
        command = [arguments.program, "measure", *masks_given, "--metrics", "--convention", convention, "--json"]
        started = time.perf_counter()
        answer = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        program_s = time.perf_counter() - started
        pairs = {(pair["a"], pair["b"]): pair for pair in answer["time_points"][0]["pairs"]}
        worst, values, package_s = 0.0, 0, 0.0
        for a, b in itertools.combinations(images, 2):
            started = time.perf_counter()
            expected = package(images[a][1], images[b][1], spacing)
            package_s += time.perf_counter() - started
            for key, value in expected.items():
                found = pairs[a, b][key]
                difference = abs(found - value) / max(abs(value), 1e-12) if found is not None else math.inf
                worst, values = max(worst, difference), values + 1
        failed |= worst > TOLERANCE
        print(f"| {convention} | {len(pairs)} | {values} | {worst:.1e} | {package_s:.2f} | {program_s:.2f} |")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
