//! Everything a user can do, as one exhaustive enum: its text, tooltip, shortcut and palette entry,
//! and what it does to the document.

use std::{collections::BTreeSet, path::PathBuf};

use egui::{Key, KeyboardShortcut, Modifiers};
use egui_tiles::Tree;
use glam::{DVec2, DVec3};
use glioscope_core::Selection;
use glioscope_render::{
    AnatomicalView, Camera, ClipPlane, Coloring, Palette, Preset, Projection, Shading, TransferFunction,
    slices::{Convention, Overlay, Plane, Window},
};

use crate::{
    comparing::ChangeSetting,
    document::{self, CaseRef, Document, Pane, Ruler},
    layout,
    rulers::{self, RulerFormat},
    views::{
        ellipsoids::{EllipsoidLook, OwnOpacity},
        overlap::{self, OverlapMode},
    },
    world::World,
};

/// Something the user did or asks for.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "text() says in words what each does")]
pub enum Command {
    // The case and the program.
    OpenDialog,
    Open(CaseRef),
    OpenSample,
    OpenSession(PathBuf),
    AddTracts(Vec<PathBuf>),
    SaveSession,
    SaveSessionAs,
    SaveSessionTo(PathBuf),
    CancelLoading,
    AcceptGuess(bool),
    ScreenshotWindow,
    ScreenshotPane(Pane),
    ScreenshotTo(Option<Pane>, PathBuf),
    ExportMeasurements,
    ExportMeasurementsTo(PathBuf),
    BrowseFiles,
    BrowseFolders,
    ClearRecent,
    Undo,
    Redo,
    ShowPalette,
    ShowAbout,
    ToggleDark,
    Quit,
    // Regions.
    ToggleRegion(u32),
    OnlyRegion(u32),
    SetRegion(u32, bool),
    ShowAllRegions,
    ToggleMask(usize),
    OnlyMask(usize),
    SetOverlapMode(OverlapMode),
    SetPalette(Palette),
    SetColoring(Coloring),
    // Lens and camera.
    ToggleLens,
    SetLensRadius(f64),
    SetLensCenter(DVec3),
    DragLensCenter(DVec3),
    LensToCursor,
    FitTumor,
    FitLens,
    SetCamera(Camera),
    Look(AnatomicalView),
    ToggleProjection,
    ToggleFollowPointer,
    TogglePlane,
    SetPaneZoom(Pane, f64),
    // Context view and ellipsoid diagram.
    SetTransfer(String, Option<TransferFunction>),
    SetClips(Vec<ClipPlane>),
    ToggleTracts(String),
    ToggleAllTracts,
    SetEllipsoidLook(EllipsoidLook),
    SetEllipsoidOpacities(Vec<OwnOpacity>),
    SetChange(Box<ChangeSetting>),
    SetShading(Shading),
    SetPreset(Option<Preset>),
    SetAperture(f64),
    // Measuring.
    ToggleRuler,
    AddRuler(Box<Ruler>),
    RenameRuler(usize, String),
    DeleteRuler(usize),
    ShowRuler(usize),
    ExportRulers(RulerFormat),
    ExportRulersTo(PathBuf),
    // Slices.
    SetCursor(DVec3),
    SetContext(Option<String>),
    NextContext,
    SetWindow(String, Window),
    SetOverlay(Overlay),
    NextOverlay,
    SetOverlayOpacity(f32),
    SetConvention(Convention),
    SetZoom(Option<f64>),
    SetPan(Plane, DVec2),
    ResetSlices,
    SetTime(usize),
    // Panes.
    TogglePane(Pane),
    SetLayout(Box<Tree<Pane>>),
    MaximizePane(Pane),
    ResetLayout,
}

const CTRL: Modifiers = Modifiers::COMMAND;

