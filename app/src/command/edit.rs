//! Commands that change state covered by undo.

use std::collections::{BTreeMap, BTreeSet};

use egui::{Key, Modifiers};
use egui_tiles::Tree;
use glam::DVec3;
use glioscope_core::{Regions, Selection, case::Alignment, lesions, optics::Camera};
use glioscope_render::{
    ClipPlane, Coloring, Lamp, Lens, LightingMode, Palette, Preset, TransferFunction,
    flat::{Overlay, Window},
    light,
};
use strum::{EnumDiscriminants, EnumIter, VariantArray};

use super::{Entry, Label, Listed, Menu};
use crate::{
    model::{
        AgreementSetting, ChangeSetting, Document, EllipsoidLook, EllipsoidOpacity, FiberLook, Fusion,
        HiddenRegions, KeyPicture, LesionSetting, OverlapMode, PaneId, Reading, ResponseSetting, Ruler,
        Shading, TakeHome,
        document::{default_lens, tumor_radius_mm},
        fusion::{is_pet, second_of},
        layout::{self, Held, Task},
        lesions::MOST_LESION_EDITS,
        made::{MOST_MADE, MadeMask},
        masks::MaskLook,
        overlap::{regions_of_mask, with_mask_toggled},
        rulers::MOST_RULERS,
    },
    world::World,
};

/// A command that changes state covered by undo.
#[derive(Clone, Debug, PartialEq, EnumDiscriminants)]
#[strum_discriminants(name(EditKind), vis(pub(super)), derive(EnumIter))]
#[allow(missing_docs, reason = "label() describes each")]
pub enum EditCommand {
    Undo,
    Redo,
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
    SetMaskLook(String, MaskLook),
    MakeMask(Box<MadeMask>),
    /// By id and label of its date.
    DeleteMadeMask(String, String),
    // Lens.
    ToggleLens,
    SetLensRadius(f64),
    SetLensCenter(DVec3),
    DragLensCenter(DVec3),
    LensToCursor,
    GoTo(DVec3, f64),
    FitTumor,
    // Context view, ellipsoid diagram, change view.
    SetTransfer(String, Option<TransferFunction>),
    SetClips(Vec<ClipPlane>),
    ToggleTracts(String),
    ToggleAllTracts,
    /// Of these ids; others keep theirs.
    SetTractLooks(BTreeMap<String, FiberLook>),
    SetEllipsoidLook(EllipsoidLook),
    SetEllipsoidOpacities(Vec<EllipsoidOpacity>),
    SetChange(Box<ChangeSetting>),
    SetAgreement(Box<AgreementSetting>),
    // Lesions.
    SetLesions(Box<LesionSetting>),
    EditLesions(Vec<lesions::Edit>),
    SetResponse(Box<ResponseSetting>),
    // Light.
    SetLightingMode(LightingMode),
    SetPreset(Option<Preset>),
    SetAperture(f64),
    SetLamp(Lamp),
    /// Whether the cone of light points to the lamp instead of to the eye.
    SetTowardsLamp(bool),
    SetShading(Box<Shading>),
    // Measuring.
    AddRuler(Box<Ruler>),
    RenameRuler(usize, String),
    /// A measurement after one of its handles was dragged.
    SetRuler(usize, Box<Ruler>),
    /// The last measurement of another date, again at the date shown.
    MeasureAgain,
    DeleteRuler(usize),
    // Slices.
    SetWindow(String, Window),
    SetOverlay(Overlay),
    NextOverlay,
    SetOverlayOpacity(f32),
    ToggleOutlinePatterns,
    SetFusion(Box<Fusion>),
    // Panes.
    TogglePane(PaneId),
    MaximizePane(PaneId),
    SetLayout(Box<Tree<PaneId>>),
    ResetLayout,
    SetTask(Task),
    /// A layout that the user kept, by its name.
    UseLayout(String, Box<Tree<PaneId>>),
    // Report.
    /// With its size on the screen, points.
    KeepPicture(PaneId, [f32; 2]),
    SetPictures(Vec<KeyPicture>),
    SetReading(Box<Reading>),
    SetTakeHome(Box<TakeHome>),
    // Registration.
    SetAlignments(Vec<Alignment>),
}

