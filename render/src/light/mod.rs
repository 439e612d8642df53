//! Lighting of the 3D views: one row per lighting mode, one folder per row. All modes write the same buffers, so the
//! composing passes don't depend on the mode. `suite` holds the tests that every row inherits.

mod budget;
pub(crate) mod cones;
pub(crate) mod dynamic_ambient;
pub(crate) mod frame_error;
#[cfg(test)]
mod frame_error_tests;
pub(crate) mod half_angle;
pub(crate) mod harmonics;
pub(crate) mod horizon;
pub(crate) mod kernel;
pub(crate) mod layers;
pub(crate) mod lit;
pub(crate) mod paths;
pub(crate) mod screen;
pub(crate) mod shadow_volume;
pub(crate) mod slices;
#[cfg(test)]
pub(crate) mod suite;
pub(crate) mod summed;
pub(crate) mod traced;
pub(crate) mod vicinity;
pub(crate) mod volume;

use glioscope_core::optics::Camera;
use strum::VariantArray;

pub use budget::{Auto, BUDGET_MS};
pub use frame_error::{FrameError, FrameErrors, LightSample};
pub use lit::{LightRow, LightWork, StandardError};

use crate::{
    device::{Gpu, PassName, RenderError, runner::PassRunner},
    image::Shade,
    scene::{LightSettings, LightingMode, Plan, Preset, Quality},
    solid::view::TINTED,
};
use lit::{Light, LitKind, LitMarch, LitScene, Measured};

/// One row per [`LightingMode`], in its order, which is also the order of menus.
pub const LIGHTS: [LightRow; LightingMode::VARIANTS.len()] = [
    screen::ROW,
    horizon::ROW,
    traced::ROW,
    slices::ROW,
    cones::ROW,
    half_angle::ROW,
    shadow_volume::ROW,
    harmonics::ROW,
    dynamic_ambient::ROW,
    paths::ROW,
    summed::DEPTH_DARKENING,
    summed::VICINITY_MAP,
];

const _: () = {
    let mut at = 0;
    while at < LIGHTS.len() {
        assert!(LIGHTS[at].mode as usize == at, "rows are in the order of LightingMode");
        at += 1;
    }
};

/// Cost of [`Preset::Draft`], relative to balanced.
const DRAFT_COST: f64 = 1.0 / 8.0;

/// Why image passes are omitted in a view that has no image.
pub(crate) const NO_IMAGE: &str = "opaque foreground without context";

/// The row of a mode.
pub fn row(mode: LightingMode) -> &'static LightRow {
    const ROWS: &[LightRow] = &LIGHTS;
    &ROWS[mode as usize]
}

/// The passes of a mode for a kind of scene, in order.
pub(crate) fn passes(mode: LightingMode, kind: LitKind) -> &'static [PassName] {
    (row(mode).passes)(kind)
}

/// Why `pass` of the quality's lighting mode is omitted; `None` if it runs or isn't a light pass. `no_opaque` and
/// `no_image` give the reason why there is no opaque geometry or no image.
pub(crate) fn omission_reason(
    pass: PassName,
    quality: &Quality,
    no_opaque: Option<&'static str>,
    no_image: Option<&'static str>,
) -> Option<&'static str> {
    (row(quality.lighting.mode).omission_reason)(pass, quality, no_opaque, no_image)
}

/// Flags of the view's uniform that the light passes of `plan` set.
pub(crate) fn flags(mode: LightingMode, plan: &Plan) -> u32 {
    row(mode).flags.iter().filter(|(pass, _)| plan.has(*pass)).fold(0, |all, (_, flag)| all | flag)
}

/// How gradients shade tissue: in the modes that compute no light for it.
pub(crate) fn shade(quality: &Quality, camera: &Camera) -> Shade {
    let light = &quality.lighting;
    let is_headlight = row(light.mode).is_headlight();
    Shade {
        share: if is_headlight { light.tissue_shading } else { 1.0 },
        lamp: (is_headlight && light.towards_lamp).then(|| light.lamp.direction(camera)),
    }
}

/// Constants of composing passes for a frame: see lib/surface_light.
pub(crate) fn composing_constants(mode: LightingMode, plan: &Plan) -> Vec<(&'static str, f64)> {
    if flags(mode, plan) & TINTED != 0 { vec![("tinted", 1.0)] } else { Vec::new() }
}

/// The quality that takes about `cost` times as long as [`Preset::Balanced`], clamped to the mode's range; not finite
/// counts as 1. One path through the settings, along which error falls as time rises (docs/accuracy.md). With cones,
/// costs above 4 take up to three times that.
pub fn at_cost(mode: LightingMode, cost: f64) -> Quality {
    let row = row(mode);
    let cost = if cost.is_finite() { cost.clamp(1e-3, row.most_cost) } else { 1.0 };
    let mut quality = (row.at_cost)(cost);
    quality.lighting.mode = mode;
    quality.cost = (!row.measured.is_empty()).then_some(cost);
    quality
}