impl Command {
    /// The commands that need no argument: what the palette lists, besides one for every pane.
    pub fn listed() -> Vec<Self> {
        let mut all = vec![
            Self::OpenDialog,
            Self::OpenSample,
            Self::SaveSession,
            Self::SaveSessionAs,
            Self::ExportMeasurements,
            Self::BrowseFiles,
            Self::BrowseFolders,
            Self::ClearRecent,
            Self::ScreenshotWindow,
            Self::ScreenshotPane(Pane::Closeup),
            Self::ScreenshotPane(Pane::Context),
            Self::ScreenshotPane(Pane::Ellipsoids),
            Self::ScreenshotPane(Pane::Change),
            Self::ScreenshotPane(Pane::Overlap),
            Self::Undo,
            Self::Redo,
            Self::ShowPalette,
            Self::ShowAllRegions,
            Self::SetOverlapMode(OverlapMode::Regions),
            Self::SetOverlapMode(OverlapMode::WholeMasks),
            Self::SetPalette(Palette::Thesis),
            Self::SetPalette(Palette::ColorBlindSafe),
            Self::SetColoring(Coloring::Masks),
            Self::SetColoring(Coloring::Agreement),
            Self::SetShading(Shading::ScreenSpace),
            Self::SetShading(Shading::Slices),
            Self::SetShading(Shading::Cones),
            Self::SetPreset(None),
            Self::SetPreset(Some(Preset::Draft)),
            Self::SetPreset(Some(Preset::Balanced)),
            Self::SetPreset(Some(Preset::Reference)),
            Self::ToggleRuler,
            Self::ExportRulers(RulerFormat::Csv),
            Self::ExportRulers(RulerFormat::Json),
            Self::ToggleLens,
            Self::LensToCursor,
            Self::FitTumor,
            Self::FitLens,
            Self::ToggleProjection,
            Self::ToggleFollowPointer,
            Self::TogglePlane,
            Self::ToggleAllTracts,
            Self::NextContext,
            Self::NextOverlay,
            Self::SetConvention(Convention::Radiological),
            Self::SetConvention(Convention::Neurological),
            Self::ResetSlices,
            Self::ResetLayout,
            Self::ToggleDark,
            Self::ShowAbout,
            Self::Quit,
        ];
        all.extend(AnatomicalView::ALL.map(Self::Look));
        let planes = [Plane::Axial, Plane::Coronal, Plane::Sagittal].map(Pane::Slice);
        for pane in Pane::NOT_SLICES.into_iter().chain(planes) {
            all.push(Self::TogglePane(pane));
            all.push(Self::MaximizePane(pane));
        }
        all
    }

