//! Known smooth displacements of a picture whose value at every place is a formula: nothing is interpolated in the input.

use glam::DVec3;

use super::{DeformError, DeformOptions, Deformation, deform};
use crate::{
    Grid, Mask, MaskBits, Progress, Samples, Scaling, Volume,
    grid::ijk,
    optics::random::Random,
    register::{Image, Which},
};

/// Radius of the lesion at the earlier date.
const RADIUS_MM: f64 = 11.0;

/// Tissue with folds of 15 to 40 mm and a border, mostly between 0 and 1.
fn tissue(p: DVec3) -> f64 {
    let folds = (0.31 * p.x + 0.4).sin() * (0.27 * p.y + 1.0).sin() * (0.29 * p.z - 0.5).sin();
    let fine = (0.42 * p.x - 0.17 * p.z).sin() * (0.39 * p.y + 0.21 * p.z + 0.3).cos();
    let border = 1.0 / (1.0 + ((p / DVec3::new(1.0, 1.15, 0.9)).length() - 42.0).exp());
    border * (0.55 + 0.2 * folds + 0.1 * fine)
}

fn grid(spacing_mm: f64) -> Grid {
    let n = (100.0 / spacing_mm) as usize;
    Grid::axis_aligned(
        [n, n, n],
        DVec3::splat(spacing_mm),
        DVec3::splat(-0.5 * (n as f64 - 1.0) * spacing_mm),
    )
    .unwrap()
}

fn scan(grid: &Grid, value: impl Fn(DVec3) -> f64) -> Volume {
    scan_with(grid, value)
}

fn scan_with(grid: &Grid, mut value: impl FnMut(DVec3) -> f64) -> Volume {
    let values = (0..grid.voxel_count()).map(|l| value(grid.center_of_voxel_mm(ijk(grid.dims(), l))) as f32);
    Volume::new(grid.clone(), Samples::F32(values.collect()), Scaling::NONE).unwrap()
}

fn ball(grid: &Grid, inside: impl Fn(DVec3) -> bool) -> Mask {
    let bits = MaskBits::from_fn(grid.dims(), |l| inside(grid.center_of_voxel_mm(ijk(grid.dims(), l))));
    Mask::new("lesion", grid.clone(), bits).unwrap()
}

/// A displacement by its inverse: what lies at y of the later date came from `y + back(y)`.
type Back = fn(DVec3) -> DVec3;

const STILL: Back = |_| DVec3::ZERO;
const SHIFT: Back = |_| DVec3::new(-2.1, 1.3, -0.8);
/// A bump of 4 mm that fades over 20 mm, from one side.
const BUMP: Back =
    |y| DVec3::new(0.0, -3.2, 2.4) * (-0.5 * (y - DVec3::new(9.0, 4.0, 0.0)).length_squared() / 400.0).exp();
/// Pressed apart: outwards by 3 mm at the surface, fading.
const APART: Back = |y| {
    -y.normalize_or_zero() * 3.0 * (y.length() / 14.0).min(1.0) * (-(y.length() - 14.0).max(0.0) / 18.0).exp()
};

/// How what lies at x moved: the u with `x + u + back(x + u) = x`.
fn truth(back: Back, x: DVec3) -> DVec3 {
    (0..60).fold(DVec3::ZERO, |u, _| -back(x + u))
}

/// The two dates' images and masks, of a lesion that moved with the tissue and grew by `grown_mm` over that.
struct Pair {
    images: [Volume; 2],
    masks: [Mask; 2],
}

fn pair(spacing_mm: f64, back: Back, grown_mm: f64) -> Pair {
    pair_of(spacing_mm, back, grown_mm, |value, _| value)
}

fn pair_of(spacing_mm: f64, back: Back, grown_mm: f64, later: impl Fn(f64, DVec3) -> f64) -> Pair {
    let grid = grid(spacing_mm);
    let value = |p: DVec3, radius: f64| if p.length() <= radius { 2.0 } else { tissue(p) };
    Pair {
        images: [
            scan(&grid, |p| value(p, RADIUS_MM)),
            scan(&grid, |y| later(value(y + back(y), RADIUS_MM + grown_mm), y)),
        ],
        masks: [
            ball(&grid, |p| p.length() <= RADIUS_MM),
            ball(&grid, |y| (y + back(y)).length() <= RADIUS_MM + grown_mm),
        ],
    }
}

impl Pair {
    fn run(&self, options: &DeformOptions) -> Result<Deformation, DeformError> {
        let excluded = [[&self.masks[0]], [&self.masks[1]]];
        let [fixed, moving] = [0, 1].map(|n| Image { volume: &self.images[n], excluded: &excluded[n] });
        deform(&fixed, &moving, options, &Progress::new())
    }
}