const CTRL: Modifiers = Modifiers::COMMAND;

/// What edits of lesions do, for undo.
fn lesion_edit_text(edits: &[lesions::Edit]) -> &'static str {
    let [edit] = edits else { return "Verify the links" };
    match edit {
        lesions::Edit::Link { .. } => "Link the lesions",
        lesions::Edit::Unlink { .. } => "Unlink the lesions",
        lesions::Edit::Merge { .. } => "Merge the lesions",
        lesions::Edit::Split { .. } => "Split the lesion at its neck",
        lesions::Edit::Ignore { .. } => "Ignore the component: no lesion",
        lesions::Edit::Name { .. } => "Name the lesion",
        lesions::Edit::Verify { .. } => "Verify the link",
        lesions::Edit::VerifyAll => "Verify all links",
    }
}

impl EditCommand {
    /// The commands of `kind` that need no further input.
    pub(super) fn listed(kind: EditKind) -> Vec<Listed> {
        let listed = |command: Self| Listed::new(command);
        match kind {
            EditKind::Undo => vec![listed(Self::Undo).keys(CTRL, Key::Z).menu(Menu::Edit, 0)],
            EditKind::Redo => {
                vec![listed(Self::Redo).keys(CTRL | Modifiers::SHIFT, Key::Z).menu(Menu::Edit, 0)]
            }
            EditKind::ShowAllRegions => vec![listed(Self::ShowAllRegions).key(Key::A).menu(Menu::Edit, 1)],
            EditKind::SetOverlapMode => OverlapMode::VARIANTS
                .iter()
                .map(|mode| listed(Self::SetOverlapMode(*mode)).menu(Menu::View, 2))
                .collect(),
            EditKind::SetPalette => Palette::VARIANTS
                .iter()
                .map(|palette| listed(Self::SetPalette(*palette)).menu(Menu::Colors, 0))
                .collect(),
            EditKind::SetColoring => Coloring::VARIANTS
                .iter()
                .map(|coloring| listed(Self::SetColoring(*coloring)).menu(Menu::Colors, 1))
                .collect(),
            EditKind::ToggleLens => vec![listed(Self::ToggleLens).key(Key::L).menu(Menu::Tools, 0)],
            EditKind::LensToCursor => vec![listed(Self::LensToCursor).key(Key::C).menu(Menu::Tools, 0)],
            EditKind::FitTumor => vec![listed(Self::FitTumor).key(Key::F).menu(Menu::View, 3)],
            EditKind::ToggleAllTracts => vec![listed(Self::ToggleAllTracts).key(Key::T)],
            EditKind::SetLightingMode => LightingMode::VARIANTS
                .iter()
                .map(|mode| listed(Self::SetLightingMode(*mode)).menu(Menu::Light, 0))
                .collect(),
            EditKind::SetPreset => std::iter::once(None)
                .chain(Preset::VARIANTS.iter().copied().map(Some))
                .map(|preset| listed(Self::SetPreset(preset)).menu(Menu::Light, 1))
                .collect(),
            EditKind::SetOverlay => Overlay::VARIANTS
                .iter()
                .map(|overlay| listed(Self::SetOverlay(*overlay)).menu(Menu::Slices, 1))
                .collect(),
            EditKind::ToggleOutlinePatterns => {
                vec![listed(Self::ToggleOutlinePatterns).menu(Menu::Slices, 1)]
            }
            EditKind::NextOverlay => vec![listed(Self::NextOverlay).key(Key::O)],
            EditKind::TogglePane => PaneId::all()
                .map(|pane| {
                    let entry = listed(Self::TogglePane(pane)).menu(Menu::Panes, 0);
                    if pane == PaneId::Diagnostics { entry.key(Key::D) } else { entry }
                })
                .collect(),
            EditKind::MaximizePane => PaneId::all().map(|pane| listed(Self::MaximizePane(pane))).collect(),
            EditKind::ResetLayout => vec![listed(Self::ResetLayout).menu(Menu::View, 1)],
            EditKind::MeasureAgain => {
                vec![listed(Self::MeasureAgain).keys(Modifiers::SHIFT, Key::M).menu(Menu::Tools, 1)]
            }
            EditKind::SetTask => Task::VARIANTS
                .iter()
                .map(|task| listed(Self::SetTask(*task)).menu(Menu::Layouts, 0))
                .collect(),
            EditKind::ToggleRegion
            | EditKind::OnlyRegion
            | EditKind::SetRegion
            | EditKind::ToggleMask
            | EditKind::OnlyMask
            | EditKind::SetMaskLook
            | EditKind::MakeMask
            | EditKind::DeleteMadeMask
            | EditKind::SetLensRadius
            | EditKind::SetLensCenter
            | EditKind::DragLensCenter
            | EditKind::GoTo
            | EditKind::SetTransfer
            | EditKind::SetClips
            | EditKind::ToggleTracts
            | EditKind::SetTractLooks
            | EditKind::SetEllipsoidLook
            | EditKind::SetEllipsoidOpacities
            | EditKind::SetChange
            | EditKind::SetAgreement
            | EditKind::SetLesions
            | EditKind::EditLesions
            | EditKind::SetResponse
            | EditKind::SetAperture
            | EditKind::SetLamp
            | EditKind::SetTowardsLamp
            | EditKind::SetShading
            | EditKind::AddRuler
            | EditKind::RenameRuler
            | EditKind::SetRuler
            | EditKind::DeleteRuler
            | EditKind::SetWindow
            | EditKind::SetOverlayOpacity
            | EditKind::SetFusion
            | EditKind::KeepPicture
            | EditKind::SetPictures
            | EditKind::SetReading
            | EditKind::SetTakeHome
            | EditKind::SetAlignments
            | EditKind::SetLayout
            | EditKind::UseLayout => Vec::new(),
        }
    }

