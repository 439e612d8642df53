//! The voxel grid of a NIfTI header: sform, qform, units, and which form is in force.
//!
//! From `nifti1.h`, "3D image (volume) orientation and location in space": method 3 (sform) where
//! `sform_code > 0`, else method 2 (qform) where `qform_code > 0`, else method 1 (pixdim alone),
//! which does not distinguish left from right. All arithmetic is `f64`.

use glam::{DAffine3, DMat3, DVec3};
use serde::Serialize;

use super::nifti_header::{Fault, Header};
use super::placed::{grid_in_mm, is_sheared, report_unusual_spacing};
use crate::{Check, Grid, Sides, decimal};

/// What a grid was made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// The affine of `srow_x`, `srow_y`, `srow_z`.
    Sform,
    /// Quaternion, offset and pixdim.
    Qform,
    /// pixdim alone: left and right are unknown.
    Pixdim,
}

impl Form {
    /// Its name in the header.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sform => "sform",
            Self::Qform => "qform",
            Self::Pixdim => "pixdim",
        }
    }
}

/// The unit of length in `xyzt_units` and its size in millimetres; `None` when unknown.
pub fn length_unit(xyzt_units: i32) -> Option<(&'static str, f64)> {
    match xyzt_units & 7 {
        1 => Some(("m", 1000.0)),
        2 => Some(("mm", 1.0)),
        3 => Some(("µm", 1e-3)),
        _ => None,
    }
}

