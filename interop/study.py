"""`glioscope study`: a robot goes through it as several participants, and SciPy, statsmodels and pingouin compute from its files what
`study analyse` says of them.

Usage: study.py PROGRAM [PARTICIPANTS]. Everything is made in a temporary folder.
"""

import itertools
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pingouin
from scipy import stats
from statsmodels.stats.anova import AnovaRM

PROGRAM = str(Path(sys.argv[1]).resolve())
PARTICIPANTS = int(sys.argv[2]) if len(sys.argv) > 2 else 12
LIGHTS = ["screen-space", "horizon", "traced", "slices", "cones"]
MEASURES = {
    "nearer": ["correct", "time_s"],
    "depth": ["error_percent", "time_s"],
    "larger": ["correct", "time_s"],
    "shape": ["correct", "time_s"],
    "preference": ["preferred"],
}
NAMES = {"correct": "correct_share", "preferred": "preferred_share"}
checks, worst = 0, 0.0


def same(what, found, expected, tolerance=1e-8):
    """Numbers to a relative tolerance; those that rounding makes of nothing to an absolute one."""
    global checks, worst
    checks += 1
    off = abs(found - expected) / max(abs(expected), 1e-9)
    worst = max(worst, off)
    if not off <= tolerance:
        sys.exit(f"{what}: found {found!r}, expected {expected!r}")


def glioscope(*arguments):
    done = subprocess.run([PROGRAM, "study", *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{arguments}: exit code {done.returncode}: {done.stderr}")
    return done.stdout


def numbers(task, measure, rows):
    """A row for each number: participant, light, value."""
    if measure != "preferred":
        return rows[["participant", "light", measure]].set_axis(["participant", "light", "value"], axis=1)
    left = (rows.answer == "left").astype(float)
    own = pd.DataFrame({"participant": rows.participant, "light": rows.light, "value": left})
    other = pd.DataFrame({"participant": rows.participant, "light": rows.other_light, "value": 1 - left})
    return pd.concat([own, other])


def check_measure(name, report, table):
    wide = table.pivot_table(index="participant", columns="light", values="value", aggfunc="mean")[LIGHTS]
    same(f"{name} left out", len(report["left_out"]), 0)
    for light, found in zip(LIGHTS, report["lights"], strict=True):
        same(f"{name} {light} mean", found["mean"], wide[light].mean())
        same(f"{name} {light} error", found["standard_error"], stats.sem(wide[light]))
        same(f"{name} {light} trials", found["trials"], int((table.light == light).sum()))
    means = wide.reset_index().melt("participant", value_name="value")
    anova, spherical = report["anova"], pingouin.rm_anova(
        means, dv="value", within="light", subject="participant", correction=True, effsize="np2", detailed=True
    ).iloc[0]
    for key, column in {
        "f": "F",
        "df_lights": "DF",
        "p": "p_unc",
        "epsilon": "eps",
        "p_corrected": "p_GG_corr",
        "partial_eta_squared": "np2",
    }.items():
        same(f"{name} {key}", anova[key], float(spherical[column]))
    mauchly = pingouin.sphericity(means, dv="value", within="light", subject="participant")
    for key, expected in {"w": mauchly.W, "chi_squared": mauchly.chi2, "df": mauchly.dof, "p": mauchly.pval}.items():
        same(f"{name} Mauchly {key}", anova["mauchly"][key], float(expected))
    by_statsmodels = AnovaRM(means, "value", "participant", within=["light"]).fit().anova_table.iloc[0]
    same(f"{name} F by statsmodels", anova["f"], float(by_statsmodels["F Value"]))
    same(f"{name} error by statsmodels", anova["df_error"], float(by_statsmodels["Den DF"]))
    same(f"{name} p by statsmodels", anova["p"], float(by_statsmodels["Pr > F"]))
    pairs = list(itertools.combinations(LIGHTS, 2))
    for (a, b), found in zip(pairs, report["comparisons"], strict=True):
        test = stats.ttest_rel(wide[a], wide[b])
        same(f"{name} {a} {b}", (found["a"], found["b"]) == (a, b), True)
        same(f"{name} {a} {b} difference", found["difference"], (wide[a] - wide[b]).mean())
        same(f"{name} {a} {b} t", found["t"], test.statistic)
        same(f"{name} {a} {b} p", found["p"], test.pvalue)
        same(f"{name} {a} {b} corrected", found["p_bonferroni"], pingouin.multicomp([test.pvalue] * len(pairs), method="bonf")[1][0])


def main():
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for participant in range(1, PARTICIPANTS + 1):
            files.append(Path(folder) / f"{participant}.csv")
            glioscope("--robot", 3, "--participant", participant, "--lights", ",".join(LIGHTS), "--out", files[-1])
        report = json.loads(glioscope("analyse", "--json", *files))
        rows = pd.concat([pd.read_csv(path) for path in files])
        same("answers", len(rows), PARTICIPANTS * (4 * (6 * len(LIGHTS) + 3) + len(LIGHTS) * (len(LIGHTS) - 1) + 3))
        same("lights", report["lights"] == LIGHTS, True)
        counted = rows[rows.practice == 0]
        # Within a task every participant sees each light equally often, each scene once.
        for (participant, task), own in counted.groupby(["participant", "task"]):
            same(f"{participant} {task} scenes", own.scene.nunique(), len(own))
            if task != "preference":
                same(f"{participant} {task} lights", own.light.value_counts().tolist() == [6] * len(LIGHTS), True)
        for task, found in zip(MEASURES, report["tasks"], strict=True):
            of = counted[counted.task == task]
            same(f"{task}", found["task"] == task, True)
            for measure, measured in zip(MEASURES[task], found["measures"], strict=True):
                same(f"{task} {measure}", measured["measure"] == NAMES.get(measure, measure), True)
                check_measure(f"{task} {measure}", measured, numbers(task, measure, of))
            if task != "preference":
                pearson = stats.pearsonr(of[MEASURES[task][0]].astype(float), of.time_s)
                same(f"{task} r", found["score_with_time"]["r"], pearson.statistic)
                same(f"{task} p of r", found["score_with_time"]["p"], pearson.pvalue)
    print(f"study: {checks} checks, {PARTICIPANTS} participants; numbers differ by at most {worst:.1e} of themselves")


if __name__ == "__main__":
    main()
