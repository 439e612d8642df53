"""Times programs side by side and prints Markdown tables for docs/performance.md. Standard library only.

  timing.py processes --runs N NAME COMMAND [NAME COMMAND …]
      Whole processes, start to exit, interleaved (A B A B …), so that other load on the machine affects all equally;
      CPU time varies less under load. Each program first runs once untimed. Peak memory is that of the process alone.
      The last column is the ratio of the first program's median to each program's.
  timing.py passes --runs N COMMAND [COMMAND …]
      Runs `glioscope render … --stats`, reads its JSON, and prints the median time of each pass.

A COMMAND is one argument, split into words as by a shell.
"""

import argparse
import json
import os
import shlex
import statistics
import subprocess
import sys
import time


def run(command):
    """Runs `command`; returns (seconds, CPU seconds, peak resident bytes, stdout). A failure ends the benchmark."""
    words = shlex.split(command)
    started = time.perf_counter()
    try:
        process = subprocess.Popen(words, stdout=subprocess.PIPE)
    except OSError as error:
        sys.exit(f"{words[0]}: {error.strerror}")
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - started
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"exit {process.returncode}: {command}")
    peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return seconds, usage.ru_utime + usage.ru_stime, peak, output


def processes(runs, words):
    if not words or len(words) % 2:
        sys.exit("processes: expected NAME COMMAND pairs")
    programs = list(zip(words[::2], words[1::2]))
    for _, command in programs:
        run(command)
    samples_by_name = {name: [] for name, _ in programs}
    for _ in range(runs):
        for name, command in programs:
            samples_by_name[name].append(run(command)[:3])
    first = statistics.median(seconds * 1e3 for seconds, _, _ in samples_by_name[programs[0][0]])
    print(
        f"| program | median of {runs} (ms) | fastest to slowest (ms) | CPU time, median (ms) | peak memory (MiB) "
        f"| {programs[0][0]} / this |"
    )
    print("|---|---:|---:|---:|---:|---:|")
    for name, samples in samples_by_name.items():
        times = sorted(seconds * 1e3 for seconds, _, _ in samples)
        median = statistics.median(times)
        cpu = statistics.median(seconds * 1e3 for _, seconds, _ in samples)
        peak = max(size for _, _, size in samples) / 2**20
        print(
            f"| {name} | {median:.0f} | {times[0]:.0f} to {times[-1]:.0f} | {cpu:.0f} | {peak:.0f} "
            f"| {first / median:.2f} |"
        )


def passes(runs, commands):
    for command in commands:
        frames = [json.loads(run(command)[-1]) for _ in range(runs)]
        size = frames[0]["size"]
        print(f"\nSize {'x'.join(map(str, size))}; adapter {frames[0]['adapter']}; timed by {frames[0].get('timed_by', 'unknown')}.\n")
        print(f"| pass | median of {runs} (ms) | fastest to slowest (ms) |")
        print("|---|---:|---:|")
        names = [step["name"] for step in frames[0]["passes"]]
        rows = {name: sorted(f["passes"][i]["ms"] for f in frames) for i, name in enumerate(names)}
        rows["all passes"] = sorted(sum(step["ms"] for step in f["passes"]) for f in frames)
        for name, times in rows.items():
            print(f"| {name} | {statistics.median(times):.1f} | {times[0]:.1f} to {times[-1]:.1f} |")
        omitted = ", ".join(f"{step['name']} ({step['reason']})" for step in frames[0].get("omitted", []))
        print(f"\nOmitted by the plan: {omitted or 'nothing'}.")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["processes", "passes"])
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("words", nargs="+", metavar="NAME|COMMAND")
    args = parser.parse_args()
    if args.runs < 1:
        parser.error("--runs: at least 1")
    {"processes": processes, "passes": passes}[args.what](args.runs, args.words)


if __name__ == "__main__":
    main()
