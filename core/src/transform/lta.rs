//! Linear transform arrays of FreeSurfer: a matrix from the source (moving) to the destination (fixed) volume, of voxel
//! indices or RAS mm, and both volumes' geometry.
//!
//! Sources: `LTAchangeType`, `vg_i_to_r` of FreeSurfer's `utils/transform`; nitransforms (lta). The centre
//! `cras` belongs to index n/2, not (n-1)/2.

use glam::{DAffine3, DMat3, DVec3};

use super::{ImageGeometry, Refusal, inverse, matrix, quoted};

const EXPECTED: &str = "one linear transform of FreeSurfer";

/// A volume's geometry.
#[derive(Clone, Copy, Default)]
struct Volume {
    valid: bool,
    dims: Option<[f64; 3]>,
    spacing_mm: Option<[f64; 3]>,
    /// `xras`, `yras`, `zras`: the axes' directions.
    axes: [Option<[f64; 3]>; 3],
    center_mm: Option<[f64; 3]>,
}

impl Volume {
    fn set(&mut self, key: &str, value: &str) -> Result<(), Refusal> {
        let slot = match key {
            "valid" => {
                self.valid = value == "1";
                return Ok(());
            }
            "volume" => &mut self.dims,
            "voxelsize" => &mut self.spacing_mm,
            "xras" => &mut self.axes[0],
            "yras" => &mut self.axes[1],
            "zras" => &mut self.axes[2],
            "cras" => &mut self.center_mm,
            // The file's name, which may be anything.
            _ => return Ok(()),
        };
        let numbers = matrix::numbers(value);
        *slot =
            Some(numbers.ok_or_else(|| Refusal::new(format!("{key} = {}", quoted(value)), "three numbers"))?);
        Ok(())
    }

    fn world_from_voxel(&self, which: &str) -> Result<DAffine3, Refusal> {
        let given = || {
            let [x, y, z] = self.axes;
            let axes = DMat3::from_cols_array_2d(&[x?, y?, z?]);
            let matrix3 = axes * DMat3::from_diagonal(DVec3::from_array(self.spacing_mm?));
            let center = DVec3::from_array(self.dims?) / 2.0;
            Some(DAffine3 { matrix3, translation: DVec3::from_array(self.center_mm?) - matrix3 * center })
        };
        self.valid.then(given).flatten().ok_or_else(|| {
            let found = format!("a transform between voxels without a valid {which} volume");
            Refusal::new(found, "both volumes' geometry, or the transform in RAS (lta_convert --outlta)")
        })
    }
}

/// Whether a text is an array of transforms: its first lines that are no comments say type and number.
pub(super) fn is_one(text: &str) -> bool {
    let mut keys = lines(text).map(|line| line.split_once('=').map(|(key, _)| key.trim()));
    keys.next() == Some(Some("type")) && keys.next() == Some(Some("nxforms"))
}

/// The matrix, from RAS mm of the fixed volume to RAS mm of the moving one.
pub(super) fn read(text: &str) -> Result<DAffine3, Refusal> {
    let (mut kind, mut count) = (None, None);
    let mut stored = None;
    let mut volumes = [Volume::default(); 2];
    let mut within = None;
    let mut lines = lines(text);
    while let Some(line) = lines.next() {
        match (line, line.split_once('=')) {
            ("src volume info", _) => within = Some(0),
            ("dst volume info", _) => within = Some(1),
            ("1 4 4", _) => {
                let mut row = || lines.next().and_then(matrix::numbers::<4>);
                let rows = (|| Some([row()?, row()?, row()?, row()?]))();
                let rows = rows.ok_or_else(|| Refusal::new("no 4x4 matrix after 1 4 4", EXPECTED))?;
                if stored.replace(matrix::affine(&rows)?).is_some() {
                    return Err(Refusal::new("several transforms", EXPECTED));
                }
            }
            (_, Some((key, value))) => match (key.trim(), value.trim(), within) {
                ("type", value, None) => kind = Some(value),
                ("nxforms", value, None) => count = Some(value),
                (key, value, Some(which)) => volumes[which].set(key, value)?,
                _ => (),
            },
            // Subject, and a scale of brightness.
            _ => (),
        }
    }
    if count != Some("1") {
        let found = format!("{} transforms", count.map_or_else(|| "no number of".into(), quoted));
        return Err(Refusal::new(found, EXPECTED));
    }
    let stored = stored.ok_or_else(|| Refusal::new("no matrix", EXPECTED))?;
    let [source, destination] = volumes;
    Ok(match kind {
        Some("1") => inverse(stored),
        Some("0") => {
            let (moving, fixed) = (source.world_from_voxel("src")?, destination.world_from_voxel("dst")?);
            moving * inverse(stored) * inverse(fixed)
        }
        other => {
            let found = format!("type {}", other.map_or_else(|| "none".into(), quoted));
            return Err(Refusal::new(found, "type 0 (between voxels) or 1 (between RAS)"));
        }
    })
}

/// The text of a matrix from RAS mm of the fixed volume to RAS mm of the moving one: of type 1, with both volumes' geometry.
pub(super) fn text(moving_from_fixed: DAffine3, fixed: &ImageGeometry, moving: &ImageGeometry) -> String {
    format!(
        "type      = 1 # LINEAR_RAS_TO_RAS\nnxforms   = 1\nmean      = 0.0000 0.0000 0.0000\nsigma     = 1.0000\n1 4 4\n\
         {}src volume info\n{}dst volume info\n{}",
        matrix::bare_text(inverse(moving_from_fixed)),
        volume_text(moving),
        volume_text(fixed)
    )
}

