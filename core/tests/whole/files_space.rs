//! Voxel grids from headers: qform against nibabel, which form is in force, and the checks about it.

use crate::common::{NiftiBuilder, codes};
use glam::{DMat3, DVec3};
use glioscope_core::files::{FileError, nifti_space::Form};
use glioscope_core::{Severity, Sides};

type Rows = [[f64; 4]; 3];

/// `Nifti1Header.get_qform()` of nibabel 5.4.2 (22 Nov 2026) for pixdim, quaternion, offset, qfac.
#[rustfmt::skip]
#[allow(clippy::type_complexity, reason = "a table, read once below")]
const QFORMS: &[(&str, [f32; 3], [f32; 3], [f32; 3], f32, Rows)] = &[
    ("no rotation", [1.5, 2.0, 3.0], [0.0, 0.0, 0.0], [-10.0, 20.0, 5.5], 1.0, [[1.5, 0.0, 0.0, -10.0], [0.0, 2.0, 0.0, 20.0], [0.0, 0.0, 3.0, 5.5]]),
    ("half turn about z, as LPS", [1.0, 1.0, 2.0], [0.0, 0.0, 1.0], [90.0, 126.0, -72.0], 1.0, [[-1.0, 0.0, 0.0, 90.0], [0.0, -1.0, 0.0, 126.0], [0.0, 0.0, 2.0, -72.0]]),
    ("half turn about y, mirrored", [4.0, 4.0, 6.0], [0.0, 1.0, 0.0], [128.0, -128.0, -44.0], -1.0, [[-4.0, 0.0, 0.0, 128.0], [0.0, 4.0, 0.0, -128.0], [0.0, 0.0, 6.0, -44.0]]),
    ("oblique", [0.5, 0.7, 5.0], [0.1, -0.25, 0.3], [12.25, -33.5, 7.75], 1.0, [[0.3474999928474425, -0.419363116515544, -1.9878756256473955, 12.25], [0.24954508758155292, 0.559999980032444, -1.665150300254593, -33.5], [0.25878756584299506, 0.02312103329724391, 4.274999997019767, 7.75]]),
    ("oblique, mirrored", [0.5, 0.7, 5.0], [0.1, -0.25, 0.3], [12.25, -33.5, 7.75], -1.0, [[0.3474999928474425, -0.419363116515544, 1.9878756256473955, 12.25], [0.24954508758155292, 0.559999980032444, 1.665150300254593, -33.5], [0.25878756584299506, 0.02312103329724391, -4.274999997019767, 7.75]]),
    ("steep", [1.25, 1.25, 1.25], [0.5, 0.5, 0.5], [-1.0, -2.0, -3.0], 1.0, [[0.0, 0.0, 1.25, -1.0], [1.25, 0.0, 0.0, -2.0], [0.0, 1.25, 0.0, -3.0]]),
    ("near half turn", [1.0, 1.0, 1.0], [0.7, 0.1, 0.7], [0.0, 0.0, 0.0], -1.0, [[3.278255433780686e-08, -2.2947768496572093e-07, -0.9999999999999731, 0.0], [0.28000022888163845, -0.9599999332427984, 2.2947768496572093e-07, 0.0], [0.9599999332428253, 0.28000022888163845, -3.278255433780686e-08, 0.0]]),
];

fn rows_of(nifti: &NiftiBuilder) -> (Rows, Vec<&'static str>) {
    let loaded = nifti.read().unwrap();
    let m = loaded.volume.grid().world_from_voxel();
    let rows = std::array::from_fn(|r| {
        std::array::from_fn(|c| if c < 3 { m.matrix3.col(c)[r] } else { m.translation[r] })
    });
    (rows, codes(&loaded))
}

fn assert_rows(ours: Rows, expected: Rows, what: &str) {
    for (a, b) in ours.iter().flatten().zip(expected.iter().flatten()) {
        assert!((a - b).abs() < 1e-6, "{what}: {ours:?}, expected {expected:?}");
    }
}

