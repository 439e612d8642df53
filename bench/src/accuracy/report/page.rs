//! The numbers as CSV, and the page that says what they mean.

use std::{
    fmt::Write,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use glioscope_render::{
    Gpu,
    accuracy::{Axis, Curve, Family, Point, Timing, load_average},
};

use super::plot::Plot;

/// When and where a run began.
#[derive(Debug)]
pub(super) struct Begun {
    date: String,
    adapter: String,
    load: Option<f64>,
}

impl Begun {
    pub fn now(gpu: &Gpu) -> Self {
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
        Self { date: date(seconds / 86_400), adapter: gpu.describe(), load: load_average() }
    }
}

/// The day so many days after 1970-01-01, as an ISO date.
fn date(mut days: u64) -> String {
    let is_leap = |y: u64| (y.is_multiple_of(4) && !y.is_multiple_of(100)) || y.is_multiple_of(400);
    let mut year = 1970;
    while days >= 365 + u64::from(is_leap(year)) {
        days -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(is_leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 1;
    for length in lengths {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    format!("{year}-{month:02}-{:02}", days + 1)
}

/// Processor, cores and system, as far as the system says.
fn machine() -> String {
    let value = |file: &str, key: &str| -> Option<String> {
        let text = std::fs::read_to_string(file).ok()?;
        let line = text.lines().find(|l| l.starts_with(key))?;
        let (_, value) = line.split_once([':', '='])?;
        Some(value.trim().trim_matches('"').to_owned())
    };
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let processor = value("/proc/cpuinfo", "model name").unwrap_or_else(|| "processor unknown".to_owned());
    let system = value("/etc/os-release", "PRETTY_NAME").unwrap_or_else(|| std::env::consts::OS.to_owned());
    format!("{cores} cores of {processor}, {system}")
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// A number, or nothing.
fn cell(value: Option<f64>) -> String {
    value.map(|v| format!("{v:e}")).unwrap_or_default()
}

/// A row a point.
pub(super) fn csv(curves: &[Curve]) -> String {
    let mut out = "family,kernel,scene,knob,setting,value,median_ms,q1_ms,q3_ms,cpu_median_ms,cpu_q1_ms,cpu_q3_ms,runs,peak_bytes,error_rms,\
                   error_max,unit,delta_e_rms,delta_e_max,truth,truth_error,default,pareto\n"
        .to_owned();
    for c in curves {
        for p in &c.points {
            let time = |of: fn(&Timing) -> f64| cell(p.time.as_ref().map(of));
            let cpu = |of: fn(&Timing) -> f64| cell(p.cpu.as_ref().map(of));
            let fields = [
                c.family.name().to_owned(),
                quoted(&c.kernel),
                quoted(&c.scene),
                quoted(c.knob),
                quoted(&p.setting),
                cell(Some(p.value)),
                time(|t| t.median_ms),
                time(|t| t.q1_ms),
                time(|t| t.q3_ms),
                cpu(|t| t.median_ms),
                cpu(|t| t.q1_ms),
                cpu(|t| t.q3_ms),
                p.time.map(|t| t.runs.to_string()).unwrap_or_default(),
                p.peak_bytes.map(|b| b.to_string()).unwrap_or_default(),
                cell(Some(p.error_rms)),
                cell(Some(p.error_max)),
                quoted(c.unit),
                cell(p.delta_e.map(|d| d[0])),
                cell(p.delta_e.map(|d| d[1])),
                quoted(&c.truth),
                cell(c.truth_error),
                p.is_default.to_string(),
                p.is_pareto.to_string(),
            ];
            out.push_str(&fields.join(","));
            out.push('\n');
        }
    }
    out
}

/// What is swept, and what the default weighs against what.
fn about(family: Family) -> &'static str {
    match family {
        Family::Context => {
            "The picture of the march alone, over white, against the same rays in `f64` without table, bricks, \
             jitter or early end. The device ends a ray that is as good as opaque and packs colours into 16 \
             bits; with the jitter of the first cell these set a floor. The default, 0.5 mm, is half of the \
             finest usual spacing (1 mm): each voxel is met by two cells. While the camera moves the program \
             takes 1 mm."
        }
        Family::Ambient => {
            "Two truths. The hemisphere is what the pass stands for: what it lacks against it no number of \
             samples brings, because the pass knows no normals and counts half of the ball as light. Its own \
             integral is what its samples come to. The default, 12 pairs, is where the second error has fallen \
             to a tenth of what the first leaves in any case (which more pairs make worse, not better); the time is \
             that of the whole frame, on this adapter hardly that of the pairs."
        }
        Family::Occlusion => {
            "Slices after the paper drift with the number of slices (their penumbra depends on it), so more \
             slices are no better there; the mended ones converge, to a limit with a bias against Monte \
             Carlo, where its error stops falling; cones fall to the standard error of Monte Carlo itself. Time is \
             a whole picture, submitted to done. Aperture 60°. The mended default, 2 mm, 2x2 points and a reference \
             of 2.5 mm: on soft media slices half as thick cost twice as much and gain nothing, half as many lose \
             half; more points take up to three times the time for the same error; a reference of 5 mm has a sixth \
             more error there (and no less on labels), 10 mm more than twice as much. Labels need thinner slices, or \
             cones. The cones' default reads intensities at level 1 at most (level 2 saves a quarter of the time for \
             1.6 times the error), and labels themselves, whose rays jump from face to face: that is both faster and \
             righter than any level."
        }
        Family::View => {
            "What the window draws, with the black of places that no light reaches not softened, against Monte \
             Carlo at some of its pixels. The path is the one that the presets draft, balanced and reference are on \
             and that the automatic mode moves along; beside it pixels against thickness of slices or side of \
             cells, from which the path was chosen, and one knob changed from draft or balanced. Slices of 1 mm \
             have half the error of 2 mm where surfaces are opaque; those of 0.7 mm, the reference, gain a \
             twentieth, thinner ones nothing; nor do more points than 2x2 in a footprint. Down the path pixels go \
             first, to a fifth along each side, and slices grow a little thicker with them. Cones are there sooner, \
             and serve what is solid; slices are righter where surfaces are opaque. The headlight is another model, \
             held against no truth of light."
        }
        Family::Ellipsoids => {
            "The error is what the volume exceeds the minimum by; the tolerance is a certificate, so the error \
             is never above it. Time is that of all components one after another, hull corners given. The \
             default, exchange at 1e-7, costs little over 1e-3, because the last digits come from Newton \
             steps, and keeps volumes right in every digit that is shown."
        }
        Family::Skeleton => {
            "Boundary whose extent is below θ times its distance is summed as one charge. First the force: the \
             error is the angle to a plain sum over all charges at every voxel inside, which is largest where \
             the force all but vanishes; time is that of the field. Then, not with --quick, where the mask is \
             too small, the whole skeleton: how far its points and those of the exact sum's lie from each \
             other. That error doesn't fall evenly: a streamline that turns off elsewhere moves many points at \
             once."
        }
        Family::Resampling => {
            "There is no knob: images are brought onto another grid trilinearly. What there is to know is the \
             error by the spacing of the image, of second order in it. Structures of less than four voxels are \
             lost in any case. Masks go to the nearest voxel, which is exact to half a voxel and not drawn here."
        }
        Family::Half => {
            "Transmittance and colour of a slab, put together from slices front to back, each stored value \
             rounded. Half floats are emulated, so there is no time. They would halve the picture's buffers (20 \
             to 10 bytes a pixel), and lose the light of thin slices: an opacity below 2⁻¹¹ no longer changes a \
             transmittance of 1. Second, what directional occlusion stores from slice to slice (the paper: half \
             floats, 220 to 1563 slices), counted in full and rounded when stored: the buffers stop changing, at \
             4000 slices with more than half of the light wrong. The program adds up in 32 bits everywhere; \
             only finished pixels are packed."
        }
    }
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

/// Shares of `own`'s cost and error that `rival` has, where it beats it: neither is above 1, and one is below.
fn beaten_by(own: &Point, rival: &Point) -> Option<[f64; 2]> {
    let shares = [rival.cost()?.median_ms / own.cost()?.median_ms, rival.error_rms / own.error_rms];
    (shares.iter().all(|s| *s <= 1.0) && shares != [1.0; 2]).then_some(shares)
}

/// How much is left, by which the best of several rivals is told.
fn left<'a>(shares: impl IntoIterator<Item = &'a [f64; 2]>) -> f64 {
    shares.into_iter().flatten().product()
}

/// Whether a default lies on the front, and what beats it where it doesn't.
fn verdict(curves: &[&Curve], own: &Point) -> String {
    let name = &own.setting;
    if own.is_pareto {
        return format!("The default ({name}) lies on the measured front.");
    }
    let best_of = |curves: &[&Curve]| -> Option<String> {
        let rivals = curves.iter().flat_map(|c| c.points.iter().map(move |p| (&c.kernel, p)));
        let (kernel, p, [t, e]) = rivals
            .filter_map(|(kernel, p)| Some((kernel, p, beaten_by(own, p)?)))
            .min_by(|a, b| left([&a.2]).total_cmp(&left([&b.2])))?;
        Some(format!("{kernel}, {}, takes {t:.2} of its time and has {e:.2} of its error", p.setting))
    };
    let is_own = |c: &&&Curve| c.points.iter().any(|p| std::ptr::eq(p, own));
    let own_kernel: Vec<&Curve> = curves.iter().filter(is_own).copied().collect();
    match (best_of(&own_kernel), best_of(curves)) {
        (Some(_), Some(best)) => {
            format!("**The default ({name}) does not lie on the measured front**: {best}.")
        }
        (None, Some(best)) => {
            format!("The default ({name}) lies on the front of its own kernel; of the others, {best}.")
        }
        (_, None) => format!("The default ({name}) has no time, or no error."),
    }
}

/// Whether the presets lie on the front of their own kernel over all scenes: whether no setting with at least as many
/// pixels is as fast and as right on each of them. Pixels aren't weighed against light: what contours of masks lose with
/// them no error here counts.
fn presets(out: &mut String, curves: &[Curve]) -> std::fmt::Result {
    let measured: Vec<(&Curve, &Point)> = curves
        .iter()
        .filter(|c| c.family == Family::View)
        .flat_map(|c| c.points.iter().map(move |p| (c, p)))
        .collect();
    let mut said: Vec<(&str, &str)> = Vec::new();
    writeln!(out)?;
    for (curve, point) in measured.iter().filter(|(_, p)| p.is_default) {
        let name = (curve.kernel.as_str(), point.setting.as_str());
        if said.contains(&name) {
            continue;
        }
        said.push(name);
        let same = |(c, p): &&(&Curve, &Point)| (c.kernel.as_str(), p.setting.as_str()) == name;
        let own: Vec<_> = measured.iter().filter(same).collect();
        // Times and errors of a rival to the preset's, on each scene; nothing where it is no rival on one.
        let ratios = |rival: &(&Curve, &Point)| -> Option<Vec<[f64; 2]>> {
            let on_scene = |(c, p): &&(&Curve, &Point)| {
                let beside = |(rc, rp): &&(&Curve, &Point)| {
                    rc.scene == c.scene && rc.kernel == rival.0.kernel && rp.setting == rival.1.setting
                };
                let (_, rp) = measured.iter().find(beside)?;
                beaten_by(p, rp).filter(|_| rp.pixel_share >= p.pixel_share - 1e-9)
            };
            own.iter().map(on_scene).collect()
        };
        // Settings beside a kernel's path are named after it.
        let rivals = measured.iter().filter(|(c, _)| c.kernel.starts_with(&curve.kernel));
        let better = rivals.filter_map(|r| Some((r, ratios(r)?)));
        match better.min_by(|a, b| left(&a.1).total_cmp(&left(&b.1))) {
            None => writeln!(
                out,
                "- {}, {}: on the measured front; nothing with as many pixels is as fast and as right on every scene.",
                name.0, name.1
            )?,
            Some(((c, p), ratios)) => {
                let words: Vec<String> = ratios
                    .iter()
                    .map(|[t, e]| format!("{t:.2} of its time and {e:.2} of its error"))
                    .collect();
                writeln!(
                    out,
                    "- **{}, {}: not on the measured front**; {}, {}, takes {}.",
                    name.0,
                    name.1,
                    c.kernel,
                    p.setting,
                    words.join(", then ")
                )?;
            }
        }
    }
    Ok(())
}

/// The page; pictures are in the folder `images` beside it.
pub(super) fn markdown(
    curves: &[Curve],
    plots: &[Plot],
    took: &[(Family, Duration)],
    begun: &Begun,
) -> String {
    let mut out = String::new();
    // Writing to a string can't fail.
    let _ = write_page(&mut out, curves, plots, took, begun);
    out
}

/// How long each family took, truths and settings together.
pub(super) fn durations(took: &[(Family, Duration)]) -> String {
    let one = |(family, time): &(Family, Duration)| format!("{} {:.1} s", family.name(), time.as_secs_f64());
    let parts: Vec<String> = took.iter().map(one).collect();
    let total: Duration = took.iter().map(|t| t.1).sum();
    format!("{}; {:.1} s in all", parts.join(", "), total.as_secs_f64())
}

fn write_page(
    out: &mut String,
    curves: &[Curve],
    plots: &[Plot],
    took: &[(Family, Duration)],
    begun: &Begun,
) -> std::fmt::Result {
    let command: Vec<String> = std::env::args().skip(1).collect();
    let load = |l: Option<f64>| l.map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    let build =
        if cfg!(debug_assertions) { "dev profile, kernels at opt-level 2" } else { "release profile" };
    writeln!(
        out,
        "# Accuracy: error against run time\n\n\
         Made by `glioscope accuracy` (`./x accuracy`); don't edit, run it again. {date}, `glioscope {command}`, \
         {build}.\n\n\
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
        date = begun.date,
        command = command.join(" "),
        machine = machine(),
        before = load(begun.load),
        after = load(load_average()),
        adapter = begun.adapter,
        took = durations(took),
    )?;
    for family in Family::ALL {
        if !curves.iter().any(|c| c.family == family) {
            continue;
        }
        writeln!(out, "\n## {}\n\n{}", family.title(), about(family))?;
        if family == Family::View {
            presets(out, curves)?;
        }
        for plot in plots {
            let own: Vec<&Curve> =
                plot.curves.iter().filter_map(|n| curves.get(*n)).filter(|c| c.family == family).collect();
            if let Some(first) = own.first() {
                section(out, plot, &own, first)?;
            }
        }
    }
    Ok(())
}

fn section(out: &mut String, plot: &Plot, curves: &[&Curve], first: &Curve) -> std::fmt::Result {
    let off = match first.truth_error {
        Some(e) => format!("itself off by {} (RMS)", number(e)),
        None => "taken as exact".to_owned(),
    };
    let (scene, truth, unit) = (&plot.scene, &first.truth, first.unit);
    writeln!(out, "\n### {scene}\n\nTruth: {truth}; {off}. Errors in {unit}.\n")?;
    writeln!(out, "![error against time](images/{}.png)\n", plot.name)?;
    for point in
        curves.iter().flat_map(|c| &c.points).filter(|p| p.is_default && first.family != Family::View)
    {
        writeln!(out, "{}\n", verdict(curves, point))?;
    }
    writeln!(
        out,
        "| Kernel | Setting | CPU ms, median (quartiles) | ms | MiB | Error RMS | Error max | ΔE RMS, max | |\n\
         |---|---|--:|--:|--:|--:|--:|--:|---|"
    )?;
    let shown = |p: &&Point| p.is_pareto || p.is_default || first.axis == Axis::Knob;
    for (c, p) in curves.iter().flat_map(|c| c.points.iter().filter(shown).map(move |p| (c, p))) {
        let mib = p.peak_bytes.map_or("–".to_owned(), |b| (b >> 20).to_string());
        let delta_e = p.delta_e.map_or("–".to_owned(), |d| format!("{:.2}, {:.1}", d[0], d[1]));
        let marks = match (p.is_default, p.is_pareto) {
            (true, true) => format!("{}, Pareto", c.family.default_word()),
            (true, false) => c.family.default_word().to_owned(),
            (false, true) => "Pareto".to_owned(),
            (false, false) => String::new(),
        };
        writeln!(
            out,
            "| {} | {} | {} | {} | {mib} | {} | {} | {delta_e} | {marks} |",
            c.kernel,
            p.setting,
            milliseconds(p.cpu),
            milliseconds(p.time),
            number(p.error_rms),
            number(p.error_max)
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::date;

    #[test]
    fn days_become_dates() {
        assert_eq!(date(0), "1970-01-01");
        assert_eq!(date(59), "1970-03-01");
        assert_eq!(date(11_016), "2000-02-29");
        assert_eq!(date(20_781), "2026-11-24");
    }
}