    /// What menus, buttons and the palette call it.
    pub fn text(&self) -> String {
        match self {
            Self::OpenDialog => "Open a case…".into(),
            Self::Open(_) => "Open this case".into(),
            Self::OpenSample => "Open the sample case".into(),
            Self::OpenSession(_) => "Open this session".into(),
            Self::AddTracts(_) => "Add these fibre tracts".into(),
            Self::SaveSession => "Save the session".into(),
            Self::SaveSessionAs => "Save the session as…".into(),
            Self::SaveSessionTo(_) => "Save the session here".into(),
            Self::CancelLoading => "Cancel loading".into(),
            Self::AcceptGuess(true) => "Open it like this".into(),
            Self::AcceptGuess(false) => "Don't open it".into(),
            Self::ScreenshotWindow => "Picture of the window…".into(),
            Self::ScreenshotPane(pane) => format!("Picture of {}…", pane.title()),
            Self::ScreenshotTo(..) => "Write the picture".into(),
            Self::ExportMeasurements => "Export measurements…".into(),
            Self::ExportMeasurementsTo(_) => "Write the measurements".into(),
            Self::BrowseFiles => "Browse for a case file…".into(),
            Self::BrowseFolders => "Browse for a case folder…".into(),
            Self::ClearRecent => "Forget recent cases".into(),
            Self::Undo => "Undo".into(),
            Self::Redo => "Redo".into(),
            Self::ShowPalette => "All commands…".into(),
            Self::ShowAbout => "About Glioscope".into(),
            Self::ToggleDark => "Light or dark".into(),
            Self::Quit => "Quit".into(),
            Self::ToggleRegion(_) => "Show or hide the region".into(),
            Self::OnlyRegion(_) => "Show only this region".into(),
            Self::SetRegion(_, true) => "Show the region".into(),
            Self::SetRegion(_, false) => "Hide the region".into(),
            Self::ShowAllRegions => "Show all regions".into(),
            Self::ToggleMask(_) => "Show or hide the mask".into(),
            Self::OnlyMask(_) => "Show only this mask".into(),
            Self::SetOverlapMode(OverlapMode::Regions) => "Diagram selects regions".into(),
            Self::SetOverlapMode(OverlapMode::WholeMasks) => {
                "Diagram selects whole masks (no overlaps)".into()
            }
            Self::SetPalette(Palette::Thesis) => "Colours: red, green, blue".into(),
            Self::SetPalette(Palette::ColorBlindSafe) => "Colours: colour-blind safe".into(),
            Self::SetColoring(Coloring::Masks) => "Colours: which masks".into(),
            Self::SetColoring(Coloring::Agreement) => "Colours: how many masks agree".into(),
            Self::ToggleRuler => "Ruler on or off".into(),
            Self::AddRuler(_) => "Keep the line measured".into(),
            Self::RenameRuler(..) => "Name the line".into(),
            Self::DeleteRuler(_) => "Delete the line".into(),
            Self::ShowRuler(_) => "Show the line".into(),
            Self::ExportRulers(format) => format!("Export lines as {}…", format.name()),
            Self::ExportRulersTo(_) => "Write the lines".into(),
            Self::ToggleLens => "Lens on or off".into(),
            Self::SetLensRadius(_) => "Lens radius".into(),
            Self::SetLensCenter(_) | Self::DragLensCenter(_) => "Move the lens".into(),
            Self::LensToCursor => "Move the lens to the crosshair".into(),
            Self::FitTumor => "Fit the tumour".into(),
            Self::FitLens => "Fit the lens".into(),
            Self::SetCamera(_) => "Turn".into(),
            Self::Look(view) => format!("Look from {}", format!("{view:?}").to_lowercase()),
            Self::ToggleProjection => "Perspective or orthographic".into(),
            Self::ToggleFollowPointer => "Crosshair follows the pointer".into(),
            Self::TogglePlane => "Axial slice in the 3D views".into(),
            Self::SetPaneZoom(pane, _) => format!("Zoom {}", pane.title()),
            Self::SetTransfer(_, Some(_)) => "Transfer function".into(),
            Self::SetTransfer(_, None) => "Transfer function to begin with".into(),
            Self::SetClips(_) => "Cut the image open".into(),
            Self::ToggleTracts(id) => format!("Show or hide fibre tracts {id}"),
            Self::ToggleAllTracts => "Show or hide all fibre tracts".into(),
            Self::SetEllipsoidLook(_) => "Look of the ellipsoid diagram".into(),
            Self::SetEllipsoidOpacities(_) => "Opacity of an ellipsoid".into(),
            Self::SetChange(_) => "Compare dates".into(),
            Self::SetShading(shading) => format!("Light: {}", shading.title().to_lowercase()),
            Self::SetPreset(None) => "Quality: automatic".into(),
            Self::SetPreset(Some(preset)) => format!("Quality: {}", preset.name()),
            Self::SetAperture(_) => "Aperture of the light".into(),
            Self::SetCursor(_) => "Move the crosshair".into(),
            Self::SetContext(_) => "Show this image".into(),
            Self::NextContext => "Next image on the slices".into(),
            Self::SetWindow(..) => "Window and level".into(),
            Self::SetOverlay(style) => format!("Masks on slices: {style:?}").to_lowercase(),
            Self::NextOverlay => "Masks on slices: fill, outline, both".into(),
            Self::SetOverlayOpacity(_) => "Opacity of masks".into(),
            Self::SetConvention(Convention::Radiological) => {
                "Radiological: patient's left on the right".into()
            }
            Self::SetConvention(Convention::Neurological) => {
                "Neurological: patient's left on the left".into()
            }
            Self::SetZoom(_) => "Zoom the slices".into(),
            Self::SetPan(..) => "Move the slice".into(),
            Self::ResetSlices => "Fit the slices".into(),
            Self::SetTime(_) => "Show this date".into(),
            Self::TogglePane(pane) => format!("Show or hide {}", pane.title()),
            Self::SetLayout(_) => "Arrange panes".into(),
            Self::MaximizePane(pane) => format!("Maximise {}", pane.title()),
            Self::ResetLayout => "Default layout".into(),
        }
    }

