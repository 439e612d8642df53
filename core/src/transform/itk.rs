//! Transforms of ITK in text.
//!
//! Sources: ITK's `itkTxtTransformIO` and `itkCompositeTransform`.

use glam::DAffine3;

use super::{
    Refusal,
    itk_class::{LINEAR, base, flip, of_class, ras},
    quoted,
};

/// The most transforms of a composite.
pub(super) const MOST: usize = 100;
/// The most numbers of a transform that are read: those that are linear have at most 15.
pub(super) const MOST_NUMBERS: usize = 64;

/// The class that is written.
pub(super) const WRITTEN: &str = "AffineTransform_double_3_3";

/// One transform as a file has it.
#[derive(Default)]
pub(super) struct Stored {
    pub(super) class: String,
    pub(super) parameters: Option<Vec<f64>>,
    pub(super) fixed: Vec<f64>,
}

/// The matrix, from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn read(text: &str) -> Result<DAffine3, Refusal> {
    composed(&stored(text)?)
}

/// The matrix of a file's transforms: of the only one, or of a composite and its parts.
pub(super) fn composed(all: &[Stored]) -> Result<DAffine3, Refusal> {
    let parts = match all {
        [] => return Err(Refusal::new("no transform", LINEAR)),
        [composite, parts @ ..] if base(&composite.class)? == "CompositeTransform" => parts,
        [one] => std::slice::from_ref(one),
        several => {
            let found = format!("{} transforms that are not composed, as of motion", several.len());
            return Err(Refusal::new(found, "one transform, or a CompositeTransform"));
        }
    };
    if parts.is_empty() {
        return Err(Refusal::new("a CompositeTransform of nothing", LINEAR));
    }
    let mut all = DAffine3::IDENTITY;
    // The last one of a composite comes first.
    for part in parts {
        all *= of_class(&part.class, part.parameters.as_deref().unwrap_or_default(), &part.fixed)?;
    }
    ras(all)
}

/// The text of a matrix from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn text(moving_from_fixed: DAffine3) -> String {
    let numbers = parameters(moving_from_fixed).map(|number| number.to_string());
    format!(
        "#Insight Transform File V1.0\n#Transform 0\nTransform: {WRITTEN}\nParameters: {}\nFixedParameters: 0 0 0\n",
        numbers.join(" ")
    )
}

/// The parameters of [`WRITTEN`] about the origin, in LPS mm: the matrix by rows, then the translation.
pub(super) fn parameters(moving_from_fixed: DAffine3) -> [f64; 12] {
    let lps = flip(moving_from_fixed);
    let [a, b, c, d, e, f, g, h, i] = lps.matrix3.transpose().to_cols_array();
    let [x, y, z] = lps.translation.to_array();
    // The sum makes 0 of -0.
    [a, b, c, d, e, f, g, h, i, x, y, z].map(|number| number + 0.0)
}

fn stored(text: &str) -> Result<Vec<Stored>, Refusal> {
    let mut all: Vec<Stored> = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (key, value) = line.split_once(':').map_or((line, ""), |(key, value)| (key.trim(), value.trim()));
        let count = all.len();
        match (key, all.last_mut()) {
            ("Transform", _) if count > MOST => {
                return Err(Refusal::new(format!("more than {MOST} transforms"), LINEAR));
            }
            ("Transform", _) => {
                base(value)?;
                all.push(Stored { class: value.to_owned(), ..Stored::default() });
            }
            ("Parameters", Some(last)) if last.parameters.is_none() => {
                last.parameters = Some(numbers(value)?);
            }
            ("FixedParameters", Some(last)) => last.fixed = numbers(value)?,
            _ => {
                return Err(Refusal::new(
                    format!("the line {}", quoted(line)),
                    "Transform, Parameters or FixedParameters",
                ));
            }
        }
    }
    Ok(all)
}

