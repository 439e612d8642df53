//! Ranges of the numbers in a session file: what the window itself could have saved, with room to spare.

use std::{collections::BTreeSet, fmt::Display, ops::RangeInclusive};

use egui_tiles::{Container, Tile, TileId, Tree};
use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{Connectivity, dates::iso_date, lesions};
use glioscope_render::{Lamp, LightSettings, PathSettings, image::MOST_CLIP_PLANES};
use serde_json::Value;

use super::{
    agreement::{MOST_COMPARED, PERCENTILE, TOLERANCE_MM},
    change::CHANGE_SCALE_MM,
    document::{CaseRef, Document, Edit, MOST_CAPTION, MOST_PICTURES, Navigation},
    fibers::{FIBER_DEVIATION, FIBER_RADIUS_MM, FiberColor, FiberLook, MOST_SCALAR_NAME},
    lesions::{LesionSetting, MOST_LESION_EDITS, MOST_LESION_NAME, SMALLEST_ML, WITHIN_MM},
    light::Shading,
    made,
    pane::PaneId,
    reading::{MOST_CONCLUSION, MOST_READER},
    response::{MOST_ANSWERED, MOST_ANSWERS, MOST_AUTHOR, ResponseSetting},
    rulers::MOST_RULERS,
    shape::Shape,
    take_home::MOST_PAGE_TEXT,
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
/// Scalars along fibres.
const SCALAR: RangeInclusive<f64> = -1e37..=1e37;
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
    count("alignments", document.edit.alignments.len(), MOST_ENTRIES)?;
    count("order", document.order.len(), MOST_ENTRIES)?;
    if let CaseRef::Files { left_out, .. } = &document.case {
        count("left_out", left_out.len(), MOST_ENTRIES)?;
    }
    check_edit(&document.edit)?;
    check_navigation(&document.nav)?;
    count("pictures", document.edit.pictures.len(), MOST_PICTURES)?;
    for picture in &document.edit.pictures {
        count("characters of a caption", picture.caption.chars().count(), MOST_CAPTION)?;
        count("pictures of a picture", picture.edit.pictures.len(), 0)?;
        for side in picture.size_points {
            number("picture size_points", side, &(1.0..=1e5))?;
        }
        check_edit(&picture.edit)?;
        check_navigation(&picture.nav)?;
        check_layout(&picture.edit.layout)?;
    }
    check_private_of_layout(json.pointer("/edit/layout").unwrap_or(&Value::Null))?;
    check_layout(&document.edit.layout)
}

/// A layout that was kept as JSON; `None` where it is none of this version, or can't be laid out.
pub fn kept_layout(json: &Value) -> Option<Tree<PaneId>> {
    check_private_of_layout(json).ok()?;
    let layout: Tree<PaneId> = serde_json::from_value(json.clone()).ok()?;
    layout.root()?;
    check_layout(&layout).ok().map(|()| layout)
}

fn check_private_of_layout(json: &Value) -> Checked {
    for key in ["width", "height"] {
        if let Some(points) = json.get(key).and_then(Value::as_f64) {
            number(&format!("layout {key}"), points, &(0.0..=1e5))?;
        }
    }
    let next = json.pointer("/tiles/next_tile_id").and_then(Value::as_u64).unwrap_or_default();
    if next > LARGEST_TILE {
        return fault("layout next_tile_id", next, format!("at most {LARGEST_TILE}"));
    }
    Ok(())
}

