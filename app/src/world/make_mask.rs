//! A mask made from those of the date shown.

use glam::DVec3;
use glioscope_core::{Components, Connectivity, MaskBits, case::TimePoint};
use glioscope_render::flat::place_label;

use super::World;
use crate::{
    format,
    model::{Document, made::MadeMask, masks::region_name},
};

/// What a mask is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MadeOf {
    /// The regions shown.
    Selection,
    /// Their part inside the lens: voxels whose centres lie in it.
    InLens,
    /// Their connected piece (26 neighbours) at the crosshair.
    Piece,
    /// The voxels where at least this many masks are active.
    Agreement(u32),
}

/// Makes a mask of the date shown.
///
/// # Errors
/// Why there is none, as a sentence.
pub fn make(
    world: &World,
    doc: &Document,
    of: MadeOf,
    id: &str,
    author: Option<String>,
) -> Result<MadeMask, String> {
    let (Some(case), Some(time_point)) = (world.case(), world.time_point(doc)) else {
        return Err("No case is open.".into());
    };
    let (grid, index) = (&case.grid, &time_point.index);
    let selection = world.selection(doc);
    let shows = |bits: u32| bits != 0 && selection.shows(bits);
    let sides_known = grid.sides() == glioscope_core::Sides::Known;
    let place = |place_mm: DVec3| place_label(place_mm, sides_known);
    let lens = doc.edit.lens;
    let selected = || MaskBits::from_fn(grid.dims(), |at| shows(index.get(at)));
    let (bits, how) = match of {
        MadeOf::Selection => (selected(), words(time_point, &shows)),
        MadeOf::InLens => {
            let inside =
                |at: usize| grid.center_of_voxel_mm(grid.ijk(at)).distance(lens.center_mm) <= lens.radius_mm;
            let bits = MaskBits::from_fn(grid.dims(), |at| shows(index.get(at)) && inside(at));
            let radius = format::length_mm(lens.radius_mm);
            let at = place(lens.center_mm);
            (bits, format!("{}, inside a ball of radius {radius} at {at}", words(time_point, &shows)))
        }
        MadeOf::Piece => {
            let cursor_mm = doc.nav.cursor_mm;
            let bits = piece(&selected(), grid.voxel_at(cursor_mm))?;
            (bits, format!("{}, the piece at {}", words(time_point, &shows), place(cursor_mm)))
        }
        MadeOf::Agreement(least) => {
            let least = least.max(1);
            let raters = raters(doc, time_point);
            let bits = MaskBits::from_fn(grid.dims(), |at| (index.get(at) & raters).count_ones() >= least);
            (bits, format!("where at least {least} of {} masks are active", raters.count_ones()))
        }
    };
    if bits.bounds().is_none() {
        return Err("No voxel is in it.".into());
    }
    let parents = time_point.regions.mask_ids().iter().enumerate().filter(|(k, _)| {
        let is_shown = |region: &glioscope_core::Region| region.bits >> k & 1 == 1 && shows(region.bits);
        if matches!(of, MadeOf::Agreement(_)) {
            return raters(doc, time_point) >> k & 1 == 1;
        }
        time_point.regions.list().iter().any(is_shown)
    });
    let parents = parents.map(|(_, id)| id.clone()).collect();
    let mut made = MadeMask::new(id.to_owned(), time_point.label.clone(), grid, &bits)
        .ok_or("The mask has another size than the case grid.")?;
    made.parents = parents;
    made.how = how;
    made.author = author;
    Ok(made)
}

/// Bits of the masks of a date that were not made from others: only they can agree.
pub fn raters(doc: &Document, time_point: &TimePoint) -> u32 {
    let is_made = |id: &str| doc.edit.made.iter().any(|made| made.id == id && made.time == time_point.label);
    let ids = time_point.regions.mask_ids().iter().enumerate();
    ids.filter(|(_, id)| !is_made(id)).fold(0, |bits, (k, _)| bits | 1 << k)
}

/// The regions shown, in words.
fn words(time_point: &TimePoint, shows: &dyn Fn(u32) -> bool) -> String {
    let regions = &time_point.regions;
    let shown: Vec<u32> =
        regions.list().iter().map(|region| region.bits).filter(|bits| shows(*bits)).collect();
    if shown.len() == regions.list().len() {
        return "all of them together".into();
    }
    let names: Vec<String> = shown.iter().map(|bits| region_name(regions.mask_ids(), *bits)).collect();
    format!("the regions {}", names.join(", "))
}

/// The connected piece of `bits` that has the voxel `at`.
fn piece(bits: &MaskBits, at: Option<[usize; 3]>) -> Result<MaskBits, String> {
    let nothing = "The crosshair isn't in what is shown: click there first.";
    let [x, y, z] = at.filter(|at| bits.get(*at)).ok_or(nothing)?.map(|index| index as u32);
    let components = Components::of_mask(bits, Connectivity::TwentySix).map_err(|error| error.to_string())?;
    let has = |component: &&glioscope_core::Component| {
        let mut runs = components.runs(component).iter();
        runs.any(|run| (run.y, run.z) == (y, z) && (run.first..=run.last).contains(&x))
    };
    let component = components.list().iter().find(has).ok_or(nothing)?;
    let mut own = MaskBits::empty(bits.dims());
    for run in components.runs(component) {
        (run.first..=run.last).for_each(|x| own.set([x, run.y, run.z].map(|index| index as usize)));
    }
    Ok(own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_is_what_is_connected_at_a_voxel() {
        let dims = [9, 3, 2];
        // Two bars, which a corner would connect if x 4 were active.
        let bits = MaskBits::from_fn(dims, |at| (at % 9 < 4 && at / 9 == 0) || (at % 9 > 5 && at / 9 == 1));
        let left = piece(&bits, Some([2, 0, 0])).unwrap();
        assert_eq!(left.count(), 4);
        assert!((0..4).all(|x| left.get([x, 0, 0])));
        assert_eq!(piece(&bits, Some([8, 1, 0])).unwrap().count(), 3);
        assert!(piece(&bits, Some([5, 1, 0])).is_err());
        assert!(piece(&bits, None).is_err());
    }
}