/// Whether the closeup shows its smooth surface at this quality.
pub fn shows_smooth(quality: &Quality) -> bool {
    quality.smooth && row(quality.lighting.mode).lights_smooth
}

/// A fixed preset of a lighting mode.
pub fn preset(mode: LightingMode, preset: Preset) -> Quality {
    match preset {
        Preset::Draft => at_cost(mode, DRAFT_COST),
        Preset::Balanced => at_cost(mode, 1.0),
        Preset::Reference => at_cost(mode, row(mode).most_cost),
    }
}

/// Expected error of the picture shown, on the head phantom's opaque surfaces and in its tissue: root mean square of
/// linear radiance against Monte Carlo, interpolated between measurements along the path (docs/accuracy.md). They are of
/// light without an ambient share; the picture's error is proportional to the rest. `None` for light by a headlight, which
/// is a different model, and for custom settings.
pub fn expected_error(quality: &Quality) -> Option<[f64; 2]> {
    let LightSettings { aperture_deg, towards_lamp, .. } = quality.lighting;
    let is_default = aperture_deg == LightSettings::DEFAULT.aperture_deg && !towards_lamp;
    let cost = quality.cost.filter(|_| is_default)?;
    shown_error(row(quality.lighting.mode).measured, cost, quality)
}

/// Errors at a knob's value, interpolated between measured ones on logarithmic scales, of a picture with the quality's share
/// of ambient light. `None` where nothing was measured.
fn shown_error(measured: Measured, knob: f64, quality: &Quality) -> Option<[f64; 2]> {
    let after = measured.iter().position(|(k, _)| *k >= knob).unwrap_or(measured.len().checked_sub(1)?);
    let [(k0, e0), (k1, e1)] = [after.saturating_sub(1), after].map(|i| measured[i]);
    let share = if k1 > k0 { ((knob / k0).ln() / (k1 / k0).ln()).clamp(0.0, 1.0) } else { 1.0 };
    let shown = f64::from(quality.strength());
    Some(std::array::from_fn(|scene| shown * e0[scene] * (e1[scene] / e0[scene]).powf(share)))
}

/// Expected error of the light that is lost to masks in the closeup, as the picture shows it: root mean square on the head
/// phantom's tumour and on a mask of deep folds, interpolated between measured numbers of rays (docs/accuracy.md). `None` where
/// it wasn't measured: in other modes, at other radii, on the smooth surface.
pub fn occlusion_error(quality: &Quality) -> Option<[f64; 2]> {
    let mode = LightingMode::Traced;
    let radius_mm = preset(mode, Preset::Balanced).occlusion_radius_mm;
    let is_measured =
        quality.lighting.mode == mode && quality.occlusion_radius_mm == radius_mm && !quality.smooth;
    shown_error(traced::MEASURED, f64::from(quality.occlusion_rays), quality).filter(|_| is_measured)
}

/// The light passes of a renderer, of the lighting mode last used.
#[derive(Default)]
pub(crate) struct LightPasses {
    light: Option<(LightingMode, Box<dyn Light>)>,
    /// For tests: see [`Light::run_everywhere`].
    #[cfg(test)]
    pub everywhere: bool,
}