fn check_edit(edit: &Edit) -> Checked {
    place("lens center_mm", edit.lens.center_mm)?;
    number("lens radius_mm", edit.lens.radius_mm, &LENGTH_MM)?;
    for window in edit.windows.values() {
        finite("window low", window.low)?;
        finite("window high", window.high)?;
    }
    number("overlay_opacity", edit.overlay_opacity, &SHARE)?;
    number("fusion opacity", edit.fusion.opacity, &SHARE)?;
    number("fusion share", edit.fusion.share, &SHARE)?;
    edit.fusion.threshold.map_or(Ok(()), |value| finite("fusion threshold", value))?;
    if let Some((found, expected)) = made::fault(&edit.made) {
        return Err(Fault { found, expected });
    }
    count("rulers", edit.rulers.len(), MOST_RULERS)?;
    for ruler in &edit.rulers {
        place("ruler from_mm", ruler.from_mm)?;
        place("ruler to_mm", ruler.to_mm)?;
        ruler.handles_mm().into_iter().try_for_each(|at| place("ruler shape", at))?;
        if let Shape::Circle { normal } = ruler.shape {
            number("ruler normal", normal.length(), &(0.99..=1.01))?;
        }
    }
    count("clips", edit.clips.len(), MOST_CLIP_PLANES)?;
    for clip in &edit.clips {
        place("clip normal", clip.normal)?;
        number("length of clip normal", clip.normal.length(), &(1e-9..=2e6))?;
        finite("clip offset_mm", clip.offset_mm)?;
    }
    count("tract_looks", edit.tract_looks.len(), MOST_ENTRIES)?;
    edit.tract_looks.values().try_for_each(check_fibers)?;
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
    check_lamp("light lamp", &edit.light.lamp)?;
    edit.light.own.iter().try_for_each(check_light)?;
    check_shading(&edit.light.shading)?;
    number("agreement percentile", edit.agreement.percentile, &PERCENTILE)?;
    number("agreement tolerance_mm", edit.agreement.tolerance_mm, &TOLERANCE_MM)?;
    count("characters of the conclusion", edit.reading.conclusion.chars().count(), MOST_CONCLUSION)?;
    let page = edit.take_home.text.as_deref().unwrap_or_default();
    count("characters of the page to take home", page.chars().count(), MOST_PAGE_TEXT)?;
    count("characters of the reader's name", edit.reading.reader.chars().count(), MOST_READER)?;
    if !edit.reading.day.is_empty() && iso_date(&edit.reading.day).is_none() {
        return fault("the day of the reading", format!("{:?}", edit.reading.day), "2024-01-31");
    }
    check_lesions(&edit.lesions)?;
    check_response(&edit.response)?;
    for operand in edit.agreement.two.iter().flatten() {
        count("agreement masks", operand.masks.len(), MOST_COMPARED)?;
    }
    let change = &edit.change;
    change.full_mm.map_or(Ok(()), |mm| number("change full_mm", mm, &CHANGE_SCALE_MM))?;
    number("change smallest_ml", change.smallest_ml, &SMALLEST_ML)?;
    numbers("change", [change.smooth_mm, change.threshold_mm, change.registration_mm], &EXTENT_MM)
}

fn check_fibers(look: &FiberLook) -> Checked {
    number("tract_looks radius_mm", look.radius_mm, &FIBER_RADIUS_MM)?;
    look.smooth.map_or(Ok(()), |share| number("tract_looks smooth", share, &FIBER_DEVIATION))?;
    look.range.iter().flatten().try_for_each(|&value| number("tract_looks range", value, &SCALAR))?;
    match &look.color {
        FiberColor::Scalar(name) => {
            count("characters of a scalar's name", name.chars().count(), MOST_SCALAR_NAME)
        }
        FiberColor::Plain | FiberColor::Direction => Ok(()),
    }
}

fn check_lesions(setting: &LesionSetting) -> Checked {
    number("lesions smallest_ml", setting.smallest_ml, &SMALLEST_ML)?;
    number("lesions within_mm", setting.within_mm, &WITHIN_MM)?;
    count("lesions edits", setting.edits.len(), MOST_LESION_EDITS)?;
    for edit in &setting.edits {
        edit.places_mm().into_iter().try_for_each(|mm| place("lesions edit", mm))?;
        if let lesions::Edit::Name { name, .. } = edit {
            count("characters of a lesion's name", name.chars().count(), MOST_LESION_NAME)?;
            if name.chars().any(char::is_control) {
                return fault("a lesion's name", format!("{name:?}"), "a text in one line");
            }
        }
    }
    Ok(())
}

