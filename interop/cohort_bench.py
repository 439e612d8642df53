"""A made cohort of 200 cases, killed at 20 random moments and run again: the same tables as undisturbed, and no partial case. Then the
time of a case against the number of processes and of cases, memory, and what a case of full size costs. Prints Markdown.

Usage: cohort_bench.py PROGRAM DATA [CASES [KILLS]] [--numbers]. DATA: the folder glioma-5-algorithms. --numbers: nothing of this, but
every number of every case beside NumPy and SciPy (cohort_numbers.py).
"""

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cohort_cases

PROGRAM, DATA, *COUNTS = (word for word in sys.argv[1:] if word != "--numbers")
CASES, KILLS = (int(text) for text in (*COUNTS, *("200", "20")[len(COUNTS) :]))
OPTIONS = ["--compute", "metrics,lesions,change"]
SEED = 19


def command(data, out, *more):
    return [PROGRAM, "cohort", str(data), str(out), *more]


def run(data, out, *more):
    """Seconds, and most memory of the run itself in MB."""
    started, peak = time.monotonic(), 0
    child = subprocess.Popen(command(data, out, *more), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while child.poll() is None:
        try:
            lines = Path(f"/proc/{child.pid}/status").read_text().splitlines()
            peak = max(peak, *(int(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0)
        except (OSError, ValueError, TypeError):
            pass
        time.sleep(0.02)
    if child.returncode:
        sys.exit(f"{more}: exit code {child.returncode}: {child.stderr.read()}")
    return time.monotonic() - started, peak / 1024


def statuses(out):
    return [json.loads(path.read_text()) for path in sorted(Path(out).glob("cases/*/status.json"))]


def whole(out):
    """The cases in the results, each checked against its status."""
    folders = sorted((Path(out) / "cases").iterdir()) if (Path(out) / "cases").is_dir() else []
    for folder in folders:
        status = json.loads((folder / "status.json").read_text())
        for file in status["results"]:
            if (folder / file["path"]).stat().st_size != file["bytes"]:
                sys.exit(f"{folder / file['path']}: found another size, expected {file['bytes']} bytes")
    return len(folders)


def tables(data, out):
    run(data, out, "group", "--reference", cohort_cases.REFERENCE)
    return {path.name: path.read_bytes() for path in sorted((Path(out) / "tables").iterdir())}


def killed(data, folder):
    undisturbed, out = folder / "undisturbed", folder / "killed"
    seconds, _ = run(data, undisturbed, "participant", *OPTIONS)
    draw, counts, words = random.Random(SEED), [], []
    for _ in range(KILLS):
        child = subprocess.Popen(command(data, out, "participant", *OPTIONS), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(draw.uniform(0.02, 1.3 * seconds / KILLS))
        how = draw.choice([signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
        if child.poll() is None:
            words.append(how.name)
            os.kill(child.pid, how)
        child.wait()
        counts.append(whole(out))
    run(data, out, "participant", *OPTIONS)
    same = tables(data, undisturbed) == tables(data, out)
    left = len(list((out / ".parts").iterdir()))
    print(f"{CASES} cases, {len(words)} runs killed ({', '.join(f'{words.count(w)} {w}' for w in sorted(set(words)))}); whole cases after each: "
          f"{', '.join(map(str, counts))}; then {whole(out)}, parts left: {left}. The same tables: {'yes' if same else 'NO'}")
    if not same or left or whole(out) != CASES:
        sys.exit("the killed run differs")


def scaled(folder, data):
    print("\n| cases | processes | s | s per case | memory of the run, MB | most of a case, MB |\n|---|---|---|---|---|---|")
    labels = [f"case-{n:04d}" for n in range(CASES)]
    for count, processes in ((CASES // 8, 1), (CASES // 2, 1), (CASES // 2, 2), (CASES // 2, 4), (CASES, 2)):
        out = folder / f"scaled-{count}-{processes}"
        seconds, memory = run(data, out, "participant", *OPTIONS, "--n-procs", str(processes), "--participant-label", *labels[:count])
        most = max(step["peak_mb"] or 0 for status in statuses(out) for step in status["steps"])
        print(f"| {count} | {processes} | {seconds:.1f} | {seconds / count:.3f} | {memory:.0f} | {most:.0f} |")


def full_size(folder):
    """The case as its files have it: six masks and four images of 240 × 240 × 155 voxels."""
    data, out = folder / "full", folder / "full results"
    (data / "glioma").mkdir(parents=True)
    for path in Path(DATA).glob("*.nii.gz"):
        (data / "glioma" / path.name).symlink_to(path)
    print("\n| step | s | most memory, MB |\n|---|---|---|")
    run(data, out, "participant", "--compute", "metrics,lesions,report,pictures", "--n-procs", "1", "--software")
    steps = statuses(out)[0]["steps"]
    for step in steps:
        print(f"| {step['step']} | {step['seconds']:.1f} | {step['peak_mb']:.0f} |")
    disk = sum(path.stat().st_size for path in (out / "cases").rglob("*") if path.is_file())
    print(f"\nresults: {disk / 1e6:.2f} MB on disk; without report and pictures "
          f"{sum(p.stat().st_size for p in (out / 'cases').rglob('*') if p.suffix in ('.json', '.txt')) / 1e6:.3f} MB")


def numbers(data, folder, make):
    import cohort_numbers

    by_corners, by_voxels = folder / "by corners", folder / "by voxels"
    run(data, by_corners, "participant", *OPTIONS, "--of", cohort_cases.REFERENCE)
    run(data, by_voxels, "participant", "--compute", "metrics", "--convention", "metrics-reloaded")
    for out in (by_corners, by_voxels):
        run(data, out, "group")
    cohort_numbers.all_numbers(by_corners, by_voxels, make, CASES)
    print(f"{CASES} cases: {cohort_numbers.checks} numbers as by NumPy and SciPy")


with tempfile.TemporaryDirectory() as temporary:
    folder = Path(temporary).resolve()
    data = folder / "made"
    make = cohort_cases.write(DATA, data, CASES)
    if "--numbers" in sys.argv:
        numbers(data, folder, make)
    else:
        killed(data, folder)
        scaled(folder, data)
        full_size(folder)
