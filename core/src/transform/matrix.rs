//! Bare 4x4 matrices in text, and what they may mean.

use glam::{DAffine3, DMat3, DVec3};

use super::{Refusal, inverse};

/// How far the last row may be from 0 0 0 1: FreeSurfer multiplies in single precision.
const LAST_ROW: f64 = 1e-6;

/// What a bare 4x4 matrix maps to what; it doesn't say so itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// RAS mm of the fixed image to RAS mm of the moving one, as resampling needs it.
    RasMovingFromFixed,
    /// RAS mm of the moving image to RAS mm of the fixed one, as it carries points.
    RasFixedFromMoving,
    /// greedy (`-a -o`) and Convert3D (`c3d_affine_tool -o`): RAS mm, fixed to moving.
    Greedy,
    /// NiftyReg (`reg_aladin -aff`): RAS mm, reference to floating.
    NiftyReg,
}

impl Convention {
    /// Every convention.
    pub const ALL: [Self; 4] =
        [Self::RasMovingFromFixed, Self::RasFixedFromMoving, Self::Greedy, Self::NiftyReg];

    /// Its word on the command line and in manifests.
    pub fn word(self) -> &'static str {
        match self {
            Self::RasMovingFromFixed => "ras-moving-from-fixed",
            Self::RasFixedFromMoving => "ras-fixed-from-moving",
            Self::Greedy => "greedy",
            Self::NiftyReg => "niftyreg",
        }
    }

    /// That of a word.
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|known| known.word() == word)
    }

    fn is_fixed_from_moving(self) -> bool {
        self == Self::RasFixedFromMoving
    }
}

/// Whether a text is four rows of four numbers and nothing else.
pub(super) fn is_one(text: &str) -> bool {
    rows(text).is_some()
}

/// The matrix, from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn read(text: &str, convention: Option<Convention>) -> Result<DAffine3, Refusal> {
    let convention = convention.ok_or_else(without_convention)?;
    let stored = bare(text)?;
    Ok(if convention.is_fixed_from_moving() { inverse(stored) } else { stored })
}

/// The refusal of a bare matrix that may mean anything.
pub(super) fn without_convention() -> Refusal {
    let words = Convention::ALL.map(Convention::word).join(", ");
    Refusal::new("a bare 4x4 matrix", format!("what it means with it: {words}, or flirt with both images"))
}

/// The text of a matrix from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn text(moving_from_fixed: DAffine3, convention: Convention) -> String {
    let stored =
        if convention.is_fixed_from_moving() { inverse(moving_from_fixed) } else { moving_from_fixed };
    bare_text(stored)
}

/// The text of a matrix as it is.
pub(super) fn bare_text(stored: DAffine3) -> String {
    let (m, t) = (stored.matrix3.transpose().to_cols_array_2d(), stored.translation);
    // The sum makes 0 of -0.
    let row = |[a, b, c]: [f64; 3], t: f64| format!("{} {} {} {}\n", a + 0.0, b + 0.0, c + 0.0, t + 0.0);
    format!("{}{}{}0 0 0 1\n", row(m[0], t.x), row(m[1], t.y), row(m[2], t.z))
}

/// The matrix of a text that is nothing else, as stored.
pub(super) fn bare(text: &str) -> Result<DAffine3, Refusal> {
    let rows = rows(text).ok_or_else(|| Refusal::new("no 4x4 matrix", "four rows of four numbers"))?;
    affine(&rows)
}

/// Lines that begin with `#` are comments.
fn rows(text: &str) -> Option<[[f64; 4]; 4]> {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let rows: Vec<[f64; 4]> = lines.take(5).map(numbers).collect::<Option<_>>()?;
    rows.try_into().ok()
}

/// The numbers of a line that has exactly as many.
pub(super) fn numbers<const N: usize>(line: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> =
        line.split_whitespace().take(N + 1).map(|word| word.parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

/// A matrix by its rows, whose last must be 0 0 0 1.
pub(super) fn affine(rows: &[[f64; 4]; 4]) -> Result<DAffine3, Refusal> {
    let last = rows[3].iter().zip([0.0, 0.0, 0.0, 1.0]);
    if !last.into_iter().all(|(found, expected)| (found - expected).abs() <= LAST_ROW) {
        let [a, b, c, d] = rows[3];
        return Err(Refusal::new(format!("a matrix whose last row is {a} {b} {c} {d}"), "0 0 0 1"));
    }
    Ok(from_rows([0, 1, 2].map(|i| [rows[i][0], rows[i][1], rows[i][2]]), [0, 1, 2].map(|i| rows[i][3])))
}

/// A matrix by its rows, and a translation.
pub(super) fn from_rows(rows: [[f64; 3]; 3], translation: [f64; 3]) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_cols_array_2d(&rows).transpose(),
        translation: DVec3::from_array(translation),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Convention, Given, Transform, tests::*};

    /// By reg_aladin 1.5.68 (`-ref fixed -flo moving -rigOnly -aff`), which found the truth of smooth blobs but for
    /// 0.2 mm.
    pub(in super::super) const REG_ALADIN: &str = "\
0.9957156 -0.08623312 -0.03338054 3.836349
0.08374432 0.9940332 -0.06989219 -6.137359
0.03920841 0.06679731 0.9969959 4.994127
0 0 0 1
";

    /// By greedy 1.4.0.3 (`-a -dof 6 -i fixed moving -o`) of the same images, within 0.7 mm.
    const GREEDY: &str = "\
0.993889 -0.099991 -0.0467641 3.70797 
0.0955314 0.991399 -0.0894556 -5.35716 
0.0553066 0.0844414 0.994892 4.59024 
0 0 0 1
";

    #[test]
    fn matrices_of_niftyreg_and_greedy_map_the_fixed_image_to_the_moving_one() {
        let read = |text: &str, convention| {
            mapped(text, Given { convention: Some(convention), ..Given::default() }).unwrap()
        };
        assert!(difference(read(REG_ALADIN, Convention::NiftyReg), truth()) < 0.2);
        assert!(difference(read(GREEDY, Convention::Greedy), truth()) < 0.7);
        let inverse = Transform::new(truth()).unwrap().fixed_from_moving();
        assert!(difference(read(GREEDY, Convention::RasFixedFromMoving), inverse) < 0.7);
        assert!(difference(inverse, truth()) > 10.0);
    }

    #[test]
    fn a_bare_matrix_needs_its_convention() {
        let error = mapped(REG_ALADIN, Given::default()).unwrap_err();
        assert!(error.contains("found a bare 4x4 matrix, expected what it means with it: ras-"), "{error}");
        let given = Given { convention: Some(Convention::NiftyReg), ..Given::default() };
        let shifted = REG_ALADIN.replace("0 0 0 1", "0 0 0 2");
        assert!(mapped(shifted, given).unwrap_err().contains("whose last row is 0 0 0 2, expected 0 0 0 1"));
        assert!(mapped(REG_ALADIN.replace('-', ""), given).is_ok(), "any other number passes");
        assert!(mapped(format!("# a comment\n\n{REG_ALADIN}"), given).is_ok());
        assert!(mapped(format!("{REG_ALADIN}0 0 0 1\n"), given).is_err());
    }
}
