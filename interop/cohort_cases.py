"""A made cohort from five algorithms' masks of one glioma: every case is the same tumour on a grid of its own size, each algorithm moved
by a known number of voxels, so that every number is known from NumPy.

Case n: voxels 1 + (n mod 7) / 10 times as large (volumes grow by its cube, distances by it); algorithm k moved by (n + k) mod 4 voxels
along axis (n + k) mod 3. Two dates; at the later one every mask is one voxel larger on all sides.
"""

from pathlib import Path

import numpy as np
import SimpleITK as sitk

REFERENCE = "consensus"
ALGORITHMS = ("isen-20", "sanet0-20", "scan-20")
DATES = ("2024-01-01", "2024-03-01")
# Every third voxel of each axis: numbers are known for any grid, and small ones are quick.
STEP = 3


def source(folder):
    """The masks by name, cut to what any of them has and four voxels more, and the size of their voxels in mm (x, y, z)."""
    images = {name: sitk.ReadImage(str(Path(folder) / f"{name}.nii.gz")) for name in (REFERENCE, *ALGORITHMS)}
    spacing = images[REFERENCE].GetSpacing()
    masks = {name: sitk.GetArrayFromImage(image).transpose() > 0 for name, image in images.items()}
    masks = {name: mask[::STEP, ::STEP, ::STEP] for name, mask in masks.items()}
    places = np.argwhere(np.any(list(masks.values()), axis=0))
    box = tuple(slice(low, high + 1) for low, high in zip(places.min(axis=0), places.max(axis=0)))
    return {name: np.pad(mask[box], 6) for name, mask in masks.items()}, tuple(STEP * mm for mm in spacing)


def grown(mask):
    """One voxel larger over faces."""
    out = mask.copy()
    for axis in range(3):
        for step in (-1, 1):
            out |= np.roll(mask, step, axis)
    return out


def case(masks, spacing, n):
    """The masks of case n by date and name, and the size of its voxels."""
    scale = 1 + n % 7 / 10
    made = {}
    for date in DATES:
        made[date] = {}
        for k, (name, mask) in enumerate(masks.items()):
            moved = mask if name == REFERENCE else np.roll(mask, (n + k) % 4, (n + k) % 3)
            made[date][name] = moved if date == DATES[0] else grown(moved)
    return made, tuple(mm * scale for mm in spacing)


def write(data, folder, count):
    """Writes `count` cases as folders with manifests, and returns a function that makes case n again."""
    masks, spacing = source(data)
    for n in range(count):
        made, size = case(masks, spacing, n)
        place = Path(folder) / f"case-{n:04d}"
        place.mkdir(parents=True)
        lines = ["glioscope = 1"]
        for date, of_date in made.items():
            for name, mask in of_date.items():
                image = sitk.GetImageFromArray(mask.transpose().astype(np.uint8))
                image.SetSpacing(size)
                file = f"{name}-{date}.nii.gz"
                sitk.WriteImage(image, str(place / file), useCompression=True)
                lines += ["[[mask]]", f'id = "{name}"', f'file = "{file}"', f'time = "{date}"']
        (place / "case.toml").write_text("\n".join(lines) + "\n")
    return lambda n: case(masks, spacing, n)