    /// More words, for tooltips.
    pub fn tooltip(&self) -> String {
        let more = match self {
            Self::OpenDialog => "A manifest, a NIfTI file, or drop a folder on the window",
            Self::SaveSession => "Selection, lens, views and layout; the images stay where they are",
            Self::ExportMeasurements => "Every number of the case as JSON",
            Self::ToggleLens => "Inside the lens: the selection, in full. Outside: everything, faint",
            Self::LensToCursor => "The camera turns about the lens",
            Self::SetColoring(Coloring::Masks) => "A region has the colours of its masks, mixed",
            Self::SetColoring(Coloring::Agreement) => {
                "Dark blue where one mask is active, light yellow where all are"
            }
            Self::ToggleRuler => "Drag in the closeup from surface to surface, or in a slice",
            Self::ExportRulers(_) => "Every line measured, in millimetres",
            Self::ShowRuler(_) => "Crosshair and closeup go to its middle",
            Self::SetOverlapMode(_) => {
                "Regions: each overlap apart. Whole masks: overlaps are not told apart"
            }
            Self::ToggleFollowPointer => "Off: click a view to move the crosshair of all",
            Self::ToggleAllTracts => "In the context view",
            Self::TogglePlane => "Semi-transparent, through the crosshair",
            Self::SetShading(Shading::ScreenSpace) => {
                "Fastest: relief from the image's gradients, corners of the tumour darker"
            }
            Self::SetShading(Shading::Slices) => {
                "Soft shadows of tissue on tissue and on the tumour; light comes from the eye"
            }
            Self::SetShading(Shading::Cones) => {
                "Soft shadows, also of the tumour on itself; nearest to the truth"
            }
            Self::SetPreset(None) => "Fluent while something moves, then as good as it gets",
            Self::SetPreset(Some(_)) => "The same whether something moves or not",
            Self::MaximizePane(_) => "Again brings the other panes back",
            _ => "",
        };
        let keys = self.shortcut().map(|s| s.format(&egui::ModifierNames::NAMES, false));
        match (more.is_empty(), keys) {
            (true, None) => self.text(),
            (true, Some(keys)) => format!("{} ({keys})", self.text()),
            (false, None) => format!("{}. {more}", self.text()),
            (false, Some(keys)) => format!("{} ({keys}). {more}", self.text()),
        }
    }

