#!/usr/bin/env python3
"""Times of the kernels of the change between two dates and of other implementations on the same masks, as CSV.

Run:  python bench/peer_change.py BENCH FILE_A FILE_B LABELS [--threads 1,2] [--reps 101] [--ball 256]

BENCH is target/release/glioscope-bench; FILE_A and FILE_B are label maps on one grid; LABELS such
as 1,2,4. Needs numpy, nibabel, scipy, edt, SimpleITK, scikit-image and kimimaro (PyPI).

Rows: distance transforms, and curve skeletons of the first mask. The skeletons are of different kinds, so their counts
and times are listed without a reference. Cases: files (the crop, which is the bounding box of both masks plus one
voxel, at the files' spacing), whole (the whole image), odd (the crop at 1 x 1 x 1.2 mm, whose squares are not exact),
ball (256 cubed, radius 50; smaller with --ball). Times are medians and minima, because the machine's load (printed)
increases medians.
"""
import argparse, os, statistics, subprocess, time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
import nibabel, numpy as np


def times(job, reps):
    """Median and minimum seconds, and the last result."""
    job()
    seconds = []
    for _ in range(reps):
        start = time.perf_counter()
        value = job()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds), min(seconds), value


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("bench", "file_a", "file_b", "labels"):
        parser.add_argument(name)
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--reps", type=int, default=101)
    parser.add_argument("--ball", type=int, default=256)
    options = parser.parse_args()
    labels = [int(v) for v in options.labels.split(",")]
    image = nibabel.load(options.file_a)
    a, b = (np.isin(np.asarray(nibabel.load(f).dataobj), labels) for f in (options.file_a, options.file_b))
    spacing = [float(v) for v in image.header.get_zooms()[:3]]
    where = np.argwhere(a | b)
    box = tuple(slice(max(lo - 1, 0), hi + 2) for lo, hi in zip(where.min(0), where.max(0)))
    # Axes z, y, x: x varies fastest, as in the files.
    inside, whole = np.ascontiguousarray(a[box].T), np.ascontiguousarray(a.T)
    sampling = spacing[::-1]
    z, y, x = np.ogrid[: options.ball, : options.ball, : options.ball]
    center_x, center_y, center_z, radius = (share * options.ball // 256 for share in (140, 100, 120, 50))
    ball = (x - center_x) ** 2 + (y - center_y) ** 2 + (z - center_z) ** 2 < radius**2
    print(f"# crop {inside.shape[::-1]}, voxels {int(inside.sum())}")
    print("kernel,case,peer,threads,median_ms,least_ms,answer")

    def report_glioscope():
        """Rows of glioscope; called before and after the peers, because the load varies."""
        print(f"# load {os.getloadavg()[0]:.1f}")
        lines = subprocess.run(
            [options.bench, "change", f"{options.file_a}:{options.labels}", f"{options.file_b}:{options.labels}",
             "--short", f"--runs={options.reps}", f"--ball={options.ball}"],
            check=True, capture_output=True, text=True).stdout.splitlines()
        for line in lines:
            cells = line.split(",")
            if line.startswith("distance,") and cells[3].isdigit():
                print(f"distance,{cells[1]},glioscope sites,{cells[3]},{cells[4]},{cells[5]},")
                print(f"distance,{cells[1]},glioscope sites and distances,{cells[3]},{cells[6]},{cells[7]},")
            if line.startswith("pipeline,files"):
                print(f"change,files,glioscope whole pipeline,2,{1e3 * float(cells[6]):.0f},,{cells[4]} vectors")
                print(f"skeleton,files,glioscope of the intersection,2,{1e3 * float(cells[7]):.0f},,{cells[5]} voxels")

    def report(kernel, case, peer, threads, timed, describe):
        median, minimum, value = timed
        print(f"{kernel},{case},{peer},{threads},{1e3 * median:.3f},{1e3 * minimum:.3f},{describe(value)}", flush=True)

    report_glioscope()
    import edt, scipy.ndimage, SimpleITK
    farthest = lambda value: f"{float(value.max()):.6f} mm farthest"
    # Distance of every voxel to the nearest active one: zeros are the sites.
    for case, mask, steps, reps in (
            ("files", inside, sampling, options.reps), ("whole", whole, sampling, min(options.reps, 15)),
            ("odd", inside, [1.2, 1.0, 1.0], options.reps), ("ball", ball, [1.0] * 3, min(options.reps, 9))):
        outside = (~mask).astype(np.uint8)
        itk = SimpleITK.GetImageFromArray(mask.astype(np.uint8))
        itk.SetSpacing(steps[::-1])
        for threads in [int(t) for t in options.threads.split(",")]:
            report("distance", case, "edt", threads,
                   times(lambda: edt.edt(outside, anisotropy=steps, parallel=threads), reps), farthest)
            SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
            report("distance", case, "SimpleITK Maurer", threads, times(lambda: SimpleITK.SignedMaurerDistanceMap(
                itk, squaredDistance=False, useImageSpacing=True), min(reps, 11)), lambda _: "signed")
        report("distance", case, "SciPy with indices", 1, times(lambda: scipy.ndimage.distance_transform_edt(
            outside, sampling=steps, return_indices=True), min(reps, 11 if mask is inside else 1)), lambda v: farthest(v[0]))
    report_glioscope()

    import kimimaro, skimage.morphology
    report("skeleton", "files", "scikit-image Lee", 1, times(lambda: skimage.morphology.skeletonize(inside), 3),
           lambda value: f"{int(value.sum())} voxels")
    report("skeleton", "files", "kimimaro TEASAR", 1, times(
        lambda: kimimaro.skeletonize(inside.astype(np.uint8), anisotropy=tuple(sampling), progress=False, parallel=1,
                                     dust_threshold=0), 3),
           lambda value: f"{sum(len(s.vertices) for s in value.values())} vertices")


if __name__ == "__main__":
    main()
