//! The numbers as CSV, and the Markdown page.

use std::fmt::Write;

use glioscope_core::csv::Table;

use super::{RunStart, durations, plot::Plot};
use crate::{
    accuracy::{Axis, Defaults, MeasuredFamily, front},
    clock::{Timing, load_average, machine},
};

/// One row per point.
pub(super) fn csv(measured: &[MeasuredFamily]) -> Vec<u8> {
    let number = |value: Option<f64>| value.map(|v| format!("{v:e}")).unwrap_or_default();
    let mut table = Table::new([
        "family",
        "kernel",
        "scene",
        "knob",
        "setting",
        "value",
        "median_ms",
        "q1_ms",
        "q3_ms",
        "cpu_median_ms",
        "cpu_q1_ms",
        "cpu_q3_ms",
        "runs",
        "peak_bytes",
        "error_rms",
        "error_max",
        "unit",
        "delta_e_rms",
        "delta_e_max",
        "truth",
        "truth_error",
        "default",
        "pareto",
    ]);
    for c in measured.iter().flat_map(|m| &m.curves) {
        for p in &c.points {
            let time = |of: fn(&Timing) -> f64| number(p.time.as_ref().map(of));
            let cpu = |of: fn(&Timing) -> f64| number(p.cpu.as_ref().map(of));
            table.row([
                c.family.to_owned(),
                c.kernel.clone(),
                c.scene.clone(),
                c.knob.to_owned(),
                p.setting.clone(),
                number(Some(p.value).filter(|v| !v.is_nan())),
                time(|t| t.median_ms),
                time(|t| t.q1_ms),
                time(|t| t.q3_ms),
                cpu(|t| t.median_ms),
                cpu(|t| t.q1_ms),
                cpu(|t| t.q3_ms),
                p.time.map(|t| t.runs.to_string()).unwrap_or_default(),
                p.peak_bytes.map(|b| b.to_string()).unwrap_or_default(),
                number(Some(p.error_rms)),
                number(Some(p.error_max)),
                c.unit.to_owned(),
                number(p.delta_e.map(|d| d[0])),
                number(p.delta_e.map(|d| d[1])),
                c.truth.clone(),
                number(c.truth_error),
                p.is_default.to_string(),
                p.is_pareto.to_string(),
            ]);
        }
    }
    table.into_bytes()
}

/// The page; plots are in the folder `images` beside it.
pub(super) fn markdown(measured: &[MeasuredFamily], plots: &[Plot<'_>], run_start: &RunStart) -> String {
    let mut out = String::new();
    // Writing to a string can't fail.
    let _ = write_page(&mut out, measured, plots, run_start);
    out
}

fn write_page(
    out: &mut String,
    measured: &[MeasuredFamily],
    plots: &[Plot<'_>],
    run_start: &RunStart,
) -> std::fmt::Result {
    let command: Vec<String> = std::env::args().skip(1).collect();
    let load = |l: Option<f64>| l.map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    let build = if cfg!(debug_assertions) { "dev profile" } else { "release profile" };
    writeln!(
        out,
        "# Accuracy: error against run time\n\n\
         Made by `./x accuracy`; don't edit, run it again. {date}, `glioscope-bench {command}`, {build}.\n\n\
         - Machine: {machine}; load of the last minute {before} at the beginning, {after} at the end. Times \
         (submitted to done) are medians beside whatever else ran then. CPU times are those of all threads of \
         the program, software adapter included, and hardly depend on that: front and plots go by them where \
         they are known. Compare points of one run, not of two.\n\
         - Graphics: {adapter}.\n\
         - The measuring itself took: {took}.\n\
         - Memory: the most that the whole process had resident while a setting ran (VmHWM, reset before each; \
         on a software adapter with its buffers, on a graphics card without).\n\
         - Errors: root mean square and largest, over what is not empty; ΔE is CIE76 in CIELAB (D65) of the \
         displayed picture, RMS and largest.\n\
         - Pareto points, filled in the plots, are those that no other point of the same plot beats in cost \
         and RMS error. Tables hold them and the defaults; all points are in accuracy.csv.",
        date = run_start.date,
        command = command.join(" "),
        machine = machine(),
        before = load(run_start.load),
        after = load(load_average()),
        adapter = run_start.adapter,
        took = durations(measured),
    )?;
    for MeasuredFamily { family, curves, .. } in measured {
        writeln!(out, "\n## {}\n\n{}", family.title, family.about)?;
        let presets = front::preset_verdicts(family.defaults, curves);
        if !presets.is_empty() {
            write!(out, "\n{presets}")?;
        }
        for plot in plots.iter().filter(|p| p.family.name == family.name) {
            section(out, plot)?;
        }
    }
    Ok(())
}

fn section(out: &mut String, plot: &Plot<'_>) -> std::fmt::Result {
    let Some(first) = plot.curves.first() else { return Ok(()) };
    let truth_error = match first.truth_error {
        Some(e) => format!("itself off by {} (RMS)", number(e)),
        None => "taken as exact".to_owned(),
    };
    writeln!(
        out,
        "\n### {}\n\nTruth: {}; {truth_error}. Errors in {}.\n",
        first.scene, first.truth, first.unit
    )?;
    writeln!(out, "![error against time](images/{})\n", plot.file_name())?;
    if plot.family.defaults == Defaults::One {
        for line in front::scene_verdicts(&plot.curves) {
            writeln!(out, "{line}\n")?;
        }
    }
    writeln!(
        out,
        "| Kernel | Setting | CPU ms, median (quartiles) | ms | MiB | Error RMS | Error max | ΔE RMS, max | |\n\
         |---|---|--:|--:|--:|--:|--:|--:|---|"
    )?;
    for c in &plot.curves {
        for p in c.points.iter().filter(|p| p.is_pareto || p.is_default || c.axis == Axis::Knob) {
            let mib = p.peak_bytes.map_or("–".to_owned(), |b| (b >> 20).to_string());
            let delta_e = p.delta_e.map_or("–".to_owned(), |d| format!("{:.2}, {:.1}", d[0], d[1]));
            let marks = [(p.is_default, plot.family.defaults.label()), (p.is_pareto, "Pareto")];
            let marks: Vec<&str> = marks.iter().filter(|(is, _)| *is).map(|(_, word)| *word).collect();
            writeln!(
                out,
                "| {} | {} | {} | {} | {mib} | {} | {} | {delta_e} | {} |",
                c.kernel,
                p.setting,
                milliseconds(p.cpu),
                milliseconds(p.time),
                number(p.error_rms),
                number(p.error_max),
                marks.join(", ")
            )?;
        }
    }
    Ok(())
}

fn number(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e4).contains(&value.abs()) {
        format!("{value:.1e}")
    } else {
        format!("{value:.4}")
    }
}

fn milliseconds(timing: Option<Timing>) -> String {
    let digits = |v: f64| if v < 10.0 { format!("{v:.2}") } else { format!("{v:.0}") };
    timing.map_or("–".to_owned(), |t| {
        format!("{} ({} to {})", digits(t.median_ms), digits(t.q1_ms), digits(t.q3_ms))
    })
}
