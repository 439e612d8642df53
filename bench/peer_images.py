"""Reads DICOM series as glioscope-bench images does: with pydicom and NumPy, and with SimpleITK.

Usage: peer_images.py FOLDER...
"""

import glob
import sys
import time

import numpy as np
import pydicom
import SimpleITK as sitk


def with_pydicom(folder):
    slices = [pydicom.dcmread(path) for path in glob.glob(f"{folder}/*")]
    x, y = (np.array(slices[0].ImageOrientationPatient[n : n + 3], float) for n in (0, 3))
    normal = np.cross(x, y)
    slices.sort(key=lambda s: float(normal @ np.array(s.ImagePositionPatient, float)))
    return np.stack(
        [s.pixel_array * float(s.get("RescaleSlope", 1)) + float(s.get("RescaleIntercept", 0)) for s in slices]
    )


def with_sitk(folder):
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(folder))
    return reader.Execute()


for folder in sys.argv[1:]:
    for name, read in [("pydicom + NumPy", with_pydicom), ("SimpleITK", with_sitk)]:
        times = []
        for _ in range(5):
            started = time.perf_counter()
            image = read(folder)
            times.append(time.perf_counter() - started)
        # A view lives as long as its image.
        voxels = sitk.GetArrayViewFromImage(image) if isinstance(image, sitk.Image) else image
        total = float(voxels.sum(dtype=np.float64))
        print(f"{folder}: {name}: {voxels.shape} in {min(times) * 1e3:.1f} ms (minimum of 5), sum {total:.0f}")