/// Places of the earlier lesion's surface.
fn surface() -> Vec<DVec3> {
    let mut random = Random::new(3, 5);
    let mut one = || 2.0 * random.unit() - 1.0;
    (0..300).map(|_| RADIUS_MM * DVec3::new(one(), one(), one()).normalize_or(DVec3::X)).collect()
}

/// Errors along the surface's normal in mm: root mean square and largest.
fn errors_mm(found: &Deformation, back: Back) -> [f64; 2] {
    let of = |p: &DVec3| (found.by_mm(*p) - truth(back, *p)).dot(p.normalize_or_zero());
    let errors: Vec<f64> = surface().iter().map(of).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    [rms, errors.iter().fold(0.0, |most: f64, e| most.max(e.abs()))]
}

/// As incompressible tissue moves about a ball that swells from 11 to 14 mm: most of it within a few millimetres of the ball.
const SWOLLEN: Back = |y| {
    let r = y.length();
    let came_from = (r.powi(3) - 14f64.powi(3) + RADIUS_MM.powi(3)).max(0.0).cbrt();
    if r < 14.0 { -y * (3.0 / 14.0) } else { y.normalize_or_zero() * (came_from - r) }
};

#[test]
fn an_image_that_did_not_change_has_a_field_of_zeros() {
    let found = pair(2.0, STILL, 0.0).run(&DeformOptions::default()).unwrap();
    let most_mm = surface().iter().map(|p| found.by_mm(*p).length()).fold(0.0, f64::max);
    assert!(most_mm < 1e-4, "{most_mm}");
    assert!(found.correlations[1] > 0.999_999 && found.tissue_ml > 100.0);
}

/// The program's own figures of docs/change.md, with `--no-capture`.
#[test]
fn known_fields_are_found_at_the_lesions_surface() {
    // The last ones bend within less than the lattice, and in what isn't seen: they are found too small, never too large.
    let fields: [(&str, Back, f64); 4] =
        [("shift", SHIFT, 0.1), ("bump", BUMP, 0.15), ("apart", APART, 0.9), ("swollen", SWOLLEN, 1.4)];
    for (name, back, most_mm) in fields {
        for grown_mm in [0.0, 3.0] {
            let found = pair(1.0, back, grown_mm).run(&DeformOptions::default()).unwrap();
            let [rms_mm, largest_mm] = errors_mm(&found, back);
            println!(
                "{name}, grown {grown_mm} mm: {rms_mm:.3} mm, at most {largest_mm:.3}, {} steps",
                found.steps
            );
            assert!(rms_mm < most_mm, "{name} {grown_mm}: {rms_mm}");
            let outwards = |p: &DVec3| {
                (found.by_mm(*p).dot(p.normalize_or_zero()), truth(back, *p).dot(p.normalize_or_zero()))
            };
            let over = surface()
                .iter()
                .map(outwards)
                .map(|(found, true_mm)| found.abs() - true_mm.abs())
                .fold(0.0, f64::max);
            assert!(over < 0.35, "{name} {grown_mm}: {over}");
        }
    }
}

#[test]
fn growth_alone_moves_no_tissue() {
    let found = pair(1.0, STILL, 3.0).run(&DeformOptions::default()).unwrap();
    let [rms_mm, largest_mm] = errors_mm(&found, STILL);
    assert!(rms_mm < 0.05 && largest_mm < 0.1, "{rms_mm} {largest_mm}");
}

/// A gain of a half that varies by a third over the picture, and noise of 5 % of the range at both dates.
#[test]
fn noise_and_a_smooth_gain_are_survived() {
    let mut random = Random::new(11, 2);
    let mut noise = || 0.05 * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0);
    let mut pair = pair_of(1.0, SHIFT, 0.0, |value, y| value * 0.5 * (0.003 * y.x - 0.002 * y.z).exp() + 0.2);
    for (image, scale) in pair.images.iter_mut().zip([1.0, 0.5]) {
        let values = image.to_f32().into_iter().map(|v| v + (scale * noise()) as f32).collect();
        *image = Volume::new(image.grid().clone(), Samples::F32(values), Scaling::NONE).unwrap();
    }
    let found = pair.run(&DeformOptions::default()).unwrap();
    let [rms_mm, largest_mm] = errors_mm(&found, SHIFT);
    let deviations: Vec<f64> =
        surface().iter().map(|p| found.uncertainty_mm(*p, p.normalize_or_zero()).unwrap()).collect();
    let deviation_mm = deviations.iter().sum::<f64>() / deviations.len() as f64;
    println!("noise and gain: {rms_mm:.3} mm, at most {largest_mm:.3}; stated {deviation_mm:.3}");
    assert!(rms_mm < 0.2 && largest_mm < 0.5, "{rms_mm} {largest_mm}");
    assert!(rms_mm < 2.0 * deviation_mm && deviation_mm < 0.3, "{rms_mm} {deviation_mm}");
}

