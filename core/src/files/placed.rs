//! Voxel grids from the numbers of any header: units, plausible sizes, what is worth a check.

use glam::DAffine3;

use crate::{Check, Grid, Sides, decimal};

/// Largest plausible matrix entry in millimetres: ten kilometres.
const MAX_MM: f64 = 1e7;
/// Smallest plausible spacing in millimetres: a hundredth of an atom.
pub(crate) const MIN_SPACING_MM: f64 = 1e-9;

/// Spacings of images of patients and specimens in millimetres: others load with a warning.
const USUAL_SPACINGS_MM: [f64; 2] = [1e-3, 100.0];

/// The size of a unit of length in millimetres, by its name in a header; `None` for other names.
pub(super) fn mm_per_unit(name: &str) -> Option<f64> {
    Some(match name.to_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1.0,
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre"
        | "micrometres" => 1e-3,
        "nm" | "nanometer" | "nanometers" | "nanometre" | "nanometres" => 1e-6,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 10.0,
        "m" | "meter" | "meters" | "metre" | "metres" => 1000.0,
        _ => return None,
    })
}

/// The grid of a matrix in a header's unit of length, or why it can't be one.
pub(super) fn grid_in_mm(matrix: DAffine3, dims: [usize; 3], mm_per_unit: f64) -> Result<Grid, String> {
    let mm =
        DAffine3 { matrix3: matrix.matrix3 * mm_per_unit, translation: matrix.translation * mm_per_unit };
    let grid = Grid::new(dims, mm, Sides::Known).map_err(|e| {
        let text = e.to_string();
        text.strip_prefix("found ").and_then(|t| t.split(", expected").next()).unwrap_or(&text).to_owned()
    })?;
    let m = mm.matrix3;
    let largest = [m.x_axis, m.y_axis, m.z_axis, mm.translation]
        .iter()
        .fold(0.0_f64, |most, v| most.max(v.abs().max_element()));
    if largest > MAX_MM {
        return Err(format!("{largest:.3e} mm is no patient's size"));
    }
    if grid.spacing_mm().min_element() < MIN_SPACING_MM {
        return Err(format!("a spacing of {:.3e} mm", grid.spacing_mm().min_element()));
    }
    Ok(grid)
}

/// `grid` without a statement of left and right.
pub(super) fn without_sides(grid: &Grid) -> Result<Grid, String> {
    Grid::new(grid.dims(), grid.world_from_voxel(), Sides::Unknown).map_err(|e| e.to_string())
}

/// Reports spacings that no image of a patient has.
pub(super) fn report_unusual_spacing(grid: &Grid, name: &str, checks: &mut Vec<Check>) {
    let finest = grid.spacing_mm().min_element();
    let coarsest = grid.spacing_mm().max_element();
    let [low, high] = USUAL_SPACINGS_MM;
    if finest < low || coarsest > high {
        checks.push(Check::warning(
            "spacing-unusual",
            format!(
                "{name}: found voxels of {} mm, expected {low} to {high} mm; the unit may be wrong",
                decimal::sizes(grid.spacing_mm().to_array(), 4)
            ),
        ));
    }
}

/// Whether axes are not at right angles.
pub(super) fn is_sheared(grid: &Grid) -> bool {
    let m = grid.world_from_voxel().matrix3;
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|c| c / c.length());
    [x.dot(y), x.dot(z), y.dot(z)].iter().any(|cosine| cosine.abs() > 1e-3)
}
