//! Classes of ITK's transforms with parameters: LPS mm, from the fixed to the moving image.
//!
//! Sources: `SetParameters` and `ComputeMatrix` of each class of ITK; what each maps was compared with SimpleITK 2.5.7.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::{Refusal, matrix::from_rows, quoted};

/// How far a versor's length may be above 1 by rounding.
const VERSOR_ROUNDING: f64 = 1e-6;
pub(super) const LINEAR: &str = "a rigid or affine transform in 3D";
/// Known classes. Those of versors with scales or skews are none: what SimpleITK 2.5.7 writes of one it reads back as
/// another transform, 6 mm off.
const CLASSES: [&str; 11] = [
    "AffineTransform",
    "CompositeTransform",
    "Euler3DTransform",
    "IdentityTransform",
    "MatrixOffsetTransformBase",
    "Rigid3DTransform",
    "ScaleTransform",
    "Similarity3DTransform",
    "TranslationTransform",
    "VersorRigid3DTransform",
    "VersorTransform",
];

/// From LPS to RAS.
pub(super) fn ras(lps: DAffine3) -> Result<DAffine3, Refusal> {
    if lps.is_finite() { Ok(flip(lps)) } else { Err(Refusal::new("numbers that are not finite", LINEAR)) }
}

/// Between LPS and RAS, either way.
pub(super) fn flip(affine: DAffine3) -> DAffine3 {
    let signs = DVec3::new(-1.0, -1.0, 1.0);
    let flip = DMat3::from_diagonal(signs);
    DAffine3 { matrix3: flip * affine.matrix3 * flip, translation: signs * affine.translation }
}

/// A class without precision and dimensions, `AffineTransform` of `AffineTransform_double_3_3`; others than [`CLASSES`]
/// are refused by name.
pub(super) fn base(class: &str) -> Result<&str, Refusal> {
    let name = class.split('_').next().unwrap_or_default();
    let is_known = CLASSES.contains(&name) && class.ends_with("_3_3");
    is_known
        .then_some(name)
        .ok_or_else(|| Refusal::new(quoted(class), format!("{LINEAR}, as AffineTransform")))
}

/// What a class with these parameters maps, in LPS mm.
pub(super) fn of_class(class: &str, parameters: &[f64], fixed: &[f64]) -> Result<DAffine3, Refusal> {
    let name = base(class)?;
    if name == "CompositeTransform" {
        return Err(Refusal::new("a CompositeTransform inside of another, or in a .mat", LINEAR));
    }
    let number = || {
        let found =
            format!("{} with {} parameters and {} fixed ones", quoted(class), parameters.len(), fixed.len());
        Refusal::new(found, "as many as the class has")
    };
    let center = match *fixed {
        [] => DVec3::ZERO,
        [x, y, z] => DVec3::new(x, y, z),
        [x, y, z, _] if name == "Euler3DTransform" => DVec3::new(x, y, z),
        _ => return Err(number()),
    };
    let about = |matrix3: DMat3, [x, y, z]: [f64; 3]| {
        Ok(DAffine3 { matrix3, translation: DVec3::new(x, y, z) + center - matrix3 * center })
    };
    match (name, parameters) {
        ("IdentityTransform", _) => Ok(DAffine3::IDENTITY),
        ("TranslationTransform", &[x, y, z]) => Ok(DAffine3::from_translation(DVec3::new(x, y, z))),
        ("ScaleTransform", &[x, y, z]) => about(DMat3::from_diagonal(DVec3::new(x, y, z)), [0.0; 3]),
        (
            "AffineTransform" | "MatrixOffsetTransformBase" | "Rigid3DTransform",
            &[a, b, c, d, e, f, g, h, i, x, y, z],
        ) => about(from_rows([[a, b, c], [d, e, f], [g, h, i]], [0.0; 3]).matrix3, [x, y, z]),
        ("Euler3DTransform", &[ax, ay, az, x, y, z]) => {
            let [rx, ry, rz] =
                [DMat3::from_rotation_x(ax), DMat3::from_rotation_y(ay), DMat3::from_rotation_z(az)];
            // The fourth fixed parameter chooses the order; older versions have three.
            let is_zyx = fixed.get(3).is_some_and(|&order| order != 0.0);
            about(if is_zyx { rz * ry * rx } else { rz * rx * ry }, [x, y, z])
        }
        ("VersorTransform", &[a, b, c]) => about(versor([a, b, c])?, [0.0; 3]),
        ("VersorRigid3DTransform", &[a, b, c, x, y, z]) => about(versor([a, b, c])?, [x, y, z]),
        ("Similarity3DTransform", &[a, b, c, x, y, z, scale]) => about(versor([a, b, c])? * scale, [x, y, z]),
        _ => Err(number()),
    }
}

