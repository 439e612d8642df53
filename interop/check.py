"""Glioscope beside pydicom, highdicom and SimpleITK, in both directions: what they write is read here with the same voxels in
the same place, and what is exported here is read by them.

Reports as DICOM and as PDF are read by others, too.

Usage: check.py PROGRAM [ROOT]. ROOT: where Debian's packages dcmtk and dicom3tools are unpacked, whose dsrdump and dciodvfy
read the reports. With GLIOSCOPE_REAL_DATA, reports of real cases as well. Everything is made in a temporary folder; nothing is
downloaded.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import check_pdf
import highdicom as hd
import numpy as np
import pydicom
import SimpleITK as sitk
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sr._concepts_dict import concepts
from pydicom.sr.codedict import codes
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

ROWS, COLUMNS, SLICES = 31, 23, 9
SPACING_MM = (1.25, 0.8, 3.0)  # rows, columns, slices
PROGRAM = sys.argv[1]
ROOT = Path(sys.argv[2]) if len(sys.argv) > 2 else None
# Names of a folder and a file, which no report has unless asked.
STUDY, SEGMENTATION = "Folder-Canary", "file-canary"
# Whole dates: four digits alone stand in a hash now and then.
HIDDEN = ["Interop", "Canary", "IOP-7", "1950-01-01", "19500101", STUDY, SEGMENTATION]
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
    study = folder / STUDY
    (study / "sub").mkdir()
    segmentation(images, masks).save_as(study / "sub" / SEGMENTATION)
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


def transforms(folder):
    """An affine transform of SimpleITK as .tfm, written as ITK's other formats: both map points alike, in LPS mm."""
    affine = sitk.AffineTransform(3)
    affine.SetMatrix([1, 0.1, 0.05, -0.1, 0.9, 0.02, 0.03, -0.04, 1.1])
    affine.SetTranslation([1.5, -2.5, 3.5])
    affine.SetCenter([10, -20, 30])
    sitk.WriteTransform(affine, str(folder / "affine.tfm"))
    for ending, more in [("mat", ["--out-convention", "itk"]), ("h5", []), ("txt", [])]:
        path = folder / f"written.{ending}"
        glioscope("transform", folder / "affine.tfm", "--out", path, *more)
        read = sitk.ReadTransform(str(path))
        for point in [(0.0, 0.0, 0.0), (100.0, -80.0, 60.0), (-30.0, 90.0, -120.0)]:
            found, expected = np.array(read.TransformPoint(point)), np.array(affine.TransformPoint(point))
            same(f"{ending} read by SimpleITK, {point}", 1e4 * (found - expected), 0)  # 1e-9 mm


# Codes that pydicom's tables don't have: the language, a date's label, a unit, and our own.
OTHER_CODES = {("en", "RFC5646"), ("C2348792", "UMLS"), ("ml", "UCUM"), ("PERP_PRODUCT", "99GLIOSCOPE")}


def check_codes(item):
    """Every code of a report has the meaning that pydicom's tables of the standard give it."""
    global checks
    if "CodeValue" in item:
        code = (item.CodeValue, item.CodingSchemeDesignator)
        if code not in OTHER_CODES:
            known = [of[item.CodeValue][0] for of in concepts[item.CodingSchemeDesignator].values() if item.CodeValue in of]
            if item.CodeMeaning.lower() not in [meaning.lower() for meaning in known]:
                sys.exit(f"{code} means {known}, and not {item.CodeMeaning}")
            checks += 1
    for element in item:
        if element.VR == "SQ":
            for inner in element.value:
                check_codes(inner)


# What dcmtk 3.6.7 says of any object in UTF-8: of itself, not of the object.
OF_DCMTK = "W: The VR checker does not support this Specific Character Set: ISO_IR 192"


