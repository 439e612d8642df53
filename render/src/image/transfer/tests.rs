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
            let gradient = f.gradient().map(<[GradientPoint]>::to_vec);
            let mut checked = TransferFunction::new(f.points().to_vec(), gradient).unwrap();
            checked.set_shapes(f.shapes().map(<[Shape]>::to_vec)).unwrap();
            assert_eq!(checked, f, "{preset:?}");
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
    let shapes = |image: &Volume, name| TransferPreset::first_shapes_for(&flat::Histogram::of(image), name);
    assert_eq!(shapes(&images[0], "T1c"), TransferPreset::T1cShapes);
    assert_eq!(shapes(&images[0], "sub-1_FLAIR"), TransferPreset::FlairShapes);
    assert_eq!(shapes(&images[4], "planning"), TransferPreset::CtBoneShapes);
    assert_eq!(shapes(&images[0], "FDG"), TransferPreset::PetShapes);
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
    let row = ((13f64.sqrt() / h.highest_gradient()).sqrt() * 128.0) as usize;
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

fn of_shapes(shapes: Vec<Shape>) -> Result<TransferFunction, TransferError> {
    let mut transfer = ramp();
    transfer.set_shapes(Some(shapes)).map(|()| transfer)
}

fn shape(form: Form, opacity: f64) -> Shape {
    Shape { form, color: [255, 0, 0], opacity }
}

const BLOB: Form =
    Form::Blob { value: 10.0, gradient_per_mm: 2.0, value_deviation: 4.0, gradient_deviation_per_mm: 0.5 };

/// Closed forms at chosen places: inside, on an edge, between, outside.
#[test]
fn weights_of_shapes_have_their_closed_forms() {
    let hard = Form::Box { values: [10.0, 20.0], gradients_per_mm: [2.0, 4.0], soft: 0.0 };
    for (value, gradient, weight) in
        [(10.0, 2.0, 1.0), (20.0, 4.0, 1.0), (15.0, 3.0, 1.0), (9.99, 3.0, 0.0), (15.0, 4.01, 0.0)]
    {
        assert_eq!(hard.weight(value, gradient), weight, "{value} {gradient}");
    }
    let soft = Form::Box { values: [10.0, 20.0], gradients_per_mm: [0.0, 4.0], soft: 0.5 };
    // It rises over 2.5 from each side of the values and over 1 from the upper edge, not from gradient 0.
    for (value, gradient, weight) in
        [(10.0, 1.0, 0.0), (11.25, 1.0, 0.5), (19.0, 0.0, 0.4), (15.0, 3.5, 0.5), (11.25, 3.5, 0.25)]
    {
        assert!((soft.weight(value, gradient) - weight).abs() < 1e-12, "{value} {gradient}");
    }
    let triangle = Form::Trapezoid {
        gradients_per_mm: [1.0, 5.0],
        lower_values: [10.0, 10.0],
        upper_values: [6.0, 18.0],
        soft: 0.0,
    };
    // Half way up it reaches from 8 to 14.
    for (value, gradient, weight) in [
        (10.0, 1.0, 1.0),
        (8.0, 3.0, 1.0),
        (14.0, 3.0, 1.0),
        (7.9, 3.0, 0.0),
        (14.1, 3.0, 0.0),
        (10.0, 5.1, 0.0),
    ] {
        assert_eq!(triangle.weight(value, gradient), weight, "{value} {gradient}");
    }
    assert_eq!(BLOB.weight(10.0, 2.0), 1.0);
    let rest = (-4.5f64).exp();
    let expected = ((-0.5f64).exp() - rest) / (1.0 - rest);
    assert!(
        (BLOB.weight(14.0, 2.0) - expected).abs() < 1e-12
            && (BLOB.weight(10.0, 1.5) - expected).abs() < 1e-12
    );
    assert!(BLOB.weight(21.999, 2.0) > 0.0 && BLOB.weight(21.999, 2.0) < 1e-4);
    assert_eq!(BLOB.weight(22.0, 2.0), 0.0);
    for form in [hard, soft, triangle, BLOB] {
        assert_eq!((form.weight(f64::NAN, 2.0), form.weight(12.0, f64::NAN)), (0.0, 0.0));
        // Nothing is outside the bounds.
        let (values, gradients) = form.bounds();
        for i in 0..4000 {
            let at = |n: usize, [low, high]: [f64; 2]| low - 3.0 + noise([i, n, 0], 7) * (high - low + 6.0);
            let (value, gradient) = (at(0, values), at(1, gradients));
            let inside =
                (values[0]..=values[1]).contains(&value) && (gradients[0]..=gradients[1]).contains(&gradient);
            assert!(
                inside || gradient < 0.0 || form.weight(value, gradient) == 0.0,
                "{form:?} {value} {gradient}"
            );
        }
    }
}

