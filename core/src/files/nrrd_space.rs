//! The voxel grid of an NRRD header: which axes are in space, and where.

use glam::{DAffine3, DMat3, DVec3};

use super::{
    nifti_header::Fault,
    nrrd_header::Fields,
    placed::{grid_in_mm, is_sheared, mm_per_unit, report_unusual_spacing, without_sides},
    text_header::quoted,
};
use crate::{Check, Grid};

/// Grid and frames of a file.
pub(super) struct Placed {
    pub(super) grid: Grid,
    pub(super) place_from: &'static str,
    pub(super) unit: Option<String>,
    /// Product of the axes in front of those in space.
    pub(super) lead: u64,
    /// Product of the axes behind them.
    pub(super) trail: u64,
}

/// A world space: the sign of its first two axes in RAS, or `None` where it names no sides.
struct Space {
    to_ras: Option<DVec3>,
    dimension: usize,
}

impl Space {
    fn of(fields: &Fields) -> Result<Option<Self>, Fault> {
        match (fields.get("space"), fields.get("spacedimension")) {
            (Some(_), Some(_)) => Err(Fault::new(
                "nrrd-space",
                "both space and space dimension",
                "one of them, as the format forbids both",
            )),
            (Some(name), None) => Self::named(name).map(Some),
            (None, Some(text)) => {
                let wrong =
                    || Fault::new("nrrd-space", format!("space dimension {}", quoted(text)), "2 or 3");
                let dimension = text.parse().ok().filter(|n| (2..=3).contains(n)).ok_or_else(wrong)?;
                Ok(Some(Self { to_ras: None, dimension }))
            }
            (None, None) => Ok(None),
        }
    }

    fn named(name: &str) -> Result<Self, Fault> {
        let lower = name.to_lowercase();
        let (base, dimension) = match lower.strip_suffix("-time").or(match lower.as_str() {
            "rast" | "last" | "lpst" => lower.strip_suffix('t'),
            _ => None,
        }) {
            Some(base) => (base, 4),
            None => (lower.as_str(), 3),
        };
        let to_ras = match base {
            "right-anterior-superior" | "ras" => Some(DVec3::ONE),
            "left-anterior-superior" | "las" => Some(DVec3::new(-1.0, 1.0, 1.0)),
            "left-posterior-superior" | "lps" => Some(DVec3::new(-1.0, -1.0, 1.0)),
            "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => None,
            _ => {
                let expected = "RAS, LAS, LPS, scanner-xyz, 3D-right-handed or 3D-left-handed";
                return Err(Fault::new("nrrd-space", format!("space {}", quoted(name)), expected));
            }
        };
        Ok(Self { to_ras, dimension })
    }
}

impl Fields {
    /// The grid, whose axes are those with a direction; without directions, those whose kinds are in space.
    pub(super) fn place(&self, sizes: &[u64], name: &str, checks: &mut Vec<Check>) -> Result<Placed, Fault> {
        let kinds = self.words("kinds", sizes.len())?;
        let space = Space::of(self)?;
        let directions = self.directions(sizes.len(), space.as_ref())?;
        let in_space = self.axes_in_space(kinds.as_deref(), directions.as_deref(), sizes)?;
        let (first, count) = in_space;
        let end = first + count;
        let mut dims = [1; 3];
        for (dim, &size) in dims.iter_mut().zip(&sizes[first..end]) {
            *dim = usize::try_from(size).unwrap_or(usize::MAX);
        }
        if dims.iter().try_fold(1_usize, |all, &n| all.checked_mul(n)).is_none_or(|all| all >= 1 << 40) {
            return Err(Fault::new(
                "nrrd-sizes",
                format!("sizes {sizes:?}"),
                "fewer than 2^40 voxels a frame",
            ));
        }
        let unusable = |why: String| {
            Fault::new("nrrd-place", format!("a place that can't be used ({why})"), "one that can")
        };
        let flat = |axes: &[DVec3]| match axes {
            [x, y] => x.cross(*y).try_normalize(),
            _ => None,
        };
        let (matrix, mm, sides_known, place_from, unit);
        if let Some(directions) = &directions {
            let axes: Vec<DVec3> = directions[first..end].iter().flatten().copied().collect();
            let third = axes.get(2).copied().or_else(|| flat(&axes)).unwrap_or(DVec3::ZERO);
            let [x, y] = [0, 1].map(|axis| axes.get(axis).copied().unwrap_or(DVec3::ZERO));
            let to_ras = space.as_ref().and_then(|space| space.to_ras);
            let flip = DMat3::from_diagonal(to_ras.unwrap_or(DVec3::ONE));
            let origin = self.origin(space.as_ref())?;
            if origin.is_none() {
                checks.push(Check::warning(
                    "origin-missing",
                    format!("{name}: no space origin; the first voxel is placed at 0, 0, 0"),
                ));
            }
            let translation = flip * origin.unwrap_or(DVec3::ZERO);
            matrix = DAffine3 { matrix3: flip * DMat3::from_cols(x, y, third), translation };
            sides_known = to_ras.is_some() && origin.is_some();
            place_from = "space directions";
            let text = self.get("spaceunits");
            (mm, unit) = unit_of(text.map(quoted_words), name, checks)?;
        } else {
            let (spacings, mins) = self.spacings(sizes.len(), first, count, name, checks)?;
            matrix = DAffine3 { matrix3: DMat3::from_diagonal(spacings), translation: mins };
            sides_known = false;
            place_from = "spacings";
            let words = self.get("units").map(quoted_words);
            let words = words.map(|words| words.into_iter().skip(first).take(count).collect());
            (mm, unit) = unit_of(words, name, checks)?;
        }
        let mut grid = grid_in_mm(matrix, dims, mm).map_err(unusable)?;
        if !sides_known {
            grid = without_sides(&grid).map_err(unusable)?;
            checks.push(Check::warning(
                "side-unknown",
                format!("{name}: the header names no patient space: left and right are unknown"),
            ));
        }
        if count < 3 {
            checks.push(Check::warning(
                "thickness-unknown",
                format!("{name}: {count} axes in space; one unit assumed along the third"),
            ));
        }
        report_unusual_spacing(&grid, name, checks);
        if is_sheared(&grid) {
            checks.push(Check::note(
                "sheared",
                format!("{name}: the voxels are sheared (axes not at right angles)"),
            ));
        }
        let product = |sizes: &[u64]| sizes.iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
        let too_many = || Fault::new("nrrd-sizes", format!("sizes {sizes:?}"), "fewer frames");
        let lead = product(&sizes[..first]).ok_or_else(too_many)?;
        let trail = product(&sizes[end..]).ok_or_else(too_many)?;
        Ok(Placed { grid, place_from, unit, lead, trail })
    }

