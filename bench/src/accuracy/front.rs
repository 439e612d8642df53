//! The Pareto front of cost and error, and where the defaults lie relative to it.

use std::fmt::Write;

use super::{Axis, Curve, Defaults, Point};

/// Marks the Pareto points, those that no other point of the same scene dominates, on curves of error against time.
/// `curves` are those of one family.
pub(super) fn mark_pareto(curves: &mut [Curve]) {
    let cost = |p: &Point| p.cost().map(|t| (t.median_ms, p.error_rms)).filter(|c| !c.1.is_nan());
    for number in 0..curves.len() {
        let Some(own) = curves.get(number).filter(|c| c.axis == Axis::Time) else { continue };
        let rivals: Vec<(f64, f64)> = curves
            .iter()
            .filter(|c| c.scene == own.scene)
            .flat_map(|c| c.points.iter().filter_map(cost))
            .collect();
        let is_dominated =
            |(t, e): (f64, f64)| rivals.iter().any(|&(rt, re)| rt <= t && re <= e && (rt < t || re < e));
        for point in curves.get_mut(number).into_iter().flat_map(|c| &mut c.points) {
            point.is_pareto = cost(point).is_some_and(|own| !is_dominated(own));
        }
    }
}

/// Ratios of `rival`'s cost and error to those of `own` if it dominates: neither is above 1, and one is below.
fn dominance_ratios(own: &Point, rival: &Point) -> Option<[f64; 2]> {
    let ratios = [rival.cost()?.median_ms / own.cost()?.median_ms, rival.error_rms / own.error_rms];
    (ratios.iter().all(|r| *r <= 1.0) && ratios != [1.0; 2]).then_some(ratios)
}

/// Product of all ratios, by which the best of several rivals is chosen.
fn product<'a>(ratios: impl IntoIterator<Item = &'a [f64; 2]>) -> f64 {
    ratios.into_iter().flatten().product()
}

/// Verdicts on the defaults among the curves of one scene, for the page; empty without a default.
pub(super) fn scene_verdicts(curves: &[&Curve]) -> Vec<String> {
    curves.iter().flat_map(|c| &c.points).filter(|p| p.is_default).map(|p| verdict(curves, p)).collect()
}

/// Whether a default lies on the front, and otherwise which point dominates it.
fn verdict(curves: &[&Curve], own: &Point) -> String {
    let name = &own.setting;
    if own.is_pareto {
        return format!("The default ({name}) lies on the measured front.");
    }
    let best_of = |curves: &[&Curve]| -> Option<String> {
        let rivals = curves.iter().flat_map(|c| c.points.iter().map(move |p| (&c.kernel, p)));
        let (kernel, p, [t, e]) = rivals
            .filter_map(|(kernel, p)| Some((kernel, p, dominance_ratios(own, p)?)))
            .min_by(|a, b| product([&a.2]).total_cmp(&product([&b.2])))?;
        Some(format!("{kernel}, {}, has {t:.2} times its cost and {e:.2} times its error", p.setting))
    };
    let is_own = |c: &&&Curve| c.points.iter().any(|p| std::ptr::eq(p, own));
    let own_kernel: Vec<&Curve> = curves.iter().filter(is_own).copied().collect();
    match (best_of(&own_kernel), best_of(curves)) {
        (Some(_), Some(best)) => {
            format!("**The default ({name}) does not lie on the measured front**: {best}.")
        }
        (None, Some(best)) => {
            format!("The default ({name}) lies on the front of its own kernel; of the other kernels, {best}.")
        }
        (_, None) => format!("The default ({name}) has no cost or no error."),
    }
}

/// Verdicts on the presets, one line each: whether no setting of the same kernel with at least as many pixels dominates
/// the preset on every scene. Settings with fewer pixels don't count, because no error here measures the detail that
/// mask contours lose with resolution.
pub(super) fn preset_verdicts(defaults: Defaults, curves: &[Curve]) -> String {
    let mut out = String::new();
    let measured: Vec<(&Curve, &Point)> = curves
        .iter()
        .filter(|_| defaults == Defaults::Presets)
        .flat_map(|c| c.points.iter().map(move |p| (c, p)))
        .collect();
    let mut listed: Vec<(&str, &str)> = Vec::new();
    for (curve, point) in measured.iter().filter(|(_, p)| p.is_default) {
        let name = (curve.kernel.as_str(), point.setting.as_str());
        if listed.contains(&name) {
            continue;
        }
        listed.push(name);
        let same = |(c, p): &&(&Curve, &Point)| (c.kernel.as_str(), p.setting.as_str()) == name;
        let own: Vec<_> = measured.iter().filter(same).collect();
        // Ratios of a rival's costs and errors to the preset's on each scene; `None` unless it dominates on all.
        let ratios = |rival: &(&Curve, &Point)| -> Option<Vec<[f64; 2]>> {
            let on_scene = |(c, p): &&(&Curve, &Point)| {
                let is_same_setting = |(rc, rp): &&(&Curve, &Point)| {
                    rc.scene == c.scene && rc.kernel == rival.0.kernel && rp.setting == rival.1.setting
                };
                let (_, rp) = measured.iter().find(is_same_setting)?;
                dominance_ratios(p, rp).filter(|_| rp.pixel_share >= p.pixel_share - 1e-9)
            };
            own.iter().map(on_scene).collect()
        };
        // Names of curves off a kernel's path begin with the kernel's name.
        let rivals = measured.iter().filter(|(c, _)| c.kernel.starts_with(&curve.kernel));
        let dominating = rivals.filter_map(|r| Some((r, ratios(r)?)));
        let line = match dominating.min_by(|a, b| product(&a.1).total_cmp(&product(&b.1))) {
            None => format!(
                "- {}, {}: on the measured front; no setting with at least as many pixels is as fast and as accurate \
                 on every scene.",
                name.0, name.1
            ),
            Some(((c, p), ratios)) => {
                let ratio_texts: Vec<String> = ratios
                    .iter()
                    .map(|[t, e]| format!("{t:.2} times its cost and {e:.2} times its error"))
                    .collect();
                format!(
                    "- **{}, {}: not on the measured front**; {}, {}, has, scene by scene, {}.",
                    name.0,
                    name.1,
                    c.kernel,
                    p.setting,
                    ratio_texts.join("; ")
                )
            }
        };
        // Writing to a string can't fail.
        let _ = writeln!(out, "{line}");
    }
    out
}