def by_other_program(tool, path):
    """Findings of dcmtk's or dicom3tools' reading of a file; None where the program isn't there."""
    program = ROOT / "usr" / "bin" / tool if ROOT else None
    if not program or not program.exists():
        print(f"interop: {tool} isn't there; its reading of {path.name} is SKIPPED")
        return None
    libraries = f"{ROOT}/usr/lib/{platform.machine()}-linux-gnu"
    environment = {"LD_LIBRARY_PATH": libraries, "DCMDICTPATH": f"{ROOT}/usr/share/libdcmtk17/dicom.dic"}
    run = subprocess.run([program, path], capture_output=True, text=True, errors="replace", env={**os.environ, **environment})
    if tool == "dsrdump" and (run.returncode != 0 or "Imaging Measurement Report" not in run.stdout):
        sys.exit(f"dsrdump can't read {path.name}: {run.stderr}")
    marks = ["W:", "E:", "F:"] if tool == "dsrdump" else ["Error"]
    lines = (run.stderr + run.stdout).splitlines()
    return [line for line in lines if line.startswith(tuple(marks)) and line != OF_DCMTK]


def no_findings(tool, path):
    global checks
    found = by_other_program(tool, path)
    if found:
        sys.exit(f"{tool} of {path.name}: " + "; ".join(found))
    checks += found is not None


def numbers_of(group):
    found = {measurement.name.value: measurement for measurement in group.get_measurements()}
    # The number of the date, which isn't measured.
    found.pop("126073", None)
    return {code: (measurement.value, measurement.unit.value) for code, measurement in found.items()}


def check_groups(groups, expected):
    """Groups against the numbers of `measure --json` and `lesions --json`, by their names."""
    names = [group.tracking_identifier for group in groups]
    if names != list(expected):
        sys.exit(f"the structured report has {names}, expected {list(expected)}")
    for group, (name, values) in zip(groups, expected.items()):
        found = numbers_of(group)
        if {code: unit for code, (_, unit) in found.items()} != {code: unit for code, (_, unit) in values.items()}:
            sys.exit(f"{name}: found {found}, expected {values}")
        for code, (value, _) in values.items():
            same(f"structured report, {name}, {code}", found[code][0], value)


def measured(study):
    masks = {mask["id"]: {"118565006": (mask["native_volume_ml"], "ml")} for mask in measure(study)}
    found = json.loads(glioscope("lesions", study, "--json"))
    lesions = {}
    for lesion in found["lesions"]:
        (date,) = lesion["dates"]
        if not lesion["small"]:
            lesions[f"{found['of']}: lesion {lesion['id']}"] = {
                "118565006": (date["volume_ml"], "ml"),
                "103339001": (date["d1_mm"], "mm"),
                "131189007": (date["d2_mm"], "mm"),
                "PERP_PRODUCT": (date["product_mm2"], "mm2"),
            }
    if not lesions:
        sys.exit("no lesion to compare")
    return masks, lesions


