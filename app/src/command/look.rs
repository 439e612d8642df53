//! Commands that change the navigation state.

use egui::{Key, Modifiers};
use glam::{DVec2, DVec3};
use glioscope_core::optics::{AnatomicalView, Camera, Projection};
use glioscope_render::flat::{Convention, Plane, SliceView};
use strum::{EnumDiscriminants, EnumIter, VariantArray};

use super::{Entry, Label, Listed, Menu};
use crate::{
    model::{Document, PaneId, Tool, slice_axes::AxesOf},
    world::World,
};

/// A command that changes the navigation state, which undo doesn't cover.
#[derive(Clone, Debug, PartialEq, EnumDiscriminants)]
#[strum_discriminants(name(LookKind), vis(pub(super)), derive(EnumIter))]
#[allow(missing_docs, reason = "label() describes each")]
pub enum LookCommand {
    // 3D views.
    SetCamera(Camera),
    LookFrom(AnatomicalView),
    ToggleProjection,
    FitLens,
    SetZoom(PaneId, f64),
    TogglePlane,
    // Crosshair and time points.
    SetCursor(DVec3),
    PreviewCursor(PaneId, Option<DVec3>),
    SetSlice(Plane, f64),
    ToggleFollowPointer,
    SetTime(usize),
    // Measuring.
    ToggleRuler,
    SetTool(Tool),
    ShowRuler(usize),
    // Slices.
    SetContext(Option<String>),
    NextContext,
    SetConvention(Convention),
    SetSliceAxes(AxesOf),
    ToggleTumorAxes(Plane),
    SetSliceZoom(Option<f64>),
    SetPan(Plane, DVec2),
    ResetSlices,
}

impl LookCommand {
    /// The commands of `kind` that need no further input.
    pub(super) fn listed(kind: LookKind) -> Vec<Listed> {
        let listed = |command: Self| Listed::new(command);
        match kind {
            LookKind::LookFrom => AnatomicalView::VARIANTS
                .iter()
                .map(|view| {
                    let key = match view {
                        AnatomicalView::Anterior => Key::Num1,
                        AnatomicalView::Posterior => Key::Num2,
                        AnatomicalView::Left => Key::Num3,
                        AnatomicalView::Right => Key::Num4,
                        AnatomicalView::Superior => Key::Num5,
                        AnatomicalView::Inferior => Key::Num6,
                    };
                    listed(Self::LookFrom(*view)).key(key).menu(Menu::LookFrom, 0)
                })
                .collect(),
            LookKind::ToggleProjection => {
                vec![listed(Self::ToggleProjection).key(Key::P).menu(Menu::View, 3)]
            }
            LookKind::FitLens => {
                vec![listed(Self::FitLens).keys(Modifiers::SHIFT, Key::F).menu(Menu::View, 3)]
            }
            LookKind::TogglePlane => vec![listed(Self::TogglePlane).key(Key::X).menu(Menu::View, 2)],
            LookKind::ToggleFollowPointer => vec![listed(Self::ToggleFollowPointer).menu(Menu::View, 2)],
            LookKind::ToggleRuler => vec![listed(Self::ToggleRuler).key(Key::M).menu(Menu::Tools, 1)],
            LookKind::SetTool => {
                Tool::VARIANTS.iter().map(|tool| listed(Self::SetTool(*tool)).menu(Menu::Tools, 1)).collect()
            }
            LookKind::NextContext => vec![listed(Self::NextContext).key(Key::I)],
            LookKind::SetConvention => Convention::VARIANTS
                .iter()
                .map(|convention| listed(Self::SetConvention(*convention)).menu(Menu::Slices, 0))
                .collect(),
            LookKind::SetSliceAxes => AxesOf::VARIANTS
                .iter()
                .map(|of| listed(Self::SetSliceAxes(*of)).menu(Menu::Slices, 1))
                .collect(),
            LookKind::ToggleTumorAxes => {
                Plane::ALL.map(|plane| listed(Self::ToggleTumorAxes(plane)).menu(Menu::Slices, 2)).into()
            }
            LookKind::ResetSlices => vec![listed(Self::ResetSlices).key(Key::R).menu(Menu::Slices, 3)],
            LookKind::SetCamera
            | LookKind::SetZoom
            | LookKind::SetCursor
            | LookKind::PreviewCursor
            | LookKind::SetSlice
            | LookKind::SetTime
            | LookKind::ShowRuler
            | LookKind::SetContext
            | LookKind::SetSliceZoom
            | LookKind::SetPan => Vec::new(),
        }
    }

