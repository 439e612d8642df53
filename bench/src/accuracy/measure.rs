//! Times, memory, errors, and which points are worth having.

use std::io::Write;

use glam::{DMat3, DVec3};
use serde::Serialize;

use super::{Axis, Curve, Point};

/// Milliseconds of processor time that this process's threads have had; nothing on other systems than
/// Linux.
pub(super) fn cpu_ms() -> Option<f64> {
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let one = |task: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let line = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        line.split_whitespace().next()?.parse().ok()
    };
    // A thread that ends while it is asked is one that had nothing to do.
    Some(tasks.filter_map(one).sum::<f64>() * 1e-6)
}

/// Quartiles of several runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// Median.
    pub median_ms: f64,
    /// A quarter of the runs took at most this.
    pub q1_ms: f64,
    /// Three quarters did.
    pub q3_ms: f64,
    /// Runs, at least one.
    pub runs: usize,
}

/// First quartile, median and third, between neighbours where they fall between; `None` for none.
pub fn quartiles(values: &[f64]) -> Option<[f64; 3]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |part: f64| {
        let x = part * sorted.len().checked_sub(1)? as f64;
        let (low, high) = (sorted.get(x.floor() as usize)?, sorted.get(x.ceil() as usize)?);
        Some(low + (high - low) * x.fract())
    };
    Some([at(0.25)?, at(0.5)?, at(0.75)?])
}

/// Sets the peak back to what is resident now; does nothing where the system has no such file.
pub(super) fn reset_peak() {
    if let Ok(mut file) = std::fs::OpenOptions::new().write(true).open("/proc/self/clear_refs") {
        // Not being able to only makes the peak an older one.
        let _ = file.write_all(b"5");
    }
}

/// Most bytes that this process had resident since the peak was last reset: VmHWM of
/// /proc/self/status; nothing on other systems.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// The system's load of the last minute, processes; nothing on other systems.
pub fn load_average() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// Errors collected one by one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    squares: f64,
    count: f64,
    max: f64,
}

impl Errors {
    /// Takes in one, of either sign.
    pub fn add(&mut self, error: f64) {
        self.squares += error * error;
        self.count += 1.0;
        // A NaN must be seen.
        if error.is_nan() || error.abs() > self.max {
            self.max = error.abs();
        }
    }

    /// Root mean square; 0 of none.
    pub fn rms(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }

    /// Largest absolute one; 0 of none.
    pub fn max(&self) -> f64 {
        self.max
    }
}

/// Colour difference CIE76: the distance in CIELAB, D65 white, of two gamma-encoded sRGB colours, 0 to
/// 1 each channel. About 2.3 is just noticed (Mahy et al. 1994).
pub fn delta_e(a: [f64; 3], b: [f64; 3]) -> f64 {
    lab(a).distance(lab(b))
}

fn lab(encoded: [f64; 3]) -> DVec3 {
    let linear = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    // IEC 61966-2-1: linear sRGB to XYZ, columns red, green, blue.
    let xyz_from_rgb = DMat3::from_cols(
        DVec3::new(0.4124, 0.2126, 0.0193),
        DVec3::new(0.3576, 0.7152, 0.1192),
        DVec3::new(0.1805, 0.0722, 0.9505),
    );
    let rgb = DVec3::from_array(encoded.map(|c| linear(c.clamp(0.0, 1.0))));
    let white = xyz_from_rgb * DVec3::ONE;
    let bent = |t: f64| {
        let d = 6.0 / 29.0;
        if t > d * d * d { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 }
    };
    let v = xyz_from_rgb * rgb / white;
    let [x, y, z] = [v.x, v.y, v.z].map(bent);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Linear radiance as displayed: gamma-encoded sRGB, cut off at 0 and 1.
pub(super) fn displayed(linear: DVec3) -> [f64; 3] {
    linear.to_array().map(|c| {
        let c = c.clamp(0.0, 1.0);
        if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
    })
}

/// Colours against true ones, all 0 to 1 and gamma-encoded: RMS and maximum of ΔE.
pub(super) fn delta_e_of(pairs: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> [f64; 2] {
    let mut errors = Errors::default();
    pairs.for_each(|(a, b)| errors.add(delta_e(a, b)));
    [errors.rms(), errors.max()]
}

/// Marks the points that no other of the same family and scene is better than, where error stands
/// against time.
pub fn mark_pareto(curves: &mut [Curve]) {
    let cost = |p: &Point| p.cost().map(|t| (t.median_ms, p.error_rms)).filter(|c| !c.1.is_nan());
    for number in 0..curves.len() {
        let Some(own) = curves.get(number).filter(|c| c.axis == Axis::Time) else { continue };
        let beside = |c: &&Curve| c.family == own.family && c.scene == own.scene;
        let rivals: Vec<(f64, f64)> =
            curves.iter().filter(beside).flat_map(|c| c.points.iter().filter_map(cost)).collect();
        let better =
            |(t, e): (f64, f64)| rivals.iter().any(|&(rt, re)| rt <= t && re <= e && (rt < t || re < e));
        for point in curves.get_mut(number).into_iter().flat_map(|c| &mut c.points) {
            point.is_pareto = cost(point).is_some_and(|own| !better(own));
        }
    }
}
