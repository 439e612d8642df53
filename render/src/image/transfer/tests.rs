use glam::DVec3;
use glioscope_core::{Grid, Samples, Scaling, Volume};
use strum::VariantArray;

use crate::{flat, image::transfer::*, testing::noise};

fn point(value: f64, grey: u8, opacity: f64) -> ControlPoint {
    ControlPoint { value, color: [grey; 3], opacity }
}

fn ramp() -> TransferFunction {
    TransferFunction::new(
        vec![point(0.0, 0, 0.0), point(10.0, 100, 0.5), point(10.0, 200, 0.8), point(20.0, 100, 0.2)],
        None,
    )
    .unwrap()
}

#[test]
fn functions_are_piecewise_linear_with_constant_ends_and_steps() {
    let f = ramp();
    for (value, grey, opacity) in [
        (-5.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (2.5, 25.0, 0.125),
        (9.999_999_999, 100.0, 0.5),
        (10.0, 200.0, 0.8),
        (15.0, 150.0, 0.5),
        (20.0, 100.0, 0.2),
        (1e300, 100.0, 0.2),
    ] {
        let (color, found) = f.sample(value, 1e9);
        assert!((color[1] * 255.0 - grey).abs() < 1e-6 && (found - opacity).abs() < 1e-9, "{value}");
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(f.sample(bad, 0.0).1, 0.0);
    }
    let wide = TransferFunction::new(vec![point(f64::MIN, 0, 0.0), point(f64::MAX, 0, 1.0)], None).unwrap();
    assert!((wide.sample(0.0, 0.0).1 - 0.5).abs() < 1e-12);
}

#[test]
fn the_gradient_factor_scales_opacity() {
    let mut f = ramp();
    let two_d =
        vec![GradientPoint { gradient: 1.0, factor: 0.25 }, GradientPoint { gradient: 3.0, factor: 0.75 }];
    f.set_gradient(Some(two_d)).unwrap();
    for (gradient, factor) in [(0.0, 0.25), (2.0, 0.5), (9.0, 0.75), (f64::INFINITY, 0.75), (f64::NAN, 0.0)] {
        assert!((f.sample(15.0, gradient).1 - 0.5 * factor).abs() < 1e-12, "{gradient}");
    }
}

#[test]
fn invalid_functions_are_rejected_with_the_offending_number() {
    let two = |a: ControlPoint, b: ControlPoint| TransferFunction::new(vec![a, b], None).unwrap_err();
    let few = TransferFunction::new(vec![point(0.0, 0, 0.0)], None).unwrap_err();
    assert!(few.to_string().contains("1 control points"), "{few}");
    assert!(
        two(point(2.0, 0, 0.0), point(1.0, 0, 0.0)).to_string().contains("1 as value of point 1 after 2")
    );
    assert!(matches!(two(point(f64::NAN, 0, 0.0), point(1.0, 0, 0.0)), TransferError::Number { .. }));
    assert!(matches!(two(point(0.0, 0, 0.0), point(f64::INFINITY, 0, 0.0)), TransferError::Number { .. }));
    assert!(matches!(two(point(0.0, 0, 1.5), point(1.0, 0, 0.0)), TransferError::Number { .. }));
    let gradient = |g: f64, factor: f64| GradientPoint { gradient: g, factor };
    let mut f = ramp();
    assert!(f.set_gradient(Some(vec![gradient(0.0, 1.0)])).is_err());
    assert!(f.set_gradient(Some(vec![gradient(-1.0, 1.0), gradient(0.0, 1.0)])).is_err());
    assert!(f.set_gradient(Some(vec![gradient(1.0, 1.0), gradient(0.0, 1.0)])).is_err());
    assert!(f.set_gradient(Some(vec![gradient(0.0, 1.0), gradient(1.0, f64::NAN)])).is_err());
    assert_eq!(f, ramp());
}

#[test]
fn editing_preserves_order_ranges_and_two_points() {
    let mut f = ramp();
    f.set_point(0, point(50.0, 7, -3.0));
    assert_eq!(f.points()[0], point(10.0, 7, 0.0));
    f.set_point(3, point(f64::NAN, 9, 2.0));
    assert_eq!(f.points()[3], point(20.0, 9, 1.0));
    f.set_point(99, point(0.0, 0, 0.0));
    let mut f = ramp();
    let number = f.add_point(5.0).unwrap();
    assert_eq!((number, f.points()[number]), (1, point(5.0, 50, 0.25)));
    assert_eq!(f.add_point(f64::NAN), None);
    assert_eq!(f.add_point(-9.0), Some(0));
    assert!(!f.remove_point(9));
    for _ in 0..4 {
        assert!(f.remove_point(0));
    }
    assert!(!f.remove_point(0));
    assert_eq!(f.points().len(), 2);
    assert!(TransferFunction::new(f.points().to_vec(), None).is_ok());
}

#[test]
fn is_transparent_means_zero_opacity_everywhere() {
    assert!(!ramp().is_transparent());
    let zero = TransferFunction::new(vec![point(0.0, 0, 0.0), point(1.0, 255, 0.0)], None).unwrap();
    assert!(zero.is_transparent());
    let mut f = ramp();
    f.set_gradient(Some(vec![
        GradientPoint { gradient: 0.0, factor: 0.0 },
        GradientPoint { gradient: 1.0, factor: 0.0 },
    ]))
    .unwrap();
    assert!(f.is_transparent());
}

/// Compared with many samples; the maximum of a piecewise linear function is at its ends and corners.
#[test]
fn the_largest_opacity_of_a_range_is_exact() {
    let peaks = TransferFunction::new(
        (0..40).map(|i| point(f64::from(i), 0, noise([i as usize, 0, 0], 3))).collect(),
        None,
    )
    .unwrap();
    for f in [ramp(), peaks] {
        for i in 0..200 {
            let low = noise([i, 1, 0], 1) * 44.0 - 2.0;
            let high = low + noise([i, 2, 0], 1).powi(3) * 44.0;
            let found = f.max_opacity(low, high);
            let corners = f.points().iter().map(|p| p.value).filter(|v| (low..=high).contains(v));
            let brute = (0..=2000)
                .map(|k| low + (high - low) * f64::from(k) / 2000.0)
                .chain(corners)
                .map(|v| f.sample(v, 0.0).1)
                .fold(0.0, f64::max);
            assert!(found >= brute - 1e-12, "{low} {high}: {found} {brute}");
            // A step's lower side may count too.
            assert!(found <= brute + 1e-12 || (low..=high).contains(&10.0), "{low} {high}: {found} {brute}");
        }
        assert_eq!(f.max_opacity(3.0, 2.0), 0.0);
        assert_eq!(f.max_opacity(f64::NAN, 2.0), 0.0);
    }
}

#[test]
fn opacities_of_two_halves_compose_to_the_whole() {
    for per_mm in [0.0, 1e-12, 0.3, 0.999] {
        for length in [1e-3, 0.5, 1.0, 7.0] {
            let whole = TransferFunction::opacity_over(per_mm, length);
            let half = TransferFunction::opacity_over(per_mm, length / 2.0);
            assert!((1.0 - (1.0 - half) * (1.0 - half) - whole).abs() < 1e-15, "{per_mm} {length}");
        }
        assert!((TransferFunction::opacity_over(per_mm, 1.0) - per_mm).abs() < 1e-15);
    }
    assert_eq!(TransferFunction::opacity_over(1.0, 1e-9), 1.0);
    assert_eq!(TransferFunction::opacity_over(1.0, 0.0), 0.0);
    // Far below the precision of 1 − x.
    assert!((TransferFunction::opacity_over(1e-20, 2.0) - 2e-20).abs() < 1e-30);
}

fn line(values: Vec<f32>) -> Volume {
    let grid = Grid::axis_aligned([values.len(), 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
    Volume::new(grid, Samples::F32(values), Scaling::NONE).unwrap()
}

#[test]
fn every_preset_is_valid_for_every_image() {
    let images = [
        line((0..1000).map(|i| i as f32).collect()),
        line(vec![3.0; 50]),
        line(vec![f32::NAN; 50]),
        line((0..1000).map(|i| 1e-30 * i as f32).collect()),
        line((0..4000).map(|i| if i < 2000 { -1000.0 } else { (i - 2500) as f32 }).collect()),
    ];
    for image in &images {
        let statistics = flat::Histogram::of(image);
        for preset in TransferPreset::VARIANTS {
            let f = preset.transfer(&statistics);
            let checked =
                TransferFunction::new(f.points().to_vec(), f.gradient().map(<[GradientPoint]>::to_vec));
            assert_eq!(checked.as_ref(), Ok(&f), "{preset:?}");
            assert!(!f.is_transparent());
            // Background is invisible.
            assert_eq!(f.sample(f.points()[0].value - 1.0, 0.0).1, 0.0, "{preset:?}");
        }
    }
    let first = |image: &Volume, name| TransferPreset::first_for(&flat::Histogram::of(image), name);
    assert_eq!(first(&images[0], "T1c"), TransferPreset::MrSurface);
    assert_eq!(first(&images[4], "planning"), TransferPreset::CtSkin);
    assert_eq!(first(&images[0], "sub-1_FDG-pet"), TransferPreset::PetHot);
    assert_eq!(first(&images[0], "petra"), TransferPreset::MrSurface);
}

#[test]
fn histograms_count_every_voxel_once() {
    let mut values: Vec<f32> = (0..10_000).map(|i| (i % 100) as f32).collect();
    values.extend([f32::NAN, f32::INFINITY, 1e9]);
    let image = line(values);
    let h = ValueHistogram::of(&image, &flat::Histogram::of(&image));
    assert_eq!((h.counts().len(), h.outside()), (256, 1));
    assert_eq!(h.counts().iter().sum::<u64>(), 10_000);
    let (low, high) = h.range();
    assert!(low == 0.0 && (99.0..200.0).contains(&high), "{low} {high}");
    // Value 50 is in its bin.
    let bin = ((50.0 - low) / (high - low) * 256.0) as usize;
    assert_eq!(h.counts()[bin], 100);
    let heights = h.log_heights();
    assert_eq!(heights.iter().copied().fold(0.0, f64::max), 1.0);
    let nothing = line(vec![f32::NAN; 3]);
    let h = ValueHistogram::of(&nothing, &flat::Histogram::of(&nothing));
    assert!(h.counts().iter().all(|&c| c == 0) && h.range().1 > h.range().0);
    assert!(h.log_heights().iter().all(|&x| x == 0.0));
}

/// Closed form: value = 2x + 3y (x, y in mm) on a grid of 1 x 2 x 3 mm has a gradient of √13 everywhere inside.
#[test]
fn gradients_are_per_millimetre() {
    let spacing = DVec3::new(1.0, 2.0, 3.0);
    let grid = Grid::axis_aligned([12, 12, 5], spacing, DVec3::splat(1e6)).unwrap();
    let values = (0..720).map(|l| 2.0 * f64::from(l % 12) + 3.0 * 2.0 * f64::from(l / 12 % 12)).collect();
    let image = Volume::new(grid, Samples::F64(values), Scaling::NONE).unwrap();
    let h = GradientHistogram::of(&image, &flat::Histogram::of(&image));
    assert_eq!(h.counts().iter().sum::<u64>(), 720);
    let row = (13f64.sqrt() / h.highest_gradient() * 128.0) as usize;
    let inside: u64 = h.counts()[row * 128..(row + 1) * 128].iter().sum();
    assert_eq!(inside, 10 * 10 * 5);
}

#[test]
fn deserialized_functions_are_checked() {
    // Serde's own value deserializers, as this crate has no format crate.
    use serde::de::{
        IntoDeserializer,
        value::{Error, MapDeserializer},
    };
    let empty = MapDeserializer::<_, Error>::new(
        [("points", Vec::<u8>::new())].into_iter().map(|(k, v)| (k, v.into_deserializer())),
    );
    let e = TransferFunction::deserialize(empty).unwrap_err().to_string();
    assert!(e.contains("0 control points"), "{e}");
}
