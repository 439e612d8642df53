#!/usr/bin/env python3
"""The change's kernels beside others on the same masks, as CSV on stdout.

Run:  python bench/peer_change.py BENCH FILE_A FILE_B LABELS [--threads 1,2] [--reps 11]

BENCH is target/release/examples/bench_change; FILE_A and FILE_B are label maps on one grid, LABELS
as 1,2,4. Needs numpy, nibabel, scipy, edt, SimpleITK, scikit-image and kimimaro (PyPI).

Rows: distance transforms on the same crop (both masks' box and one voxel), and curve skeletons of
the first mask. Skeletons differ in kind: counts and times stand beside each other as figures, none
is the truth. Times are medians; the machine's load is printed, since ratios under load drift.
"""
import argparse, os, statistics, subprocess, time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
import nibabel, numpy as np


def median(job, reps):
    job()
    times = []
    for _ in range(reps):
        start = time.perf_counter()
        value = job()
        times.append(time.perf_counter() - start)
    return statistics.median(times), value


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("bench", "file_a", "file_b", "labels"):
        parser.add_argument(name)
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--reps", type=int, default=11)
    options = parser.parse_args()
    labels = [int(v) for v in options.labels.split(",")]
    image = nibabel.load(options.file_a)
    a, b = (np.isin(np.asarray(nibabel.load(f).dataobj), labels) for f in (options.file_a, options.file_b))
    spacing = [float(v) for v in image.header.get_zooms()[:3]]
    where = np.argwhere(a | b)
    box = tuple(slice(max(lo - 1, 0), hi + 2) for lo, hi in zip(where.min(0), where.max(0)))
    inside = np.ascontiguousarray(a[box].T)  # z, y, x: x runs fastest, as in the files
    sampling = spacing[::-1]
    print(f"# load {os.getloadavg()[0]:.1f}, crop {inside.shape[::-1]}, voxels {int(inside.sum())}")
    print("kernel,peer,threads,seconds,answer")
    own = subprocess.run(
        [options.bench, f"{options.file_a}:{options.labels}", f"{options.file_b}:{options.labels}", "short"],
        check=True, capture_output=True, text=True).stdout.splitlines()
    for line in own:
        cells = line.split(",")
        if line.startswith("distance,files"):
            print(f"distance,glioscope feature transform,{cells[5]},{cells[6]},sites and distances")
        if line.startswith("pipeline,files"):
            print(f"change,glioscope whole pipeline,2,{cells[6]},{cells[4]} vectors")
            print(f"skeleton,glioscope of the intersection,2,{cells[7]},{cells[5]} voxels")

    import scipy.ndimage
    outside = ~inside  # distance of every voxel to the nearest active one: zeros are the sites
    for threads in [int(t) for t in options.threads.split(",")]:
        import edt
        seconds, value = median(
            lambda: edt.edt(outside.astype(np.uint8), anisotropy=sampling, parallel=threads), options.reps)
        print(f"distance,edt,{threads},{seconds:.5f},{float(value.max()):.6f} mm farthest")
        import SimpleITK
        SimpleITK.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
        itk = SimpleITK.GetImageFromArray(inside.astype(np.uint8))
        itk.SetSpacing(spacing)
        seconds, value = median(
            lambda: SimpleITK.SignedMaurerDistanceMap(itk, squaredDistance=False, useImageSpacing=True), options.reps)
        print(f"distance,SimpleITK Maurer,{threads},{seconds:.5f},signed")
    seconds, value = median(
        lambda: scipy.ndimage.distance_transform_edt(outside, sampling=sampling, return_indices=True), options.reps)
    print(f"distance,SciPy with indices,1,{seconds:.5f},{float(value[0].max()):.6f} mm farthest")

    import kimimaro, skimage.morphology
    seconds, value = median(lambda: skimage.morphology.skeletonize(inside), 3)
    print(f"skeleton,scikit-image Lee,1,{seconds:.4f},{int(value.sum())} voxels")
    seconds, value = median(
        lambda: kimimaro.skeletonize(inside.astype(np.uint8), anisotropy=tuple(sampling), progress=False, parallel=1,
                                     dust_threshold=0), 3)
    print(f"skeleton,kimimaro TEASAR,1,{seconds:.4f},{sum(len(s.vertices) for s in value.values())} vertices")


if __name__ == "__main__":
    main()
