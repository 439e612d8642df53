#!/usr/bin/env python3
"""Writes mgh_nibabel.json: files that nibabel writes, as hexadecimal digits, and what it reads in them.

    python3 mgh_nibabel.py > mgh_nibabel.json

Made with nibabel 5.4.2.
"""
import json
import pathlib
import tempfile

import nibabel
import numpy as np

oblique = nibabel.affines.from_matvec(
    nibabel.eulerangles.euler2mat(0.3, -0.2, 0.5) @ np.diag([1.5, 0.75, 2.25]), [-31.5, 12.25, 7.0]
)
coronal = np.array([[-1.0, 0, 0, 128], [0, 0, 1, -128], [0, -1, 0, 128], [0, 0, 0, 1]])
shapes = {
    "uchar.mgz": ((3, 2, 4), "uint8", coronal),
    "short.mgh": ((3, 2, 5), ">i2", oblique),
    "int.mgh.gz": ((2, 3, 2), ">i4", coronal),
    "frames.mgz": ((2, 3, 2, 3), ">f4", oblique),
}
found = {}
with tempfile.TemporaryDirectory() as folder:
    for name, (shape, dtype, affine) in shapes.items():
        step = 0.25 if dtype == ">f4" else 1
        data = (np.arange(np.prod(shape)) * step - (0 if dtype == "uint8" else 7)).reshape(shape, order="F")
        path = pathlib.Path(folder) / name.replace(".mgh.gz", ".mgz")
        nibabel.save(nibabel.MGHImage(data.astype(dtype), affine), path)
        read = nibabel.load(path)
        found[name] = {
            "bytes": path.read_bytes().hex(),
            "dims": [int(n) for n in read.shape],
            "affine": read.affine.tolist(),
            "values": np.asarray(read.dataobj).ravel(order="F").astype(float).tolist(),
        }
print("{" + ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in found.items()) + "}")