    /// Keys that do it.
    pub fn shortcut(&self) -> Option<KeyboardShortcut> {
        let plain = |key| Some(KeyboardShortcut::new(Modifiers::NONE, key));
        match self {
            Self::OpenDialog => Some(KeyboardShortcut::new(CTRL, Key::O)),
            Self::SaveSession => Some(KeyboardShortcut::new(CTRL, Key::S)),
            Self::SaveSessionAs => Some(KeyboardShortcut::new(CTRL | Modifiers::SHIFT, Key::S)),
            Self::ExportMeasurements => Some(KeyboardShortcut::new(CTRL, Key::E)),
            Self::Undo => Some(KeyboardShortcut::new(CTRL, Key::Z)),
            Self::Redo => Some(KeyboardShortcut::new(CTRL | Modifiers::SHIFT, Key::Z)),
            Self::ShowPalette => Some(KeyboardShortcut::new(CTRL, Key::P)),
            Self::Quit => Some(KeyboardShortcut::new(CTRL, Key::Q)),
            Self::ScreenshotWindow => plain(Key::F12),
            Self::ShowAbout => plain(Key::F1),
            Self::ShowAllRegions => plain(Key::A),
            Self::ToggleLens => plain(Key::L),
            Self::LensToCursor => plain(Key::C),
            Self::ToggleRuler => plain(Key::M),
            Self::FitTumor => plain(Key::F),
            Self::FitLens => Some(KeyboardShortcut::new(Modifiers::SHIFT, Key::F)),
            Self::ToggleProjection => plain(Key::P),
            Self::TogglePlane => plain(Key::X),
            Self::ToggleAllTracts => plain(Key::T),
            Self::NextContext => plain(Key::I),
            Self::NextOverlay => plain(Key::O),
            Self::ResetSlices => plain(Key::R),
            Self::TogglePane(Pane::Diagnostics) => plain(Key::D),
            Self::Look(view) => plain(match view {
                AnatomicalView::Anterior => Key::Num1,
                AnatomicalView::Posterior => Key::Num2,
                AnatomicalView::Left => Key::Num3,
                AnatomicalView::Right => Key::Num4,
                AnatomicalView::Superior => Key::Num5,
                AnatomicalView::Inferior => Key::Num6,
            }),
            _ => None,
        }
    }

