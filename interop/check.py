"""Glioscope beside pydicom, highdicom and SimpleITK, in both directions: what they write is read here with the same voxels in
the same place, and what is exported here is read by them.

Usage: check.py PROGRAM. Everything is made in a temporary folder; nothing is downloaded.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import highdicom as hd
import numpy as np
import pydicom
import SimpleITK as sitk
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sr.codedict import codes
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

ROWS, COLUMNS, SLICES = 31, 23, 9
SPACING_MM = (1.25, 0.8, 3.0)  # rows, columns, slices
PROGRAM = sys.argv[1]
checks = 0


def same(what, found, expected):
    global checks
    checks += 1
    if not np.allclose(found, expected, rtol=0, atol=1e-5):
        sys.exit(f"{what}: found {found}, expected {expected}")


def glioscope(*arguments):
    run = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"{arguments}: {run.stderr}")
    return run.stdout


def measure(*arguments):
    return json.loads(glioscope("measure", *arguments, "--json"))["time_points"][0]["masks"]


def series(folder):
    """An oblique CT, its files named against their order."""
    turn = np.deg2rad(20.0)
    row = np.array([np.cos(turn), np.sin(turn), 0.0])
    column = np.array([-np.sin(turn), np.cos(turn), 0.0])
    normal = np.cross(row, column)
    rng = np.random.default_rng(7)
    values = rng.integers(-1000, 2000, (SLICES, ROWS, COLUMNS))
    study, uid, frame = generate_uid(), generate_uid(), generate_uid()
    files = []
    for n in range(SLICES):
        d = Dataset()
        d.file_meta = FileMetaDataset()
        d.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        d.SOPClassUID = CTImageStorage
        d.SOPInstanceUID = d.file_meta.MediaStorageSOPInstanceUID = generate_uid()
        d.file_meta.MediaStorageSOPClassUID = CTImageStorage
        d.PatientName, d.PatientID, d.PatientBirthDate, d.PatientSex = "Interop^Canary", "IOP-7", "19500101", "O"
        d.StudyInstanceUID, d.SeriesInstanceUID, d.FrameOfReferenceUID = study, uid, frame
        d.StudyDate = d.SeriesDate = d.AcquisitionDate = d.ContentDate = "20240302"
        d.StudyTime = d.SeriesTime = d.AcquisitionTime = d.ContentTime = "101500"
        d.StudyID, d.AccessionNumber, d.ReferringPhysicianName, d.Manufacturer = "1", "77", "", "made here"
        d.Modality, d.SeriesNumber, d.InstanceNumber = "CT", 3, SLICES - n
        d.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
        d.Rows, d.Columns, d.SamplesPerPixel, d.PhotometricInterpretation = ROWS, COLUMNS, 1, "MONOCHROME2"
        d.BitsAllocated, d.BitsStored, d.HighBit, d.PixelRepresentation = 16, 16, 15, 1
        d.PixelSpacing = list(SPACING_MM[:2])
        d.SliceThickness = SPACING_MM[2]
        d.ImageOrientationPatient = [float(f"{v:.10f}") for v in [*row, *column]]
        d.ImagePositionPatient = [float(f"{v:.6f}") for v in np.array([-12.0, 30.0, 55.0]) + normal * SPACING_MM[2] * n]
        d.RescaleSlope, d.RescaleIntercept, d.RescaleType = 1, 0, "HU"
        d.PixelData = values[n].astype("<i2").tobytes()
        path = folder / f"{SLICES - n:03}"
        d.save_as(path, enforce_file_format=True)
        files.append(d)
    return files


def overlapping_masks():
    z, y, x = np.mgrid[:SLICES, :ROWS, :COLUMNS]
    one = ((z - 4) ** 2 / 9 + (y - 14) ** 2 / 81 + (x - 10) ** 2 / 49) < 1
    two = ((z - 5) ** 2 / 9 + (y - 18) ** 2 / 64 + (x - 12) ** 2 / 36) < 1
    return {"core": one, "oedema": two}


def segmentation(images, masks):
    descriptions = [
        hd.seg.SegmentDescription(
            segment_number=n + 1,
            segment_label=name,
            segmented_property_category=codes.SCT.MorphologicallyAbnormalStructure,
            segmented_property_type=codes.SCT.Neoplasm,
            algorithm_type=hd.seg.SegmentAlgorithmTypeValues.MANUAL,
        )
        for n, name in enumerate(masks)
    ]
    return hd.seg.Segmentation(
        source_images=images,
        pixel_array=np.stack(list(masks.values()), axis=-1).astype(np.uint8),
        segmentation_type=hd.seg.SegmentationTypeValues.BINARY,
        segment_descriptions=descriptions,
        series_instance_uid=generate_uid(),
        series_number=9,
        sop_instance_uid=generate_uid(),
        instance_number=1,
        manufacturer="made here",
        manufacturer_model_name="interop",
        software_versions="1",
        device_serial_number="1",
    )


def centroid_lps(images, mask):
    z, y, x = np.nonzero(mask)
    first = images[0]
    row, column = np.array(first.ImageOrientationPatient[:3]), np.array(first.ImageOrientationPatient[3:])
    step = (np.array(images[-1].ImagePositionPatient) - np.array(first.ImagePositionPatient)) / (SLICES - 1)
    origin = np.array(first.ImagePositionPatient)
    return origin + x.mean() * SPACING_MM[1] * row + y.mean() * SPACING_MM[0] * column + z.mean() * step


def from_others(folder, images, masks):
    study = folder / "study"
    (study / "sub").mkdir()
    segmentation(images, masks).save_as(study / "sub" / "seg")
    for found, (name, mask) in zip(measure(study), masks.items(), strict=True):
        same(f"highdicom's SEG, {name}", found["voxels"], mask.sum())
        same(f"{name} in ml", found["native_volume_ml"], mask.sum() * np.prod(SPACING_MM) / 1000)
    image = sitk.GetImageFromArray(masks["core"].astype(np.uint8))
    image.SetSpacing((SPACING_MM[1], SPACING_MM[0], SPACING_MM[2]))
    for ending in ["nrrd", "mha", "nii.gz"]:
        path = folder / f"core.{ending}"
        sitk.WriteImage(image, str(path), useCompression=True)
        same(f"SimpleITK's {ending}", measure("--mask", f"m={path}")[0]["voxels"], masks["core"].sum())
    return study


def to_others(folder, study, images, masks):
    path = folder / "export.dcm"
    glioscope("export", study, "--format", "dicom-seg", "--identified", "--out", path)
    seg = hd.seg.segread(path)
    if (seg.PatientID, seg.StudyInstanceUID) != (images[0].PatientID, images[0].StudyInstanceUID):
        sys.exit("the identified segmentation is not of the image's patient and study")
    instances = [image.SOPInstanceUID for image in images]
    found = seg.get_pixels_by_source_instance(
        instances, ignore_spatial_locations=False, assert_missing_frames_are_empty=True
    )
    for n, (name, mask) in enumerate(masks.items()):
        same(f"SEG read by highdicom, {name}", found[..., n], mask)
    path = folder / "nobody.dcm"
    glioscope("export", study, "--format", "dicom-seg", "--out", path)
    if any(word in path.read_bytes() for word in [b"Canary", b"IOP-7", b"20240302", str(images[0].StudyInstanceUID).encode()]):
        sys.exit("an export without identity names the patient")
    path = folder / "export.dcm.rt.dcm"
    glioscope("export", study, "--format", "rtstruct", "--identified", "--out", path)
    names = [roi.ROIName for roi in pydicom.dcmread(path).StructureSetROISequence]
    if names != list(masks):
        sys.exit(f"the structure set has {names}")
    for name, mask in masks.items():
        for ending, kind in [("nii.gz", "nifti"), ("seg.nrrd", "seg.nrrd")]:
            path = folder / f"export-{name}.{ending}"
            glioscope("export", study, "--select", name, "--format", kind, "--out", path)
            image = sitk.ReadImage(str(path))
            array = sitk.GetArrayFromImage(image)
            same(f"{kind} read by SimpleITK, {name}", (array != 0).sum(), mask.sum())
            z, y, x = np.nonzero(array)
            place = image.TransformContinuousIndexToPhysicalPoint((x.mean(), y.mean(), z.mean()))
            checked = np.allclose(place, centroid_lps(images, mask), rtol=0, atol=1e-3)
            if not checked:
                sys.exit(f"{kind}, {name}: centroid {place}, expected {centroid_lps(images, mask)}")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study").mkdir()
        images, masks = series(folder / "study"), overlapping_masks()
        study = from_others(folder, images, masks)
        to_others(folder, study, images, masks)
    print(f"interop: {checks} comparisons with highdicom {hd.__version__}, pydicom and SimpleITK are equal")


if __name__ == "__main__":
    main()
