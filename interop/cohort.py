"""`glioscope cohort` on a made cohort beside what others say of it: tables against NumPy's numbers, read by DuckDB and pandas; the SQL of
docs/cohort.md with the answers that stand there; ranks against pandas, tests against SciPy; and the same tables by Snakemake and, where
it runs, Nextflow.

Usage: cohort.py PROGRAM DATA [--update]. DATA: the folder glioma-5-algorithms. --update writes DuckDB's answers into the page.
Everything is made in a temporary folder.
"""

import csv
import io
import itertools
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
from scipy import ndimage, stats

import cohort_cases
from cohort_cases import DATES, REFERENCE

PROGRAM, DATA = (str(Path(path).resolve()) for path in sys.argv[1:3])
UPDATE = "--update" in sys.argv[3:]
ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "cohort.md"
CASES = 12
OPTIONS = ["--compute", "metrics,lesions,change", "--of", REFERENCE]
GROUP = ["--reference", REFERENCE, "--rank-by", "dice,hd95_mm"]
checks = 0


def same(what, found, expected, tolerance=0.0):
    global checks
    checks += 1
    is_same = np.allclose(found, expected, rtol=tolerance, atol=0) if tolerance else found == expected
    if not is_same:
        sys.exit(f"{what}: found {found}, expected {expected}")


