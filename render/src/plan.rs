//! Which passes a scene needs, and why the others are left out. Pure: no device is touched.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::{
    lighting,
    quality::Quality,
    scene::{Lens, Scene},
};

/// The passes of every view, each view's in the order they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PassName {
    /// First shown voxel along each ray, inside the lens or everywhere when it is off.
    Surface,
    /// The faint outer level and its first hit.
    Outside,
    /// Screen-space ambient occlusion.
    Occlusion,
    /// Its blur.
    OcclusionBlur,
    /// Light that reaches cells of the context image, by cones.
    LightGrid,
    /// The context image by slices, with directional occlusion.
    Slices,
    /// Hands the slices' picture on.
    SlicesFinish,
    /// Light that reaches solid surfaces, by cones.
    SolidCones,
    /// Light that reaches solid surfaces, by vicinity occlusion and what slices let through.
    Vicinity,
    /// Ray march through the context image.
    Context,
    /// Its opacity by gradient magnitude: a part of that pass, without a time of its own.
    GradientOpacity,
    /// Colours, lines, ring.
    Compose,
    /// Fragments of ellipsoids, listed and sorted at each pixel.
    EllipsoidLists,
    /// The ellipsoid diagram's colours, outlines, slice, ring.
    EllipsoidCompose,
    /// Its pixels whose fragments have no room on the card. Only drawing tells whether there are any:
    /// the frame's plan names it, the scene's doesn't.
    EllipsoidRest,
    /// Lengths of surface change at each pixel's voxel.
    Heights,
    /// Their filter along rows.
    HeightFilterAcross,
    /// Their filter along columns.
    HeightFilterDown,
    /// Arrows of surface change.
    Arrows,
    /// Fibre tracts as tubes.
    Tubes,
    /// Puts them among what is seen first along each ray.
    TubesMerge,
    /// Puts arrows among what is solid, for the passes of light.
    ArrowsMerge,
}

impl PassName {
    /// The closeup's, in order.
    pub const CLOSEUP: [Self; 8] = [
        Self::Surface,
        Self::Outside,
        Self::Occlusion,
        Self::OcclusionBlur,
        Self::Slices,
        Self::SolidCones,
        Self::Vicinity,
        Self::Compose,
    ];

    /// The ellipsoid diagram's, in order.
    pub const ELLIPSOIDS: [Self; 7] = [
        Self::EllipsoidLists,
        Self::Occlusion,
        Self::OcclusionBlur,
        Self::LightGrid,
        Self::Slices,
        Self::Vicinity,
        Self::EllipsoidCompose,
    ];
    /// The context view's, in order.
    pub const CONTEXT: [Self; 13] = [
        Self::Surface,
        Self::Tubes,
        Self::TubesMerge,
        Self::Occlusion,
        Self::OcclusionBlur,
        Self::LightGrid,
        Self::Slices,
        Self::SlicesFinish,
        Self::SolidCones,
        Self::Vicinity,
        Self::Context,
        Self::GradientOpacity,
        Self::Compose,
    ];

    /// The change view's, in order.
    pub const CHANGE: [Self; 17] = [
        Self::Surface,
        Self::Outside,
        Self::Arrows,
        Self::ArrowsMerge,
        Self::Occlusion,
        Self::OcclusionBlur,
        Self::LightGrid,
        Self::Slices,
        Self::SlicesFinish,
        Self::SolidCones,
        Self::Vicinity,
        Self::Context,
        Self::GradientOpacity,
        Self::Heights,
        Self::HeightFilterAcross,
        Self::HeightFilterDown,
        Self::Compose,
    ];

    /// Its name in `--explain`, `--stats` and the diagnostics panel.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Outside => "outside",
            Self::Occlusion => "occlusion",
            Self::OcclusionBlur => "occlusion_blur",
            Self::LightGrid => "light_grid",
            Self::Slices => "slices",
            Self::SlicesFinish => "slices_finish",
            Self::SolidCones => "solid_cones",
            Self::Vicinity => "vicinity",
            Self::Context => "context",
            Self::GradientOpacity => "gradient_opacity",
            Self::Compose => "compose",
            Self::EllipsoidLists => "ellipsoid_lists",
            Self::EllipsoidCompose => "ellipsoid_compose",
            Self::EllipsoidRest => "ellipsoid_rest",
            Self::Heights => "heights",
            Self::HeightFilterAcross => "height_filter_across",
            Self::HeightFilterDown => "height_filter_down",
            Self::Arrows => "arrows",
            Self::Tubes => "tubes",
            Self::TubesMerge => "tubes_merge",
            Self::ArrowsMerge => "arrows_merge",
        }
    }
}

impl fmt::Display for PassName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The passes of one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// What runs, in order.
    pub passes: Vec<PassName>,
    /// What doesn't, and why.
    pub omitted: Vec<(PassName, &'static str)>,
}

impl Plan {
    /// The passes of `order` that `reason` has none against, and the others with theirs.
    pub(crate) fn of(order: &[PassName], reason: impl Fn(PassName) -> Option<&'static str>) -> Self {
        let mut plan = Self { passes: Vec::new(), omitted: Vec::new() };
        for &pass in order {
            match reason(pass) {
                Some(reason) => plan.omitted.push((pass, reason)),
                None => plan.passes.push(pass),
            }
        }
        plan
    }

