//! The overlap diagram of one case, small: the ring of the overlap view without labels and borders.
//!
//! A glyph is laid out once at a standard radius and drawn smaller, gaps and all, so that areas keep the rule of the diagram: painted area
//! is proportional to voxels.

use egui::{Color32, Pos2, Ui, epaint::Mesh};
use glioscope_cohort::Overlaps;
use glioscope_render::MaskColors;

use crate::{
    model::cohort::GlyphScale,
    theme,
    views::overlap::{
        paint,
        ring::{RingLayout, pieces_of_regions},
    },
};

/// The radius at which glyphs are laid out.
const STANDARD_RADIUS: f64 = 100.0;

/// The diagram of one case.
#[derive(Debug)]
pub struct Glyph {
    layout: RingLayout,
    /// Square root of the painted area of a millilitre of a mask at the standard radius; 0 without voxels.
    length_per_root_ml: f64,
}

impl Glyph {
    /// The diagram of the overlaps of `masks` masks.
    fn new(overlaps: &Overlaps, masks: usize) -> Self {
        let voxels = |bits: u32| overlaps.voxels.get(bits as usize).copied().unwrap_or_default();
        let layout = RingLayout::new(&pieces_of_regions(masks, voxels), STANDARD_RADIUS);
        let area = if overlaps.voxel_ml > 0.0 { layout.area_per_voxel / overlaps.voxel_ml } else { 0.0 };
        Self { layout, length_per_root_ml: area.sqrt() }
    }

    /// Whether no mask has a voxel.
    pub fn is_empty(&self) -> bool {
        self.layout.is_empty()
    }

    fn outer(&self) -> f64 {
        let disc = self.layout.disc.as_ref().map_or(0.0, |disc| disc.radius);
        self.layout.layers.last().map_or(disc, |layer| layer.1)
    }

    /// The parts of the ring: start and end angle, inner and outer radius at the standard radius, and the mask.
    fn parts(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2], usize)> {
        let ring = self.layout.segments.iter().flat_map(|segment| {
            let layers = segment.piece.masks.iter().zip(&self.layout.layers);
            layers.map(|(mask, (inner, outer))| ([segment.from_rad, segment.to_rad], [*inner, *outer], *mask))
        });
        let disc = self.layout.disc.iter().flat_map(|disc| {
            let sector = std::f64::consts::TAU / disc.piece.masks.len() as f64;
            let masks = disc.piece.masks.iter().enumerate();
            masks.map(move |(i, mask)| {
                ([(i as f64 - 0.5) * sector, (i as f64 + 0.5) * sector], [0.0, disc.radius], *mask)
            })
        });
        ring.chain(disc)
    }
}

/// The diagrams of all cases.
#[derive(Debug)]
pub struct Glyphs {
    all: Vec<Glyph>,
    /// The least of what fits of a case's standard radius, by the length of a root of a millilitre: the largest case.
    least: f64,
}

impl Glyphs {
    /// Lays out the diagrams of all cases.
    pub fn new(overlaps: &[Overlaps], masks: usize) -> Self {
        let all: Vec<Glyph> = overlaps.iter().map(|overlaps| Glyph::new(overlaps, masks)).collect();
        let fits = all.iter().filter(|glyph| !glyph.is_empty() && glyph.length_per_root_ml > 0.0);
        let least = fits.map(|glyph| glyph.length_per_root_ml / glyph.outer()).fold(f64::INFINITY, f64::min);
        Self { all, least }
    }

    /// The diagram of a case; `None` where there is no such case.
    pub fn get(&self, case: usize) -> Option<&Glyph> {
        self.all.get(case)
    }

    /// By what a glyph is drawn smaller than it was laid out, for the largest radius in points. At the same scale the largest case has that
    /// radius, and the painted areas of all cases are proportional to their volumes.
    pub fn shrunk(&self, glyph: &Glyph, scale: GlyphScale, radius: f64) -> f64 {
        match scale {
            GlyphScale::Same if glyph.length_per_root_ml > 0.0 => {
                radius * self.least / glyph.length_per_root_ml
            }
            _ => radius / glyph.outer().max(1.0),
        }
    }