const SCANNER: [[f32; 4]; 3] = [[-1.5, 0.0, 0.0, 90.0], [0.0, 2.0, 0.0, -126.0], [0.0, 0.0, 3.0, -72.0]];

fn wide(rows: [[f32; 4]; 3]) -> Rows {
    rows.map(|r| r.map(f64::from))
}

#[test]
fn qforms_match_nibabel() {
    for &(what, pixdim, quatern, offset, qfac, expected) in QFORMS {
        let mut nifti = NiftiBuilder::new();
        nifti.f32s(76, &[qfac, pixdim[0], pixdim[1], pixdim[2]]).qform(1, quatern, offset);
        let (rows, codes) = rows_of(&nifti);
        assert_rows(rows, expected, what);
        assert_eq!(codes, Vec::<&str>::new(), "{what}");
    }
}

#[test]
fn the_sform_takes_precedence_over_the_qform() {
    let mut nifti = NiftiBuilder::new();
    nifti.qform(1, [0.0; 3], [7.0, 8.0, 9.0]);
    assert_rows(
        rows_of(&nifti).0,
        [[1.5, 0.0, 0.0, 7.0], [0.0, 2.0, 0.0, 8.0], [0.0, 0.0, 3.0, 9.0]],
        "qform",
    );
    // sform rows with code 0 are ignored.
    nifti.sform(0, SCANNER);
    assert_eq!(rows_of(&nifti).0[0][3], 7.0);
    nifti.sform(3, SCANNER);
    assert_rows(rows_of(&nifti).0, wide(SCANNER), "sform");
}

#[test]
fn sheared_and_mirrored_sforms_are_kept() {
    let sheared = [[1.5, 0.4, 0.0, 3.0], [0.0, 2.0, -0.7, 4.0], [0.1, 0.0, 3.0, 5.0]];
    let mut nifti = NiftiBuilder::new();
    let (rows, codes) = rows_of(nifti.sform(1, sheared));
    assert_rows(rows, wide(sheared), "sheared");
    assert!(codes.contains(&"sheared"));
    // Volume of a sheared voxel: the determinant, computed by hand.
    let m =
        DMat3::from_cols(DVec3::new(1.5, 0.0, 0.1), DVec3::new(0.4, 2.0, 0.0), DVec3::new(0.0, -0.7, 3.0));
    let by_hand = 1.5 * (2.0 * 3.0 - 0.0) - 0.4 * (0.0 * 3.0 + 0.7 * 0.1);
    assert!((m.determinant() - by_hand).abs() < 1e-12);
    assert!((nifti.read().unwrap().volume.grid().voxel_volume_mm3() - by_hand).abs() < 1e-6);
    let grid = NiftiBuilder::new().sform(1, SCANNER).read().unwrap().volume.grid().clone();
    assert_eq!(grid.axis_codes(), ['L', 'A', 'S']);
    assert!(grid.world_from_voxel().matrix3.determinant() < 0.0);
}

#[test]
fn forms_that_disagree_by_more_than_half_a_voxel_are_reported() {
    let code = "sform-qform-disagree";
    let rows = |shift: f32| [[1.5, 0.0, 0.0, shift], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]];
    // The finest spacing is 1.5 mm: half of it is 0.75.
    for (shift, reported) in [(0.0, false), (0.74, false), (0.76, true), (-30.0, true)] {
        let codes = rows_of(NiftiBuilder::new().qform(1, [0.0; 3], [0.0; 3]).sform(1, rows(shift))).1;
        assert_eq!(codes.contains(&code), reported, "shift {shift}");
    }
    let mut mirrored = NiftiBuilder::new();
    let loaded = mirrored.qform(1, [0.0; 3], [0.0; 3]).sform(1, SCANNER).read().unwrap();
    let check = loaded.checks.iter().find(|c| c.code == code).unwrap();
    assert!(
        check.message.starts_with("made.nii: ") && check.message.contains("left and right"),
        "{}",
        check.message
    );
}