/// The grid and the form in force that it was made from.
pub(crate) fn grid_from_header(
    header: &Header,
    dims: [usize; 3],
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<(Grid, Form), Fault> {
    let spacing = Spacing::of(header, dims)?;
    let mm_per_unit = unit(header, name, checks);
    for (form, code) in [("qform", header.qform_code), ("sform", header.sform_code)] {
        if !(0..=5).contains(&code) {
            let meaning = if code > 0 { "used, but its space is unknown" } else { "taken as 0: not set" };
            checks.push(Check::warning(
                "form-code-unknown",
                format!("{name}: {form}_code {code} is not one of 0 to 5; {meaning}"),
            ));
        }
    }
    let sform = (header.sform_code > 0).then(|| grid_in_mm(sform(header), dims, mm_per_unit));
    let qform = (header.qform_code > 0)
        .then(|| qform(header, &spacing).and_then(|m| grid_in_mm(m, dims, mm_per_unit)));
    let (grid, form) = match (sform, qform) {
        (Some(Ok(s)), q) => {
            match q {
                Some(Ok(q)) => compare_forms(&s, &q, name, checks),
                Some(Err(why)) => {
                    checks.push(Check::note("qform-unusable", format!("{name}: qform not usable: {why}")));
                }
                None => {}
            }
            (s, Form::Sform)
        }
        (Some(Err(why)), Some(Ok(q))) => {
            checks.push(Check::warning(
                "sform-unusable",
                format!("{name}: sform not usable ({why}); the qform is used"),
            ));
            (q, Form::Qform)
        }
        (None, Some(Ok(q))) => (q, Form::Qform),
        (Some(Err(s)), Some(Err(q))) => {
            let found = format!("an sform that can't be used ({s}) and a qform that can't either ({q})");
            return Err(Fault::new("place-unusable", found, "one that can"));
        }
        (Some(Err(why)), None) => {
            let found = format!("an sform that can't be used ({why}) and no qform");
            return Err(Fault::new("place-unusable", found, "a matrix that can be inverted"));
        }
        (None, Some(Err(why))) => {
            let found = format!("a qform that can't be used ({why}) and no sform");
            return Err(Fault::new("place-unusable", found, "finite numbers and spacings above 0"));
        }
        (None, None) => {
            let diagonal = DMat3::from_diagonal(spacing.for_placing()?);
            let grid =
                grid_in_mm(DAffine3 { matrix3: diagonal, translation: DVec3::ZERO }, dims, mm_per_unit)
                    .and_then(|g| {
                        Grid::new(dims, g.world_from_voxel(), Sides::Unknown).map_err(|e| e.to_string())
                    })
                    .map_err(|why| Fault::new("place-unusable", why, "spacings above 0"))?;
            checks.push(Check::warning(
                "side-unknown",
                format!("{name}: neither sform nor qform is set: left and right are unknown"),
            ));
            (grid, Form::Pixdim)
        }
    };
    spacing.report(&grid, form, mm_per_unit, name, checks);
    if form == Form::Qform {
        report_quaternion(header, name, checks);
    }
    report_unusual_spacing(&grid, name, checks);
    if is_sheared(&grid) {
        checks.push(Check::note(
            "sheared",
            format!("{name}: the voxels are sheared (axes not at right angles)"),
        ));
    }
    Ok((grid, form))
}

/// pixdim 1 to 3 as stored, and the number of voxels along each axis.
struct Spacing {
    stored: [f64; 3],
    dims: [usize; 3],
}

impl Spacing {
    fn of(header: &Header, dims: [usize; 3]) -> Result<Self, Fault> {
        let stored = [header.pixdim[1], header.pixdim[2], header.pixdim[3]];
        let rank = header.dim[0].clamp(1, 3) as usize;
        for (axis, &value) in stored.iter().enumerate().take(rank) {
            if !value.is_finite() {
                let found = format!("pixdim[{}] = {value}", axis + 1);
                return Err(Fault::new("pixdim-not-finite", found, "a finite spacing"));
            }
        }
        Ok(Self { stored, dims })
    }

    /// Whether the spacing along `axis` is missing and irrelevant: there is only one voxel.
    fn is_assumed(&self, axis: usize) -> bool {
        self.dims[axis] == 1 && !(self.stored[axis].is_finite() && self.stored[axis] != 0.0)
    }

    /// Absolute values; 1 along an axis of one voxel without a stated spacing.
    fn for_placing(&self) -> Result<DVec3, Fault> {
        let mut out = DVec3::ONE;
        for axis in 0..3 {
            if self.is_assumed(axis) {
                continue;
            }
            if !(self.stored[axis] != 0.0) {
                let found = format!("pixdim[{}] = {}", axis + 1, self.stored[axis]);
                return Err(Fault::new("pixdim-zero", found, "a spacing above 0"));
            }
            out[axis] = self.stored[axis].abs();
        }
        Ok(out)
    }

    fn report(&self, grid: &Grid, form: Form, mm_per_unit: f64, name: &str, checks: &mut Vec<Check>) {
        for axis in 0..3 {
            let stored = self.stored[axis];
            if form != Form::Sform && self.is_assumed(axis) {
                checks.push(Check::warning(
                    "thickness-unknown",
                    format!(
                        "{name}: pixdim[{}] is {stored}; one unit assumed along an axis of one voxel",
                        axis + 1
                    ),
                ));
            }
            if form != Form::Sform && stored < 0.0 {
                checks.push(Check::warning(
                    "pixdim-negative",
                    format!("{name}: pixdim[{}] is {stored}; its size is used", axis + 1),
                ));
            }
        }
        let stated = DVec3::from_array(self.stored).abs() * mm_per_unit;
        let used = grid.spacing_mm();
        let off = |a: usize| self.dims[a] > 1 && (stated[a] - used[a]).abs() > 0.01 * used[a];
        if form == Form::Sform && (0..3).any(off) {
            checks.push(Check::warning(
                "pixdim-sform-disagree",
                format!(
                    "{name}: pixdim says {} mm, the sform {} mm; the sform is used, programs that use pixdim differ",
                    decimal::sizes(stated.to_array(), 4),
                    decimal::sizes(used.to_array(), 4)
                ),
            ));
        }
    }
}

fn unit(header: &Header, name: &str, checks: &mut Vec<Check>) -> f64 {
    match length_unit(header.xyzt_units) {
        Some(("mm", factor)) => factor,
        Some((unit, factor)) => {
            checks.push(Check::warning(
                "units-converted",
                format!(
                    "{name}: lengths are in {unit}; converted to mm (programs that ignore the unit differ)"
                ),
            ));
            factor
        }
        None => {
            let code = header.xyzt_units & 7;
            let what = if code == 0 { "no unit of length".into() } else { format!("unit code {code}") };
            checks.push(Check::warning("units-unknown", format!("{name}: {what}; mm assumed")));
            1.0
        }
    }
}

fn sform(header: &Header) -> DAffine3 {
    let column = |c: usize| DVec3::new(header.srow[0][c], header.srow[1][c], header.srow[2][c]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// `nifti1.h`, method 2: `x = R · (pixdim · (i, j, qfac·k)) + qoffset`.
fn qform(header: &Header, spacing: &Spacing) -> Result<DAffine3, String> {
    let spacing = spacing.for_placing().map_err(|fault| fault.found)?;
    let qfac = header.pixdim[0];
    if qfac.is_nan() {
        return Err("pixdim[0] (qfac) is NaN".into());
    }
    let rotation = rotation(header.quatern).ok_or("its quaternion is not finite")?;
    let flip = DVec3::new(1.0, 1.0, if qfac < 0.0 { -1.0 } else { 1.0 });
    Ok(DAffine3 {
        matrix3: rotation * DMat3::from_diagonal(spacing * flip),
        translation: DVec3::from_array(header.qoffset),
    })
}

/// Rotation of the quaternion `(a, b, c, d)` with `a = sqrt(1 - b² - c² - d²)`; where a² is below 1e-7,
/// `(b, c, d)` is normalised and `a` is 0, as in `nifti_quatern_to_mat44`.
fn rotation(quatern: [f64; 3]) -> Option<DMat3> {
    let [b, c, d] = quatern;
    let squares = b * b + c * c + d * d;
    if !squares.is_finite() {
        return None;
    }
    let a_squared = 1.0 - squares;
    let (a, b, c, d) = if a_squared < 1e-7 {
        let unit = 1.0 / squares.sqrt();
        (0.0, b * unit, c * unit, d * unit)
    } else {
        (a_squared.sqrt(), b, c, d)
    };
    Some(DMat3::from_cols(
        DVec3::new(a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)),
        DVec3::new(2.0 * (b * c - a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d + a * b)),
        DVec3::new(2.0 * (b * d + a * c), 2.0 * (c * d - a * b), a * a + d * d - c * c - b * b),
    ))
}

fn report_quaternion(header: &Header, name: &str, checks: &mut Vec<Check>) {
    let norm = header.quatern.iter().map(|q| q * q).sum::<f64>().sqrt();
    if norm > 1.0 + 1e-5 {
        checks.push(Check::warning(
            "quaternion-norm",
            format!("{name}: the quaternion's length is {norm:.6}, above 1; made 1"),
        ));
    }
    let qfac = header.pixdim[0];
    if qfac.abs() != 1.0 {
        let text =
            format!("{name}: pixdim[0] (qfac) is {qfac}, taken as {}", if qfac < 0.0 { -1 } else { 1 });
        // The standard defines 0 as 1; any other value is ambiguous.
        checks.push(if qfac == 0.0 { Check::note("qfac", text) } else { Check::warning("qfac", text) });
    }
}

/// The affine, converted to millimetres, as a grid; or why it is unusable.
/// Reports forms that put an outer corner more than half the finest spacing apart.
fn compare_forms(s: &Grid, q: &Grid, name: &str, checks: &mut Vec<Check>) {
    if s.same_place(q, 0.5) {
        return;
    }
    let distance_mm =
        s.corners_mm().iter().zip(q.corners_mm()).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
    let determinant = |g: &Grid| g.world_from_voxel().matrix3.determinant();
    let sides = if determinant(s) * determinant(q) < 0.0 {
        "; one mirrors the other, so left and right may be swapped"
    } else {
        ""
    };
    checks.push(Check::warning(
        "sform-qform-disagree",
        format!(
            "{name}: sform and qform are up to {} mm apart{sides}; the sform is used",
            decimal::text(distance_mm, 2)
        ),
    ));
}