fn check_response(setting: &ResponseSetting) -> Checked {
    count("characters of the response's author", setting.author.chars().count(), MOST_AUTHOR)?;
    let answers = setting.bt_rads.values().map(std::collections::BTreeMap::len).sum();
    count("response bt_rads", answers, MOST_ANSWERS)?;
    count("dates of response bt_rads", setting.bt_rads.len(), MOST_ANSWERED)?;
    count("authors of response bt_rads", setting.bt_rads_by.len(), MOST_ANSWERED)?;
    let by = setting.bt_rads_by.iter();
    for text in by.flat_map(|(date, by)| std::iter::once(date).chain(&by.author).chain(&by.entered)) {
        count("characters of response bt_rads_by", text.chars().count(), MOST_AUTHOR)?;
    }
    let keys = setting
        .bt_rads
        .iter()
        .flat_map(|(date, of)| std::iter::once(date).chain(of.keys()).chain(of.values()));
    for key in keys {
        count("characters of response bt_rads", key.chars().count(), MOST_AUTHOR)?;
    }
    match setting.history.as_ref().map(glioscope_core::response::History::check) {
        Some(Err(error)) => Err(Fault {
            found: format!("response {}: {}", error.place, error.found),
            expected: error.expected,
        }),
        _ => Ok(()),
    }
}

fn check_shading(shading: &Shading) -> Checked {
    let given = |name: &str, value: Option<f64>, range| value.map_or(Ok(()), |v| number(name, v, range));
    given("light shading occlusion_radius_mm", shading.occlusion_radius_mm, &(0.0..=1e3))?;
    given("light shading ambient_share", shading.ambient_share, &SHARE)?;
    given("light shading relief", shading.relief, &SHARE)?;
    given("light shading vicinity_mm", shading.vicinity_mm, &(0.01..=1e3))?;
    let most = f64::from(LightSettings::MOST_VICINITY);
    given("light shading vicinity_samples", shading.vicinity_samples.map(f64::from), &(1.0..=most))?;
    shading.knobs.given().try_for_each(|(knob, value)| {
        number(&format!("light shading knobs {}", <&str>::from(knob)), value, &knob.row().limits)
    })
}

fn check_lamp(name: &str, lamp: &Lamp) -> Checked {
    number(&format!("{name} azimuth_deg"), lamp.azimuth_deg, &(-360.0..=360.0))?;
    number(&format!("{name} elevation_deg"), lamp.elevation_deg, &(-90.0..=90.0))
}

fn check_light(own: &LightSettings) -> Checked {
    check_lamp("light own lamp", &own.lamp)?;
    number("light own lamp_texel_mm", own.lamp_texel_mm, &(0.01..=100.0))?;
    let paths = &own.paths;
    number("light own paths most", paths.most, &(2.0..=f64::from(PathSettings::MOST)))?;
    number("light own paths bounces", paths.bounces, &(1.0..=f64::from(PathSettings::MOST_BOUNCES)))?;
    number("light own paths anisotropy", paths.anisotropy, &(-0.95..=0.95))?;
    number("light own paths lamp_share", paths.lamp_share, &SHARE)?;
    number("light own paths lamp_radius_deg", paths.lamp_radius_deg, &(0.0..=60.0))?;
    number("light own aperture_deg", own.aperture_deg, &(0.0..=85.0))?;
    number("light own slice_grid", own.slice_grid, &(1.0..=13.0))?;
    number("light own slice_mm", own.slice_mm, &(0.01..=100.0))?;
    number("light own reference_mm", own.reference_mm, &(0.01..=1e3))?;
    number("light own sub_cones", own.sub_cones, &(1.0..=f64::from(LightSettings::MOST_SUB_CONES)))?;
    number("light own coarsest_level", own.coarsest_level, &(0.0..=16.0))?;
    number("light own cone_step", own.cone_step, &(0.01..=100.0))?;
    number("light own cell_mm", own.cell_mm, &(0.01..=1e3))?;
    number("light own tissue_bleeding", own.tissue_bleeding, &SHARE)?;
    number("light own tissue_shading", own.tissue_shading, &SHARE)?;
    let most = f64::from(LightSettings::MOST_VICINITY);
    number("light own vicinity_samples", own.vicinity_samples, &(1.0..=most))?;
    number("light own vicinity_mm", own.vicinity_mm, &(0.01..=1e3))?;
    number("light own layer_cell", own.layer_cell, &(1.0..=4.0))
}