fn numbers(line: &str) -> Result<Vec<f64>, Refusal> {
    let words = line.split_whitespace().take(MOST_NUMBERS + 1);
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.len() <= MOST_NUMBERS);
    numbers.ok_or_else(|| Refusal::new(format!("the parameters {}", quoted(line)), "a few numbers"))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Given, itk_class::tests::one, tests::*};
    use super::*;

    /// By SimpleITK 2.5.7, `WriteTransform(CompositeTransform([euler, affine]))`.
    pub(in super::super) const COMPOSITE: &str = "\
#Insight Transform File V1.0
#Transform 0
Transform: CompositeTransform_double_3_3
#Transform 1
Transform: Euler3DTransform_double_3_3
Parameters: 0.1 -0.2 0.3 1.5 -2.5 3.5
FixedParameters: 10 -20 30 0
#Transform 2
Transform: AffineTransform_double_3_3
Parameters: 1 0.1 0.05 -0.1 0.9 0.02 0.03 -0.04 1.1 1.5 -2.5 3.5
FixedParameters: 10 -20 30
";

    #[test]
    fn the_last_transform_of_a_composite_comes_first() {
        // By TransformPoint of SimpleITK 2.5.7, from LPS to RAS.
        let expected = rows([
            [0.9667326063465822, -0.16398873211890486, 0.13574264028773442, -4.210435327104846],
            [0.17105958478477135, 0.888662922855616, 0.13485723374257041, 4.894652195750265],
            [-0.21694857980545557, -0.07061094305948101, 1.0845678688376386, 3.665724819076336],
        ]);
        assert!(difference(mapped(COMPOSITE, Given::default()).unwrap(), expected) < 1e-13);
    }

    #[test]
    fn only_so_many_transforms_and_numbers_are_read() {
        let header = "#Insight Transform File V1.0\nTransform: CompositeTransform_double_3_3\n";
        let composite = |n: usize| header.to_owned() + &"Transform: IdentityTransform_double_3_3\n".repeat(n);
        assert!(mapped(composite(MOST), Given::default()).is_ok());
        assert!(
            mapped(composite(MOST + 1), Given::default()).unwrap_err().contains("more than 100 transforms")
        );
        let affine = |n: usize| mapped(one("AffineTransform", &"1 ".repeat(n), "0 0 0"), Given::default());
        assert!(affine(MOST_NUMBERS).unwrap_err().contains("with 64 parameters"));
        assert!(affine(MOST_NUMBERS + 1).unwrap_err().contains("the parameters \"1 1 "));
    }

    #[test]
    fn what_is_written_is_what_itk_writes() {
        let text = text(rows([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, -2.5], [0.0, 0.0, 1.0, 1e-7]]));
        assert_eq!(text, one("AffineTransform", "0 -1 0 1 0 0 0 0 1 0 2.5 0.0000001", "0 0 0"));
    }

    #[test]
    fn several_nested_flat_and_unknown_transforms_are_refused() {
        let listed = COMPOSITE.replace("#Transform 0\nTransform: CompositeTransform_double_3_3\n", "");
        let affine = "1 0 0 0 1 0 0 0 1 0 0 0";
        for (text, expected) in [
            (listed, "2 transforms that are not composed"),
            (
                COMPOSITE.replace("Euler3DTransform", "CompositeTransform"),
                "a CompositeTransform inside of another",
            ),
            (COMPOSITE.replace("AffineTransform", "BSplineTransform"), "(BSpline)"),
            (
                format!("{}Transform: CompositeTransform_double_3_3\n", &COMPOSITE[..29]),
                "CompositeTransform of nothing",
            ),
            (one("AffineTransform", affine, "0 0").replace("3_3", "2_2"), "\"AffineTransform_double_2_2\""),
            (
                one("ScaleVersor3DTransform", "0 0 0 0 0 0 1 1 1", "0 0 0"),
                "\"ScaleVersor3DTransform_double_3_3\"",
            ),
            (one("AffineTransform", &affine[2..], "0 0 0"), "with 11 parameters and 3 fixed ones"),
            (one("AffineTransform", affine, "0 0 0 0"), "with 12 parameters and 4 fixed ones"),
            (one("AffineTransform", "1 x", "0 0 0"), "the parameters \"1 x\""),
            (one("VersorTransform", "1 1 1", "0 0 0"), "a versor of length 1.7"),
            (
                one("AffineTransform", &affine.replacen('1', "-1", 1), ""),
                "a reflection, which swaps left and right",
            ),
            (one("AffineTransform", &affine.replacen('1', "nan", 1), ""), "not finite"),
            (one("VersorTransform", "0 0 0\nParameters: 0 0 1", ""), "the line \"Parameters: 0 0 1\""),
            ("#Insight Transform File V1.0\nhello\n".into(), "the line \"hello\""),
            ("#Insight Transform File V1.0\n".into(), "no transform"),
        ] {
            let error = mapped(&text, Given::default()).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
