//! MATLAB 4 files of ITK, as ANTs writes them: column vectors, one named after the class, then one named `fixed`.
//!
//! Sources: ITK's `itkMatlabTransformIO` and vnl's `vnl_matlab_header`: the type is 1000 in big-endian order, plus 100 by
//! rows, plus 10 in single precision.

use glam::DAffine3;

use super::{
    Refusal,
    itk::{self, WRITTEN},
    itk_class, quoted,
};

/// Bytes of a vector's header: type, rows, columns, whether complex, length of the name with its 0.
const HEADER: usize = 20;
/// The longest name, with its 0.
const LONGEST_NAME: usize = 128;
/// The most numbers of a vector: transforms that are linear have at most 15.
const MOST: usize = 64;
const EXPECTED: &str = "a linear transform of ITK in MATLAB 4";

struct Vector<'a> {
    name: &'a str,
    numbers: Vec<f64>,
}

/// Whether the bytes begin with a vector's header and a name.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    header(bytes).is_some_and(|header| header.name_of(bytes).is_some())
}

/// Whether the bytes may begin with a vector, of any length, whose name begins like this.
pub(super) fn name_begins(bytes: &[u8], start: &str) -> bool {
    bytes.get(HEADER..).is_some_and(|name| name.starts_with(start.as_bytes()))
}

/// The matrix, from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn read(bytes: &[u8]) -> Result<DAffine3, Refusal> {
    let (transform, rest) = vector(bytes)?;
    let (fixed, rest) = if rest.is_empty() { (Vec::new(), rest) } else { fixed(rest)? };
    if !rest.is_empty() {
        return Err(Refusal::new("more than one transform", EXPECTED));
    }
    itk_class::ras(itk_class::of_class(transform.name, &transform.numbers, &fixed)?)
}

/// The file of a matrix from RAS mm of the fixed image to RAS mm of the moving one, in double precision and little-endian.
pub(super) fn bytes(moving_from_fixed: DAffine3) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut add = |name: &str, numbers: &[f64]| {
        let sizes = [numbers.len(), 1, 0, name.len() + 1];
        bytes.extend_from_slice(&0_u32.to_le_bytes());
        bytes.extend(sizes.iter().flat_map(|&size| (size as u32).to_le_bytes()));
        bytes.extend_from_slice(name.as_bytes());
        bytes.push(0);
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    };
    add(WRITTEN, &itk::parameters(moving_from_fixed));
    add("fixed", &[0.0; 3]);
    bytes
}

fn fixed(bytes: &[u8]) -> Result<(Vec<f64>, &[u8]), Refusal> {
    let (vector, rest) = vector(bytes)?;
    if vector.name != "fixed" {
        return Err(Refusal::new(
            format!("{} after the transform", quoted(vector.name)),
            "its centre, fixed",
        ));
    }
    Ok((vector.numbers, rest))
}

struct Header {
    is_big: bool,
    is_single: bool,
    count: usize,
    name_bytes: usize,
}

impl Header {
    fn name_of<'a>(&self, bytes: &'a [u8]) -> Option<&'a str> {
        let name = bytes.get(HEADER..HEADER + self.name_bytes)?.strip_suffix(b"\0")?;
        let is_word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
        std::str::from_utf8(name).ok().filter(|name| !name.is_empty() && name.as_bytes().iter().all(is_word))
    }
}

/// A header in either byte order, of real numbers of which there are not too many.
fn header(bytes: &[u8]) -> Option<Header> {
    let (fields, _) = bytes.get(..HEADER)?.as_chunks::<4>();
    for is_big in [false, true] {
        let field =
            |at: usize| if is_big { u32::from_be_bytes(fields[at]) } else { u32::from_le_bytes(fields[at]) };
        let (kind, rows, columns, complex, name_bytes) = (field(0), field(1), field(2), field(3), field(4));
        let Some(kind) = kind.checked_sub(u32::from(is_big) * 1000) else { continue };
        // A vector is the same by rows (100) and by columns.
        let is_vector = rows.min(columns) <= 1 && rows.max(columns) as usize <= MOST;
        let is_named = (2..=LONGEST_NAME).contains(&(name_bytes as usize));
        if matches!(kind, 0 | 10 | 100 | 110) && is_vector && complex == 0 && is_named {
            let count = (rows * columns) as usize;
            let is_single = kind % 100 == 10;
            return Some(Header { is_big, is_single, count, name_bytes: name_bytes as usize });
        }
    }
    None
}