    pub(super) fn label(&self) -> Label {
        match self {
            Self::Undo => Label::new("Undo"),
            Self::Redo => Label::new("Redo"),
            Self::ToggleRegion(_) => Label::new("Show or hide the region"),
            Self::OnlyRegion(_) => Label::new("Show only this region"),
            Self::SetRegion(_, true) => Label::new("Show the region"),
            Self::SetRegion(_, false) => Label::new("Hide the region"),
            Self::ShowAllRegions => Label::new("Show all regions"),
            Self::ToggleMask(_) => Label::new("Show or hide the mask"),
            Self::OnlyMask(_) => Label::new("Show only this mask"),
            Self::SetOverlapMode(mode) => Label::new(match mode {
                OverlapMode::Regions => "Diagram selects regions",
                OverlapMode::WholeMasks => "Diagram selects whole masks (no overlaps)",
            })
            .detail("Regions: each overlap apart. Whole masks: overlaps are not told apart"),
            Self::SetPalette(palette) => Label::new(match palette {
                Palette::ColorBlindSafe => "Colours: colour-blind safe",
                Palette::Thesis => "Colours: red, green, blue",
            }),
            Self::SetColoring(Coloring::Masks) => {
                Label::new("Colours: which masks").detail("A region has the colours of its masks, mixed")
            }
            Self::SetColoring(Coloring::Agreement) => Label::new("Colours: how many masks agree")
                .detail("Violet where one mask is active, light yellow where all are"),
            Self::SetMaskLook(..) => Label::new("Name and colour of the mask"),
            Self::MakeMask(_) => Label::new("Make the mask"),
            Self::DeleteMadeMask(..) => Label::new("Delete the mask that was made"),
            Self::ToggleLens => Label::new("Lens on or off")
                .detail("Inside the lens: the selection, in full. Outside: everything, faint"),
            Self::SetLensRadius(_) => Label::new("Lens radius"),
            Self::SetLensCenter(_) | Self::DragLensCenter(_) => Label::new("Move the lens"),
            Self::LensToCursor => {
                Label::new("Move the lens to the crosshair").detail("The camera turns about the lens")
            }
            Self::GoTo(..) => Label::new("Go there").detail("Crosshair and lens move there"),
            Self::FitTumor => Label::new("Fit the tumour"),
            Self::SetTransfer(_, Some(_)) => Label::new("Transfer function"),
            Self::SetTransfer(_, None) => Label::new("Transfer function to begin with"),
            Self::SetClips(_) => Label::new("Cut the image open"),
            Self::ToggleTracts(id) => Label::new(format!("Show or hide fibre tracts {id}")),
            Self::ToggleAllTracts => {
                Label::new("Show or hide all fibre tracts").detail("In the context view")
            }
            Self::SetTractLooks(_) => Label::new("Look of fibre tracts"),
            Self::SetEllipsoidLook(_) => Label::new("Look of the ellipsoid diagram"),
            Self::SetEllipsoidOpacities(_) => Label::new("Opacity of an ellipsoid"),
            Self::SetChange(_) => Label::new("Compare dates"),
            Self::SetAgreement(_) => Label::new("How masks are compared"),
            Self::SetLesions(_) => Label::new("Which components are lesions"),
            Self::SetResponse(_) => Label::new("Statements for the response"),
            Self::EditLesions(edits) => Label::new(lesion_edit_text(edits)),
            Self::SetLightingMode(mode) => {
                let row = light::row(*mode);
                Label::new(format!("Light: {}", row.title.to_lowercase()))
                    .detail(format!("{}. {}", row.summary, row.advice))
            }
            Self::SetPreset(None) => Label::new("Quality: automatic")
                .detail("Fluent while something moves, then as good as it gets"),
            Self::SetPreset(Some(preset)) => Label::new(format!("Quality: {}", preset.name()))
                .detail("The same whether something moves or not"),
            Self::SetAperture(_) => Label::new("Aperture of the light"),
            Self::SetLamp(_) => Label::new("Place of the lamp"),
            Self::SetTowardsLamp(true) => Label::new("Light from the lamp"),
            Self::SetTowardsLamp(false) => Label::new("Light from the eye"),
            Self::SetShading(shading) if **shading == Shading::default() => {
                Label::new("Shading as the lighting mode has it")
            }
            Self::SetShading(_) => Label::new("Shading"),
            Self::AddRuler(_) => Label::new("Keep the line measured"),
            Self::RenameRuler(..) => Label::new("Name the line"),
            Self::SetRuler(..) => Label::new("Change the measurement"),
            Self::MeasureAgain => Label::new("Measure again at this date")
                .detail("The last measurement of another date, at the same place"),
            Self::DeleteRuler(_) => Label::new("Delete the line"),
            Self::SetWindow(..) => Label::new("Window and level"),
            Self::SetOverlay(overlay) => {
                let word: &str = overlay.into();
                Label::new(format!("Masks on slices: {word}"))
            }
            Self::NextOverlay => Label::new("Masks on slices: next of fill, outline, both"),
            Self::SetOverlayOpacity(_) => Label::new("Opacity of masks"),
            Self::SetFusion(_) => Label::new("Second image on slices"),
            Self::ToggleOutlinePatterns => Label::new("Outlines with patterns")
                .detail("Solid, dashed and dotted in turn, so that masks differ without colour"),
            Self::TogglePane(pane) => Label::new(format!("Show or hide {}", pane.title())),
            Self::MaximizePane(pane) => {
                Label::new(format!("Maximise {}", pane.title())).detail("Again brings the other panes back")
            }
            Self::SetLayout(_) => Label::new("Arrange panes"),
            Self::ResetLayout => Label::new("Default layout"),
            Self::KeepPicture(pane, _) => Label::new(format!("Keep {} for the report", pane.title())),
            Self::SetReading(_) => Label::new("Conclusion of the report"),
            Self::SetTakeHome(_) => Label::new("Page to take home"),
            Self::SetPictures(_) => Label::new("Pictures of the report"),
            Self::SetAlignments(_) => Label::new("Move dates and images"),
            Self::UseLayout(name, _) => Label::new(format!("Layout: {name}")),
            Self::SetTask(task) => Label::new(format!("Layout: {}", task.name())).detail(task.detail()),
        }
    }