#[test]
fn without_sform_and_qform_sides_are_unknown() {
    let loaded = NiftiBuilder::new().read().unwrap();
    assert_eq!(loaded.volume.grid().sides(), Sides::Unknown);
    assert_eq!(codes(&loaded), ["side-unknown"]);
    assert_eq!(loaded.volume.grid().spacing_mm(), DVec3::new(1.5, 2.0, 3.0));
    let mut nifti = NiftiBuilder::new();
    let loaded = nifti.i16s(252, &[-1]).read().unwrap();
    assert_eq!(codes(&loaded), ["form-code-unknown", "side-unknown"]);
}

#[test]
fn lengths_are_converted_to_millimetres() {
    for (unit, factor, expected) in [
        (1, 1000.0, &["units-converted", "spacing-unusual"][..]),
        (2, 1.0, &[]),
        (3, 1e-3, &["units-converted"]),
        (0, 1.0, &["units-unknown"]),
        (5, 1.0, &["units-unknown"]),
    ] {
        // The upper bits are the unit of time.
        let (rows, codes) = rows_of(NiftiBuilder::new().put(123, &[unit | 8]).sform(1, SCANNER));
        assert_rows(rows, wide(SCANNER).map(|r| r.map(|v| v * factor)), "unit");
        assert_eq!(codes, expected, "unit {unit}");
    }
}

#[test]
fn invalid_quaternions_and_spacings_are_repaired_and_reported() {
    // nifti_quatern_to_mat44: (2, 0, 0) is normalised to (1, 0, 0), a half turn, and so about each axis.
    for (quatern, signs) in [([2.0, 0.0, 0.0], [1.0, -1.0, -1.0]), ([0.0, -3.0, 0.0], [-1.0, 1.0, -1.0])] {
        let (rows, codes) = rows_of(NiftiBuilder::new().qform(1, quatern, [0.0; 3]));
        assert_eq!([rows[0][0], rows[1][1], rows[2][2]], [1.5 * signs[0], 2.0 * signs[1], 3.0 * signs[2]]);
        assert_eq!(codes, ["quaternion-norm"]);
    }
    let (rows, codes) = rows_of(NiftiBuilder::new().qform(1, [0.0, 0.0, 2.0], [0.0; 3]));
    assert_rows(rows, [[-1.5, 0.0, 0.0, 0.0], [0.0, -2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]], "norm");
    assert_eq!(codes, ["quaternion-norm"]);
    for (qfac, z, expected) in [(0.0, 3.0, "qfac"), (-2.0, -3.0, "qfac"), (2.0, 3.0, "qfac")] {
        let (rows, codes) = rows_of(NiftiBuilder::new().f32s(76, &[qfac]).qform(1, [0.0; 3], [0.0; 3]));
        assert_eq!((rows[2][2], codes), (z, vec![expected]), "qfac {qfac}");
    }
    // As in nibabel's header check, negative spacings are made positive.
    let (rows, codes) = rows_of(NiftiBuilder::new().f32s(84, &[-2.0]).qform(1, [0.0, 0.0, 1.0], [0.0; 3]));
    assert_rows(rows, [[-1.5, 0.0, 0.0, 0.0], [0.0, -2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]], "negative");
    assert_eq!(codes, ["pixdim-negative"]);
    // One slice without a thickness; then an sform whose spacing contradicts pixdim.
    let mut slice = NiftiBuilder::new();
    slice.i16s(40, &[2, 6, 4]).f32s(88, &[0.0]).qform(1, [0.0; 3], [0.0; 3]);
    assert_eq!(rows_of(&slice).1, ["thickness-unknown"]);
    let codes = rows_of(NiftiBuilder::new().f32s(80, &[1.0]).sform(1, SCANNER)).1;
    assert_eq!(codes, ["pixdim-sform-disagree"]);
}