    /// First and number of the axes in space, which follow each other.
    fn axes_in_space(
        &self,
        kinds: Option<&[&str]>,
        directions: Option<&[Option<DVec3>]>,
        sizes: &[u64],
    ) -> Result<(usize, usize), Fault> {
        let kind = |axis: usize| kinds.map_or("", |kinds| kinds[axis]);
        let is_frame =
            |axis: usize| matches!(kind(axis).to_lowercase().as_str(), "time" | "list" | "stub" | "scalar");
        let is_domain = |axis: usize| {
            matches!(kind(axis).to_lowercase().as_str(), "domain" | "space" | "none" | "???" | "")
        };
        let mut axes = Vec::new();
        for axis in 0..sizes.len() {
            let has_place = directions.map_or(is_domain(axis) && axes.len() < 3, |d| d[axis].is_some());
            if has_place {
                axes.push(axis);
            } else if !is_frame(axis) && !is_domain(axis) {
                let found = format!("axis {axis} of kind {}, of {} numbers", quoted(kind(axis)), sizes[axis]);
                return Err(Fault::new("nrrd-kind", found, "one number a voxel"));
            }
        }
        let wrong =
            |found: String| Fault::new("nrrd-axes", found, "two or three axes in space, one after another");
        match axes.as_slice() {
            [first, .., last] if axes.len() <= 3 && last - first + 1 == axes.len() => {
                Ok((*first, axes.len()))
            }
            _ => Err(wrong(format!("axes {axes:?} in space"))),
        }
    }

    /// The direction of each axis that has one in space, in the header's space and unit.
    fn directions(&self, count: usize, space: Option<&Space>) -> Result<Option<Vec<Option<DVec3>>>, Fault> {
        let Some(text) = self.get("spacedirections") else { return Ok(None) };
        let wrong = |expected: String| {
            Fault::new("nrrd-directions", format!("space directions {}", quoted(text)), expected)
        };
        let Some(space) = space else { return Err(wrong("a space that they are in".into())) };
        let vectors = vectors(text, space.dimension).filter(|all| all.len() == count).ok_or_else(|| {
            wrong(format!("a vector of {} finite numbers or none for each of {count} axes", space.dimension))
        })?;
        if let Some(spacings) = self.numbers("spacings", count)?
            && spacings.iter().zip(&vectors).any(|(spacing, vector)| !spacing.is_nan() && vector.is_some())
        {
            let expected = "one of them, as the format forbids both";
            return Err(Fault::new("nrrd-directions", "both spacings and space directions", expected));
        }
        let mut out = Vec::new();
        for vector in vectors {
            out.push(match vector {
                // The direction of time.
                Some((along, time)) if along == DVec3::ZERO && time != 0.0 => None,
                Some((_, time)) if time != 0.0 => {
                    return Err(wrong("directions in space or in time, not in both".into()));
                }
                Some((along, _)) => Some(along),
                None => None,
            });
        }
        Ok(Some(out))
    }

