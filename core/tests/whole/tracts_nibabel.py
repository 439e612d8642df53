#!/usr/bin/env python3
"""Writes tracts_nibabel.json: what nibabel reads from the files of common/tracts.rs.

    GLIOSCOPE_TRACTS_OUT=/tmp/made cargo test -p glioscope-core --test files_tracts -- --ignored write_files_for_nibabel
    python3 tracts_nibabel.py /tmp/made > tracts_nibabel.json

Made with nibabel 5.4.2.
"""
import json
import pathlib
import sys
import warnings

import nibabel

warnings.simplefilter("ignore")
found = {}
for path in sorted(pathlib.Path(sys.argv[1]).glob("*.t?k")):
    fibers = nibabel.streamlines.load(path).streamlines
    found[path.name] = [[[float(v) for v in p] for p in fiber] for fiber in fibers]
print("{" + ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in found.items()) + "}")