def reports(folder, study, images):
    """Reports as DICOM: highdicom, pydicom, dcmtk and dicom3tools read what `measure`, `lesions` and the PDF say."""
    masks, lesions = measured(study)
    seg = pydicom.dcmread(study / "sub" / SEGMENTATION, stop_before_pixels=True)
    path = folder / "full.sr.dcm"
    glioscope("report", study, "--identity", "full", "--out", path)
    report = hd.sr.srread(path)
    check_groups(report.content.get_volumetric_roi_measurement_groups(), masks)
    check_groups(report.content.get_image_measurement_groups(), lesions)
    for number, group in enumerate(report.content.get_volumetric_roi_measurement_groups(), 1):
        same(f"segment of {group.tracking_identifier}", group.referenced_segment.referenced_segment_numbers, [number])
        if group.referenced_segment.referenced_sop_instance_uid != seg.SOPInstanceUID:
            sys.exit("the structured report refers to another segmentation")
    by_uid = report.content.get_volumetric_roi_measurement_groups(referenced_sop_instance_uid=seg.SOPInstanceUID)
    same("groups found by the segmentation's UID", len(by_uid), len(masks))
    (observer,) = report.content.get_observer_contexts()
    if observer.observer_identifying_attributes.name != "Glioscope":
        sys.exit(f"the observer is {observer}")
    instances = {image.SOPInstanceUID for image in images} | {seg.SOPInstanceUID}
    if {instance for _, _, instance, _ in report.get_evidence()} != instances:
        sys.exit("the evidence isn't the image's files and the segmentation")
    plain = folder / "plain.sr.dcm"
    glioscope("report", "--mask", f"m={folder / 'core.nii.gz'}", "--out", plain)
    (mask, lesion) = hd.sr.srread(plain).content.get_image_measurement_groups()
    same("a mask without a segmentation", numbers_of(mask)["118565006"][0], measure("--mask", f"m={folder / 'core.nii.gz'}")[0]["native_volume_ml"])
    none = folder / "none.sr.dcm"
    glioscope("report", study, "--out", none)
    check_groups(hd.sr.srread(none).content.get_image_measurement_groups(), {**masks, **lesions})

    pages = {}
    for identity in ["full", "none"]:
        pages[identity] = folder / f"{identity}.dcm"
        glioscope("report", study, "--software", "--identity", identity, "--out", pages[identity])
        glioscope("report", study, "--software", "--identity", identity, "--out", folder / f"{identity}.pdf")
        document = pydicom.dcmread(pages[identity])
        if document.EncapsulatedDocument[: document.EncapsulatedDocumentLength] != (folder / f"{identity}.pdf").read_bytes():
            sys.exit(f"the encapsulated PDF ({identity}) isn't the PDF")
    for path in [folder / "full.sr.dcm", pages["full"]]:
        found = pydicom.dcmread(path)
        if (found.PatientID, found.StudyInstanceUID) != (images[0].PatientID, images[0].StudyInstanceUID):
            sys.exit(f"{path.name} is not of the image's patient and study")
    if pydicom.dcmread(none).StudyInstanceUID != pydicom.dcmread(pages["none"]).StudyInstanceUID:
        sys.exit("reports of one case without identity are of two studies")
    uids = [images[0].StudyInstanceUID, images[0].SeriesInstanceUID, *instances]
    for path in [none, pages["none"]]:
        written = path.read_bytes()
        if any(word in written for word in [b"Canary", b"IOP-7", b"19500101", *(str(uid).encode() for uid in uids)]):
            sys.exit(f"{path.name} names the patient")
    for path in [folder / "full.sr.dcm", plain, none]:
        check_codes(pydicom.dcmread(path))
        no_findings("dsrdump", path)
        no_findings("dciodvfy", path)
    for path in pages.values():
        no_findings("dciodvfy", path)


def pdfs(folder, study):
    """Reports as PDF by qpdf and PDFium, and nobody's name in them."""
    global checks
    # Name, case, options of the report, language, words that are nowhere and words that are in the text.
    cases = [
        ("full", [study], [], "en", [], ["Interop", "Canary", "IOP-7", "1950-01-01", STUDY, SEGMENTATION]),
        ("none", [study], [], "en", [*HIDDEN, folder.name], []),
        ("sample", ["--sample"], ["--criteria", "rano-2.0"], "en", [], []),
    ]
    if data := os.environ.get("GLIOSCOPE_REAL_DATA"):
        glioma, pair = Path(data) / "glioma-5-algorithms", Path(data) / "reported/14-cat12-62-prepost"
        cases.append(("glioma", [glioma], ["--language", "de"], "de", [glioma.name, ".nii"], []))
        cases.append(("pair", [pair, "--order", "pre,post"], [], "en", [pair.name, "sub-01", ".nii"], []))
    for name, case, options, language, hidden, shown in cases:
        path = folder / f"{name}.pdf"
        # The first two are made.
        if not path.exists():
            glioscope("report", *case, *options, "--software", "--out", path)
        measured = json.loads(glioscope("measure", *case, "--metrics", "--json"))
        found = check_pdf.faults(path.read_bytes(), language, measured, hidden, shown)
        if name == "full":
            found += [f"a fault isn't found: {one}" for one in check_pdf.faults_are_found(path.read_bytes(), measured, "Nobody-Knows")]
        if found:
            sys.exit(f"{path.name}: " + "; ".join(found))
        checks += 1


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / STUDY).mkdir()
        images, masks = series(folder / STUDY), overlapping_masks()
        study = from_others(folder, images, masks)
        to_others(folder, study, images, masks)
        transforms(folder)
        reports(folder, study, images)
        pdfs(folder, study)
    print(f"interop: {checks} comparisons with highdicom {hd.__version__}, pydicom, SimpleITK and what else is there are equal")


if __name__ == "__main__":
    main()