    pub(super) fn gesture(&self) -> Option<&'static str> {
        match self {
            Self::SetLensRadius(_) => Some("lens radius"),
            Self::SetLensCenter(_) | Self::DragLensCenter(_) => Some("lens centre"),
            Self::RenameRuler(..) => Some("name of a line"),
            Self::SetRuler(..) => Some("a measurement"),
            Self::SetMaskLook(..) => Some("look of a mask"),
            Self::SetWindow(..) => Some("window"),
            Self::SetOverlayOpacity(_) => Some("opacity"),
            Self::SetFusion(_) => Some("second image"),
            Self::SetTransfer(..) => Some("transfer"),
            Self::SetClips(_) => Some("clips"),
            Self::SetTractLooks(_) => Some("fibre tracts"),
            Self::SetEllipsoidLook(_) => Some("ellipsoids"),
            Self::SetEllipsoidOpacities(_) => Some("ellipsoid opacity"),
            Self::SetChange(_) => Some("change"),
            Self::SetPictures(_) => Some("pictures"),
            Self::SetReading(_) => Some("reading"),
            Self::SetTakeHome(_) => Some("page"),
            Self::SetAgreement(_) => Some("agreement"),
            Self::SetLesions(_) => Some("lesions"),
            Self::SetAperture(_) => Some("aperture"),
            Self::SetLamp(_) => Some("lamp"),
            Self::SetShading(_) => Some("shading"),
            _ => None,
        }
    }

    pub(super) fn entry(&self, doc: &Document) -> Entry {
        let edit = &doc.edit;
        match self {
            Self::SetOverlapMode(mode) => Entry::Choice(edit.overlap_mode == *mode),
            Self::SetPalette(palette) => Entry::Choice(edit.palette == *palette),
            Self::SetColoring(coloring) => Entry::Choice(edit.coloring == *coloring),
            Self::SetLightingMode(mode) => Entry::Choice(edit.light.mode == *mode),
            Self::SetPreset(preset) => Entry::Choice(edit.light.preset == *preset),
            Self::SetOverlay(overlay) => Entry::Choice(edit.overlay == *overlay),
            Self::ToggleOutlinePatterns => Entry::Switch(edit.outline_patterns),
            Self::ToggleLens => Entry::Switch(edit.lens_on),
            Self::ToggleTracts(id) => Entry::Switch(!edit.hidden_tracts.contains(id)),
            Self::TogglePane(pane) => Entry::Switch(layout::contains(&edit.layout, *pane)),
            _ => Entry::Plain,
        }
    }

    /// Applies the command to the document. [`Self::Undo`] and [`Self::Redo`] do nothing here: the history handles
    /// them.
    pub(super) fn apply(&self, doc: &mut Document, world: &World) {
        if let Self::KeepPicture(pane, size_points) = self {
            return doc.keep_picture(*pane, *size_points);
        }
        let Some(time_point) = world.time_point(doc) else { return };
        let regions = &time_point.regions;
        let Document { edit, nav, .. } = doc;
        match self {
            Self::Undo | Self::Redo | Self::KeepPicture(..) => {}
            Self::SetReading(reading) => edit.reading.clone_from(reading),
            Self::SetTakeHome(page) => edit.take_home.clone_from(page),
            Self::SetPictures(pictures) => edit.pictures.clone_from(pictures),
            Self::ShowAllRegions => edit.selection = HiddenRegions::none(),
            Self::ToggleRegion(_)
            | Self::OnlyRegion(_)
            | Self::SetRegion(..)
            | Self::ToggleMask(_)
            | Self::OnlyMask(_) => {
                let mut selection = edit.selection.at(regions);
                self.select(&mut selection, regions, edit.overlap_mode);
                edit.selection.set(regions, &selection);
            }
            Self::SetOverlapMode(mode) => edit.overlap_mode = *mode,
            Self::SetPalette(palette) => edit.palette = *palette,
            Self::SetColoring(coloring) => edit.coloring = *coloring,
            Self::SetMaskLook(id, look) => edit.masks.set(id, look),
            Self::MakeMask(made) if edit.made.len() < MOST_MADE => edit.made.push((**made).clone()),
            Self::MakeMask(_) => {}
            Self::DeleteMadeMask(id, time) => {
                edit.made.retain(|made| (&made.id, &made.time) != (id, time));
            }
            Self::ToggleLens => edit.lens_on = !edit.lens_on,
            Self::SetLensRadius(radius_mm) => {
                if radius_mm.is_finite() {
                    edit.lens.radius_mm = radius_mm.clamp(0.1, 1000.0);
                }
            }
            Self::SetLensCenter(center_mm) => {
                if center_mm.is_finite() {
                    edit.lens.center_mm = *center_mm;
                    nav.camera.focus_mm = *center_mm;
                }
            }
            // The camera doesn't follow during a drag: it would move the surface away from the pointer.
            Self::DragLensCenter(center_mm) => {
                if center_mm.is_finite() {
                    edit.lens.center_mm = *center_mm;
                }
            }
            Self::LensToCursor => {
                edit.lens.center_mm = nav.crosshair_mm();
                nav.camera.focus_mm = nav.crosshair_mm();
            }
            Self::GoTo(center_mm, radius_mm) => {
                if center_mm.is_finite() && radius_mm.is_finite() {
                    edit.lens = Lens { center_mm: *center_mm, radius_mm: radius_mm.clamp(0.1, 1000.0) };
                    edit.lens_on = true;
                    super::look::center_on(doc, world, *center_mm);
                }
            }
            Self::FitTumor => {
                let Camera { world_from_camera, projection, .. } = nav.camera;
                edit.lens = default_lens(time_point);
                let radius_mm = tumor_radius_mm(time_point);
                nav.camera = Camera::fit(edit.lens.center_mm, radius_mm, world_from_camera, projection);
            }
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
            Self::SetTractLooks(looks) => {
                edit.tract_looks.extend(looks.clone());
                edit.tract_looks.retain(|_, look| *look != FiberLook::default());
            }
            Self::SetEllipsoidLook(look) => edit.ellipsoids = *look,
            Self::SetEllipsoidOpacities(all) => edit.ellipsoid_opacities.clone_from(all),
            Self::SetChange(setting) => edit.change = setting.as_ref().clone().checked_as(&edit.change),
            Self::SetAgreement(setting) => edit.agreement.clone_from(setting),
            Self::SetLesions(setting) => edit.lesions.clone_from(setting),
            Self::SetResponse(setting) => edit.response.clone_from(setting),
            Self::EditLesions(own) => {
                let room = MOST_LESION_EDITS.saturating_sub(edit.lesions.edits.len());
                edit.lesions.edits.extend(own.iter().take(room).cloned());
            }
            Self::SetLightingMode(mode) => edit.light.mode = *mode,
            Self::SetPreset(preset) => edit.light.preset = *preset,
            Self::SetAperture(degrees) => edit.light.aperture_deg = *degrees,
            Self::SetLamp(lamp) => edit.light.lamp = *lamp,
            Self::SetTowardsLamp(on) => edit.light.towards_lamp = *on,
            Self::SetShading(shading) => edit.light.shading = **shading,
            Self::AddRuler(ruler) => {
                if ruler.length_mm().is_finite() && edit.rulers.len() < MOST_RULERS {
                    edit.rulers.push((**ruler).clone());
                }
            }
            Self::RenameRuler(index, name) => {
                if let Some(ruler) = edit.rulers.get_mut(*index) {
                    ruler.name.clone_from(name);
                }
            }
            Self::SetRuler(index, ruler) => {
                if let Some(old) = edit.rulers.get_mut(*index).filter(|_| ruler.length_mm().is_finite()) {
                    old.clone_from(ruler);
                }
            }
            Self::MeasureAgain => {
                let elsewhere = edit.rulers.iter().rev().find(|ruler| ruler.time != nav.time).cloned();
                if let Some(mut ruler) = elsewhere.filter(|_| edit.rulers.len() < MOST_RULERS) {
                    ruler.time = nav.time;
                    edit.rulers.push(ruler);
                }
            }
            Self::DeleteRuler(index) => {
                if *index < edit.rulers.len() {
                    edit.rulers.remove(*index);
                }
            }
            Self::SetWindow(id, window) => {
                edit.windows.insert(id.clone(), *window);
            }
            Self::SetOverlay(overlay) => edit.overlay = *overlay,
            Self::ToggleOutlinePatterns => edit.outline_patterns = !edit.outline_patterns,
            Self::NextOverlay => {
                let all = Overlay::VARIANTS;
                let current = all.iter().position(|overlay| *overlay == edit.overlay).unwrap_or_default();
                edit.overlay = all[(current + 1) % all.len()];
            }
            Self::SetOverlayOpacity(opacity) => edit.overlay_opacity = opacity.clamp(0.0, 1.0),
            Self::SetFusion(fusion) => edit.fusion = (**fusion).clone(),
            Self::TogglePane(pane) => layout::toggle(&mut edit.layout, *pane),
            Self::MaximizePane(pane) => {
                edit.maximized = (edit.maximized != Some(*pane)).then_some(*pane);
            }
            Self::SetLayout(tree) => edit.layout = (**tree).clone(),
            Self::UseLayout(_, tree) => {
                edit.layout = (**tree).clone();
                edit.maximized = None;
            }
            Self::ResetLayout => {
                edit.layout = layout::opening(Held::at(time_point, world.time_point_count()));
                edit.maximized = None;
            }
            Self::SetAlignments(alignments) => edit.alignments.clone_from(alignments),
            Self::SetTask(task) => {
                edit.layout = task.layout(Held::at(time_point, world.time_point_count()));
                edit.maximized = None;
                let has_pet = edit.fusion.second.as_ref().is_some_and(|second| is_pet(&second.id));
                if *task == Task::Fusion && !has_pet {
                    let first = nav.context.as_ref();
                    let second = second_of(time_point, first.map(String::as_str));
                    edit.fusion = edit.fusion.showing(second, false);
                }
            }
        }
    }

    /// Applies a command that shows or hides regions or masks of one time point.
    fn select(&self, selection: &mut Selection, regions: &Regions, mode: OverlapMode) {
        match self {
            Self::ToggleRegion(bits) => selection.toggle(*bits),
            Self::OnlyRegion(bits) => *selection = Selection::only(regions, &[*bits]),
            Self::SetRegion(bits, shown) => selection.set(*bits, *shown),
            Self::ToggleMask(k) if mode == OverlapMode::WholeMasks => {
                *selection = with_mask_toggled(regions, selection, *k);
            }
            Self::ToggleMask(k) => {
                let of_mask = regions_of_mask(regions, *k);
                let all_shown = of_mask.iter().all(|bits| selection.shows(*bits));
                for bits in of_mask {
                    selection.set(bits, !all_shown);
                }
            }
            Self::OnlyMask(k) => *selection = Selection::only(regions, &regions_of_mask(regions, *k)),
            _ => {}
        }
    }
}
