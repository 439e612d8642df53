#!/usr/bin/env python3
"""Error and time of `glioscope register` and of other programs on the same files, as a Markdown table.

Run:  python bench/peer_registration.py GLIOSCOPE DATA [--cases 4] [--few N] [--programs A,B] [--timeout 600] [--keep DIR]
Ctrl-C ends it with the table of the cases until then.

GLIOSCOPE is target/release/glioscope, DATA the folder with glioma-5-algorithms. Needs bench/requirements-registration.txt.

A case is a scan and the same patient's scan moved by a known rigid transform: up to 20 degrees about any axis and 30 mm, put on with
one resampling by cubic B-splines. Both images get noise (1 to 4 % of their 99th percentile); the moved one a smooth bias (up to a
quarter) and a third of its field of view cut (T1c: in every third case; FLAIR: in every one); in every second case the tumour grows
by 5 mm before it is moved. The fixed image is T1c, the moved one T1c or FLAIR. Glioscope gets both dates' masks, as a reader has
them; the others have no use for them in these recipes.

The error is the largest distance from the truth over the tumour's surface, in mm. CPU seconds are those of the whole process with
its threads (two each), reading included; of Glioscope with its consistency, which the others don't compute, and alone. A program that ends with
an error, or not within the time, failed: Glioscope refuses what it can't align, with exit code 2.

Recipes:
  SimpleITK  Mattes mutual information of 50 bins at a fifth of the voxels, centres of the images as start, three levels, regular-step gradient descent
  elastix    its default parameter map for rigid transforms, and centres of gravity as start, which the map leaves out
  greedy     normalised mutual information, 6 degrees of freedom, 100x50x5 iterations, centres of the images as start
  ANTs       antspyx's registration of type Rigid
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

THREADS = 2
# Variables by which the programs take their number of threads.
THREAD_VARIABLES = ("ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS", "RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
LPS = (-1.0, -1.0, 1.0)
# A registration this far off, and not told as failed, misleads.
MISLEADS_MM = 2.0


# ---- cases --------------------------------------------------------------------------------------


def rotation(axis, angle):
    """Rodrigues' formula."""
    import numpy as np

    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Case:
    """The files of a case, its truth (fixed to moving, LPS mm, homogeneous) and the tumour's surface (LPS mm)."""

    def __init__(self, kind, number, data, folder):
        import numpy as np
        import scipy.ndimage as ndimage
        import SimpleITK as sitk

        random = np.random.default_rng([number, len(kind)])
        read = lambda name: sitk.ReadImage(os.path.join(data, "glioma-5-algorithms", name + ".nii.gz"))
        fixed, source, labels = read("t1c"), read("t1c" if kind == "T1c" else "fla"), read("hnfnetv1-20")
        origin, spacing = np.array(fixed.GetOrigin()), np.array(fixed.GetSpacing())
        # Axes x, y, z, as in the transforms.
        array = lambda image: sitk.GetArrayFromImage(image).astype(np.float64).T
        fixed, source, tumour = array(fixed), array(source), np.isin(array(labels), (1, 2, 4))

        axis = random.normal(size=3)
        shift = random.normal(size=3)
        shift *= 30 * random.uniform() / np.linalg.norm(shift)
        turn = rotation(axis / np.linalg.norm(axis), np.radians(20) * random.uniform())
        centre = origin + spacing * (np.array(fixed.shape) - 1) / 2
        self.truth = np.eye(4)
        self.truth[:3, :3], self.truth[:3, 3] = turn, centre - turn @ centre + shift

        later = tumour
        if number % 2:
            # New tumour is like the old one's rim, with a soft edge.
            distance = ndimage.distance_transform_edt(~tumour, sampling=spacing)
            later = distance <= 5
            rim = source[tumour & ndimage.binary_dilation(~tumour, iterations=3)]
            grown = np.clip(5.5 - distance, 0, 1) * ~tumour
            source = source + grown * (rim.mean() + rim.std() * ndimage.gaussian_filter(random.normal(size=source.shape), 1.0) - source)
        # Where each voxel of the moved image was: voxels to voxels.
        back = np.linalg.inv(self.truth)
        matrix = back[:3, :3] * spacing / spacing[:, None]
        offset = (back[:3, :3] @ origin + back[:3, 3] - origin) / spacing
        moved = ndimage.affine_transform(source, matrix, offset, order=3, mode="constant", cval=0.0)
        later = ndimage.affine_transform(later.astype(np.uint8), matrix, offset, order=0)

        x, y, z = np.meshgrid(*(np.linspace(-1, 1, n) for n in moved.shape), indexing="ij", sparse=True)
        a, b, c, d = random.uniform(-1, 1, 4)
        bias = (a * x + b * y + c * z + d * (x * x + y * z)) / (abs(a) + abs(b) + abs(c) + 2 * abs(d))
        moved = moved * np.exp(0.25 * bias)
        noise = lambda image: image + random.normal(size=image.shape) * np.percentile(image, 99) * random.uniform(0.01, 0.04)
        fixed, moved = noise(fixed), noise(moved)
        moved_origin = origin
        if kind != "T1c" or number % 3 == 2:
            # A third of the field is cut off along z, above or below, where it leaves most of the tumour.
            count = moved.shape[2]
            below, above = (later[:, :, : count // 3].sum(), later[:, :, -(count // 3) :].sum())
            keep = slice(count // 3, None) if below < above else slice(None, count - count // 3)
            moved, later = moved[:, :, keep], later[:, :, keep]
            moved_origin = origin + spacing * [0, 0, keep.start or 0]

        surface = tumour & ~ndimage.binary_erosion(tumour)
        self.points = origin + spacing * np.argwhere(surface)
        self.kind = kind
        self.files = {}
        for name, image, at in [("fixed", fixed, origin), ("moving", moved, moved_origin),
                                ("lesion", tumour.astype(np.uint8), origin), ("moving-lesion", later, moved_origin)]:
            written = sitk.GetImageFromArray(image.T.astype(np.float32 if "lesion" not in name else np.uint8))
            written.SetOrigin(at.tolist())
            written.SetSpacing(spacing.tolist())
            self.files[name] = os.path.join(folder, f"{kind}-{number}-{name}.nii.gz")
            sitk.WriteImage(written, self.files[name])

    def error_mm(self, found):
        """The largest distance of a transform from the truth over the tumour's surface."""
        import numpy as np

        apart = (np.array(found) - self.truth)[:3]
        return float(np.linalg.norm(self.points @ apart[:, :3].T + apart[:, 3], axis=1).max())


# ---- programs -----------------------------------------------------------------------------------
# Each is given the files in a process of its own, and prints a 4x4 matrix, fixed to moving, LPS mm, as JSON.


def of_itk(transform):
    """The matrix of a linear transform of SimpleITK."""
    import numpy as np

    origin = np.array(transform.TransformPoint((0.0, 0.0, 0.0)))
    axes = [np.array(transform.TransformPoint(tuple(axis))) - origin for axis in np.eye(3)]
    return np.vstack([np.column_stack([*axes, origin]), [0, 0, 0, 1]])


def of_ras(matrix):
    """The matrix between RAS spaces as one between LPS spaces."""
    import numpy as np

    flip = np.diag([*LPS, 1.0])
    return flip @ np.array(matrix) @ flip


def run_simpleitk(fixed, moving):
    import SimpleITK as sitk

    fixed, moving = (sitk.ReadImage(path, sitk.sitkFloat32) for path in (fixed, moving))
    registration = sitk.ImageRegistrationMethod()
    registration.SetMetricAsMattesMutualInformation(numberOfHistogramBins=50)
    registration.SetMetricSamplingStrategy(registration.RANDOM)
    registration.SetMetricSamplingPercentage(0.2, seed=1)
    registration.SetInterpolator(sitk.sitkLinear)
    registration.SetOptimizerAsRegularStepGradientDescent(learningRate=2.0, minStep=1e-3, numberOfIterations=300)
    registration.SetOptimizerScalesFromPhysicalShift()
    registration.SetShrinkFactorsPerLevel([4, 2, 1])
    registration.SetSmoothingSigmasPerLevel([2, 1, 0])
    registration.SmoothingSigmasAreSpecifiedInPhysicalUnitsOn()
    start = sitk.CenteredTransformInitializer(
        fixed, moving, sitk.Euler3DTransform(), sitk.CenteredTransformInitializerFilter.GEOMETRY)
    registration.SetInitialTransform(start, inPlace=False)
    return of_itk(registration.Execute(fixed, moving))


def run_elastix(fixed, moving):
    import itk
    import SimpleITK as sitk

    fixed, moving = (itk.imread(path, itk.F) for path in (fixed, moving))
    parameters = itk.ParameterObject.New()
    rigid = parameters.GetDefaultParameterMap("rigid")
    rigid["AutomaticTransformInitialization"] = ["true"]
    rigid["AutomaticTransformInitializationMethod"] = ["CenterOfGravity"]
    parameters.AddParameterMap(rigid)
    _, found = itk.elastix_registration_method(
        fixed, moving, parameter_object=parameters, log_to_console=False, number_of_threads=THREADS)
    found = found.GetParameterMap(0)
    numbers = lambda key: [float(number) for number in found[key]]
    x, y, z, *shift = numbers("TransformParameters")
    euler = sitk.Euler3DTransform(numbers("CenterOfRotationPoint"), x, y, z, shift)
    euler.SetComputeZYX(found["ComputeZYX"][0] == "true")
    return of_itk(euler)


def run_greedy(fixed, moving):
    from picsl_greedy import Greedy3D

    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "rigid.mat")
        Greedy3D().execute(
            f"-threads {THREADS} -a -dof 6 -m NMI -n 100x50x5 -ia-image-centers -i {fixed} {moving} -o {out}")
        with open(out) as text:
            return of_ras([[float(word) for word in line.split()] for line in text if line.strip()])


def run_ants(fixed, moving):
    import ants
    import SimpleITK as sitk

    fixed, moving = (ants.image_read(path) for path in (fixed, moving))
    found = ants.registration(fixed, moving, "Rigid", random_seed=1)
    return of_itk(sitk.ReadTransform(found["fwdtransforms"][0]))


# With the consistency that the window and `change` use, and without, as the others have none.
OURS = {"glioscope": [], "glioscope-alone": ["--no-consistency"]}
PEERS = {"SimpleITK": run_simpleitk, "elastix": run_elastix, "greedy": run_greedy, "ANTs": run_ants}


def command(program, glioscope, case):
    if program not in OURS:
        return [sys.executable, os.path.abspath(__file__), "--peer", program, case.files["fixed"], case.files["moving"]]
    return [glioscope, "register", "--json", "--fixed", case.files["fixed"], "--moving", case.files["moving"],
            "--lesions", case.files["lesion"], "--moving-lesions", case.files["moving-lesion"], *OURS[program]]


def timed(words, limit):
    """What a process prints on its last line of output, or `None` where it failed or took too long; and its CPU seconds."""
    environment = {**os.environ, **{variable: str(THREADS) for variable in THREAD_VARIABLES}}
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(words, stdout=output, stderr=subprocess.DEVNULL, env=environment)
        end = time.monotonic() + limit
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() > end:
                process.kill()
                _, status, usage = os.wait4(process.pid, 0)
                break
            time.sleep(0.02)
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        text = output.read().decode(errors="replace")
    return (text if process.returncode == 0 else None), usage.ru_utime + usage.ru_stime


def found(program, text):
    if program in OURS:
        return of_ras(json.loads(text)["moving_from_fixed"])
    return json.loads(text.splitlines()[-1])


# ---- table --------------------------------------------------------------------------------------


def row(program, kind, results):
    """A row of the table; `results`: error in mm or `None`, and CPU seconds."""
    errors = sorted(error for error, _ in results if error is not None)
    failed = len(results) - len(errors)
    number = lambda value: f"{value:.3f}" if value < 0.1 else f"{value:.2f}"
    # The nearest rank: of few cases the 95th percentile is the largest.
    p95 = errors[-(-95 * len(errors) // 100) - 1] if errors else None
    shown = [number(value) for value in (statistics.median(errors), p95, errors[-1])] if errors else ["", "", ""]
    misled = sum(error > MISLEADS_MM for error in errors)
    cpu = statistics.median(seconds for _, seconds in results)
    return f"| {program} | {kind} | {len(results)} | {' | '.join(shown)} | {failed} | {misled} | {cpu:.1f} |"


def run_all(programs, options, results):
    """Adds each case's error (`None` where a program failed) and CPU seconds to `results`, by images and program."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or scratch
        os.makedirs(folder, exist_ok=True)
        # In turn, so that a run that is stopped has some of each.
        for number in range(options.cases):
            for kind in ("T1c", "FLAIR"):
                case = Case(kind, number, options.data, folder)
                for program in programs:
                    if program == "ANTs" and number >= options.few:
                        continue
                    text, seconds = timed(command(program, options.glioscope, case), options.timeout)
                    error = None if text is None else case.error_mm(found(program, text))
                    results.setdefault((kind, program), []).append((error, seconds))
                    told = "failed" if error is None else f"{error:.3f} mm"
                    print(f"{kind} {number} {program}: {told}, {seconds:.1f} s", file=sys.stderr, flush=True)
                if not options.keep:
                    for path in case.files.values():
                        os.remove(path)


def main():
    if sys.argv[1:2] == ["--peer"]:
        name, fixed, moving = sys.argv[2:]
        print()
        print(json.dumps(PEERS[name](fixed, moving).tolist()))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("glioscope")
    parser.add_argument("data")
    parser.add_argument("--cases", type=int, default=4, help="cases of each kind of images (default 4)")
    parser.add_argument("--few", type=int, default=2, help="cases of ANTs, which takes minutes each (default 2)")
    parser.add_argument("--programs", default=",".join([*OURS, *PEERS]))
    parser.add_argument("--timeout", type=float, default=600, help="seconds a program may take for a case (default 600)")
    parser.add_argument("--keep", help="keep the cases' files in this folder")
    options = parser.parse_args()
    programs = options.programs.split(",")
    unknown = [name for name in programs if name not in (*OURS, *PEERS)]
    if unknown or options.cases < 1:
        parser.error(f"found {unknown or options.cases}, expected programs of {', '.join([*OURS, *PEERS])}, and at least 1 case")
    results = {}
    try:
        run_all(programs, options, results)
    except KeyboardInterrupt:
        print("stopped: the cases until then", file=sys.stderr)
    print(f"load {os.getloadavg()[0]:.1f}\n")
    print(f"| program | images | cases | median | 95 % | most | failed | untold above {MISLEADS_MM:.0f} mm | CPU s |")
    print("|---|---|---:|---:|---:|---:|---:|---:|---:|")
    for kind in ("T1c", "FLAIR"):
        for program in programs:
            if (kind, program) in results:
                print(row(program, f"T1c on {kind}", results[kind, program]))


if __name__ == "__main__":
    main()
