"""`glioscope cohort` on a made cohort beside what others say of it: tables against NumPy's and SciPy's numbers, read by DuckDB, pandas
and, where it is, R; the SQL of docs/cohort.md with the answers that stand there; ranks against pandas, tests against SciPy; and the same
tables by Snakemake and, where it runs, Nextflow.

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


def kappa(a, b):
    """Cohen's: agreement beyond what is expected of two masks of these sizes."""
    agreed, by_chance = (a == b).mean(), a.mean() * b.mean() + (1 - a.mean()) * (1 - b.mean())
    return (agreed - by_chance) / (1 - by_chance)


def corners(mask):
    """Corners of voxels around which the eight differ."""
    padded = np.pad(mask, 1)
    around = [padded[tuple(slice(step, n + step - 1) for step, n in zip(steps, padded.shape))] for steps in itertools.product((0, 1), repeat=3)]
    return np.any(around, axis=0) & ~np.all(around, axis=0)


def faced(mask):
    """Active voxels with an inactive one across a face."""
    return mask & ~ndimage.binary_erosion(mask)


def ways_mm(a, b, spacing):
    """From each place of a surface to the nearest of the other, both ways."""
    return [ndimage.distance_transform_edt(~to, spacing)[of] for of, to in ((a, b), (b, a))]


def farthest(*ways):
    return max(way.max() for way in ways)


# Of MetricsReloaded, all places of one weight: the larger of both ways, and means over both and of both ways' means.
BY_VOXELS = {
    "hd_mm": farthest,
    "hd95_mm": lambda *ways: max(np.percentile(way, 95) for way in ways),
    "assd_mm": lambda *ways: np.concatenate(ways).mean(),
    "masd_mm": lambda *ways: np.mean([way.mean() for way in ways]),
    "nsd": lambda *ways: (np.concatenate(ways) <= 1.0).mean(),
}


def by_case(out, kind):
    return {(case, time): rows for (case, time), rows in pd.read_parquet(out / "tables" / f"{kind}.parquet").groupby(["case", "time"])}


def distances(out, make, surface, metrics):
    """Every pair of masks, by SciPy's distances between what a convention calls their surfaces."""
    tables = by_case(out, "pairs")
    for n in range(CASES):
        made, spacing = make(n)
        for date, masks in made.items():
            found = tables[f"case-{n:04d}", date].set_index(["a", "b", "metric"]).value
            surfaces = {name: surface(mask) for name, mask in masks.items()}
            for a, b in itertools.combinations(masks, 2):
                ways = ways_mm(surfaces[a], surfaces[b], spacing)
                for metric, of in metrics.items():
                    same(f"case-{n:04d} {date} {a} {b} {metric}", found[a, b, metric], of(*ways), 1e-6)


def lesion_volumes(out, make):
    """A lesion is what overlaps over the dates: here the parts of one component of both dates' union."""
    tables = by_case(out, "lesions")
    for n in range(CASES):
        made, spacing = make(n)
        lesions, count = ndimage.label(np.any([made[date][REFERENCE] for date in DATES], axis=0), np.ones((3, 3, 3)))
        for date in DATES:
            voxels = ndimage.sum_labels(made[date][REFERENCE], lesions, range(1, count + 1))
            expected = sorted(voxels[voxels > 0] * np.prod(spacing) / 1000)
            found = sorted(tables[f"case-{n:04d}", date].volume_ml)
            same(f"case-{n:04d} {date} lesions", len(found), len(expected))
            same(f"case-{n:04d} {date} volumes of lesions", found, expected, 1e-6)


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
                same(f"{case} {a} {b} kappa", pairs[a, b, "kappa"], kappa(masks[a], masks[b]), 1e-9)
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


# Of every column of the table given: name, whether it has numbers, how many fields are empty, and the sum of its numbers.
BY_R = """
table <- read.csv(commandArgs(TRUE), na.strings = "", check.names = FALSE)
for (name in names(table)) {
    column <- table[[name]]
    all <- if (is.numeric(column)) sum(as.numeric(column), na.rm = TRUE) else 0
    cat(name, is.numeric(column), sum(is.na(column)), sprintf("%.17g", all), nrow(table), sep = "\\t")
    cat("\\n")
}
"""


def by_r(out):
    """R reads the CSV as pandas reads the Parquet."""
    program = shutil.which("Rscript")
    if not program:
        print("SKIPPED: R isn't installed; the tables weren't read by it")
        return
    script = out.parent / "table.R"
    script.write_text(BY_R)
    for path in sorted((out / "tables").glob("*.csv")):
        done = subprocess.run([program, str(script), str(path)], capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"R on {path.name}: {done.stderr}")
        table = pd.read_parquet(path.with_suffix(".parquet"))
        columns = [line.split("\t") for line in done.stdout.splitlines()]
        same(f"columns of {path.name} by R", [column[0] for column in columns], list(table))
        for name, is_number, empty, total, rows in columns:
            # In CSV an empty text and none are the same, and a column without a value has no type.
            is_empty = table[name].isna() | (table[name].astype(object) == "")
            same(f"{name} of {path.name} by R", (int(empty), int(rows)), (int(is_empty.sum()), len(table)))
            if not is_empty.all() and not pd.api.types.is_bool_dtype(table[name]):
                is_expected = pd.api.types.is_numeric_dtype(table[name])
                same(f"{name} of {path.name} is a number by R", is_number == "TRUE", is_expected)
                if is_expected:
                    same(f"sum of {name} of {path.name} by R", float(total), table[name].astype(float).sum(), 1e-12)


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
    lesion_volumes(out, make)
    distances(out, make, corners, {"hd_mm": farthest})
    by_voxels = folder / "by voxels"
    cohort(data, by_voxels, "participant", "--compute", "metrics", "--convention", "metrics-reloaded")
    cohort(data, by_voxels, "group")
    distances(by_voxels, make, faced, BY_VOXELS)
    against_readers(out)
    by_r(out)
    against_statistics(out)
    examples(out)
    by_numpy(out, make)
    plain = files(out / "tables")
    by_snakemake(folder, data, plain)
    by_slurm_array(folder, data, plain)
    by_nextflow(folder, data, plain)
print(f"cohort: {checks} checks passed")