impl LightPasses {
    /// See [`Light::bind`]. A plan without any of its passes releases their buffers.
    ///
    /// # Errors
    /// As there.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let mode = scene.quality.lighting.mode;
        let row = row(mode);
        let cached = self.light.take().filter(|(cached_mode, _)| *cached_mode == mode);
        let (_, light) = self.light.insert(cached.unwrap_or_else(|| (mode, (row.start)(gpu))));
        #[cfg(test)]
        if self.everywhere {
            light.run_everywhere();
        }
        light.bind(gpu, passes, plan, scene)
    }

    /// See [`Light::lit_march`].
    pub fn lit_march(&self) -> Option<LitMarch<'_>> {
        self.light.as_ref()?.1.lit_march()
    }

    /// See [`Light::work`].
    pub fn work(&self) -> Option<LightWork> {
        self.light.as_ref()?.1.work()
    }

    /// See [`Light::measured_error`].
    ///
    /// # Errors
    /// As there.
    pub fn measured_error(&self, gpu: &Gpu) -> Result<Option<StandardError>, RenderError> {
        self.light.as_ref().map_or(Ok(None), |(_, light)| light.measured_error(gpu))
    }

    /// See [`Light::probe`].
    #[cfg(test)]
    pub fn probe(&self) -> lit::Probe<'_> {
        self.light.as_ref().map(|(_, light)| light.probe()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of a mode in docs/accuracy.md's table of expected errors: cost, on opaque surfaces, in tissue.
    fn published(page: &str, mode: LightingMode) -> Vec<[String; 3]> {
        let table = page.split("### Expected error along the path").nth(1).unwrap();
        let row = |line: &str| -> Option<[String; 3]> {
            let cells: Vec<&str> = line.strip_prefix('|')?.split('|').map(str::trim).collect();
            let [name, cost, surface, tissue, _] = cells[..] else { return None };
            (name == mode.name()).then(|| [cost, surface, tissue].map(str::to_owned))
        };
        table.split("\n#").next().unwrap().lines().filter_map(row).collect()
    }

    #[test]
    fn measured_errors_are_those_of_the_accuracy_page() {
        let page = include_str!("../../../docs/accuracy.md");
        for row in LIGHTS.iter().filter(|row| !row.measured.is_empty()) {
            let typed = |(cost, [surface, tissue]): &(f64, [f64; 2])| {
                [format!("{cost:.3}"), format!("{surface:.4}"), format!("{tissue:.4}")]
            };
            let typed: Vec<[String; 3]> = row.measured.iter().map(typed).collect();
            assert_eq!(typed, published(page, row.mode), "{:?}", row.mode);
        }
    }

    #[test]
    fn measured_errors_of_traced_occlusion_are_those_of_the_accuracy_page() {
        let page = include_str!("../../../docs/accuracy.md");
        let table = page.split("### Expected error of traced occlusion").nth(1).unwrap();
        let row = |line: &str| -> Option<[f64; 3]> {
            let cells: Vec<&str> = line.strip_prefix('|')?.split('|').map(str::trim).collect();
            let [rays, tumor, folds, _] = cells[..] else { return None };
            Some([rays.parse().ok()?, tumor.parse().ok()?, folds.parse().ok()?])
        };
        let rows: Vec<[f64; 3]> = table.split("\n#").next().unwrap().lines().filter_map(row).collect();
        assert!(rows.len() > 5, "{rows:?}");
        for [rays, tumor, folds] in rows {
            let quality =
                Quality { occlusion_rays: rays as u32, ..preset(LightingMode::Traced, Preset::Draft) };
            let typed = occlusion_error(&quality).unwrap();
            assert!((typed[0] - tumor).abs() < 1e-9 && (typed[1] - folds).abs() < 1e-9, "{rays}: {typed:?}");
            let lit = Quality { occlusion_strength: 0.5, ..quality };
            assert!((occlusion_error(&lit).unwrap()[0] - tumor / 2.0).abs() < 1e-9);
            assert_eq!(occlusion_error(&Quality { occlusion_radius_mm: 3.0, ..quality }), None);
            assert_eq!(occlusion_error(&Quality { smooth: true, ..quality }), None);
        }
    }

    #[test]
    fn presets_are_on_the_cost_path_and_their_expected_error_falls() {
        for row in LIGHTS.iter().filter(|row| !row.measured.is_empty()) {
            let errors = Preset::VARIANTS.iter().map(|p| expected_error(&preset(row.mode, *p)).unwrap());
            let errors: Vec<[f64; 2]> = errors.collect();
            for scene in [0, 1] {
                assert!(errors.windows(2).all(|pair| pair[0][scene] > pair[1][scene]), "{errors:?}");
            }
            assert_eq!(preset(row.mode, Preset::Balanced), at_cost(row.mode, 1.0));
            // The ambient share hides a part of the error.
            let lit = Quality { occlusion_strength: 0.5, ..preset(row.mode, Preset::Balanced) };
            let whole = Quality { occlusion_strength: 1.0, ..lit };
            assert_eq!(expected_error(&lit), expected_error(&whole).map(|e| e.map(|e| e / 2.0)));
            // Custom settings are not on the path.
            let mut custom = preset(row.mode, Preset::Balanced);
            custom.lighting.aperture_deg = 30.0;
            assert_eq!(expected_error(&custom), None);
        }
        let screen = preset(LightingMode::ScreenSpace, Preset::Reference);
        assert_eq!((screen, expected_error(&screen)), (Quality::FULL, None));
    }

    #[test]
    fn every_cost_gives_settings_within_their_ranges() {
        for &mode in LightingMode::VARIANTS {
            for cost in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e-9, 0.01, 0.3, 1.0, 3.0, 5.0, 1e9] {
                let Quality { resolution_scale, context_step_mm, lighting: l, .. } = at_cost(mode, cost);
                assert!((0.2..=1.0).contains(&resolution_scale), "{mode:?} {cost}: {resolution_scale}");
                assert!((0.25..=4.0).contains(&context_step_mm) && (0.4..=8.0).contains(&l.slice_mm));
                assert!((1..=LightSettings::MOST_SUB_CONES).contains(&l.sub_cones) && l.cell_mm >= 1.0);
                assert!((1..=LightSettings::MOST_VICINITY).contains(&l.vicinity_samples));
            }
        }
    }
}
