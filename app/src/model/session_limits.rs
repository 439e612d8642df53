//! Ranges of the numbers in a session file: what the window itself could have saved, with room to spare.

use std::{collections::BTreeSet, fmt::Display, ops::RangeInclusive};

use egui_tiles::{Container, Tile, TileId, Tree};
use glam::{DVec2, DVec3};
use glioscope_core::Connectivity;
use glioscope_render::{LightSettings, image::MOST_CLIP_PLANES};
use serde_json::Value;

use super::{
    change::CHANGE_SCALE_MM,
    document::{CaseRef, Document, Edit, Navigation},
    light::Shading,
    made,
    pane::PaneId,
    rulers::MOST_RULERS,
};

/// The most entries of any other list.
const MOST_ENTRIES: usize = 1 << 16;
/// The most tiles of a layout, and the largest number of one.
const MOST_TILES: usize = 1000;
const LARGEST_TILE: u64 = 1 << 40;
/// The largest share of a pane; new ones have 1.
const LARGEST_SHARE: f32 = 1e4;
/// Coordinates, world millimetres.
const PLACE_MM: RangeInclusive<f64> = -1e6..=1e6;
/// Lengths above 0, millimetres.
const LENGTH_MM: RangeInclusive<f64> = 1e-6..=1e6;
const SHARE: RangeInclusive<f64> = 0.0..=1.0;
/// Radii, thresholds and the like, millimetres.
const EXTENT_MM: RangeInclusive<f64> = 0.0..=1e4;

/// What is out of range.
pub(super) struct Fault {
    pub found: String,
    pub expected: String,
}

type Checked = Result<(), Fault>;

fn fault(name: &str, found: impl Display, expected: impl Into<String>) -> Checked {
    Err(Fault { found: format!("{name} {found}"), expected: expected.into() })
}

fn number(name: &str, value: impl Into<f64>, range: &RangeInclusive<f64>) -> Checked {
    let value = value.into();
    // Written so that NaN is out of range.
    if range.contains(&value) {
        return Ok(());
    }
    fault(name, format!("{value:e}"), format!("a number from {:e} to {:e}", range.start(), range.end()))
}

fn numbers<const N: usize>(name: &str, values: [f64; N], range: &RangeInclusive<f64>) -> Checked {
    values.into_iter().try_for_each(|value| number(name, value, range))
}

fn finite(name: &str, value: f64) -> Checked {
    number(name, value, &(f64::MIN..=f64::MAX))
}

fn place(name: &str, place_mm: DVec3) -> Checked {
    numbers(name, place_mm.to_array(), &PLACE_MM)
}

fn count(name: &str, found: usize, most: usize) -> Checked {
    if found <= most {
        Ok(())
    } else {
        fault(&format!("{found} entries of"), name, format!("at most {most}"))
    }
}

fn neighbors(name: &str, found: u32) -> Checked {
    match Connectivity::of_neighbors(found) {
        Some(_) => Ok(()),
        None => fault(name, found, "6, 18 or 26"),
    }
}

/// Checks every number of a document; `json` is the document as read.
pub(super) fn check(document: &Document, json: &Value) -> Checked {
    count("tracts", document.tracts.len(), MOST_ENTRIES)?;
    count("order", document.order.len(), MOST_ENTRIES)?;
    if let CaseRef::Files { left_out, .. } = &document.case {
        count("left_out", left_out.len(), MOST_ENTRIES)?;
    }
    check_edit(&document.edit)?;
    check_navigation(&document.nav)?;
    // Private fields of the layout.
    for key in ["width", "height"] {
        if let Some(points) = json.pointer(&format!("/edit/layout/{key}")).and_then(Value::as_f64) {
            number(&format!("layout {key}"), points, &(0.0..=1e5))?;
        }
    }
    let next = json.pointer("/edit/layout/tiles/next_tile_id").and_then(Value::as_u64).unwrap_or_default();
    if next > LARGEST_TILE {
        return fault("layout next_tile_id", next, format!("at most {LARGEST_TILE}"));
    }
    check_layout(&document.edit.layout)
}

fn check_edit(edit: &Edit) -> Checked {
    place("lens center_mm", edit.lens.center_mm)?;
    number("lens radius_mm", edit.lens.radius_mm, &LENGTH_MM)?;
    for window in edit.windows.values() {
        finite("window low", window.low)?;
        finite("window high", window.high)?;
    }
    number("overlay_opacity", edit.overlay_opacity, &SHARE)?;
    if let Some((found, expected)) = made::fault(&edit.made) {
        return Err(Fault { found, expected });
    }
    count("rulers", edit.rulers.len(), MOST_RULERS)?;
    for ruler in &edit.rulers {
        place("ruler from_mm", ruler.from_mm)?;
        place("ruler to_mm", ruler.to_mm)?;
    }
    count("clips", edit.clips.len(), MOST_CLIP_PLANES)?;
    for clip in &edit.clips {
        place("clip normal", clip.normal)?;
        number("length of clip normal", clip.normal.length(), &(1e-9..=2e6))?;
        finite("clip offset_mm", clip.offset_mm)?;
    }
    let look = &edit.ellipsoids;
    number("ellipsoids opacity", look.opacity, &SHARE)?;
    number("ellipsoids smallest_ml", look.smallest_ml, &(0.0..=1e6))?;
    neighbors("ellipsoids neighbors", look.neighbors)?;
    count("ellipsoid_opacities", edit.ellipsoid_opacities.len(), MOST_ENTRIES)?;
    for own in &edit.ellipsoid_opacities {
        number("ellipsoid_opacities opacity", own.opacity, &SHARE)?;
        neighbors("ellipsoid_opacities neighbors", own.neighbors)?;
    }
    number("light aperture_deg", edit.light.aperture_deg, &(0.0..=85.0))?;
    edit.light.own.iter().try_for_each(check_light)?;
    check_shading(&edit.light.shading)?;
    let change = &edit.change;
    change.full_mm.map_or(Ok(()), |mm| number("change full_mm", mm, &CHANGE_SCALE_MM))?;
    numbers("change", [change.smooth_mm, change.threshold_mm, change.registration_mm], &EXTENT_MM)
}