fn volume_text(image: &ImageGeometry) -> String {
    let DAffine3 { matrix3, .. } = image.world_from_voxel;
    let axes = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis];
    let directions = axes.map(|axis| axis * axis.length_recip());
    let center =
        image.world_from_voxel.transform_point3(DVec3::from_array(image.dims.map(|n| n as f64 / 2.0)));
    // The sum makes 0 of -0.
    let line = |key: &str, numbers: [f64; 3]| {
        let [x, y, z] = numbers.map(|number| number + 0.0);
        format!("{key} = {x} {y} {z}\n")
    };
    let [nx, ny, nz] = image.dims;
    [
        "valid = 1  # volume info valid\nfilename = none\n".to_owned(),
        format!("volume = {nx} {ny} {nz}\n"),
        line("voxelsize", axes.map(DVec3::length)),
        line("xras  ", directions[0].to_array()),
        line("yras  ", directions[1].to_array()),
        line("zras  ", directions[2].to_array()),
        line("cras  ", center.to_array()),
    ]
    .concat()
}

/// Lines without comments that say something.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    lines.filter(|line| !line.is_empty())
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Given, tests::*};

    /// By surfa 0.6.3 (FreeSurfer's own library): `Affine(inverse of truth, source=moving, target=fixed,
    /// space="world").convert(space="voxel")`, which resamples the moving image as the truth does.
    pub(in super::super) const VOXELS: &str = "\
type      = 0 # LINEAR_VOX_TO_VOX
nxforms   = 1
mean      = 0.0000 0.0000 0.0000
sigma     = 1.0000
1 4 4
-1.237315529601681e+00 1.187559341754913e-02 1.416017922985640e-01 4.607410345306496e+01
3.556928060954822e-02 7.883879775191910e-01 1.327956463845573e-01 2.114890108196921e+00
1.146459588786775e-01 -1.128978701710926e-01 6.506047387458455e-01 5.516849823160097e-01
0.000000000000000e+00 0.000000000000000e+00 0.000000000000000e+00 1.000000000000000e+00
src volume info
valid = 1
filename = none
volume = 44 52 46
voxelsize = 2.500000000000000e+00 2.000000000000000e+00 2.000000000000000e+00
xras   = -9.932136946024794e-01 -9.965377265696572e-02 5.996400961682441e-02
yras   = -1.021395040164776e-01 9.939688752331077e-01 -3.991737450156830e-02
zras   = 5.562444222965997e-02 4.577117720863519e-02 9.974020858026993e-01
cras   = 6.207191646099091e-01 -1.689100079238415e+00 5.102812156081200e+00
dst volume info
valid = 1
filename = none
volume = 48 44 36
voxelsize = 2.000000000000000e+00 2.500000000000000e+00 3.000000000000000e+00
xras   = 9.993501303910128e-01 1.998966745698191e-02 2.999550103639981e-02
yras   = -2.147252339032620e-02 9.985205361295088e-01 4.995667790086183e-02
zras   = -2.895250639784539e-02 -5.056829167173676e-02 9.983008565811635e-01
cras   = 2.243820801377296e-01 -6.852552682161331e+00 8.095648407936096e+00
";

    /// The same with `space="world"`.
    pub(in super::super) const RAS: &str = "\
type      = 1 # LINEAR_RAS_TO_RAS
nxforms   = 1
mean      = 0.0000 0.0000 0.0000
sigma     = 1.0000
1 4 4
9.937606691655043e-01 9.970865087213877e-02 4.997916927067833e-02 -3.626686617782576e+00
-1.034882363630050e-01 9.914231080712159e-01 7.981482141109528e-02 5.963417486823840e+00
-4.159227517465231e-02 -8.448908641752587e-02 9.955559637318877e-01 -5.318345236465984e+00
0.000000000000000e+00 0.000000000000000e+00 0.000000000000000e+00 1.000000000000000e+00
src volume info
valid = 0  # volume info invalid
dst volume info
valid = 0  # volume info invalid
subject bert # 1
fscale 0.100000
";

    #[test]
    fn both_types_of_freesurfers_own_library_agree() {
        // It holds the volumes' geometry in single precision.
        assert!(difference(mapped(VOXELS, Given::default()).unwrap(), truth()) < 5e-7);
        assert!(difference(mapped(RAS, Given::default()).unwrap(), truth()) < 1e-14);
    }

    #[test]
    fn what_is_no_single_transform_between_known_volumes_is_refused() {
        for (text, expected) in [
            (VOXELS.replacen("valid = 1", "valid = 0", 1), "without a valid src volume"),
            (VOXELS.replace("cras ", "cros "), "without a valid src volume"),
            (RAS.replace("type      = 1", "type      = 14"), "found type \"14\""),
            (RAS.replace("nxforms   = 1", "nxforms   = 2"), "found \"2\" transforms"),
            (
                RAS.replace("src volume info", "1 4 4\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\nsrc volume info"),
                "several",
            ),
            (RAS.replace("1 4 4", "1 3 3"), "found no matrix"),
            (RAS.replace("0.000000000000000e+00 1.0", "0.1 1.0"), "a matrix whose last row is 0 0 0.1 1"),
        ] {
            let error = mapped(text, Given::default()).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
