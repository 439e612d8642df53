"""The numbers of `glioscope measure --json`, computed by nibabel and NumPy: a peer for bench/run.sh and a reference for
tests.

Run: python peer_measure.py --mask ID=FILE[:LABEL,LABEL…] … [--json]

Idiomatic NumPy: one pass to read, one to select labels, one bincount over the tumour index; everything else follows
from the 2^n counts. Same keys as glioscope's `measure`. All masks must be on one grid (NumPy does not resample). Dice
and Jaccard of two empty masks are null.
"""

import argparse
import itertools
import json
import re
import sys

import nibabel
import numpy as np


def parse_mask(text):
    """ID=FILE[:1,4] as (id, file, labels or None)."""
    match = re.fullmatch(r"([^=]+)=(.+?)(?::(\d+(?:,\d+)*))?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r}: expected ID=FILE or ID=FILE:1,4")
    name, file, labels = match.groups()
    return name, file, labels and [int(label) for label in labels.split(",")]


def load(file, labels):
    """The file's image and its mask: the chosen labels, or every voxel above 0.5."""
    image = nibabel.load(file)
    values = np.asarray(image.dataobj)
    if labels is None:
        return image, values > 0.5
    if not np.issubdtype(values.dtype, np.integer):
        values = np.rint(values).astype(np.int64)
    return image, np.isin(values, labels)


def measure(masks):
    """The numbers of `measure --json` for [(id, file, labels)]."""
    index, grid = None, None
    for bit, (name, file, labels) in enumerate(masks):
        image, mask = load(file, labels)
        if grid is None:
            grid = image  # nibabel arrays are in Fortran order; mixing orders would be slower
            index = np.zeros(image.shape, np.uint8 if len(masks) <= 8 else np.uint16, order="F")
        elif image.shape != grid.shape or not np.allclose(image.affine, grid.affine, atol=1e-3):
            sys.exit(f"{file}: found another grid than that of {masks[0][1]}; this script does not resample")
        index |= mask.astype(index.dtype) << bit
    counts = np.bincount(index.ravel(order="K"), minlength=1 << len(masks))

    voxel_ml = abs(np.linalg.det(grid.affine[:3, :3])) / 1000
    sets = np.arange(len(counts))
    has = [(sets >> bit & 1).astype(bool) for bit in range(len(masks))]
    sizes = [int(counts[h].sum()) for h in has]
    names = [name for name, _, _ in masks]

    def pair(a, b):
        both, total = int(counts[has[a] & has[b]].sum()), sizes[a] + sizes[b]
        return {
            "a": names[a],
            "b": names[b],
            "dice": 2 * both / total if total else None,
            "jaccard": both / (total - both) if total else None,
        }

    return {
        "grid": {
            "dims": [int(n) for n in grid.shape],
            "spacing_mm": [float(s) for s in nibabel.affines.voxel_sizes(grid.affine)],
            "world_from_voxel": grid.affine.tolist(),
        },
        "time_points": [
            {
                "masks": [
                    {"id": n, "voxels": s, "volume_ml": s * voxel_ml, "native_volume_ml": s * voxel_ml}
                    for n, s in zip(names, sizes)
                ],
                "regions": [
                    {
                        "masks": [n for bit, n in enumerate(names) if value >> bit & 1],
                        "voxels": int(counts[value]),
                        "volume_ml": int(counts[value]) * voxel_ml,
                    }
                    for value in range(1, len(counts))
                    if counts[value]
                ],
                "pairs": [pair(a, b) for a, b in itertools.combinations(range(len(masks)), 2)],
            }
        ],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mask", action="append", required=True, type=parse_mask, metavar="ID=FILE[:1,4]")
    parser.add_argument("--json", action="store_true", help="print JSON (else a few lines of text)")
    args = parser.parse_args()
    result = measure(args.mask)
    if args.json:
        json.dump(result, sys.stdout)
        print()
    else:
        for part in result["time_points"][0]["masks"] + result["time_points"][0]["regions"]:
            print(part.get("id") or " and ".join(part["masks"]), part["voxels"], f"{part['volume_ml']:.3f} ml")


if __name__ == "__main__":
    main()