/// The first vector, and the bytes that follow it.
fn vector(bytes: &[u8]) -> Result<(Vector<'_>, &[u8]), Refusal> {
    let wrong = |found: &str| Refusal::new(found, EXPECTED);
    let header = header(bytes).ok_or_else(|| wrong("no vector of numbers"))?;
    let name = header.name_of(bytes).ok_or_else(|| wrong("a vector without a name"))?;
    let start = HEADER + header.name_bytes;
    let width = if header.is_single { 4 } else { 8 };
    let end = start + header.count * width;
    let stored = bytes.get(start..end).ok_or_else(|| wrong("a file that ends too early"))?;
    let numbers = stored.chunks_exact(width).map(|chunk| number(chunk, header.is_big)).collect();
    Ok((Vector { name, numbers }, &bytes[end..]))
}

/// A number of 4 or 8 bytes.
fn number(bytes: &[u8], is_big: bool) -> f64 {
    let mut little = [0; 8];
    let little = &mut little[..bytes.len()];
    little.copy_from_slice(bytes);
    if is_big {
        little.reverse();
    }
    match *little {
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Given, tests::*};

    /// By ANTsPy 0.6.3, `registration(fixed, moving, "Rigid")["fwdtransforms"]`: 0GenericAffine.mat.
    pub(in super::super) const ANTS: &str = "0a0000000c00000001000000000000001a000000416666696e655472616e73666f726d5f666c6f61745f335f3300d5667e3f\
     989bd4bd696e273d1189cd3d38e77d3f05cfa13dc9a747bd956598bd30fc7e3fa50e8ac0b4a0d34050e78f400a0000000300\
     0000010000000000000006000000666978656400b7e78c406e655a409ce81740";

    /// By SimpleITK 2.5.7: the affine transform of `itk_class.rs`.
    pub(in super::super) const SIMPLE_ITK: &str = "000000000c00000001000000000000001b000000416666696e655472616e73666f726d5f646f75626c655f335f3300000000\
     000000f03f9a9999999999b93f9a9999999999a93f9a9999999999b9bfcdccccccccccec3f7b14ae47e17a943fb81e85eb51\
     b89e3f7b14ae47e17aa4bf9a9999999999f13f000000000000f83f00000000000004c00000000000000c4000000000030000\
     00010000000000000006000000666978656400000000000000244000000000000034c00000000000003e40";

    /// The same file of a machine of the other byte order. SciPy 1.17.1 (`loadmat`) reads the same numbers of both.
    fn swapped(mut bytes: Vec<u8>, width: usize) -> Vec<u8> {
        let mut at = 0;
        while at < bytes.len() {
            let field = |i: usize| u32::from_le_bytes(bytes[at + 4 * i..at + 4 * i + 4].try_into().unwrap());
            let (kind, numbers, name) = (field(0), (field(1) * field(2)) as usize, field(4) as usize);
            bytes[at..at + 4].copy_from_slice(&(kind + 1000).to_le_bytes());
            bytes[at..at + 20].chunks_exact_mut(4).for_each(<[u8]>::reverse);
            let start = at + 20 + name;
            at = start + numbers * width;
            bytes[start..at].chunks_exact_mut(width).for_each(<[u8]>::reverse);
        }
        bytes
    }

    #[test]
    fn files_of_ants_and_simpleitk_in_both_byte_orders() {
        // ANTsPy's apply_ants_transform_to_point of the origin and the axes' unit vectors, from LPS to RAS.
        let ants = rows([
            [0.9937565326690674, -0.10381221771240234, -0.04087686538696289, 4.029566287994385],
            [0.10035896301269531, 0.9918093681335449, -0.07900810241699219, -6.011876106262207],
            [0.04874420166015625, 0.07441234588623047, 0.9960355758666992, 4.974958419799805],
        ]);
        let simple_itk = rows([[1.0, 0.1, -0.05, -2.0], [-0.1, 0.9, -0.02, 4.1], [-0.03, 0.04, 1.1, -0.6]]);
        for (digits, width, expected, most) in [(ANTS, 4, ants, 1e-6), (SIMPLE_ITK, 8, simple_itk, 1e-13)] {
            for bytes in [hex(digits), swapped(hex(digits), width)] {
                let read = mapped(bytes, Given::default()).unwrap();
                assert!(difference(read, expected) < most, "{read:?}");
            }
        }
        assert!(difference(ants, truth()) < 0.05, "registered from the fixed to the moving image");
    }

    #[test]
    fn cut_files_and_further_transforms_are_refused() {
        let bytes = hex(SIMPLE_ITK);
        let error = |bytes: &[u8]| mapped(bytes, Given::default()).unwrap_err();
        assert!(error(&bytes[..bytes.len() - 1]).contains("ends too early"));
        assert!(error(&[bytes.clone(), bytes.clone()].concat()).contains("more than one transform"));
        let second = 20 + 27 + 12 * 8;
        assert!(
            error(&[&bytes[..second], &bytes[..]].concat())
                .contains("after the transform, expected its centre")
        );
        // Without a centre it would be another transform, but about the origin it is one.
        assert!(mapped(&bytes[..second], Given::default()).is_ok());
    }
}