fn check_navigation(nav: &Navigation) -> Checked {
    place("camera focus_mm", nav.camera.focus_mm)?;
    number("length of camera world_from_camera", nav.camera.world_from_camera.length(), &(0.9995..=1.0005))?;
    number("camera height_mm", nav.camera.height_mm, &LENGTH_MM)?;
    place("cursor_mm", nav.cursor_mm)?;
    if let Some(mm_per_point) = nav.mm_per_point {
        number("mm_per_point", mm_per_point, &(1e-3..=1e3))?;
    }
    let is_rotation = |turn: DMat3| {
        (turn.transpose() * turn).abs_diff_eq(DMat3::IDENTITY, 1e-6) && turn.determinant() > 0.0
    };
    if !is_rotation(nav.slice_axes.turn) {
        return fault("slice_axes turn", "another matrix", "a rotation");
    }
    if !nav.own_axes.values().all(|axes| is_rotation(axes.turn)) {
        return fault("own_axes turn", "another matrix", "a rotation");
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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use egui_tiles::{Grid, Linear, LinearDir, Tiles};
    use glioscope_render::flat::Window;
    use serde_json::json;

    use super::*;
    use crate::model::session_names::tests::case;

    fn document() -> Document {
        let case = case();
        Document::new(CaseRef::Sample, &case.time_points[0], 2)
    }

    fn found(checked: Checked) -> String {
        checked.map_or_else(|fault| fault.found, |()| String::new())
    }

    /// `json` as read, checked; what is out of range, empty for nothing.
    fn found_in(json: &Value) -> String {
        let document: Document = serde_json::from_value(json.clone()).unwrap();
        found(check(&document, json))
    }

    #[test]
    fn every_number_has_a_range_whose_ends_belong_to_it() {
        let mut good = serde_json::to_value(document()).unwrap();
        let edit = &mut good["edit"];
        edit["light"]["own"] = serde_json::to_value(LightSettings::DEFAULT).unwrap();
        edit["rulers"] =
            json!([{"name": "", "from_mm": [0, 0, 0], "to_mm": [0, 0, 0], "view": "axial", "time": 0}]);
        edit["clips"] = json!([{"normal": [0, 0, 1], "offset_mm": 0}]);
        edit["ellipsoid_opacities"] = json!([{"time": 0, "neighbors": 6, "number": 0, "opacity": 0}]);
        edit["tract_looks"] =
            json!({"x": {"radius_mm": 1, "color": {"scalar": "FA"}, "range": [0, 1], "smooth": 0.1}});
        good["nav"]["zooms"] = json!({"context": 1.0});
        assert_eq!(found_in(&good), "");
        let place = [json!([-1e6, 1e6]), json!([-1.1e6, 1.1e6])];
        let length = [json!([1e-6, 1e6]), json!([0.0, 1.1e6])];
        let share = [json!([0.0, 1.0]), json!([-0.1, 1.1])];
        let extent = [json!([0.0, 1e4]), json!([-0.1, 1.1e4])];
        let neighbors = [json!([6, 18, 26]), json!([0, 7, 27])];
        let mm = [json!([0.01, 1e3]), json!([0.009, 1001.0])];
        let degrees = [json!([0.0, 85.0]), json!([-0.1, 85.1])];
        let vicinity =
            [json!([1, LightSettings::MOST_VICINITY]), json!([0, LightSettings::MOST_VICINITY + 1])];
        let sub_cones =
            [json!([1, LightSettings::MOST_SUB_CONES]), json!([0, LightSettings::MOST_SUB_CONES + 1])];
        for (pointer, name, [inside, outside]) in [
            ("/edit/lens/center_mm/1", "lens center_mm", place.clone()),
            ("/edit/lens/radius_mm", "lens radius_mm", length.clone()),
            ("/edit/overlay_opacity", "overlay_opacity", share.clone()),
            ("/edit/rulers/0/from_mm/0", "ruler from_mm", place.clone()),
            ("/edit/rulers/0/to_mm/2", "ruler to_mm", place.clone()),
            ("/edit/clips/0/normal/1", "clip normal", place.clone()),
            ("/edit/clips/0/normal/2", "length of clip normal", [json!([1e-9]), json!([0.0])]),
            ("/edit/ellipsoids/opacity", "ellipsoids opacity", share.clone()),
            (
                "/edit/ellipsoids/smallest_ml",
                "ellipsoids smallest_ml",
                [json!([0.0, 1e6]), json!([-0.1, 1.1e6])],
            ),
            ("/edit/ellipsoids/neighbors", "ellipsoids neighbors", neighbors.clone()),
            ("/edit/ellipsoid_opacities/0/opacity", "ellipsoid_opacities opacity", share.clone()),
            ("/edit/ellipsoid_opacities/0/neighbors", "ellipsoid_opacities neighbors", neighbors),
            ("/edit/light/aperture_deg", "light aperture_deg", degrees.clone()),
            ("/edit/light/own/aperture_deg", "light own aperture_deg", degrees),
            (
                "/edit/light/lamp/azimuth_deg",
                "light lamp azimuth_deg",
                [json!([-360.0, 360.0]), json!([-360.1, 361.0])],
            ),
            (
                "/edit/light/own/lamp/elevation_deg",
                "light own lamp elevation_deg",
                [json!([-90.0, 90.0]), json!([-90.1, 91.0])],
            ),
            (
                "/edit/light/own/lamp_texel_mm",
                "light own lamp_texel_mm",
                [json!([0.01, 100.0]), json!([0.009, 100.1])],
            ),
            ("/edit/light/own/paths/most", "light own paths most", [json!([2, 4096]), json!([1, 4097])]),
            ("/edit/light/own/paths/bounces", "light own paths bounces", [json!([1, 64]), json!([0, 65])]),
            (
                "/edit/light/own/paths/anisotropy",
                "light own paths anisotropy",
                [json!([-0.95, 0.95]), json!([-0.96, 1.0])],
            ),
            ("/edit/light/own/paths/lamp_share", "light own paths lamp_share", share.clone()),
            (
                "/edit/light/own/paths/lamp_radius_deg",
                "light own paths lamp_radius_deg",
                [json!([0.0, 60.0]), json!([-1.0, 60.1])],
            ),
            ("/edit/light/own/slice_grid", "light own slice_grid", [json!([1, 13]), json!([0, 14])]),
            ("/edit/light/own/slice_mm", "light own slice_mm", [json!([0.01, 100.0]), json!([0.009, 100.1])]),
            ("/edit/light/own/reference_mm", "light own reference_mm", mm.clone()),
            ("/edit/light/own/sub_cones", "light own sub_cones", sub_cones),
            ("/edit/light/own/coarsest_level", "light own coarsest_level", [json!([0, 16]), json!([17])]),
            (
                "/edit/light/own/cone_step",
                "light own cone_step",
                [json!([0.01, 100.0]), json!([0.009, 100.1])],
            ),
            ("/edit/light/own/cell_mm", "light own cell_mm", mm.clone()),
            ("/edit/light/own/vicinity_samples", "light own vicinity_samples", vicinity.clone()),
            ("/edit/light/own/vicinity_mm", "light own vicinity_mm", mm.clone()),
            ("/edit/light/own/layer_cell", "light own layer_cell", [json!([1.0, 4.0]), json!([0.9, 4.1])]),
            (
                "/edit/light/shading/occlusion_radius_mm",
                "light shading occlusion_radius_mm",
                [json!([0.0, 1e3, null]), json!([-0.1, 1001.0])],
            ),
            ("/edit/light/shading/ambient_share", "light shading ambient_share", share.clone()),
            ("/edit/light/shading/relief", "light shading relief", share),
            ("/edit/light/shading/vicinity_mm", "light shading vicinity_mm", mm),
            ("/edit/light/shading/vicinity_samples", "light shading vicinity_samples", vicinity),
            (
                "/edit/tract_looks/x/radius_mm",
                "tract_looks radius_mm",
                [json!([0.1, 3.0]), json!([0.09, 3.1])],
            ),
            (
                "/edit/tract_looks/x/smooth",
                "tract_looks smooth",
                [json!([0.005, 0.5, null]), json!([0.004, 0.6])],
            ),
            (
                "/edit/tract_looks/x/range",
                "tract_looks range",
                [json!([[0.0, 1e37], null]), json!([[0.0, 2e37]])],
            ),
            ("/edit/change/full_mm", "change full_mm", [json!([0.1, 1000.0, null]), json!([0.09, 1001.0])]),
            ("/edit/change/smooth_mm", "change", extent.clone()),
            ("/edit/change/threshold_mm", "change", extent.clone()),
            ("/edit/change/registration_mm", "change", extent),
            ("/nav/camera/focus_mm/0", "camera focus_mm", place.clone()),
            ("/nav/camera/height_mm", "camera height_mm", length),
            ("/nav/cursor_mm/1", "cursor_mm", place.clone()),
            ("/nav/mm_per_point", "mm_per_point", [json!([1e-3, 1e3, null]), json!([9e-4, 1001.0])]),
            ("/nav/pan_mm/2/1", "pan_mm", place),
            ("/nav/zooms/context", "zooms", [json!([1e-3, 1e4]), json!([9e-4, 1.1e4])]),
            ("/edit/layout/width", "layout width", [json!([0.0, 1e5]), json!([-0.1, 1.1e5])]),
            ("/edit/layout/height", "layout height", [json!([0.0, 1e5]), json!([-0.1, 1.1e5])]),
            (
                "/edit/layout/tiles/next_tile_id",
                "layout next_tile_id",
                [json!([0, 1_u64 << 40]), json!([(1_u64 << 40) + 1])],
            ),
        ] {
            let with = |value: &Value| {
                let mut changed = good.clone();
                *changed.pointer_mut(pointer).unwrap() = value.clone();
                found_in(&changed)
            };
            for value in inside.as_array().unwrap() {
                assert_eq!(with(value), "", "{pointer} {value}");
            }
            for value in outside.as_array().unwrap() {
                let found = with(value);
                assert!(found.starts_with(&format!("{name} ")), "{pointer} {value}: {found}");
            }
        }
        for (world_from_camera, name) in
            [(0.9996, ""), (1.0004, ""), (0.999, "length of"), (1.001, "length of")]
        {
            let mut changed = good.clone();
            changed["nav"]["camera"]["world_from_camera"] = json!([0.0, world_from_camera, 0.0, 0.0]);
            assert!(found_in(&changed).starts_with(name) && found_in(&changed).is_empty() == name.is_empty());
        }
    }

    #[test]
    fn no_number_may_be_infinite_or_none() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for (window, name) in [
                (Window { low: value, high: 1.0 }, "window low"),
                (Window { low: 0.0, high: value }, "window high"),
            ] {
                let mut changed = document();
                changed.edit.windows.insert("T1".into(), window);
                assert!(found(check(&changed, &Value::Null)).starts_with(name));
            }
            let mut changed = document();
            changed.nav.cursor_mm = DVec3::new(0.0, 0.0, value);
            assert!(found(check(&changed, &Value::Null)).starts_with("cursor_mm"));
        }
        assert!(number("x", f64::NAN, &SHARE).is_err() && finite("x", f64::MAX).is_ok());
    }

    #[test]
    fn lists_are_as_long_as_a_window_makes_them_at_most() {
        let entries = |count: usize| vec![String::new(); count];
        let paths = |count: usize| vec![PathBuf::new(); count];
        for (count, is_long) in [(1 << 16, false), ((1 << 16) + 1, true)] {
            let of = |name: &str| if is_long { format!("{count} entries of {name}") } else { String::new() };
            let tracts = Document { tracts: paths(count), ..document() };
            assert_eq!(found(check(&tracts, &Value::Null)), of("tracts"));
            let order = Document { order: entries(count), ..document() };
            assert_eq!(found(check(&order, &Value::Null)), of("order"));
            let (folder, manifest) = (PathBuf::new(), String::new());
            let case = CaseRef::Files { folder, manifest, left_out: paths(count) };
            assert_eq!(found(check(&Document { case, ..document() }, &Value::Null)), of("left_out"));
        }
    }

    #[test]
    fn a_layout_is_a_tree_of_few_tiles_with_each_pane_once() {
        let tree = |root: u64, tiles: &[(u64, Tile<PaneId>)]| {
            let mut all = Tiles::default();
            tiles.iter().for_each(|(id, tile)| all.insert(TileId(*id), tile.clone()));
            found(check_layout(&Tree::new(egui::Id::unique("layout"), TileId(root), all)))
        };
        let [axial, lens] = [Tile::Pane(PaneId::Axial), Tile::Pane(PaneId::Lens)];
        let pair = |children: [u64; 2]| children.map(TileId).to_vec();
        let linear = |children: [u64; 2], share: f32| {
            let mut linear = Linear::new(LinearDir::Vertical, pair(children));
            linear.shares.set_share(TileId(children[1]), share);
            Tile::Container(Container::Linear(linear))
        };
        let grid = |columns: f32, rows: f32| {
            let mut grid = Grid::new(pair([1, 2]));
            (grid.col_shares, grid.row_shares) = (vec![1.0, columns], vec![rows]);
            Tile::Container(Container::Grid(grid))
        };
        let tabs = |children: [u64; 2]| Tile::Container(Container::new_tabs(pair(children)));
        let with = |container: Tile<PaneId>, second: &Tile<PaneId>| {
            tree(3, &[(1, axial.clone()), (2, second.clone()), (3, container)])
        };
        for container in
            [linear([1, 2], 0.0), linear([1, 2], 1e4), grid(0.0, 1e4), grid(1e4, 0.0), tabs([1, 2])]
        {
            assert_eq!(with(container, &lens), "");
        }
        for container in [
            linear([1, 2], -1.0),
            linear([1, 2], 1.1e4),
            linear([1, 2], f32::NAN),
            grid(1.1e4, 1.0),
            grid(1.0, -1.0),
        ] {
            assert!(with(container, &lens).starts_with("layout share "));
        }
        assert_eq!(with(tabs([1, 2]), &axial), "layout tile 1 with the axial slice again");
        assert_eq!(with(tabs([1, 1]), &lens), "layout tile 1 in two places");
        assert_eq!(with(tabs([1, 3]), &lens), "layout tile 3 in two places");
        assert_eq!(with(tabs([1, 4]), &lens), "layout tile 4 without a description");

        let largest = 1 << 40;
        assert_eq!(tree(largest, &[(largest, axial.clone())]), "");
        assert_eq!(tree(largest + 1, &[(largest + 1, axial.clone())]), "layout tile 1099511627777");
        // Those in no place count, too.
        let many: Vec<_> = (0..1001).map(|id| (id, axial.clone())).collect();
        assert_eq!(tree(0, &many[..1000]), "");
        assert_eq!(tree(0, &many), "1001 entries of layout tiles");
    }

    #[test]
    fn unknown_keys_are_paths_in_objects_and_lists() {
        let found = json!({"a": 1, "b": {"c": 1, "d": {"e": 2}}, "list": [{"x": 1}, {"y": 2, "z": 3}, {"n": 1}], "f": {"g": 1}});
        let known = json!({"b": {"d": {"e": 0}}, "list": [{"x": 0}, {"z": 0}], "f": 0});
        assert_eq!(unknown_keys(&found, &known), ["a", "b.c", "list.1.y"]);
        assert_eq!(unknown_keys(&found, &found), [""; 0]);
    }
}
