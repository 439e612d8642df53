//! Transforms of ITK in HDF5, as of 3D Slicer, ANTs and SimpleITK: `/TransformGroup/0`, `/1` … each with its class, parameters and
//! fixed parameters.
//!
//! Source: ITK's `itkHDF5TransformIO`, which until version 4 misspelt the names of the parameters.

use glam::DAffine3;
use hdf5_pure::{
    CharacterSet, DType, Dataset, Datatype, Error, File, FileBuilder, Group, LibVer, StringPadding,
    VlenStringReadOptions, make_u8_type,
};

use super::{
    Refusal,
    itk::{self, MOST, MOST_NUMBERS, Stored, WRITTEN},
    itk_class::{LINEAR, base},
    quoted,
};

pub(super) const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";
/// The most bytes of a class's name.
const LONGEST_NAME: usize = 128;
const EXPECTED: &str = "a transform of ITK in HDF5, or saved as text (.tfm)";

/// The matrix, from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn read(bytes: &[u8]) -> Result<DAffine3, Refusal> {
    let file = File::from_bytes(bytes.to_vec()).map_err(broken)?;
    let group = file.group("TransformGroup").map_err(|_| wrong("HDF5 without a TransformGroup"))?;
    let count = group.groups().map_err(broken)?.len();
    if count > MOST {
        return Err(Refusal::new(format!("more than {MOST} transforms"), LINEAR));
    }
    let all = (0..count).map(|at| stored(&group, at)).collect::<Result<Vec<_>, _>>()?;
    itk::composed(&all)
}

/// The file of a matrix from RAS mm of the fixed image to RAS mm of the moving one, in double precision.
pub(super) fn bytes(moving_from_fixed: DAffine3) -> Result<Vec<u8>, Refusal> {
    let mut file = FileBuilder::new();
    // As HDF5 1.8 reads it, which older versions of ITK have.
    file.with_libver_bounds(LibVer::Earliest, LibVer::V18);
    let mut all = file.create_group("TransformGroup");
    let mut one = all.create_group("0");
    // ITK reads no other strings than ASCII of variable length; those that the library writes are UTF-8 until they are called ASCII.
    let ascii = Datatype::VariableLength {
        is_string: true,
        padding: Some(StringPadding::NullTerminate),
        charset: Some(CharacterSet::Ascii),
        base_type: Box::new(make_u8_type()),
    };
    one.create_dataset("TransformType").with_vlen_strings(&[WRITTEN]).with_dtype(ascii);
    one.create_dataset("TransformParameters").with_f64_data(&itk::parameters(moving_from_fixed));
    one.create_dataset("TransformFixedParameters").with_f64_data(&[0.0; 3]);
    all.add_group(one.finish());
    file.add_group(all.finish());
    file.finish()
        .map_err(|error| Refusal::new(format!("HDF5 that can't be written: {error}"), "one that can"))
}

fn stored(group: &Group, at: usize) -> Result<Stored, Refusal> {
    let own = group.group(&at.to_string());
    let own = own.map_err(|_| wrong(format!("HDF5 without the transform {at}")))?;
    let class = class(&own.dataset("TransformType").map_err(broken)?)?;
    let is_composite = base(&class)? == "CompositeTransform";
    let named = |right: &str, misspelt: &str| own.dataset(right).or_else(|_| own.dataset(misspelt)).ok();
    // A composite has no parameters of its own; what lacks them is refused by its class.
    let read =
        |found: Option<Dataset>| found.filter(|_| !is_composite).map(|found| numbers(&found)).transpose();
    let parameters = read(named("TransformParameters", "TranformParameters"))?;
    let fixed = read(named("TransformFixedParameters", "TranformFixedParameters"))?;
    Ok(Stored { class, parameters, fixed: fixed.unwrap_or_default() })
}

fn class(found: &Dataset) -> Result<String, Refusal> {
    let options = VlenStringReadOptions::new().with_max_elements(1).with_max_payload_bytes(LONGEST_NAME);
    let names = match found.dtype().map_err(broken)? {
        DType::VariableLengthString => found.read_vlen_strings(options),
        _ if few(found)? <= 1 => found.read_string(),
        _ => return Err(wrong("a transform of several classes")),
    };
    let names = names.map_err(broken)?;
    names.into_iter().next().ok_or_else(|| wrong("a transform without a class"))
}

fn numbers(found: &Dataset) -> Result<Vec<f64>, Refusal> {
    let count = few(found)?;
    if count > MOST_NUMBERS as u64 {
        return Err(Refusal::new(format!("{count} parameters"), LINEAR));
    }
    match found.dtype().map_err(broken)? {
        DType::F64 => found.read_f64().map_err(broken),
        DType::F32 => Ok(found.read_f32().map_err(broken)?.into_iter().map(f64::from).collect()),
        _ => Err(wrong("parameters that are no floating-point numbers")),
    }
}