    /// Volume of a mask that one square point shows at the same scale, ml; `None` without a voxel.
    pub fn ml_per_square_point(&self, radius: f64) -> Option<f64> {
        let length = radius * self.least;
        (length.is_finite() && length > 0.0).then(|| 1.0 / (length * length))
    }
}

/// Adds a glyph, drawn smaller by `shrunk`, to a mesh. `pixel`: width of a device pixel, points.
pub fn add(mesh: &mut Mesh, glyph: &Glyph, center: Pos2, shrunk: f64, colors: &MaskColors, pixel: f32) {
    for (span, radii, mask) in glyph.parts() {
        let color = theme::color(colors.mask(mask));
        paint::small_ring_part(mesh, center, span, radii.map(|radius| radius * shrunk), color, pixel);
    }
}

/// The outline of each part of a glyph as a polygon, with its colour: for files. Points are relative to the centre.
pub fn outlines(glyph: &Glyph, shrunk: f64, colors: &MaskColors) -> Vec<(Vec<[f64; 2]>, [u8; 3])> {
    let of = |([from, to], [inner, outer], mask): ([f64; 2], [f64; 2], usize)| {
        let arc = |radius: f64| paint::arc(Pos2::ZERO, from, to, radius * shrunk);
        let mut points = arc(outer);
        if inner > 0.0 {
            points.extend(arc(inner).into_iter().rev());
        } else {
            points.push(Pos2::ZERO);
        }
        (points.into_iter().map(|p| [f64::from(p.x), f64::from(p.y)]).collect(), colors.mask(mask))
    };
    glyph.parts().map(of).collect()
}

/// Draws the glyph of a case without voxels: an empty ring.
pub fn empty(ui: &Ui, center: Pos2, radius: f32, ink: Color32) {
    ui.painter().circle_stroke(center, radius * 0.6, egui::Stroke::new(1.0, ink));
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::glam::DVec2;

    /// Painted area of a glyph in square points, by the shoelace formula over its outlines.
    fn area(glyph: &Glyph, shrunk: f64) -> f64 {
        let colors = MaskColors::new(glioscope_render::Palette::default(), &[None; 3]);
        let of = |points: &[[f64; 2]]| {
            let next = points.iter().cycle().skip(1);
            let twice: f64 =
                points.iter().zip(next).map(|(a, b)| DVec2::from(*a).perp_dot(DVec2::from(*b))).sum();
            (twice / 2.0).abs()
        };
        outlines(glyph, shrunk, &colors).iter().map(|(points, _)| of(points)).sum()
    }

    #[test]
    fn at_the_same_scale_painted_area_is_proportional_to_volume_whatever_the_voxels() {
        // Mask-voxels (a voxel in two masks counts twice) times the voxel's volume.
        let cases = [
            (Overlaps { voxels: [0, 300, 200, 100, 50, 0, 0, 400], voxel_ml: 0.001 }, 1950.0 * 0.001),
            (Overlaps { voxels: [0, 0, 0, 0, 0, 0, 0, 900], voxel_ml: 0.008 }, 2700.0 * 0.008),
            (Overlaps { voxels: [0, 5000, 0, 0, 0, 0, 0, 0], voxel_ml: 0.001 }, 5.0),
        ];
        let glyphs = Glyphs::new(&cases.map(|(overlaps, _)| overlaps), 3);
        let radius = 40.0;
        let per_ml = 1.0 / glyphs.ml_per_square_point(radius).unwrap();
        for ((_, ml), glyph) in cases.iter().zip(&glyphs.all) {
            let shrunk = glyphs.shrunk(glyph, GlyphScale::Same, radius);
            let painted = area(glyph, shrunk);
            assert!((painted - per_ml * ml).abs() < 0.01 * painted, "{painted} {}", per_ml * ml);
            assert!(glyph.outer() * shrunk <= radius * (1.0 + 1e-9));
        }
        let largest =
            glyphs.all.iter().map(|glyph| glyph.outer() * glyphs.shrunk(glyph, GlyphScale::Same, radius));
        assert!((largest.fold(0.0, f64::max) - radius).abs() < 1e-6);
        // Each fills its cell at its own scale.
        for glyph in &glyphs.all {
            assert!((glyph.outer() * glyphs.shrunk(glyph, GlyphScale::Own, radius) - radius).abs() < 0.01);
        }
    }
}