#[test]
fn without_texture_nothing_is_said() {
    let mut random = Random::new(19, 4);
    let mut noise = move || 0.05 * ((0..12).map(|_| random.unit()).sum::<f64>() - 6.0);
    let grid = grid(2.0);
    let mut scans = || scan_with(&grid, |p| if p.length() < RADIUS_MM { 2.0 } else { 0.6 } + noise());
    let images = [scans(), scans()];
    let masks = [0, 1].map(|_| ball(&grid, |p| p.length() <= RADIUS_MM));
    let noisy = Pair { images, masks: masks.clone() }.run(&DeformOptions::default());
    assert!(matches!(noisy, Err(DeformError::Disagree { correlation }) if correlation < 0.2), "{noisy:?}");
    let flat = [0, 1].map(|_| scan(&grid, |_| 0.6));
    let flat = Pair { images: flat, masks: masks.clone() }.run(&DeformOptions::default());
    assert!(matches!(flat, Err(DeformError::Constant(Which::Fixed))), "{flat:?}");
    let nothing = [0, 1].map(|_| scan(&grid, |_| f64::NAN));
    let nothing = Pair { images: nothing, masks }.run(&DeformOptions::default());
    assert!(matches!(nothing, Err(DeformError::TooLittle { .. })), "{nothing:?}");
}

/// Layers: along them nothing is seen to move, across them it is.
#[test]
fn along_layers_the_displacement_is_unknown() {
    let grid = grid(1.0);
    let layers = |p: DVec3| if p.length() < RADIUS_MM { 2.0 } else { 0.5 + 0.2 * (0.4 * p.x).sin() };
    let images = [scan(&grid, layers), scan(&grid, |y| layers(y - DVec3::X))];
    let masks =
        [ball(&grid, |p| p.length() <= RADIUS_MM), ball(&grid, |p| (p - DVec3::X).length() <= RADIUS_MM)];
    let found = Pair { images, masks }.run(&DeformOptions::default()).unwrap();
    for sign in [-1.0, 1.0] {
        let at = DVec3::X * (sign * RADIUS_MM);
        assert!((found.by_mm(at).x - 1.0).abs() < 0.1, "{}", found.by_mm(at));
        assert!(found.uncertainty_mm(at, DVec3::X).unwrap() < 0.1);
        let along = found.uncertainty_mm(at, DVec3::Y);
        assert!(along.is_none_or(|mm| mm > 0.5), "{along:?}");
    }
}

#[test]
fn two_runs_are_equal_bit_for_bit_and_a_cancelled_one_ends() {
    let pair = pair(2.0, BUMP, 0.0);
    let [a, b] = [0, 1].map(|_| pair.run(&DeformOptions::default()).unwrap());
    assert!(surface().iter().all(|p| a.by_mm(*p) == b.by_mm(*p)));
    let progress = Progress::new();
    progress.cancel();
    let excluded = [[&pair.masks[0]], [&pair.masks[1]]];
    let [fixed, moving] = [0, 1].map(|n| Image { volume: &pair.images[n], excluded: &excluded[n] });
    let ended = deform(&fixed, &moving, &DeformOptions::default(), &progress);
    assert!(matches!(ended, Err(DeformError::Cancelled(_))));
}

/// Error against time for the knobs, for docs/change.md: `cargo nextest run -p glioscope-core --run-ignored only -E
/// 'test(error_against_time)' --no-capture`.
#[test]
#[ignore = "a table for docs/change.md: a minute"]
fn error_against_time() {
    let usual = DeformOptions::default();
    let fields: [(&str, Back); 4] =
        [("shift", SHIFT), ("bump", BUMP), ("apart", APART), ("swollen", SWOLLEN)];
    let pairs = fields.map(|(name, back)| (name, back, pair(1.0, back, 0.0)));
    for spacing_mm in [8.0, 10.0, 12.0, 16.0, 24.0] {
        for (finest_mm, most_steps) in [(2.0, 10), (1.0, 5), (1.0, 10), (1.0, 20)] {
            let options = DeformOptions { spacing_mm, finest_mm, most_steps, ..usual };
            let mut line = format!("| {spacing_mm} | {finest_mm} | {most_steps} ");
            let mut seconds = 0.0;
            for (_, back, pair) in &pairs {
                let start = std::time::Instant::now();
                let found = pair.run(&options).unwrap();
                seconds += start.elapsed().as_secs_f64() / pairs.len() as f64;
                line += &format!("| {:.2} ", errors_mm(&found, *back)[0]);
            }
            println!("{line}| {seconds:.1} |");
        }
    }
}