    /// What runs of one gesture share: commands with the same key, one soon after the other, are
    /// undone together. `None`: each is undone by itself.
    pub fn gesture(&self) -> Option<&'static str> {
        match self {
            Self::SetLensRadius(_) => Some("lens radius"),
            Self::SetLensCenter(_) | Self::DragLensCenter(_) => Some("lens centre"),
            Self::RenameRuler(..) => Some("name of a line"),
            Self::SetWindow(..) => Some("window"),
            Self::SetOverlayOpacity(_) => Some("opacity"),
            Self::SetLayout(_) => Some("layout"),
            Self::SetTransfer(..) => Some("transfer"),
            Self::SetClips(_) => Some("clips"),
            Self::SetEllipsoidLook(_) => Some("ellipsoids"),
            Self::SetEllipsoidOpacities(_) => Some("ellipsoid opacity"),
            Self::SetChange(_) => Some("change"),
            Self::SetAperture(_) => Some("aperture"),
            _ => None,
        }
    }

    /// Does what a command does to the document. Commands that reach outside it (files, dialogs,
    /// the window) change nothing here.
    pub fn apply(&self, doc: &mut Document, world: &World) {
        let Some(time_point) = world.time_point(doc) else { return };
        let regions = &time_point.regions;
        let edit = &mut doc.edit;
        let nav = &mut doc.nav;
        match self {
            Self::ToggleRegion(bits) => edit.selection.toggle(*bits),
            Self::OnlyRegion(bits) => edit.selection = Selection::only(regions, &[*bits]),
            Self::SetRegion(bits, shown) => edit.selection.set(*bits, *shown),
            Self::ShowAllRegions => edit.selection = Selection::all(),
            Self::ToggleMask(mask) if edit.overlap_mode == OverlapMode::WholeMasks => {
                edit.selection = overlap::with_mask_toggled(regions, &edit.selection, *mask);
            }
            Self::ToggleMask(mask) => {
                let of_mask = || regions.list().iter().map(|r| r.bits).filter(|b| b >> mask & 1 == 1);
                let all_shown = of_mask().all(|bits| edit.selection.shows(bits));
                for bits in of_mask() {
                    edit.selection.set(bits, !all_shown);
                }
            }
            Self::OnlyMask(mask) => {
                let of_mask: Vec<u32> =
                    regions.list().iter().map(|r| r.bits).filter(|b| b >> mask & 1 == 1).collect();
                edit.selection = Selection::only(regions, &of_mask);
            }
            Self::SetOverlapMode(mode) => edit.overlap_mode = *mode,
            Self::SetPalette(palette) => edit.palette = *palette,
            Self::SetColoring(coloring) => edit.coloring = *coloring,
            Self::ToggleLens => edit.lens_on = !edit.lens_on,
            Self::SetLensRadius(radius_mm) if radius_mm.is_finite() => {
                edit.lens.radius_mm = radius_mm.clamp(0.1, 1000.0);
            }
            Self::SetLensCenter(center_mm) if center_mm.is_finite() => {
                edit.lens.center_mm = *center_mm;
                nav.camera.focus_mm = *center_mm;
            }
            // The camera waits until the drag is over: it would carry the surface off under the pointer.
            Self::DragLensCenter(center_mm) if center_mm.is_finite() => edit.lens.center_mm = *center_mm,
            Self::LensToCursor => {
                edit.lens.center_mm = nav.cursor_mm;
                nav.camera.focus_mm = nav.cursor_mm;
            }
            Self::FitTumor => {
                let camera = nav.camera;
                let radius_mm = document::tumor_radius_mm(time_point);
                edit.lens = document::default_lens(time_point);
                nav.camera =
                    Camera::fit(edit.lens.center_mm, radius_mm, camera.world_from_camera, camera.projection);
            }
            Self::FitLens => {
                let camera = nav.camera;
                nav.camera = Camera::fit(
                    edit.lens.center_mm,
                    edit.lens.radius_mm,
                    camera.world_from_camera,
                    camera.projection,
                );
            }
            Self::SetCamera(camera) => nav.camera = *camera,
            Self::Look(view) => {
                let (azimuth, elevation) = view.azimuth_elevation_deg();
                nav.camera.world_from_camera = Camera::orientation(azimuth, elevation);
            }
            Self::ToggleProjection => {
                nav.camera.projection = match nav.camera.projection {
                    Projection::Perspective => Projection::Orthographic,
                    Projection::Orthographic => Projection::Perspective,
                };
            }
            Self::ToggleFollowPointer => nav.follow_pointer = !nav.follow_pointer,
            Self::TogglePlane => nav.show_plane = !nav.show_plane,
            Self::SetPaneZoom(Pane::Context, zoom) if zoom.is_finite() => nav.context_zoom = *zoom,
            Self::SetPaneZoom(Pane::Ellipsoids, zoom) if zoom.is_finite() => nav.ellipsoid_zoom = *zoom,
            Self::SetTransfer(id, Some(transfer)) => {
                edit.transfers.insert(id.clone(), transfer.clone());
            }
            Self::SetTransfer(id, None) => {
                edit.transfers.remove(id);
            }
            Self::SetClips(clips) => edit.clips.clone_from(clips),
            Self::ToggleTracts(id) => {
                if !edit.hidden_tracts.remove(id) {
                    edit.hidden_tracts.insert(id.clone());
                }
            }
            Self::ToggleAllTracts => {
                let ids: BTreeSet<String> =
                    world.case().iter().flat_map(|c| &c.tracts).map(|t| t.id.clone()).collect();
                edit.hidden_tracts = if ids.is_subset(&edit.hidden_tracts) { BTreeSet::new() } else { ids };
            }
            Self::SetEllipsoidLook(look) => edit.ellipsoids = *look,
            Self::SetEllipsoidOpacities(all) => edit.ellipsoid_opacities.clone_from(all),
            Self::SetChange(setting) => edit.change.clone_from(setting),
            Self::SetShading(shading) => edit.light.shading = *shading,
            Self::SetPreset(preset) => edit.light.preset = *preset,
            Self::SetAperture(degrees) => edit.light.aperture_deg = *degrees,
            Self::SetPaneZoom(Pane::Change, zoom) if zoom.is_finite() => nav.change_zoom = *zoom,
            Self::ToggleRuler => nav.ruler_on = !nav.ruler_on,
            Self::AddRuler(ruler) if ruler.length_mm().is_finite() => edit.rulers.push((**ruler).clone()),
            Self::RenameRuler(at, name) => {
                if let Some(ruler) = edit.rulers.get_mut(*at) {
                    ruler.name.clone_from(name);
                }
            }
            Self::DeleteRuler(at) if *at < edit.rulers.len() => {
                edit.rulers.remove(*at);
            }
            Self::ShowRuler(at) => rulers::look_at(doc, world, *at),
            Self::SetCursor(mm) if mm.is_finite() => nav.cursor_mm = *mm,
            Self::SetContext(id) => nav.context.clone_from(id),
            Self::NextContext => {
                let ids: Vec<&String> = time_point.contexts.iter().map(|c| &c.id).collect();
                let here = nav.context.as_ref().and_then(|id| ids.iter().position(|i| *i == id));
                let next = here.map_or(0, |at| at + 1);
                nav.context = ids.get(next).or(ids.first()).map(|id| (*id).clone());
            }
            Self::SetWindow(id, window) => {
                edit.windows.insert(id.clone(), *window);
            }
            Self::SetOverlay(style) => edit.overlay = *style,
            Self::NextOverlay => {
                edit.overlay = match edit.overlay {
                    Overlay::Fill => Overlay::Outline,
                    Overlay::Outline => Overlay::Both,
                    Overlay::Both => Overlay::Fill,
                };
            }
            Self::SetOverlayOpacity(opacity) => edit.overlay_opacity = opacity.clamp(0.0, 1.0),
            Self::SetConvention(convention) => nav.convention = *convention,
            Self::SetZoom(mm_per_point) => {
                nav.mm_per_point = mm_per_point.filter(|z| z.is_finite()).map(|z| z.clamp(1e-3, 1e3));
            }
            Self::SetPan(plane, pan_mm) if pan_mm.is_finite() => nav.pan_mm[*plane as usize] = *pan_mm,
            Self::ResetSlices => {
                nav.mm_per_point = None;
                nav.pan_mm = [DVec2::ZERO; 3];
            }
            Self::SetTime(time) => nav.time = (*time).min(world.time_point_count().saturating_sub(1)),
            Self::TogglePane(pane) => layout::toggle(&mut edit.layout, *pane),
            Self::SetLayout(tree) => edit.layout = (**tree).clone(),
            Self::MaximizePane(pane) => {
                edit.maximized = (edit.maximized != Some(*pane)).then_some(*pane);
            }
            Self::ResetLayout => {
                edit.layout = layout::default_layout(world.time_point_count());
                edit.maximized = None;
            }
            Self::SetLensRadius(_)
            | Self::SetLensCenter(_)
            | Self::DragLensCenter(_)
            | Self::AddRuler(_)
            | Self::DeleteRuler(_)
            | Self::ExportRulers(_)
            | Self::ExportRulersTo(_)
            | Self::SetCursor(_)
            | Self::SetPaneZoom(..)
            | Self::SetPan(..)
            | Self::OpenDialog
            | Self::Open(_)
            | Self::OpenSample
            | Self::OpenSession(_)
            | Self::AddTracts(_)
            | Self::SaveSession
            | Self::SaveSessionAs
            | Self::SaveSessionTo(_)
            | Self::CancelLoading
            | Self::AcceptGuess(_)
            | Self::ScreenshotWindow
            | Self::ScreenshotPane(_)
            | Self::ScreenshotTo(..)
            | Self::ExportMeasurements
            | Self::ExportMeasurementsTo(_)
            | Self::BrowseFiles
            | Self::BrowseFolders
            | Self::ClearRecent
            | Self::Undo
            | Self::Redo
            | Self::ShowPalette
            | Self::ShowAbout
            | Self::ToggleDark
            | Self::Quit => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn no_two_commands_share_keys_or_words() {
        let mut keys: BTreeMap<String, String> = BTreeMap::new();
        let mut texts: BTreeMap<String, Command> = BTreeMap::new();
        for command in Command::listed() {
            if let Some(shortcut) = command.shortcut() {
                let keys_text = shortcut.format(&egui::ModifierNames::NAMES, false);
                let before = keys.insert(keys_text.clone(), command.text());
                assert_eq!(before, None, "{keys_text}");
            }
            assert!(!command.text().is_empty() && !command.tooltip().is_empty());
            assert_eq!(texts.insert(command.text(), command.clone()), None);
        }
    }
}