    pub(super) fn label(&self) -> Label {
        match self {
            Self::SetCamera(_) => Label::new("Turn"),
            Self::LookFrom(view) => {
                let side: &str = view.into();
                Label::new(format!("Look from {side}"))
            }
            Self::ToggleProjection => Label::new("Perspective or orthographic"),
            Self::FitLens => Label::new("Fit the lens"),
            Self::SetZoom(pane, _) => Label::new(format!("Zoom {}", pane.title())),
            Self::TogglePlane => {
                Label::new("Axial slice in the 3D views").detail("Semi-transparent, through the crosshair")
            }
            Self::SetCursor(_) => Label::new("Move the crosshair"),
            Self::PreviewCursor(..) => Label::new("Show the crosshair under the pointer"),
            Self::SetSlice(..) => Label::new("Go to the slice"),
            Self::ToggleFollowPointer => Label::new("Crosshair follows the pointer")
                .detail("Until it leaves the view; a click moves the crosshair for good"),
            Self::SetTime(_) => Label::new("Show this date"),
            Self::ToggleRuler => Label::new("Ruler on or off")
                .detail("Drag in the closeup from surface to surface, or in a slice"),
            Self::SetTool(tool) => Label::new(format!("Measure: {}", tool.name())).detail(tool.detail()),
            Self::ShowRuler(_) => {
                Label::new("Show the line").detail("Crosshair and closeup go to its middle")
            }
            Self::SetContext(_) => Label::new("Show this image"),
            Self::NextContext => Label::new("Next image on the slices"),
            Self::SetConvention(convention) => Label::new(match convention {
                Convention::Radiological => "Radiological: patient's left on the right",
                Convention::Neurological => "Neurological: patient's left on the left",
            }),
            Self::SetSliceAxes(of) => Label::new(of.name()),
            Self::ToggleTumorAxes(plane) => {
                let text = format!("{} slice alone along the tumour's own axes", plane.name());
                Label::new(text).detail("The principal axes of the masks shown; the other slices stay")
            }
            Self::SetSliceZoom(_) => Label::new("Zoom the slices"),
            Self::SetPan(..) => Label::new("Move the slice"),
            Self::ResetSlices => Label::new("Fit the slices"),
        }
    }

    pub(super) fn entry(&self, doc: &Document) -> Entry {
        match self {
            Self::ToggleFollowPointer => Entry::Switch(doc.nav.follow_pointer),
            Self::TogglePlane => Entry::Switch(doc.nav.show_plane),
            Self::ToggleRuler => Entry::Switch(doc.nav.ruler_on),
            Self::SetTool(tool) => Entry::Choice(doc.nav.ruler_on && doc.nav.tool == *tool),
            Self::SetConvention(convention) => Entry::Choice(doc.nav.convention == *convention),
            Self::SetSliceAxes(of) => Entry::Choice(doc.nav.slice_axes.of == *of),
            Self::ToggleTumorAxes(plane) => Entry::Switch(doc.nav.own_axes.contains_key(plane)),
            _ => Entry::Plain,
        }
    }