    fn origin(&self, space: Option<&Space>) -> Result<Option<DVec3>, Fault> {
        let (Some(text), Some(space)) = (self.get("spaceorigin"), space) else { return Ok(None) };
        match vectors(text, space.dimension).as_deref() {
            Some([Some((origin, _))]) => Ok(Some(*origin)),
            _ => {
                let expected = format!("one vector of {} finite numbers", space.dimension);
                Err(Fault::new("nrrd-origin", format!("space origin {}", quoted(text)), expected))
            }
        }
    }

    /// Spacings and first centres along the axes in space, without a space.
    fn spacings(
        &self,
        dimension: usize,
        first: usize,
        count: usize,
        name: &str,
        checks: &mut Vec<Check>,
    ) -> Result<(DVec3, DVec3), Fault> {
        let stored = self.numbers("spacings", dimension)?;
        let mins = self.numbers("axismins", dimension)?;
        let centers = self.words("centers", dimension)?;
        let (mut spacings, mut start) = (DVec3::ONE, DVec3::ZERO);
        let mut assumed = false;
        for axis in 0..count {
            let spacing = stored.as_ref().map_or(f64::NAN, |all| all[first + axis]);
            if spacing.is_nan() {
                assumed = true;
            } else if spacing == 0.0 || spacing.is_infinite() {
                let found = format!("spacing {spacing}");
                return Err(Fault::new("nrrd-spacing", found, "a finite number other than 0"));
            } else {
                spacings[axis] = spacing.abs();
            }
            let min = mins.as_ref().map_or(0.0, |all| all[first + axis]);
            // The least coordinate of a cell is that of its face.
            let is_cell = centers.as_ref().is_some_and(|all| all[first + axis].eq_ignore_ascii_case("cell"));
            if min.is_finite() {
                let half = if is_cell && mins.is_some() { spacings[axis] / 2.0 } else { 0.0 };
                start[axis] = min + half;
            }
        }
        if assumed {
            checks.push(Check::warning(
                "spacing-missing",
                format!("{name}: no spacing along an axis; one unit assumed"),
            ));
        }
        Ok((spacings, start))
    }
}

/// Words in quotes; quotes may be missing around words without spaces.
fn quoted_words(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let (word, after) = match rest.strip_prefix('"') {
            Some(quote) => quote.split_once('"').unwrap_or((quote, "")),
            None => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
        };
        words.push(word.trim().to_owned());
        rest = after.trim_start();
    }
    words
}

/// Millimetres in the unit that all of `words` name, and its name.
fn unit_of(
    words: Option<Vec<String>>,
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<(f64, Option<String>), Fault> {
    // A fourth unit is that of time.
    let words: Vec<String> = words.unwrap_or_default().into_iter().take(3).collect();
    let Some(first) = words.first().filter(|word| !word.is_empty() && *word != "???").cloned() else {
        return Ok((1.0, None));
    };
    let sizes: Vec<Option<f64>> = words.iter().map(|word| mm_per_unit(word)).collect();
    if sizes.iter().any(|size| *size != sizes[0]) {
        let found = format!("units {}", quoted(&words.join(", ")));
        return Err(Fault::new("nrrd-units", found, "the same unit along all axes"));
    }
    let unit = super::printable(&first);
    let factor = match sizes[0] {
        Some(1.0) => 1.0,
        Some(factor) => {
            checks.push(Check::warning(
                "units-converted",
                format!(
                    "{name}: lengths are in {unit}; converted to mm (programs that ignore the unit differ)"
                ),
            ));
            factor
        }
        None => {
            let text = format!("{name}: unit {} is unknown; mm assumed", quoted(&first));
            checks.push(Check::warning("units-unknown", text));
            1.0
        }
    };
    Ok((factor, Some(unit)))
}

/// Vectors `(x,y,z)` and `none`: their part in space, and in time. `None` where a number is missing or not finite.
fn vectors(text: &str, dimension: usize) -> Option<Vec<Option<(DVec3, f64)>>> {
    let mut all = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            all.push(None);
            rest = after.trim_start();
            continue;
        }
        let (inside, after) = rest.strip_prefix('(')?.split_once(')')?;
        let parts: Vec<f64> =
            inside.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
        if parts.len() != dimension || !parts.iter().all(|part| part.is_finite()) {
            return None;
        }
        let at = |axis: usize| parts.get(axis).copied().unwrap_or(0.0);
        all.push(Some((DVec3::new(at(0), at(1), at(2)), at(3))));
        rest = after.trim_start();
    }
    Some(all)
}