/// The rotation of a versor's vector part.
fn versor([x, y, z]: [f64; 3]) -> Result<DMat3, Refusal> {
    let squared = x * x + y * y + z * z;
    if squared.is_nan() || squared > 1.0 + VERSOR_ROUNDING {
        return Err(Refusal::new(format!("a versor of length {}", squared.sqrt()), "a length of at most 1"));
    }
    let versor = DQuat::from_xyzw(x, y, z, (1.0 - squared).max(0.0).sqrt());
    Ok(DMat3::from_quat(versor * (1.0 / versor.length())))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Given, tests::*};

    /// A text of one transform as ITK writes it.
    pub(in super::super) fn one(class: &str, parameters: &str, fixed: &str) -> String {
        format!(
            "#Insight Transform File V1.0\n#Transform 0\nTransform: {class}_double_3_3\nParameters: {parameters}\n\
             FixedParameters: {fixed}\n"
        )
    }

    #[test]
    fn every_class_maps_as_simpleitk_maps_it() {
        // SimpleITK 2.5.7: the texts by WriteTransform, the matrices by TransformPoint of the origin and the axes' unit
        // vectors after ReadTransform, from LPS to RAS.
        let versor = "0.0916432938695913 0.1832865877391826 0.2749298816087739";
        let center = "10 -20 30";
        let euler = "0.1 -0.2 0.3 1.5 -2.5 3.5";
        let affine = "1 0.1 0.05 -0.1 0.9 0.02 0.03 -0.04 1.1 1.5 -2.5 3.5";
        let as_affine = [[1.0, 0.1, -0.05, -2.0], [-0.1, 0.9, -0.02, 4.1], [-0.03, 0.04, 1.1, -0.6]];
        for (text, expected) in [
            (one("AffineTransform", affine, center), as_affine),
            (one("MatrixOffsetTransformBase", affine, center), as_affine),
            (one("AffineTransform", affine, center).replace("double", "float"), as_affine),
            (one("AffineTransform", affine, center).replace('\n', "\r\n"), as_affine),
            (
                one("Euler3DTransform", euler, "10 -20 30 0"),
                [
                    [0.9421546635113685, -0.29404383655185584, 0.16088136066569614, -1.0240174538200835],
                    [0.27068148839190354, 0.9505637859220634, 0.15218416716418792, 1.6300141505521237],
                    [-0.1976768116540839, -0.09983341664682843, 0.9751703272018162, 4.264790400341248],
                ],
            ),
            (
                one("Euler3DTransform", euler, center),
                [
                    [0.9421546635113685, -0.29404383655185584, 0.16088136066569614, -1.0240174538200835],
                    [0.27068148839190354, 0.9505637859220634, 0.15218416716418792, 1.6300141505521237],
                    [-0.1976768116540839, -0.09983341664682843, 0.9751703272018162, 4.264790400341248],
                ],
            ),
            (
                one("Euler3DTransform", euler, "10 -20 30 1"),
                [
                    [0.9362933635841992, -0.31299182578546797, 0.15934507930797792, -0.6575822276879855],
                    [0.2896294776255155, 0.9447024859948943, 0.15379199798896437, 1.8884851166883418],
                    [-0.19866933079506133, -0.09784339500725547, 0.9751703272018162, 4.215064776140025],
                ],
            ),
            (
                one("VersorRigid3DTransform", &format!("{versor} 1.5 -2.5 3.5"), center),
                [
                    [0.7816391739070241, -0.48292928421421166, -0.39473979817379856, 17.817171368568488],
                    [0.5501172307043589, 0.8320301337746336, 0.0713924994178754, 9.218794649014615],
                    [0.29395787843858123, -0.2729563388883136, 0.9160150668873168, 14.418253555532576],
                ],
            ),
            (
                one("Similarity3DTransform", &format!("{versor} 1.5 -2.5 3.5 1.1"), center),
                [
                    [0.8598030912977279, -0.5312222126356332, -0.4342137779911788, 20.74888850542534],
                    [0.6051289537747939, 0.9152331471520982, 0.07853174935966312, 7.890674113916076],
                    [0.3233536662824381, -0.3002519727771453, 1.0076165735760494, 12.510078911085824],
                ],
            ),
            (
                one("VersorTransform", "0.1 0.2 0.3", center),
                [
                    [0.7399999999999984, -0.5164171097297405, -0.4309447398198287, 20.656684389189692],
                    [0.5964171097297424, 0.7999999999999998, 0.06547236990991401, 8.000000000000002],
                    [0.31094473981982773, -0.3054723699099142, 0.9000000000000004, 12.218894796396569],
                ],
            ),
            (
                one("ScaleTransform", "1.1 0.9 1.2", center),
                [[1.1, 0.0, 0.0, 1.0], [0.0, 0.9, 0.0, 2.0], [0.0, 0.0, 1.2, -6.0]],
            ),
            (
                one("TranslationTransform", "1 2 3", ""),
                [[1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 0.0, -2.0], [0.0, 0.0, 1.0, 3.0]],
            ),
            (
                one("IdentityTransform", "", ""),
                [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            ),
        ] {
            let read = mapped(&text, Given::default()).unwrap();
            assert!(difference(read, rows(expected)) < 1e-13, "{text}{read:?}");
        }
    }

    #[test]
    fn versors_too_long_by_rounding_alone_are_rotations() {
        let versor = |x: f64| mapped(one("VersorTransform", &format!("{x} 0 0"), "0 0 0"), Given::default());
        let half_turn = rows([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]]);
        assert!(difference(versor(1.000_000_1).unwrap(), half_turn) < 1e-12);
        assert!(versor(1.00001).unwrap_err().contains("a versor of length"));
    }
}
