//! Transforms that other programs wrote, and what must not be read.

use glam::{DAffine3, DVec3};

use super::{matrix::from_rows, *};

/// The transform that most fixtures hold, from RAS mm of [`images`]' fixed image to RAS mm of its moving one.
pub(super) fn truth() -> DAffine3 {
    rows([
        [0.9937606691655043, -0.10348823636300494, -0.04159227517465231, 4.0],
        [0.09970865087213879, 0.9914231080712159, -0.08448908641752585, -6.0],
        [0.04997916927067833, 0.07981482141109528, 0.9955559637318878, 5.0],
    ])
}

/// Two oblique images of different spacing; the fixed one is stored right-handed, the moving one left-handed.
pub(super) fn images() -> Images {
    Images {
        fixed: ImageGeometry {
            dims: [48, 44, 36],
            spacing_mm: DVec3::new(2.0, 2.5, 3.0),
            world_from_voxel: from_rows(
                [
                    [1.9987002611160278, -0.05368131026625633, -0.08685752004384995],
                    [0.03997933492064476, 2.4963014125823975, -0.15170487761497498],
                    [0.05999100208282471, 0.12489169836044312, 2.9949026107788086],
                ],
                [-45.0, -60.0, -50.0],
            ),
        },
        moving: ImageGeometry {
            dims: [44, 52, 46],
            spacing_mm: DVec3::new(2.5, 2.0, 2.0),
            world_from_voxel: from_rows(
                [
                    [-2.483034133911133, -0.20427900552749634, 0.11124888062477112],
                    [-0.24913442134857178, 1.9879378080368042, 0.09154235571622849],
                    [0.14991001784801483, -0.07983475178480148, 1.9948041439056396],
                ],
                [58.0, -50.0, -42.0],
            ),
        },
    }
}

/// A matrix by its first three rows.
pub(super) fn rows(rows: [[f64; 4]; 3]) -> DAffine3 {
    from_rows(rows.map(|[a, b, c, _]| [a, b, c]), rows.map(|[_, _, _, t]| t))
}

/// The largest difference of two matrices' numbers.
pub(super) fn difference(a: DAffine3, b: DAffine3) -> f64 {
    let pairs = a.to_cols_array().into_iter().zip(b.to_cols_array());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// What a file maps; the message where it is refused.
pub(super) fn mapped(bytes: impl AsRef<[u8]>, given: Given) -> Result<DAffine3, String> {
    let transform = read_bytes("t", bytes.as_ref(), &given).map_err(|error| error.to_string())?;
    Ok(transform.moving_from_fixed())
}

/// The bytes of a text in hexadecimal digits.
pub(super) fn hex(digits: &str) -> Vec<u8> {
    let digits = digits.as_bytes().chunks_exact(2).map(|pair| std::str::from_utf8(pair).unwrap());
    digits.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

#[test]
fn reflections_and_impossible_matrices_are_refused_by_what_they_are() {
    let refused = |matrix: DAffine3| Transform::new(matrix).unwrap_err().found;
    let scale = |x: f64, y: f64, z: f64| DAffine3::from_scale(DVec3::new(x, y, z));
    assert_eq!(refused(scale(-1.0, 1.0, 1.0)), "a reflection, which swaps left and right");
    assert!(refused(scale(0.0, 1.0, 1.0)).starts_with("a matrix of condition inf"));
    assert!(refused(scale(1.0 / 2200.0, 1.0, 1.0)).starts_with("a matrix of condition 1.037e3"));
    assert!(Transform::new(scale(1e-3, 1.0, 1.0)).is_ok());
    assert!(refused(scale(f64::NAN, 1.0, 1.0)).contains("not finite"));
    assert!(refused(DAffine3::from_translation(DVec3::new(0.0, 1e7, 0.0))).contains("above 1e6"));
    assert!(Transform::new(scale(0.5, 1.0, 2.0)).is_ok());
    let both = Transform::new(truth()).unwrap();
    assert!(difference(both.fixed_from_moving() * both.moving_from_fixed(), DAffine3::IDENTITY) < 1e-14);
}

#[test]
fn written_files_are_read_back_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.tfm");
    let transform = Transform::new(truth()).unwrap();
    write(&path, &transform, &Given::default()).unwrap();
    assert_eq!(Format::of_file(&path).unwrap(), Format::ItkText);
    assert_eq!(read(&path, &Given::default()).unwrap(), transform);
    for convention in Convention::ALL {
        let given = Given { format: Some(Format::Matrix), convention: Some(convention), images: None };
        write(&path, &transform, &given).unwrap();
        assert_eq!(Format::of_file(&path).unwrap(), Format::Matrix);
        let back = read(&path, &given).unwrap().moving_from_fixed();
        assert!(difference(back, truth()) < 1e-12, "{convention:?}");
    }
}

/// A file that is written, what it is written as, and what is needed to read it back.
struct Written {
    name: &'static str,
    bytes: &'static [u8],
    as_what: Given,
    back: Given,
}

/// Every format; the bytes are what other programs read as the truth: fixtures/read.py.
fn written() -> [Written; 6] {
    let of = |format| Given { format, ..Given::default() };
    let with = |format| Given { images: Some(images()), ..of(format) };
    let new = |name, bytes: &'static [u8], as_what, back| Written { name, bytes, as_what, back };
    [
        new("written.tfm", include_bytes!("fixtures/written.tfm"), of(None), of(None)),
        new("written.mat", include_bytes!("fixtures/written.mat"), of(Some(Format::ItkMat)), of(None)),
        new("written.h5", include_bytes!("fixtures/written.h5"), of(None), of(None)),
        new("written.lta", include_bytes!("fixtures/written.lta"), with(None), of(None)),
        new("written.dat", include_bytes!("fixtures/written.dat"), with(None), with(None)),
        new(
            "written.flirt.mat",
            include_bytes!("fixtures/written.flirt.mat"),
            with(Some(Format::Flirt)),
            with(Some(Format::Flirt)),
        ),
    ]
}

#[test]
fn every_format_is_read_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let transform = Transform::new(truth()).unwrap();
    for Written { name, bytes, as_what, back } in written() {
        let path = folder.path().join(name);
        write(&path, &transform, &as_what).unwrap();
        assert!(std::fs::read(&path).unwrap() == bytes, "{name}: other bytes than those that others read");
        let format = as_what.format.or_else(|| Format::of_ending(&path)).unwrap();
        let seen = if format == Format::Flirt { Format::Matrix } else { format };
        assert_eq!(Format::of_file(&path).unwrap(), seen);
        let found = read(&path, &back).unwrap().moving_from_fixed();
        let is_exact = matches!(format, Format::ItkText | Format::ItkMat | Format::ItkHdf);
        // Of numbers up to 6 mm, and of images whose corners are 60 mm away.
        let most = if is_exact { f64::MIN_POSITIVE } else { 6e-13 };
        assert!(difference(found, truth()) < most, "{name}: {found:?}");
    }
}