#[test]
fn an_unusable_form_falls_back_to_the_other_or_is_refused() {
    let flat = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]];
    let nan = [[1.0, 0.0, 0.0, f32::NAN], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let far = [[1.0, 0.0, 0.0, 1e30], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    for rows in [flat, nan, far] {
        let mut nifti = NiftiBuilder::new();
        let error = nifti.sform(1, rows).read().unwrap_err();
        assert!(matches!(&error, FileError::Wrong { found, .. } if found.contains("sform")), "{error}");
        let loaded = nifti.qform(1, [0.0; 3], [0.0; 3]).read().unwrap();
        assert_eq!(codes(&loaded), ["sform-unusable"]);
        assert_eq!(loaded.volume.grid().spacing_mm(), DVec3::new(1.5, 2.0, 3.0));
    }
    for quatern in [[f32::NAN, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0]] {
        let mut nifti = NiftiBuilder::new();
        assert!(nifti.qform(1, quatern, [0.0; 3]).read().is_err());
        assert_eq!(codes(&nifti.sform(1, SCANNER).read().unwrap()), ["qform-unusable"]);
    }
    assert!(NiftiBuilder::new().f32s(80, &[0.0]).read().unwrap_err().to_string().contains("pixdim[1] = 0"));
    assert!(NiftiBuilder::new().f32s(88, &[f32::NAN]).sform(1, SCANNER).read().is_err());
}

/// The rows of an sform that stretches x by a factor.
fn stretched(factor: f32) -> [[f32; 4]; 3] {
    [[1.5 * factor, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]]
}

fn message(nifti: &NiftiBuilder, code: &str) -> Option<String> {
    let checks = nifti.read().unwrap().checks;
    checks.into_iter().find(|check| check.code == code).map(|check| check.message)
}

#[test]
fn codes_past_the_known_ones_are_used_and_negative_ones_are_not() {
    let of = |code: i16| {
        let mut nifti = NiftiBuilder::new();
        nifti.qform(1, [0.0; 3], [0.0; 3]).sform(code, SCANNER);
        (rows_of(&nifti).0[0][0] < 0.0, message(&nifti, "form-code-unknown"))
    };
    let text = |code, meaning| Some(format!("made.nii: sform_code {code} is not one of 0 to 5; {meaning}"));
    assert_eq!((of(5), of(0)), ((true, None), (false, None)));
    assert_eq!(of(6), (true, text(6, "used, but its space is unknown")));
    assert_eq!(of(-1), (false, text(-1, "taken as 0: not set")));
}

#[test]
fn a_pixdim_that_contradicts_the_sform_by_more_than_a_hundredth_is_reported() {
    let reported = |nifti: &NiftiBuilder| message(nifti, "pixdim-sform-disagree");
    for (factor, expected) in [(0.992, false), (1.008, false), (0.988, true), (1.012, true)] {
        let mut nifti = NiftiBuilder::new();
        nifti.sform(1, stretched(factor));
        assert_eq!(reported(&nifti).is_some(), expected, "{factor}");
        // In micrometres all is a thousandth of it, pixdim too.
        assert_eq!(reported(nifti.put(123, &[3])).is_some(), expected, "{factor} in µm");
        // Along one voxel there is no spacing.
        let mut one = nifti.clone();
        assert_eq!(reported(one.i16s(42, &[1])), None, "{factor}");
    }
    let mut nifti = NiftiBuilder::new();
    let text = reported(nifti.sform(1, stretched(2.0))).unwrap();
    assert!(
        text.contains("pixdim says 1.5000 × 2.0000 × 3.0000 mm, the sform 3.0000 × 2.0000 × 3.0000 mm"),
        "{text}"
    );
}

#[test]
fn forms_that_disagree_say_how_far_and_whether_sides_may_be_swapped() {
    let of = |rows: [[f32; 4]; 3]| {
        let mut nifti = NiftiBuilder::new();
        message(nifti.qform(1, [0.0; 3], [0.0; 3]).sform(1, rows), "sform-qform-disagree").unwrap()
    };
    // The faces of two voxels along x lie at -0.75 and 2.25 mm, stretched threefold at -2.25 and 6.75.
    let text = of(stretched(3.0));
    assert!(text.contains("up to 4.50 mm apart; the sform is used"), "{text}");
    let text = of(stretched(-1.0));
    assert!(text.contains("up to 4.50 mm apart; one mirrors the other, so left and right may be"), "{text}");
}

#[test]
fn quaternions_and_qfac_are_reported_where_they_are_not_as_the_standard_says() {
    let of = |b: f32, qfac: f32| {
        let mut nifti = NiftiBuilder::new();
        nifti.f32s(76, &[qfac]).qform(1, [b, 0.0, 0.0], [0.0; 3]);
        (message(&nifti, "quaternion-norm"), message(&nifti, "qfac"))
    };
    assert_eq!([of(1.0, 1.0), of(0.8, -1.0), of(1.000_005, 1.0)], [const { (None, None) }; 3]);
    let text = |text: &str| Some(format!("made.nii: {text}"));
    assert_eq!(of(1.000_02, 1.0).0, text("the quaternion's length is 1.000020, above 1; made 1"));
    for (qfac, taken) in [("2", "1"), ("-2", "-1"), ("0", "1")] {
        let expected = text(&format!("pixdim[0] (qfac) is {qfac}, taken as {taken}"));
        assert_eq!(of(0.0, qfac.parse().unwrap()).1, expected);
    }
    // 0 is defined to mean 1.
    let severity = |qfac: f32| {
        let checks =
            NiftiBuilder::new().f32s(76, &[qfac]).qform(1, [0.0; 3], [0.0; 3]).read().unwrap().checks;
        checks[0].severity
    };
    assert_eq!([severity(0.0), severity(2.0)], [Severity::Note, Severity::Warning]);
}

/// Of one slice: 1 mm, or what pixdim says; sizes that aren't needed aren't asked for.
#[test]
fn a_thickness_that_is_missing_is_one_unit_and_one_that_is_stated_counts() {
    let of = |dims: &[i16; 4], z: f32, form: i16| {
        let mut nifti = NiftiBuilder::new();
        nifti.i16s(40, dims).f32s(88, &[z]).qform(form, [0.0; 3], [0.0; 3]);
        nifti.read().map(|loaded| {
            (loaded.volume.grid().spacing_mm().z, codes(&loaded).contains(&"thickness-unknown"))
        })
    };
    for form in [0, 1] {
        assert_eq!(of(&[3, 2, 3, 1], 5.0, form).unwrap(), (5.0, false));
        assert_eq!(of(&[3, 2, 3, 1], -5.0, form).unwrap(), (5.0, false));
        assert_eq!(of(&[3, 2, 3, 1], 0.0, form).unwrap(), (1.0, true));
        assert_eq!(of(&[2, 2, 3, 1], f32::NAN, form).unwrap(), (1.0, true));
        assert!(of(&[3, 2, 3, 1], f32::NAN, form).unwrap_err().to_string().contains("pixdim[3] = NaN"));
        assert!(of(&[3, 2, 3, 4], 0.0, form).is_err());
    }
}

/// The upper bits are the unit of time.
#[test]
fn a_unit_of_length_that_is_missing_or_unknown_is_named() {
    for (units, found) in [(8, "no unit of length"), (13, "unit code 5")] {
        let mut nifti = NiftiBuilder::new();
        let text = message(nifti.put(123, &[units]).sform(1, SCANNER), "units-unknown");
        assert_eq!(text, Some(format!("made.nii: {found}; mm assumed")));
    }
}

#[test]
fn forms_are_named_as_in_json() {
    for form in [Form::Sform, Form::Qform, Form::Pixdim] {
        assert_eq!(serde_json::to_value(form).unwrap(), form.name());
    }
}
