"""Makes glioma_regions.json, sarcoma_masks.json and degenerate_masks.json: what NumPy, SciPy and nibabel
count on the real cases, for the tests in core/tests/whole/case_real.rs.

    pip install nibabel numpy scipy
    python tests/expected/glioma_regions.py ../shared/data tests/expected

The numbers were made with nibabel 5.4, NumPy 2, SciPy 1. Nothing of Glioscope is used.
"""

import json
import sys
from pathlib import Path

import nibabel as nib
import numpy as np
from scipy import ndimage


def load(path):
    image = nib.load(path)
    return np.asanyarray(image.dataobj), image.affine


def pairs(masks):
    out = []
    names = list(masks)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            both = int((masks[a] & masks[b]).sum())
            either = int((masks[a] | masks[b]).sum())
            total = int(masks[a].sum()) + int(masks[b].sum())
            out.append({"a": a, "b": b, "dice": 2 * both / total, "jaccard": both / either})
    return out


def regions(masks):
    index = sum(m.astype(np.uint32) << k for k, m in enumerate(masks.values()))
    bits, counts = np.unique(index[index > 0], return_counts=True)
    names = list(masks)
    return [
        {"masks": [n for k, n in enumerate(names) if b >> k & 1], "voxels": int(c)}
        for b, c in zip(bits.tolist(), counts.tolist())
    ]


def onto(mask, affine, target_dims, target_affine):
    """Nearest voxel. A centre on a border goes to the higher index: floor(v + 1/2)."""
    matrix = np.linalg.inv(affine) @ target_affine
    # Differences of the places first, as offsets are large.
    i, j, k = np.meshgrid(*(np.arange(n) for n in target_dims), indexing="ij")
    out = np.zeros(target_dims, bool)
    at = [np.floor(matrix[r, 0] * i + matrix[r, 1] * j + matrix[r, 2] * k + matrix[r, 3] + 0.5).astype(int) for r in range(3)]
    inside = np.all([(a >= 0) & (a < n) for a, n in zip(at, mask.shape)], axis=0)
    out[inside] = mask[at[0][inside], at[1][inside], at[2][inside]]
    # A second opinion of SciPy's; it differs at most in ties.
    spline = ndimage.affine_transform(mask.astype(np.uint8), matrix[:3, :3], matrix[:3, 3], target_dims, order=0)
    assert (spline.astype(bool) != out).sum() <= 0.001 * out.sum(), "SciPy disagrees"
    return out


def ml(mask, affine):
    return int(mask.sum()) * abs(np.linalg.det(affine[:3, :3])) / 1000


def centroid(mask, affine):
    return (affine[:3, :3] @ np.argwhere(mask).mean(0) + affine[:3, 3]).tolist()


def glioma(data):
    folder = data / "glioma-5-algorithms"
    masks = {}
    for name in ("hnfnetv1-20", "isen-20", "scan-20"):
        values, affine = load(folder / f"{name}.nii.gz")
        masks[name] = np.isin(values, [1, 2, 4])
    return {
        "labels": [1, 2, 4],
        "masks": [{"id": n, "voxels": int(m.sum()), "volume_ml": ml(m, affine)} for n, m in masks.items()],
        "regions": regions(masks),
        "pairs": pairs(masks),
    }


def sarcoma(data):
    folder = data / "sarcoma-ct-mr-pet"
    native = {n: load(folder / f"{n}_mask.nii.gz") for n in ("CT", "MR_T1", "PET")}
    native = {n: (v > 0.5, a) for n, (v, a) in native.items()}
    finest = min(native, key=lambda n: abs(np.linalg.det(native[n][1][:3, :3])))
    target, target_affine = native[finest]
    masks = {n: onto(m, a, target.shape, target_affine) for n, (m, a) in native.items()}
    return {
        "case_grid": finest,
        "masks": [
            {
                "id": n,
                "native_voxels": int(native[n][0].sum()),
                "native_volume_ml": ml(*native[n]),
                "voxels": int(m.sum()),
                "volume_ml": ml(m, target_affine),
                "native_centroid_mm": centroid(*native[n]),
            }
            for n, m in masks.items()
        ],
        "regions": regions(masks),
        "pairs": pairs(masks),
    }


def degenerate(data):
    folder = data / "masks-degenerate"
    out = []
    for path in sorted(folder.glob("*_mask.nii.gz")):
        values, _ = load(path)
        out.append({"file": path.name, "voxels": int((values > 0.5).sum())})
    return {"masks": out}


if __name__ == "__main__":
    data, out = Path(sys.argv[1]), Path(sys.argv[2])
    for name, made in (
        ("glioma_regions", glioma(data)),
        ("sarcoma_masks", sarcoma(data)),
        ("degenerate_masks", degenerate(data)),
    ):
        (out / f"{name}.json").write_text(json.dumps(made, indent=1) + "\n")