#[test]
fn what_a_format_needs_is_named_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let transform = Transform::new(truth()).unwrap();
    let of = |format| Given { format, ..Given::default() };
    let mut flat = images();
    flat.fixed.spacing_mm.y = 0.0;
    let flat = Given { images: Some(flat), ..Given::default() };
    for (name, given, expected) in [
        ("t.lta", of(None), "found .lta of FreeSurfer, without its images, expected the two images"),
        ("t.dat", of(None), "found register.dat of FreeSurfer, without its images"),
        ("t.mat", of(Some(Format::Flirt)), "found FLIRT .mat, without its images"),
        ("t.mat", of(Some(Format::Matrix)), "found a bare 4x4 matrix, expected what it means with it"),
        ("t.mat", of(None), "found an ending of no one format, expected .tfm"),
        ("t.lta", flat, "found a grid of the fixed image without voxels or size"),
    ] {
        let path = folder.path().join(name);
        let error = write(&path, &transform, &given).unwrap_err().to_string();
        assert!(error.starts_with(&path.display().to_string()) && error.contains(expected), "{error}");
        assert!(!path.exists());
    }
    let all = [Format::ItkText, Format::ItkMat, Format::ItkHdf, Format::Matrix];
    assert!(Format::Lta.needs_images_to_write() && !all.iter().any(|f| f.needs_images_to_write()));
}