def cohort(data, out, *arguments):
    done = subprocess.run([PROGRAM, "cohort", str(data), str(out), *arguments], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{arguments}: exit code {done.returncode}: {done.stderr}")


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


def against_numpy(out, make):
    """Every mask, region and pair."""
    table = {kind: pd.read_parquet(out / "tables" / f"{kind}.parquet") for kind in ("masks", "regions", "pairs", "changes")}
    same("masks", len(table["masks"]), CASES * 2 * 4)
    for n in range(CASES):
        case, (made, spacing) = f"case-{n:04d}", make(n)
        voxel_ml = float(np.prod(spacing)) / 1000
        for date, masks in made.items():
            own = table["masks"][(table["masks"].case == case) & (table["masks"].time == date)].set_index("mask")
            for name, mask in masks.items():
                same(f"{case} {date} {name}", int(own.voxels[name]), int(mask.sum()))
                same(f"{case} {date} {name} ml", own.volume_ml[name], mask.sum() * voxel_ml, 1e-6)
            regions = table["regions"][(table["regions"].case == case) & (table["regions"].time == date)]
            names = list(masks)
            bits = sum(mask.astype(int) << k for k, mask in enumerate(masks.values()))
            expected = {
                "+".join(name for k, name in enumerate(names) if code >> k & 1): int(count)
                for code, count in zip(*np.unique(bits[bits > 0], return_counts=True))
            }
            same(f"{case} {date} regions", dict(zip(regions.region, map(int, regions.voxels))), expected)
            pairs = table["pairs"][(table["pairs"].case == case) & (table["pairs"].time == date)]
            pairs = pairs.set_index(["a", "b", "metric"]).value
            for a, b in itertools.combinations(names, 2):
                both, either = (masks[a] & masks[b]).sum(), (masks[a] | masks[b]).sum()
                same(f"{case} {a} {b} Jaccard", pairs[a, b, "jaccard"], both / either, 1e-12)
                same(f"{case} {a} {b} Dice", pairs[a, b, "dice"], 2 * both / (both + either), 1e-12)
                same(f"{case} {a} {b} kappa", pairs[a, b, "kappa"] <= pairs[a, b, "dice"], True)
            # Distances scale with the voxels: those of case n are those of n's masks on voxels of the first size.
        change = table["changes"][table["changes"].case == case].iloc[0]
        first, last = (made[date][REFERENCE] for date in DATES)
        same(f"{case} new", change.new_ml, (last & ~first).sum() * voxel_ml, 1e-6)
        same(f"{case} gone", change.gone_ml, (first & ~last).sum() * voxel_ml)
    lesions = pd.read_parquet(out / "tables" / "lesions.parquet")
    for n in range(CASES):
        made, _ = make(n)
        for date in DATES:
            own = lesions[(lesions.case == f"case-{n:04d}") & (lesions.time == date)]
            _, count = ndimage.label(made[date][REFERENCE], np.ones((3, 3, 3)))
            same(f"case-{n:04d} {date} components", int(own.components.sum()), count)


def against_readers(out):
    """DuckDB, pandas and the CSV say the same of every table."""
    for path in sorted((out / "tables").glob("*.parquet")):
        by_pandas = pd.read_parquet(path)
        by_duckdb = duckdb.sql(f"select * from '{path}'").df()
        same(f"{path.name} rows", len(by_duckdb), len(by_pandas))
        if len(by_pandas):
            alike = [table.astype(object).where(table.notna(), None) for table in (by_duckdb, by_pandas)]
            pd.testing.assert_frame_equal(*alike)
        with open(path.with_suffix(".csv"), newline="") as file:
            rows = list(csv.DictReader(file))
        same(f"{path.stem} columns", list(rows[0]) if rows else list(by_pandas), list(by_pandas))
        for name in by_pandas.select_dtypes("number"):
            found = [float(row[name]) if row[name] else np.nan for row in rows]
            np.testing.assert_array_equal(found, by_pandas[name].astype(float).to_numpy(), f"{path.name} {name}")
            same(f"{path.stem} {name}", True, True)


def against_statistics(out):
    """Ranks as pandas ranks, tests as SciPy and the definition of Holm have them."""
    pairs = pd.read_parquet(out / "tables" / "pairs.parquet")
    ranks = pd.read_parquet(out / "tables" / "ranks.parquet").set_index(["metric", "mask"])
    tests = pd.read_parquet(out / "tables" / "tests.parquet")
    overall = []
    for metric, sign in (("dice", -1), ("hd95_mm", 1)):
        own = pairs[(pairs.a == REFERENCE) & (pairs.metric == metric)]
        wide = own.pivot_table(index=["case", "time"], columns="b", values="value")
        by_case = (sign * wide).rank(axis=1).groupby("case").mean()
        overall.append(by_case)
        for mask, rank in by_case.mean().items():
            row = ranks.loc[metric, mask]
            same(f"rank of {mask} by {metric}", row.mean_rank, rank, 1e-12)
            same(f"interval of {mask}", row.low <= row.mean_rank <= row.high, True)
        values, p, rows = wide.groupby("case").mean(), [], []
        for _, row in tests[tests.metric == metric].iterrows():
            a, b = values[row.a].to_numpy(), values[row.b].to_numpy()
            method = {"exact": "exact", "normal": "approx"}[row.method]
            expected = stats.wilcoxon(a, b, zero_method="wilcox", correction=False, method=method)
            same(f"statistic {row.a} {row.b}", row.statistic, expected.statistic, 1e-12)
            same(f"p {row.a} {row.b}", row.p, expected.pvalue, 1e-9)
            p.append(row.p)
            rows.append(row)
        order, least = np.argsort(p), 0.0
        for k, n in enumerate(order):
            least = max(least, min(1.0, p[n] * (len(p) - k)))
            same(f"Holm {rows[n].a} {rows[n].b}", rows[n].p_holm, least, 1e-12)
    for mask, rank in (sum(overall) / len(overall)).mean().items():
        same(f"rank of {mask}", ranks.loc["all", mask].mean_rank, rank, 1e-12)


def examples(out):
    """The SQL of the page, with the answers that stand there."""
    page = PAGE.read_text()
    blocks = re.findall(r"```sql\n(.*?)```\n\n```csv\n(.*?)```", page, re.S)
    same("examples", len(blocks) >= 4, True)
    connection = duckdb.connect()
    os.chdir(out)
    for query, stated in blocks:
        found = connection.sql(query).df().to_csv(index=False, float_format="%.4g", lineterminator="\n")
        if UPDATE:
            page = page.replace(f"```sql\n{query}```\n\n```csv\n{stated}```", f"```sql\n{query}```\n\n```csv\n{found}```")
        else:
            same(f"answer to {query}", found, stated)
    if UPDATE:
        PAGE.write_text(page)


def by_numpy(out, make):
    """Two of the page's questions, asked of the masks."""
    rows = list(csv.DictReader(io.StringIO(re.findall(r"-- mean Dice.*?```csv\n(.*?)```", PAGE.read_text(), re.S)[0])))
    for row in rows:
        dice = []
        for n in range(CASES):
            for masks in make(n)[0].values():
                a, b = masks[REFERENCE], masks[row["b"]]
                dice.append(2 * (a & b).sum() / (a.sum() + b.sum()))
        same(f"mean Dice of {row['b']}", float(row["dice"]), float(f"{np.mean(dice):.4g}"))
    same("algorithms in the page", len(rows), len(cohort_cases.ALGORITHMS))


def by_snakemake(folder, data, plain):
    out = folder / "by snakemake"
    snakemake = Path(sys.executable).parent / "snakemake"
    options = " ".join(OPTIONS)
    command = [
        str(snakemake), "--snakefile", str(ROOT / "workflows/snakemake/Snakefile"),
        "--profile", str(ROOT / "workflows/snakemake/profiles/local"), "--quiet", "all", "--nolock",
        "--config", f"input={data}", f"output={out}", f"glioscope={PROGRAM}", f"options={options}",
        f"group_options={' '.join(GROUP)}", "batch=5",
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    if done.returncode:
        sys.exit(f"snakemake: exit code {done.returncode}: {done.stdout}{done.stderr}")
    same("tables by Snakemake", files(out / "tables") == plain, True)
    computed = lambda: [path.stat().st_mtime_ns for path in sorted(out.glob("cases/*/log.txt"))]
    first = computed()
    again = subprocess.run([*command, "--forceall"], capture_output=True, text=True, cwd=folder)
    same("Snakemake runs again", again.returncode, 0)
    same("cases are computed once", computed() == first and len(first) == CASES, True)
    same("tables by Snakemake, again", files(out / "tables") == plain, True)


def by_nextflow(folder, data, plain):
    program = shutil.which("nextflow")
    if not program or subprocess.run([program, "-version"], capture_output=True, timeout=120).returncode:
        # Its text at least: a parser of its own, which knows processes and directives.
        from reftrace import Module

        parsed = Module.from_file(str(ROOT / "workflows/nextflow/main.nf"))
        same("processes of main.nf", [process.name for process in getattr(parsed, "processes", [])] or parsed, ["LABELS", "CASES", "TABLES"])
        print("SKIPPED: Nextflow isn't installed, or its framework can't be had; workflows/nextflow was parsed, not run")
        return
    out = folder / "by nextflow"
    done = subprocess.run(
        [program, "run", str(ROOT / "workflows/nextflow/main.nf"), "-profile", "local", "--input", str(data), "--output", str(out),
         "--glioscope", PROGRAM, "--options", " ".join(OPTIONS), "--group_options", " ".join(GROUP), "--batch", "5"],
        capture_output=True, text=True, cwd=folder,
    )
    if done.returncode:
        sys.exit(f"nextflow: exit code {done.returncode}: {done.stdout}{done.stderr}")
    same("tables by Nextflow", files(out / "tables") == plain, True)


def by_slurm_array(folder, data, plain):
    """The script of a job array, its tasks run one after the other as SLURM would run them."""
    out = folder / "by array"
    for task in range(3):
        environment = {**os.environ, "SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": "3", "SLURM_MEM_PER_NODE": "4096",
                       "SLURM_TMPDIR": str(folder), "GLIOSCOPE": PROGRAM}
        done = subprocess.run([str(ROOT / "workflows/slurm-array.sh"), str(data), str(out), *OPTIONS], capture_output=True, text=True,
                              env=environment)
        if done.returncode:
            sys.exit(f"slurm-array.sh: exit code {done.returncode}: {done.stderr}")
    cohort(data, out, "group", *GROUP)
    same("tables by a job array", files(out / "tables") == plain, True)


with tempfile.TemporaryDirectory() as temporary:
    folder = Path(temporary).resolve()
    data, out = folder / "made cohort", folder / "results"
    make = cohort_cases.write(DATA, data, CASES)
    cohort(data, out, "participant", *OPTIONS)
    cohort(data, out, "group", *GROUP)
    against_numpy(out, make)
    against_readers(out)
    against_statistics(out)
    examples(out)
    by_numpy(out, make)
    plain = files(out / "tables")
    by_snakemake(folder, data, plain)
    by_slurm_array(folder, data, plain)
    by_nextflow(folder, data, plain)
print(f"cohort: {checks} checks passed")
