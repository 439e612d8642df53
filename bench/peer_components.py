"""Connected components of a tumour index by glioscope, cc3d and SciPy, interleaved, on the same voxels.

  python bench/peer_components.py PROGRAM [--data FOLDER] [--runs N] [--cases glioma,synthetic]

PROGRAM is target/release/glioscope-bench, which also generates the indices (a glioma of three masks, 240x240x155; three
synthetic masks, 512x512x512, or with --cases tiny 64x64x64) and writes them as raw bytes. Before timing, the partitions
are compared: the benchmark ends unless they are equal up to the numbering of labels.

cc3d labels all values in one pass (26-connected, one thread), as glioscope does; SciPy needs one pass per value. Both
return a label volume. glioscope returns runs with counts, bounding boxes and centroids, and a label volume only on
request, so both are timed. Reported are the median wall time and the median CPU time, which varies less under load.

Needs: pip install connected-components-3d scipy numpy
"""

import argparse
import importlib.metadata
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import cc3d
import numpy as np
import scipy
import scipy.ndimage


class Program:
    """glioscope-bench as a server: one line in, one line out."""

    def __init__(self, command):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.dims = [int(word) for word in self.read_line().split()]

    def read_line(self):
        line = self.process.stdout.readline()
        if not line:
            sys.exit("the program ended early")
        return line

    def request(self, line):
        print(line, file=self.process.stdin, flush=True)
        return self.read_line()

    def time(self, line):
        wall, cpu, _ = (float(word) for word in self.request(line).split())
        return wall, cpu


def timed(job):
    cpu, wall = time.process_time(), time.perf_counter()
    job()
    return time.perf_counter() - wall, time.process_time() - cpu


def with_cc3d(index):
    return cc3d.connected_components(index, connectivity=26)


def with_scipy(index):
    structure = np.ones((3, 3, 3), bool)
    labels, count = np.zeros(index.shape, np.uint32), 0
    for value in np.flatnonzero(np.bincount(index.ravel())):
        if value:
            value_labels, value_count = scipy.ndimage.label(index == value, structure)
            labels[value_labels > 0] = value_labels[value_labels > 0] + count
            count += value_count
    return labels


def same_partition(ours, theirs):
    """Whether two label volumes are the same partition: there are as many distinct pairs of labels as labels."""
    pairs = np.unique(ours.astype(np.uint64).ravel() << np.uint64(32) | theirs.ravel().astype(np.uint64))
    # Background with background is a pair as well.
    return len(pairs) == len(np.unique(ours)) == len(np.unique(theirs))


def bench(name, program, runs, scratch):
    program.request(f"write {scratch / 'index'} {scratch / 'labels'}")
    nx, ny, nz = program.dims
    index = np.fromfile(scratch / "index", np.uint8).reshape(nz, ny, nx)
    ours = np.fromfile(scratch / "labels", np.uint32).reshape(nz, ny, nx)
    for peer, labels in [("cc3d", with_cc3d(index)), ("SciPy", with_scipy(index))]:
        if not same_partition(ours, labels):
            sys.exit(f"{name}: {peer} gives another partition")
    print(f"\n{name}, {nx}x{ny}x{nz}: {ours.max()} components; cc3d and SciPy give the same partition.\n")
    del ours

    jobs = {
        "cc3d": lambda: timed(lambda: with_cc3d(index)),
        "SciPy, one pass per value": lambda: timed(lambda: with_scipy(index)),
    }
    for threads in (1, 2):
        label = f"{threads} thread{'s' if threads > 1 else ''}"
        jobs[f"glioscope, {label}"] = lambda t=threads: program.time(f"components {t}")
        jobs[f"glioscope with a label volume, {label}"] = lambda t=threads: program.time(f"labels {t}")
    timings = {job: [] for job in jobs}
    for round_number in range(runs + 1):
        for job, run in jobs.items():
            if job.startswith("SciPy") and round_number > 5:
                continue
            sample = run()
            # The first round warms up.
            if round_number:
                timings[job].append(sample)
    print("| program | median wall (ms) | fastest to slowest (ms) | median CPU (ms) | wall / cc3d | CPU / cc3d |")
    print("|---|---:|---:|---:|---:|---:|")
    medians = {job: [statistics.median(s[k] for s in samples) * 1e3 for k in (0, 1)] for job, samples in timings.items()}
    for job, (wall, cpu) in medians.items():
        walls = [s[0] * 1e3 for s in timings[job]]
        print(
            f"| {job} | {wall:.1f} | {min(walls):.1f} to {max(walls):.1f} | {cpu:.1f} "
            f"| {wall / medians['cc3d'][0]:.2f} | {cpu / medians['cc3d'][1]:.2f} |"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--data", default="../shared/data")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--cases", default="glioma,synthetic", help="of glioma, synthetic and tiny")
    args = parser.parse_args()
    if args.runs < 1:
        parser.error("--runs: at least 1")
    cc3d_version = importlib.metadata.version("connected-components-3d")
    print(f"cc3d {cc3d_version}, SciPy {scipy.__version__}, NumPy {np.__version__}; {args.runs} rounds (SciPy: at most 5)")
    for name in args.cases.split(","):
        with tempfile.TemporaryDirectory() as scratch:
            program = Program([args.program, "ellipsoids", "serve", name, args.data])
            bench(name, program, args.runs, pathlib.Path(scratch))
            program.process.stdin.close()
            program.process.wait()


if __name__ == "__main__":
    main()