#[test]
fn overlapping_shapes_mix_like_materials_in_any_order() {
    let flat = Form::Box { values: [0.0, 30.0], gradients_per_mm: [0.0, 9.0], soft: 0.0 };
    let red = shape(flat, 0.5);
    let blue = Shape { color: [0, 0, 255], ..shape(flat, 0.25) };
    let (color, opacity) = of_shapes(vec![red, blue]).unwrap().sample(15.0, 1.0);
    // 1 − 0.5 · 0.75, and colours by two to one.
    assert!((opacity - 0.625).abs() < 1e-12);
    assert!((color[0] - 2.0 / 3.0).abs() < 1e-12 && (color[2] - 1.0 / 3.0).abs() < 1e-12, "{color:?}");
    assert_eq!(of_shapes(vec![blue, red]).unwrap().sample(15.0, 1.0), (color, opacity));
    let twice = of_shapes(vec![red, red]).unwrap();
    assert!((twice.sample(15.0, 1.0).1 - 0.75).abs() < 1e-12);
    assert_eq!(twice.sample(f64::NAN, 1.0).1, 0.0);
    assert_eq!(twice.sample(15.0, f64::NAN).1, 0.0);
    let none = of_shapes(Vec::new()).unwrap();
    assert!(none.is_transparent() && none.uses_gradient() && none.sample(15.0, 0.0).1 == 0.0);
    assert!(of_shapes(vec![shape(BLOB, 0.0)]).unwrap().is_transparent());
    // Without shapes the points count again.
    let mut back = twice;
    back.set_shapes(None).unwrap();
    assert_eq!(back, ramp());
}

#[test]
fn invalid_shapes_are_rejected_with_the_offending_number() {
    let boxed = |values, gradients_per_mm, soft| Form::Box { values, gradients_per_mm, soft };
    let trapezoid = |lower_values, upper_values| Form::Trapezoid {
        gradients_per_mm: [0.0, 1.0],
        lower_values,
        upper_values,
        soft: 0.0,
    };
    let blob = |value_deviation, gradient_per_mm| Form::Blob {
        value: 0.0,
        gradient_per_mm,
        value_deviation,
        gradient_deviation_per_mm: 1.0,
    };
    for (form, opacity, expected) in [
        (boxed([2.0, 1.0], [0.0, 1.0], 0.0), 0.5, "1 as values of shape 1, expected rising ones"),
        (
            boxed([0.0, f64::INFINITY], [0.0, 1.0], 0.0),
            0.5,
            "inf as values of shape 1, expected a finite number",
        ),
        (boxed([0.0, 1.0], [-1.0, 1.0], 0.0), 0.5, "-1 as gradients_per_mm of shape 1, expected at least 0"),
        (boxed([0.0, 1.0], [0.0, 1.0], 1.5), 0.5, "1.5 as soft of shape 1, expected 0 to 1"),
        (trapezoid([3.0, 2.0], [0.0, 1.0]), 0.5, "2 as lower_values of shape 1"),
        (trapezoid([0.0, 1.0], [f64::NAN, 1.0]), 0.5, "NaN as upper_values of shape 1"),
        (blob(0.0, 1.0), 0.5, "0 as value_deviation of shape 1, expected a finite number above 0"),
        (blob(1.0, -2.0), 0.5, "-2 as gradient_per_mm of shape 1"),
        (BLOB, 1.5, "1.5 as opacity of shape 1, expected 0 to 1"),
    ] {
        let error = of_shapes(vec![shape(BLOB, 1.0), shape(form, opacity)]).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let many = of_shapes(vec![shape(BLOB, 0.1); 65]).unwrap_err().to_string();
    assert!(many.contains("65 shapes, expected at most 64"), "{many}");
    assert!(of_shapes(vec![shape(BLOB, 0.1); 64]).is_ok());
}

/// Whatever is done to a form by its handles, it stays valid, and a handle goes to where it was put where that is allowed.
#[test]
fn moved_and_reshaped_forms_stay_valid() {
    let forms = [
        Form::Box { values: [10.0, 20.0], gradients_per_mm: [2.0, 4.0], soft: 0.5 },
        Form::Trapezoid {
            gradients_per_mm: [1.0, 5.0],
            lower_values: [10.0, 10.0],
            upper_values: [6.0, 18.0],
            soft: 0.5,
        },
        BLOB,
    ];
    for form in forms {
        let up = form.moved(3.0, 1.0);
        assert!((up.weight(13.0, 3.0) - form.weight(10.0, 2.0)).abs() < 1e-12, "{form:?}");
        let mut any = form.moved(-5.0, -100.0);
        assert!(of_shapes(vec![shape(any, 0.5)]).is_ok() && any.handles().iter().all(|h| h[1] >= 0.0));
        for i in 0..500 {
            let number = i % form.handles().len();
            let to = [noise([i, 0, 0], 3) * 60.0 - 20.0, noise([i, 1, 0], 3) * 12.0 - 3.0];
            any = any.reshaped(number, to);
            assert!(of_shapes(vec![shape(any, 0.5)]).is_ok(), "{any:?}");
        }
        assert_eq!(form.reshaped(99, [0.0, 0.0]), form);
        assert_eq!(form.reshaped(0, [f64::NAN, 0.0]), form);
    }
    // The upper left corner of the box, and the blob's end to the right.
    assert_eq!(forms[0].reshaped(2, [12.0, 9.0]).handles()[2], [12.0, 9.0]);
    assert_eq!(forms[0].reshaped(2, [50.0, 1.0]).handles()[2], [20.0, 2.0], "edges don't cross");
    assert_eq!(
        forms[1].reshaped(3, [30.0, 7.0]).handles(),
        [[10.0, 1.0], [10.0, 1.0], [6.0, 7.0], [30.0, 7.0]]
    );
    assert_eq!(forms[2].reshaped(0, [17.0, 8.0]).handles()[0], [17.0, 2.0]);
}
