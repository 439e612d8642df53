"""`glioscope cohort` on a made cohort beside what others say of it: tables against NumPy's and SciPy's numbers, read by DuckDB, pandas
and, where it is, R; the SQL of docs/cohort.md with the answers that stand there; ranks against pandas, tests against SciPy; and the same
tables by Snakemake and, where it runs, Nextflow; else, where Groovy is, by the scripts of its pipeline.

Usage: cohort.py PROGRAM DATA [--update]. DATA: the folder glioma-5-algorithms. --update writes DuckDB's answers into the page.
Everything is made in a temporary folder.
"""

import csv
import io
import operator
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
from scipy import stats

import cohort_cases
import cohort_numbers
from cohort_cases import REFERENCE
from cohort_numbers import same

PROGRAM, DATA = (str(Path(path).resolve()) for path in sys.argv[1:3])
UPDATE = "--update" in sys.argv[3:]
ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "cohort.md"
CASES = 12
OPTIONS = ["--compute", "metrics,lesions,change", "--of", REFERENCE]
GROUP = ["--reference", REFERENCE, "--rank-by", "dice,hd95_mm"]


def cohort(data, out, *arguments):
    done = subprocess.run([PROGRAM, "cohort", str(data), str(out), *arguments], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{arguments}: exit code {done.returncode}: {done.stderr}")


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


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


def against_statistics(out, keys):
    """Ranks as pandas ranks, tests as SciPy and the definition of Holm have them; `keys`: of each metric what is least for the best."""
    pairs = pd.read_parquet(out / "tables" / "pairs.parquet")
    ranks = pd.read_parquet(out / "tables" / "ranks.parquet").set_index(["metric", "mask"])
    tests = pd.read_parquet(out / "tables" / "tests.parquet")
    overall = []
    for metric, key in keys.items():
        own = pairs[(pairs.a == REFERENCE) & (pairs.metric == metric)]
        wide = own.pivot_table(index=["case", "time"], columns="b", values="value")
        by_case = key(wide).rank(axis=1).groupby("case").mean()
        overall.append(by_case)
        for mask, rank in by_case.mean().items():
            row = ranks.loc[metric, mask]
            same(f"rank of {mask} by {metric}", row.mean_rank, rank, 1e-12)
            same(f"interval of {mask}", row.low <= row.mean_rank <= row.high, True)
        # Of a difference its size is tested.
        values, p, rows = (wide.abs() if key is abs else wide).groupby("case").mean(), [], []
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
    out = folder / "Nextflow's results"
    pipeline = str(ROOT / "workflows/nextflow/main.nf")
    words = [
        "--input", str(data), "--output", str(out), "--glioscope", PROGRAM, "--options", " ".join(OPTIONS),
        "--group_options", " ".join(GROUP), "--batch", "5",
    ]
    program = shutil.which("nextflow")
    if program and not subprocess.run([program, "-version"], capture_output=True, timeout=120).returncode:
        command = [program, "run", pipeline, "-profile", "local", *words]
    else:
        # Its text at least: a parser of its own, which knows processes and directives.
        from reftrace import Module

        parsed = Module.from_file(pipeline)
        same("processes of main.nf", [process.name for process in getattr(parsed, "processes", [])] or parsed, ["LABELS", "CASES", "TABLES"])
        print("SKIPPED: Nextflow isn't installed, or its framework can't be had; workflows/nextflow was parsed, not run")
        groovy = shutil.which("groovy")
        if not groovy:
            print("SKIPPED: Groovy isn't installed; the scripts of workflows/nextflow weren't run")
            return
        command = [groovy, str(ROOT / "interop/nextflow_scripts.groovy"), pipeline, str(folder / "nextflow"), *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=with_java())
    if done.returncode:
        sys.exit(f"{command[0]}: exit code {done.returncode}: {done.stdout}{done.stderr}")
    same("tables by Nextflow's pipeline", files(out / "tables") == plain, True)


def with_java():
    """The environment, with the place of Java that Debian's Groovy wants."""
    java = shutil.which("java")
    return {**({"JAVA_HOME": str(Path(java).resolve().parent.parent)} if java else {}), **os.environ}


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
    by_voxels = folder / "by voxels"
    cohort(data, by_voxels, "participant", "--compute", "metrics", "--convention", "metrics-reloaded")
    cohort(data, by_voxels, "group")
    cohort_numbers.all_numbers(out, by_voxels, make, CASES)
    against_readers(out)
    by_r(out)
    against_statistics(out, {"dice": operator.neg, "hd95_mm": operator.pos})
    more = {"sensitivity": operator.neg, "relative_volume_difference": abs, "nsd": operator.neg}
    cohort(data, by_voxels, "group", "--reference", REFERENCE, "--rank-by", ",".join(more))
    against_statistics(by_voxels, more)
    examples(out)
    by_numpy(out, make)
    plain = files(out / "tables")
    by_snakemake(folder, data, plain)
    by_slurm_array(folder, data, plain)
    by_nextflow(folder, data, plain)
print(f"cohort: {cohort_numbers.checks} checks passed")