    /// Applies the command to the document.
    pub(super) fn apply(&self, doc: &mut Document, world: &World) {
        let Some(time_point) = world.time_point(doc) else { return };
        let Document { edit, nav, .. } = doc;
        match self {
            Self::SetCamera(camera) => nav.camera = *camera,
            Self::LookFrom(view) => {
                let (azimuth, elevation) = view.azimuth_elevation_deg();
                nav.camera.world_from_camera = Camera::orientation(azimuth, elevation);
            }
            Self::ToggleProjection => {
                nav.camera.projection = match nav.camera.projection {
                    Projection::Perspective => Projection::Orthographic,
                    Projection::Orthographic => Projection::Perspective,
                };
            }
            Self::FitLens => {
                let Camera { world_from_camera, projection, .. } = nav.camera;
                let lens = &edit.lens;
                nav.camera = Camera::fit(lens.center_mm, lens.radius_mm, world_from_camera, projection);
            }
            Self::SetZoom(pane, zoom) => {
                if zoom.is_finite() {
                    nav.zooms.insert(*pane, *zoom);
                }
            }
            Self::TogglePlane => nav.show_plane = !nav.show_plane,
            Self::SetCursor(cursor_mm) => {
                if cursor_mm.is_finite() {
                    nav.pin_mm(*cursor_mm);
                }
            }
            Self::PreviewCursor(pane, Some(place_mm)) => {
                if place_mm.is_finite() {
                    nav.preview = Some((*pane, *place_mm));
                }
            }
            // The pointer may be over another pane already, whose preview stays.
            Self::PreviewCursor(pane, None) => nav.preview = nav.preview.filter(|(of, _)| of != pane),
            Self::SetSlice(plane, along_mm) => {
                let shown = nav.preview.as_mut().map(|(_, place_mm)| place_mm);
                for place_mm in shown.into_iter().chain([&mut nav.cursor_mm]) {
                    if along_mm.is_finite() {
                        place_mm[plane.axis()] = *along_mm;
                    }
                }
            }
            Self::ToggleFollowPointer => {
                nav.follow_pointer = !nav.follow_pointer;
                nav.preview = None;
            }
            Self::SetTime(time) => nav.time = (*time).min(world.time_point_count().saturating_sub(1)),
            Self::ToggleRuler => nav.ruler_on = !nav.ruler_on,
            Self::SetTool(tool) => (nav.ruler_on, nav.tool) = (true, *tool),
            Self::ShowRuler(index) => show_ruler(doc, world, *index),
            Self::SetContext(id) => nav.context.clone_from(id),
            Self::NextContext => {
                let ids: Vec<&String> = time_point.contexts.iter().map(|c| &c.id).collect();
                let current = nav.context.as_ref().and_then(|id| ids.iter().position(|i| *i == id));
                let next = current.map_or(0, |index| index + 1);
                nav.context = ids.get(next).or(ids.first()).map(|id| (*id).clone());
            }
            Self::SetConvention(convention) => nav.convention = *convention,
            Self::SetSliceAxes(of) => {
                if let Some(axes) = world.slice_axes(doc, *of) {
                    doc.nav.slice_axes = axes;
                    doc.nav.own_axes.clear();
                    // Along other axes.
                    doc.nav.pan_mm = [DVec2::ZERO; 3];
                }
            }
            Self::ToggleTumorAxes(plane) => {
                let was_own = doc.nav.own_axes.remove(plane).is_some();
                let axes = world.slice_axes(doc, AxesOf::Tumor).filter(|_| !was_own);
                doc.nav.own_axes.extend(axes.map(|axes| (*plane, axes)));
                doc.nav.pan_mm[*plane as usize] = DVec2::ZERO;
            }
            Self::SetSliceZoom(mm_per_point) => {
                nav.mm_per_point = mm_per_point.filter(|z| z.is_finite()).map(|z| z.clamp(1e-3, 1e3));
            }
            Self::SetPan(plane, pan_mm) => {
                if pan_mm.is_finite() {
                    nav.pan_mm[*plane as usize] = *pan_mm;
                }
            }
            Self::ResetSlices => {
                nav.mm_per_point = None;
                nav.pan_mm = [DVec2::ZERO; 3];
            }
        }
    }
}

/// Centres the crosshair, the closeup and the slices on the midpoint of a line; the lens stays where it is.
fn show_ruler(doc: &mut Document, world: &World, index: usize) {
    let Some(ruler) = doc.edit.rulers.get(index) else { return };
    let middle_mm = ruler.middle_mm();
    if ruler.time < world.time_point_count() {
        doc.nav.time = ruler.time;
    }
    center_on(doc, world, middle_mm);
}

/// Centres the crosshair, the closeup and zoomed slices on a place.
pub(super) fn center_on(doc: &mut Document, world: &World, place_mm: DVec3) {
    doc.nav.pin_mm(place_mm);
    doc.nav.camera.focus_mm = place_mm;
    if doc.nav.mm_per_point.is_none() {
        return;
    }
    // Zoomed slices may not contain the point: pan them so that it is at their centre.
    let bounds_mm = match (world.context(doc), world.case()) {
        (Some((_, image)), _) => image.volume().grid().bounds_mm(),
        (None, Some(case)) => case.grid.bounds_mm(),
        (None, None) => return,
    };
    for plane in Plane::ALL {
        let orientation = (doc.nav.convention, doc.nav.turn_of(plane));
        let fitted = SliceView::fit_turned(plane, orientation, bounds_mm, place_mm, [1, 1]);
        let offset_mm = place_mm - fitted.center_mm;
        doc.nav.pan_mm[plane as usize] =
            DVec2::new(offset_mm.dot(fitted.right()), offset_mm.dot(fitted.down()));
    }
}
