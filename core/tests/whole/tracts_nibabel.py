#!/usr/bin/env python3
"""Writes tracts_nibabel.json: what nibabel reads from the files of common/tracts.rs; with --scalars
tracts_nibabel_scalars.json: the scalars and properties that it reads; with --write nibabel_scalars.trk, which it writes.

    GLIOSCOPE_TRACTS_OUT=/tmp/made cargo test -p glioscope-core --test files_tracts -- --ignored write_files_for_nibabel
    python3 tracts_nibabel.py /tmp/made > tracts_nibabel.json
    python3 tracts_nibabel.py /tmp/made --scalars > tracts_nibabel_scalars.json
    python3 tracts_nibabel.py nibabel_scalars.trk --write

Made with nibabel 5.4.2.
"""
import json
import pathlib
import sys
import warnings

import nibabel
import numpy

warnings.simplefilter("ignore")


def write(path):
    """Two fibres of 3 and 2 points in a grid of 2 mm; FA is 0.1 times the point's number in the file, the columns of
    `normal` are the point's own coordinates, `length` is 10 and 20."""
    fibers = [numpy.array([[1, 2, 3], [4, 5, 6], [7, 8, 10]], "f4"), numpy.array([[-3, 0, 2], [5, 5, 5]], "f4")]
    tractogram = nibabel.streamlines.Tractogram(
        fibers,
        data_per_point={"FA": [0.1 * numpy.arange(0, 3, dtype="f4")[:, None], 0.1 * numpy.arange(3, 5, dtype="f4")[:, None]],
                        "normal": fibers},
        data_per_streamline={"length": numpy.array([[10], [20]], "f4")},
        affine_to_rasmm=numpy.eye(4),
    )
    affine = numpy.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = [-20, -30, -10]
    header = {"voxel_to_rasmm": affine, "voxel_sizes": (2, 2, 2), "dimensions": (30, 30, 20), "voxel_order": "RAS"}
    nibabel.streamlines.TrkFile(tractogram, header).save(path)


def lists(data):
    return {name: [numpy.asarray(rows).tolist() for rows in data[name]] for name in data}


if "--write" in sys.argv:
    write(sys.argv[1])
    sys.exit()
found = {}
if "--scalars" in sys.argv:
    for path in sorted(pathlib.Path(sys.argv[1]).glob("*.trk")):
        tractogram = nibabel.streamlines.load(path).tractogram
        found[path.name] = {"points": lists(tractogram.data_per_point), "fibers": lists(tractogram.data_per_streamline)}
    print(json.dumps(found))
    sys.exit()
for path in sorted(pathlib.Path(sys.argv[1]).glob("*.t?k")):
    fibers = nibabel.streamlines.load(path).streamlines
    found[path.name] = [[[float(v) for v in p] for p in fiber] for fiber in fibers]
print("{" + ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in found.items()) + "}")