/// How many elements there are; refused where those that are stored together are many, as what is compressed may unfold to.
fn few(found: &Dataset) -> Result<u64, Refusal> {
    let product = |sizes: Vec<u64>| sizes.into_iter().try_fold(1_u64, u64::checked_mul);
    let count = product(found.shape().map_err(broken)?);
    let chunk = product(found.chunk_shape().map_err(broken)?.unwrap_or_default());
    let most = count.zip(chunk).map_or(u64::MAX, |(count, chunk)| count.max(chunk));
    // Chunks have a size of the writer's choice.
    if most > 1 << 16 {
        return Err(Refusal::new(format!("{most} parameters"), LINEAR));
    }
    Ok(count.unwrap_or(u64::MAX))
}

fn wrong(found: impl Into<String>) -> Refusal {
    Refusal::new(found, EXPECTED)
}

#[allow(clippy::needless_pass_by_value, reason = "as `map_err` passes it")]
fn broken(error: Error) -> Refusal {
    wrong(format!("HDF5 that can't be read: {}", quoted(&error.to_string())))
}

#[cfg(test)]
pub(super) mod tests {
    use super::{
        super::{Given, tests::*},
        FileBuilder,
    };

    /// By SimpleITK 2.5.7: fixtures/write.py.
    pub(in super::super) const COMPOSITE: &[u8] = include_bytes!("fixtures/composite.h5");

    #[test]
    fn files_of_simpleitk_and_itk_map_as_these_map_them() {
        let composite = rows([
            [0.9791066529332628, -0.19399578712730836, 0.12734126102202392, -3.0742555587819336],
            [0.15335140943465753, 0.8869084593179792, 0.10137420783716333, 5.584118672872094],
            [-0.23488187318915799, -0.06297289177807386, 1.0739482857885951, 4.1871905300120655],
        ]);
        let single = rows([
            [1.0, 0.10000002384185791, -0.04999995231628418, -1.5],
            [-0.09999990463256836, 0.8999999761581421, -0.019999980926513672, 2.5],
            [-0.029999971389770508, 0.039999961853027344, 1.0999999046325684, 3.5],
        ]);
        let read = mapped(COMPOSITE, Given::default()).unwrap();
        assert!(difference(read, composite) < 1e-13, "{read:?}");
        // Its points are of single precision.
        let compressed = mapped(include_bytes!("fixtures/compressed.h5"), Given::default()).unwrap();
        assert!(difference(compressed, single) < 1e-6, "{compressed:?}");
    }

    /// A file of one affine transform with these names of the group and of the parameters.
    fn named(group: &str, [parameters, fixed]: [&str; 2]) -> Vec<u8> {
        let mut file = FileBuilder::new();
        let mut all = file.create_group(group);
        let mut one = all.create_group("0");
        one.create_dataset("TransformType").with_vlen_strings(&["AffineTransform_double_3_3"]);
        one.create_dataset(parameters)
            .with_f64_data(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 4.0, -5.0, 6.0]);
        one.create_dataset(fixed).with_f64_data(&[0.0; 3]);
        all.add_group(one.finish());
        file.add_group(all.finish());
        file.finish().unwrap()
    }

    #[test]
    fn names_that_were_misspelt_once_are_read() {
        let moves = rows([[1.0, 0.0, 0.0, -4.0], [0.0, 1.0, 0.0, 5.0], [0.0, 0.0, 1.0, 6.0]]);
        for names in [
            ["TransformParameters", "TransformFixedParameters"],
            ["TranformParameters", "TranformFixedParameters"],
        ] {
            assert_eq!(mapped(named("TransformGroup", names), Given::default()), Ok(moves), "{names:?}");
        }
        let other = named("Group", ["TransformParameters", "TransformFixedParameters"]);
        let error = mapped(other, Given::default()).unwrap_err();
        assert!(error.contains("found HDF5 without a TransformGroup"), "{error}");
        let none = named("TransformGroup", ["Parameters", "FixedParameters"]);
        let error = mapped(none, Given::default()).unwrap_err();
        assert!(error.contains("with 0 parameters and 0 fixed ones"), "{error}");
    }

    #[test]
    fn what_is_no_linear_transform_is_named() {
        let error = |bytes: &[u8]| mapped(bytes, Given::default()).unwrap_err();
        let field = error(include_bytes!("fixtures/field.h5"));
        let expected = "found \"DisplacementFieldTransform_double_3_3\", expected a rigid or affine";
        assert!(field.contains(expected), "{field}");
        let cut = error(&COMPOSITE[..COMPOSITE.len() / 2]);
        assert!(
            cut.contains("found HDF5 that can't be read") && cut.ends_with("saved as text (.tfm)"),
            "{cut}"
        );
    }
}