#[test]
fn files_that_are_no_linear_transform_are_named() {
    let mut nifti = vec![0; 400];
    nifti[344..348].copy_from_slice(b"n+1\0");
    // As SimpleITK 2.5.7 writes them.
    let warp = "#Insight Transform File V1.0\n#Transform 0\nTransform: DisplacementFieldTransform_double_3_3\nParameters: 0 0\n";
    let spline = warp.replace("DisplacementFieldTransform_double_3_3", "BSplineTransform_double_3_3_1");
    let mut spline_mat = vec![0; 20];
    spline_mat.extend_from_slice(b"BSplineTransform_double_3_3_1\0");
    let folder = tempfile::tempdir().unwrap();
    for (bytes, expected) in [
        (b"MATLAB 5.0 MAT-file, Platform".as_slice(), "found a MATLAB 5 file"),
        (b"\x1f\x8b\x08\0", "found a compressed file"),
        (&nifti, "found an image, as of a displacement field"),
        (warp.as_bytes(), "found a transform that is not linear (DisplacementField)"),
        (&spline_mat, "found a transform that is not linear (BSpline)"),
        (spline.as_bytes(), "found a transform that is not linear (BSpline)"),
        (b"", "found an empty file"),
        (b"# 3dvolreg matrices\n1 0 0 0 0 1 0 0 0 0 1 0", "found a text that begins \"# 3dvolreg"),
        (b"1 0 0 0\n0 1 0 0\n0 0 1 0\n", "found a text that begins \"1 0 0 0\""),
        (b"\xff\xfe\0", "found bytes that are no text"),
    ] {
        let path = folder.path().join("t");
        write_whole(&path, bytes).unwrap();
        let error = read(&path, &Given::default()).unwrap_err().to_string();
        assert!(error.starts_with(&path.display().to_string()) && error.contains(expected), "{error}");
        assert_eq!(Format::of_file(&path).unwrap_err().to_string(), error);
    }
    let wrong = mapped(itk::text(truth()), Given { format: Some(Format::Flirt), ..Given::default() });
    let with_images = [Format::Flirt, Format::RegisterDat];
    let all = [Format::ItkText, Format::ItkMat, Format::ItkHdf, Format::Lta, Format::Matrix];
    assert!(with_images.iter().all(|f| f.needs_images()) && !all.iter().any(|f| f.needs_images()));
    assert_eq!(wrong.unwrap_err(), "t: found ITK text, expected FLIRT .mat");
}

#[test]
fn no_bytes_panic_or_pass_as_a_transform_that_is_none() {
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut below = move |n: usize| {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed % n.max(1) as u64) as usize
    };
    let words: [&[u8]; 8] = [b"nan", b"1e999", b"-1", b"\n", b"\0", b"\xff\xff\xff\xff", b"=", b"1 4 4\n"];
    let all = all_fixtures();
    let mut passed = 0;
    for _ in 0..400 {
        for (at, fixture) in all.iter().enumerate() {
            let mut bytes = fixture.clone();
            for _ in 0..=below(4) {
                let position = below(bytes.len());
                match below(5) {
                    0 => bytes.truncate(position),
                    1 => drop(bytes.drain(position..(position + below(30)).min(bytes.len()))),
                    2 => drop(bytes.splice(position..position, words[below(words.len())].iter().copied())),
                    3 => bytes
                        .splice(position.., all[(at + below(all.len())) % all.len()].iter().copied())
                        .for_each(drop),
                    _ => {
                        if let Some(byte) = bytes.get_mut(position) {
                            *byte = below(256) as u8;
                        }
                    }
                }
            }
            for format in [None, Some(Format::Flirt)] {
                let given = Given {
                    format,
                    convention: Some(Convention::RasFixedFromMoving),
                    images: Some(images()),
                };
                if let Ok(read) = mapped(&bytes, given) {
                    passed += 1;
                    assert!(read.is_finite() && read.matrix3.determinant() > 0.0);
                }
            }
        }
    }
    assert!(passed > 100, "{passed} mutations passed: most of them break nothing but a digit");
}

fn all_fixtures() -> Vec<Vec<u8>> {
    let texts = [
        itk::tests::COMPOSITE,
        flirt::tests::NITRANSFORMS,
        register_dat::tests::REGISTER_DAT,
        lta::tests::VOXELS,
        lta::tests::RAS,
        matrix::tests::REG_ALADIN,
    ];
    let mats = [itk_mat::tests::ANTS, itk_mat::tests::SIMPLE_ITK].map(hex);
    let texts = texts.into_iter().map(|text| text.as_bytes().to_vec());
    texts.chain(mats).chain([itk_hdf::tests::COMPOSITE.to_vec()]).collect()
}

#[test]
fn turns_and_scales_are_those_of_the_parts() {
    let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.3);
    let of = |matrix: DMat3| {
        let affine = DAffine3::from_mat3_translation(matrix, DVec3::new(1.0, 2.0, 3.0));
        let transform = Transform::new(affine).unwrap();
        (transform.turn_deg(), transform.volume_ratio())
    };
    let (degrees, volume) = of(turn);
    assert!((degrees - 0.3_f64.to_degrees()).abs() < 1e-9 && (volume - 1.0).abs() < 1e-12);
    // Scaling along axes doesn't turn.
    let (degrees, volume) = of(turn * DMat3::from_diagonal(DVec3::new(2.0, 1.0, 0.5)));
    assert!((degrees - 0.3_f64.to_degrees()).abs() < 1e-9 && (volume - 1.0).abs() < 1e-12);
    assert!(of(DMat3::IDENTITY).0.abs() < 1e-9);
}
