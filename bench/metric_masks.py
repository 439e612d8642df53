"""Masks that peer_metrics.py compares: the real ones of shared/data and made ones, each set on one grid."""

from pathlib import Path

import nibabel
import numpy as np

from peer_measure import load

# Labels of a region of the glioma.
REGIONS = {"glioma, whole tumour": [1, 2, 4], "glioma, core": [1, 4]}
GLIOMA = ("consensus", "hnfnetv1-20", "isen-20", "sanet0-20", "scan-20", "yixinmpl-20")
DEGENERATE = ("empty_mask", "disconnected_mask", "full_mask", "one_voxel_mask", "uninformative")
MODALITIES = ("CT", "MR_T1", "PET")
# Of a set whose title begins so: who are compared as raters.
RATERS = {"glioma": GLIOMA, "sarcoma": MODALITIES, "made": ("box", "moved-box", "large-ball")}
# Voxels of made masks, mm.
SPACINGS = ((0.5, 0.5, 6.0), (0.7, 0.9, 1.1), (1.0, 1.0, 1.0))
DIMS = (44, 36, 28)


class Masks:
    """Masks by name (booleans on one grid), how the program is told of them, and the size of their voxels in mm."""

    def __init__(self, title, files):
        """`files`: path and labels (or None) by name."""
        self.title = title
        images = {name: load(*file) for name, file in files.items()}
        self.masks = {name: mask for name, (_, mask) in images.items()}
        self.spacing = tuple(float(mm) for mm in next(iter(images.values()))[0].header.get_zooms()[:3])
        of_labels = lambda labels: ":" + ",".join(map(str, labels)) if labels else ""
        self.arguments = [part for name, (path, labels) in files.items() for part in ("--mask", f"{name}={path}{of_labels(labels)}")]


def real(data, folder):
    for title, labels in REGIONS.items():
        yield Masks(title, {name: (data / "glioma-5-algorithms" / f"{name}.nii.gz", labels) for name in GLIOMA})
    yield Masks("masks-degenerate", {name: (data / "masks-degenerate" / f"{name}.nii.gz", None) for name in DEGENERATE})
    yield Masks("sarcoma, on the CT's grid", dict(on_one_grid(data / "sarcoma-ct-mr-pet", folder)))


def relabelled(data, folder):
    """The glioma's label maps as the BraTS challenges have them since 2023: enhancing tumour is 3."""
    for name in GLIOMA:
        image = nibabel.load(data / "glioma-5-algorithms" / f"{name}.nii.gz")
        labels = np.asarray(image.dataobj).astype(np.uint8)
        path = folder / f"{name}-labels.nii.gz"
        nibabel.Nifti1Image(np.where(labels == 4, 3, labels), image.affine).to_filename(path)
        yield path


def on_one_grid(sarcoma, folder):
    """The three modalities' masks on the CT's grid by SimpleITK; both sides get these files."""
    import SimpleITK as sitk

    grid = sitk.ReadImage(str(sarcoma / "CT_mask.nii.gz"))
    for name in MODALITIES:
        image = sitk.ReadImage(str(sarcoma / f"{name}_mask.nii.gz")) > 0
        path = folder / f"{name}.nii.gz"
        sitk.WriteImage(sitk.Resample(image, grid, sitk.Transform(), sitk.sitkNearestNeighbor), str(path))
        yield name, (path, None)


def box(start, size):
    mask = np.zeros(DIMS, bool)
    mask[tuple(slice(first, first + count) for first, count in zip(start, size))] = True
    return mask


def ball(center_mm, radius_mm, spacing):
    """Voxels whose centres are in the ball, in the coordinates of the grid whose middle is 0."""
    places = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * mm for n, mm in zip(DIMS, spacing)), indexing="ij")
    return sum((place - mm) ** 2 for place, mm in zip(places, center_mm)) <= radius_mm**2


def blobs(seed, part):
    """Many lesions, large and small."""
    from scipy import ndimage

    smooth = ndimage.gaussian_filter(np.random.default_rng(seed).random(DIMS), 1.6)
    return smooth >= np.quantile(smooth, 1 - part)


def made(folder):
    for spacing in SPACINGS:
        reach = min(n * mm for n, mm in zip(DIMS, spacing)) / 2
        masks = {
            # Empty ones first and last: a pair has its reference first.
            "empty": np.zeros(DIMS, bool),
            "box": box((5, 6, 7), (20, 14, 9)),
            "moved-box": box((9, 5, 9), (20, 14, 9)),
            "small-ball": ball((0, 0, 0), 0.5 * reach, spacing),
            "large-ball": ball((0.1 * reach, 0, 0), 0.8 * reach, spacing),
            "voxel": box((30, 20, 14), (1, 1, 1)),
            "line": box((2, 20, 14), (36, 1, 1)),
            "at-the-edge": box((0, 0, 0), (12, 36, 5)),
            "lesions": blobs(1, 0.08),
            "other-lesions": blobs(1, 0.11) & ~blobs(2, 0.3),
            "also-empty": np.zeros(DIMS, bool),
        }
        title = "made, " + "×".join(f"{mm:g}" for mm in spacing) + " mm"
        place, files = Path(folder) / "x".join(map(str, spacing)), {}
        place.mkdir()
        for name, mask in masks.items():
            files[name] = place / f"{name}.nii.gz", None
            image = nibabel.Nifti1Image(mask.astype(np.uint8), np.diag([*spacing, 1.0]))
            image.to_filename(files[name][0])
        yield Masks(title, files)