    /// Every pass of the closeup with screen-space light: what tests compare a plan with.
    #[cfg(test)]
    pub(crate) fn everything() -> Self {
        Self::of(&lighting::passes(&PassName::CLOSEUP, lighting::Shading::ScreenSpace), |_| None)
    }

    /// Whether `pass` runs.
    pub fn has(&self, pass: PassName) -> bool {
        self.passes.contains(&pass)
    }
}

/// Whether every corner of the volume's box is in the ball.
fn covers(lens: &Lens, corners_mm: &[DVec3; 8]) -> bool {
    corners_mm.iter().all(|c| c.distance(lens.center_mm) <= lens.radius_mm)
}

/// The passes that `scene` needs at `quality`. Leaving the others out changes no pixel.
pub fn plan(scene: &Scene, quality: &Quality) -> Plan {
    let nothing = "no mask is active";
    let tumor = scene.tumor.as_deref();
    let shows_any = tumor.is_some_and(|t| t.bits_of_id().iter().any(|&bits| scene.selection.shows(bits)));
    let no_surface = match tumor {
        None => Some(nothing),
        Some(_) if !shows_any => Some("selection is empty"),
        Some(_) => None,
    };
    let no_outside = match (tumor, &scene.lens) {
        (None, _) => Some(nothing),
        (_, None) => Some("lens is off"),
        (Some(t), Some(lens)) if covers(lens, &t.grid().corners_mm()) => {
            Some("lens covers everything: nothing lies outside")
        }
        _ => None,
    };
    Plan::of(&lighting::passes(&PassName::CLOSEUP, quality.lighting.shading), |pass| match pass {
        PassName::Surface => no_surface,
        PassName::Outside => no_outside,
        _ => lighting::left_out(pass, quality, no_surface, Some(lighting::NO_IMAGE)),
    })
}

/// Why `quality` leaves ambient occlusion out, if it does.
pub(crate) fn no_occlusion(quality: &Quality) -> Option<&'static str> {
    // Not a number is none.
    let none = |x: f64| x.is_nan() || x <= 0.0;
    if none(quality.occlusion_strength) {
        Some("occlusion strength is 0")
    } else if none(quality.occlusion_radius_mm) {
        Some("occlusion radius is 0")
    } else if quality.occlusion_samples == 0 {
        Some("occlusion has no samples")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use glioscope_core::Selection;

    fn names(plan: &Plan) -> Vec<&'static str> {
        plan.passes.iter().map(|p| p.name()).collect()
    }

    #[test]
    fn a_whole_scene_needs_every_pass() {
        let scene = testing::balls_scene();
        let plan = plan(&scene, &Quality::FULL);
        assert_eq!(plan, Plan::everything());
    }

    #[test]
    fn each_reason_leaves_out_its_passes() {
        let mut scene = testing::balls_scene();
        scene.lens = None;
        let without_lens = plan(&scene, &Quality::FULL);
        assert_eq!(without_lens.omitted, [(PassName::Outside, "lens is off")]);

        let mut scene = testing::balls_scene();
        if let Some(lens) = &mut scene.lens {
            lens.radius_mm = 1e4;
        }
        let covered = plan(&scene, &Quality::FULL);
        assert_eq!(covered.omitted, [(PassName::Outside, "lens covers everything: nothing lies outside")]);

        let mut scene = testing::balls_scene();
        for bits in 0..8 {
            scene.selection.set(bits, false);
        }
        let unselected = plan(&scene, &Quality::FULL);
        assert_eq!(names(&unselected), ["outside", "compose"]);
        assert!(unselected.omitted.iter().all(|(_, reason)| *reason == "selection is empty"));

        let mut scene = testing::balls_scene();
        scene.tumor = None;
        scene.selection = Selection::all();
        let empty = plan(&scene, &Quality::FULL);
        assert_eq!(names(&empty), ["compose"]);
        assert!(empty.omitted.iter().all(|(_, reason)| *reason == "no mask is active"));

        let scene = testing::balls_scene();
        let flat = plan(&scene, &Quality { occlusion_strength: 0.0, ..Quality::FULL });
        assert_eq!(names(&flat), ["surface", "outside", "compose"]);
        let nan = plan(&scene, &Quality { occlusion_strength: f64::NAN, ..Quality::FULL });
        assert_eq!(names(&nan), ["surface", "outside", "compose"]);
    }

    #[test]
    fn a_pass_is_planned_or_left_out_never_both() {
        for radius in [0.5, 20.0, 1e4] {
            let mut scene = testing::balls_scene();
            if let Some(lens) = &mut scene.lens {
                lens.radius_mm = radius;
            }
            let plan = plan(&scene, &Quality::DRAFT);
            let mut all: Vec<PassName> =
                plan.passes.iter().copied().chain(plan.omitted.iter().map(|o| o.0)).collect();
            all.sort();
            assert_eq!(all, Plan::everything().passes);
        }
    }
}