fn check_shading(shading: &Shading) -> Checked {
    let given = |name: &str, value: Option<f64>, range| value.map_or(Ok(()), |v| number(name, v, range));
    given("light shading occlusion_radius_mm", shading.occlusion_radius_mm, &(0.0..=1e3))?;
    given("light shading ambient_share", shading.ambient_share, &SHARE)?;
    given("light shading relief", shading.relief, &SHARE)?;
    given("light shading vicinity_mm", shading.vicinity_mm, &(0.01..=1e3))?;
    let most = f64::from(LightSettings::MOST_VICINITY);
    given("light shading vicinity_samples", shading.vicinity_samples.map(f64::from), &(1.0..=most))
}

fn check_light(own: &LightSettings) -> Checked {
    number("light own aperture_deg", own.aperture_deg, &(0.0..=85.0))?;
    number("light own slice_grid", own.slice_grid, &(1.0..=13.0))?;
    number("light own slice_mm", own.slice_mm, &(0.01..=100.0))?;
    number("light own reference_mm", own.reference_mm, &(0.01..=1e3))?;
    number("light own sub_cones", own.sub_cones, &(1.0..=f64::from(LightSettings::MOST_SUB_CONES)))?;
    number("light own coarsest_level", own.coarsest_level, &(0.0..=16.0))?;
    number("light own cone_step", own.cone_step, &(0.01..=100.0))?;
    number("light own cell_mm", own.cell_mm, &(0.01..=1e3))?;
    let most = f64::from(LightSettings::MOST_VICINITY);
    number("light own vicinity_samples", own.vicinity_samples, &(1.0..=most))?;
    number("light own vicinity_mm", own.vicinity_mm, &(0.01..=1e3))
}

fn check_navigation(nav: &Navigation) -> Checked {
    place("camera focus_mm", nav.camera.focus_mm)?;
    number("length of camera world_from_camera", nav.camera.world_from_camera.length(), &(0.9995..=1.0005))?;
    number("camera height_mm", nav.camera.height_mm, &LENGTH_MM)?;
    place("cursor_mm", nav.cursor_mm)?;
    if let Some(mm_per_point) = nav.mm_per_point {
        number("mm_per_point", mm_per_point, &(1e-3..=1e3))?;
    }
    nav.pan_mm.iter().try_for_each(|pan_mm: &DVec2| numbers("pan_mm", pan_mm.to_array(), &PLACE_MM))?;
    nav.zooms.values().try_for_each(|zoom| number("zooms", *zoom, &(1e-3..=1e4)))
}

/// Checks that a layout is a tree of at most [`MOST_TILES`] tiles, each pane once, with shares that can be laid out.
fn check_layout(layout: &Tree<PaneId>) -> Checked {
    count("layout tiles", layout.tiles.iter().count(), MOST_TILES)?;
    let (mut seen, mut panes) = (BTreeSet::new(), BTreeSet::new());
    let mut pending: Vec<TileId> = layout.root().into_iter().collect();
    while let Some(id) = pending.pop() {
        let name = format!("layout tile {}", id.0);
        if !seen.insert(id.0) {
            return fault(&name, "in two places", "each once");
        }
        let container = match layout.tiles.get(id) {
            None => return fault(&name, "without a description", "one"),
            Some(Tile::Pane(pane)) if !panes.insert(*pane) => {
                return fault(&name, format!("with {} again", pane.title()), "each pane once");
            }
            Some(Tile::Pane(_)) => continue,
            Some(Tile::Container(container)) => container,
        };
        let range = 0.0..=f64::from(LARGEST_SHARE);
        let share = |share: f32| number("layout share", share, &range);
        match container {
            Container::Tabs(_) => {}
            Container::Linear(linear) => linear.shares.iter().try_for_each(|(_, of)| share(*of))?,
            Container::Grid(grid) => {
                grid.col_shares.iter().chain(&grid.row_shares).try_for_each(|of| share(*of))?;
            }
        }
        pending.extend(container.children().copied());
    }
    let largest = layout.tiles.tile_ids().map(|id| id.0).max().unwrap_or_default();
    if largest > LARGEST_TILE {
        return fault("layout tile", largest, format!("at most {LARGEST_TILE}"));
    }
    Ok(())
}

/// Keys of `found` that `known`, the same as the program writes it, lacks, as paths: `edit.lens_onn`.
pub(super) fn unknown_keys(found: &Value, known: &Value) -> Vec<String> {
    let mut out = Vec::new();
    collect_unknown(found, known, "", &mut out);
    out
}

fn collect_unknown(found: &Value, known: &Value, path: &str, out: &mut Vec<String>) {
    let inner = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (found, known) {
        (Value::Object(found), Value::Object(known)) => {
            for (key, value) in found {
                match known.get(key) {
                    Some(known) => collect_unknown(value, known, &inner(key), out),
                    None => out.push(inner(key)),
                }
            }
        }
        (Value::Array(found), Value::Array(known)) => {
            for (index, (found, known)) in found.iter().zip(known).enumerate() {
                collect_unknown(found, known, &inner(&index.to_string()), out);
            }
        }
        _ => {}
    }
}
