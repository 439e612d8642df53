//! Initial transfer functions, fitted to an image's percentiles.

use crate::{
    flat,
    image::transfer::{ControlPoint, Form, GradientPoint, Shape, TransferFunction},
    scene::{Rgb, keywords::keywords},
};

keywords! {
    /// A named transfer function. The kind of image is the user's choice or a guess, never certain.
    pub enum TransferPreset {
        /// MR: the surface of everything but background (skin or brain), opaque.
        MrSurface,
        /// MR: translucent tissue, denser where brighter.
        MrTissue,
        /// MR: only borders between tissues (2-D).
        MrBorders,
        /// CT: skin, opaque.
        CtSkin,
        /// CT: soft tissue translucent, vessels and bone denser.
        CtSoft,
        /// CT: bone.
        CtBone,
        /// PET: hot spots, from red to white, visible through cold tissue.
        PetHot,
        /// PET: the whole body as a faint haze, hot spots dense.
        PetBody,
        /// Contrast-enhanced T1: the borders of what enhances, of ventricles and of skin, by shapes.
        T1cShapes,
        /// FLAIR: the borders of what is bright (oedema), and of the head, by shapes.
        FlairShapes,
        /// CT: bone, its dense middle apart from its surface, by shapes.
        CtBoneShapes,
        /// CT with contrast agent: vessels apart from bone by how steep their borders are, by shapes.
        CtVesselShapes,
        /// PET: cores of hot spots within their translucent borders, by shapes.
        PetShapes,
    }
}

/// Value, colour, opacity of 1 mm.
type Row = (f64, Rgb, f64);

impl TransferPreset {
    /// Menu text.
    pub fn name(self) -> &'static str {
        match self {
            Self::MrSurface => "MR surface",
            Self::MrTissue => "MR tissue",
            Self::MrBorders => "MR borders (2-D)",
            Self::CtSkin => "CT skin",
            Self::CtSoft => "CT soft tissue",
            Self::CtBone => "CT bone",
            Self::PetHot => "PET hot spots",
            Self::PetBody => "PET body",
            Self::T1cShapes => "T1c (2-D shapes)",
            Self::FlairShapes => "FLAIR (2-D shapes)",
            Self::CtBoneShapes => "CT bone (2-D shapes)",
            Self::CtVesselShapes => "CT vessels (2-D shapes)",
            Self::PetShapes => "PET (2-D shapes)",
        }
    }

    /// The initial preset. CT is recognised by its values ([`flat::Histogram::looks_like_ct`]),
    /// PET by the image's name (the words PET, FDG, SUV, PT); anything else counts as MR.
    pub fn first_for(statistics: &flat::Histogram, name: &str) -> Self {
        let named_pet = name
            .split(|c: char| !c.is_ascii_alphabetic())
            .any(|word| ["pet", "fdg", "suv", "pt"].iter().any(|pet| word.eq_ignore_ascii_case(pet)));
        match (named_pet, statistics.looks_like_ct()) {
            (true, _) => Self::PetHot,
            (false, true) => Self::CtSkin,
            (false, false) => Self::MrSurface,
        }
    }

    /// The initial preset of shapes: as [`TransferPreset::first_for`]; MR whose name says FLAIR counts as such, anything
    /// else as contrast-enhanced T1.
    pub fn first_shapes_for(statistics: &flat::Histogram, name: &str) -> Self {
        let name_lower = name.to_ascii_lowercase();
        match Self::first_for(statistics, name) {
            Self::PetHot => Self::PetShapes,
            Self::CtSkin => Self::CtBoneShapes,
            _ if ["fla", "flair"]
                .iter()
                .any(|flair| name_lower.starts_with(flair) || name_lower.ends_with(flair)) =>
            {
                Self::FlairShapes
            }
            _ => Self::T1cShapes,
        }
    }

    /// The function for an image with these statistics. CT presets are in Hounsfield units for any image;
    /// the others follow the percentiles. For an image without a finite value the range is 0 to 1, for a
    /// constant one a range of 1 around its value.
    pub fn transfer(self, statistics: &flat::Histogram) -> TransferFunction {
        let (low, high) = match statistics.p01_p99() {
            Some((low, high)) if high > low => (low, high),
            Some((value, _)) => (value - 0.5, value + 0.5),
            None => (0.0, 1.0),
        };
        let width = high - low;
        if let Some(shapes) = self.shapes(low, width) {
            // Whoever turns shapes off finds points for the same kind of image.
            return TransferFunction { shapes: Some(shapes), ..self.without_shapes().transfer(statistics) };
        }
        // Shares of the range between the percentiles, as values.
        let scaled = |rows: &[Row]| -> Vec<Row> {
            // Background values are below the first row, where opacity is 0: they must stay invisible.
            rows.iter().map(|&(share, color, opacity)| (low + share * width, color, opacity)).collect()
        };
        match self {
            Self::MrSurface => build(
                &scaled(&[
                    (0.02, [96, 74, 66], 0.0),
                    (0.2, [158, 128, 114], 0.5),
                    (0.5, [212, 184, 168], 0.9),
                    (0.8, [250, 238, 226], 0.95),
                    (1.0, [255, 255, 250], 0.98),
                ]),
                None,
            ),
            Self::MrTissue => build(
                &scaled(&[
                    (0.2, [96, 84, 96], 0.0),
                    (0.45, [170, 142, 136], 0.014),
                    (0.65, [226, 196, 172], 0.05),
                    (0.85, [252, 232, 200], 0.3),
                    (1.0, [255, 252, 240], 0.6),
                ]),
                None,
            ),
            Self::MrBorders => build(
                &scaled(&[
                    (0.02, [86, 96, 120], 0.0),
                    (0.3, [150, 150, 160], 0.35),
                    (0.65, [226, 200, 176], 0.6),
                    (1.0, [255, 250, 240], 0.9),
                ]),
                Some([(0.03 * width, 0.0), (0.12 * width, 0.25), (0.3 * width, 1.0)]),
            ),
            Self::CtSkin => build(
                &[
                    (-500.0, [150, 104, 84], 0.0),
                    (-250.0, [222, 176, 148], 0.7),
                    (-90.0, [232, 196, 156], 0.85),
                    (0.0, [206, 142, 118], 0.9),
                    (60.0, [184, 102, 88], 0.9),
                    (180.0, [222, 172, 144], 0.95),
                    (400.0, [250, 244, 230], 0.98),
                ],
                None,
            ),
            Self::CtSoft => build(
                &[
                    (-160.0, [150, 104, 84], 0.0),
                    (-60.0, [208, 168, 110], 0.008),
                    (30.0, [178, 84, 74], 0.05),
                    (110.0, [204, 96, 84], 0.16),
                    (220.0, [240, 214, 184], 0.5),
                    (700.0, [255, 252, 244], 0.98),
                ],
                None,
            ),
            Self::CtBone => build(
                &[
                    (170.0, [156, 110, 86], 0.0),
                    (310.0, [216, 190, 158], 0.45),
                    (600.0, [242, 230, 208], 0.95),
                    (1500.0, [255, 253, 248], 0.99),
                ],
                None,
            ),
            Self::PetHot => build(
                &scaled(&[
                    (0.35, [70, 10, 30], 0.0),
                    (0.6, [190, 30, 20], 0.04),
                    (0.9, [245, 150, 30], 0.25),
                    (1.3, [255, 250, 210], 0.7),
                ]),
                None,
            ),
            Self::PetBody
            | Self::T1cShapes
            | Self::FlairShapes
            | Self::CtBoneShapes
            | Self::CtVesselShapes
            | Self::PetShapes => build(
                &scaled(&[
                    (0.04, [70, 84, 120], 0.0),
                    (0.12, [96, 112, 150], 0.012),
                    (0.5, [130, 90, 140], 0.03),
                    (0.9, [240, 140, 30], 0.25),
                    (1.3, [255, 250, 210], 0.7),
                ]),
                None,
            ),
        }
    }

    /// The preset whose points one with shapes has beside them; other presets themselves.
    fn without_shapes(self) -> Self {
        match self {
            Self::T1cShapes | Self::FlairShapes => Self::MrBorders,
            Self::CtBoneShapes => Self::CtBone,
            Self::CtVesselShapes => Self::CtSoft,
            Self::PetShapes => Self::PetHot,
            other => other,
        }
    }

    /// The shapes of a preset that has some, for an image whose percentiles begin at `low` and are `width` apart.
    /// Gradient magnitudes of MR and PET are shares of that width per millimetre.
    fn shapes(self, low: f64, width: f64) -> Option<Vec<Shape>> {
        let (at, per_mm) = (|share: f64| low + share * width, |share: f64| share * width);
        let same = |hounsfield: f64| hounsfield;
        let (mr, ct): (Units<'_>, Units<'_>) = ((&at, &per_mm), (&same, &same));
        let shapes = match self {
            // What takes up contrast agent and is wide enough to have a middle of small gradients: the tumour, but no
            // vessel. Vessels and borders are faint, the brain's surface fainter.
            Self::T1cShapes => vec![
                trapezoid(mr, [0.0, 0.1], [0.79, 1.11], [0.79, 1.11], 0.3, [225, 70, 45], 0.6),
                trapezoid(mr, [0.09, 0.4], [0.78, 1.26], [0.63, 2.07], 0.4, [245, 190, 110], 0.12),
                blob(mr, (0.12, 0.52), (0.18, 0.16), [120, 145, 190], 0.05),
            ],
            Self::FlairShapes => vec![
                trapezoid(mr, [0.0, 0.105], [0.92, 1.37], [0.92, 1.37], 0.3, [60, 165, 160], 0.4),
                trapezoid(mr, [0.09, 0.35], [0.93, 1.19], [0.85, 1.62], 0.4, [240, 205, 120], 0.05),
                blob(mr, (0.37, 0.36), (0.12, 0.12), [130, 140, 170], 0.05),
            ],
            Self::CtBoneShapes => vec![
                rectangle(ct, [320.0, 3000.0], [0.0, 200.0], 0.3, [255, 246, 226], 0.6),
                trapezoid(ct, [100.0, 600.0], [130.0, 350.0], [200.0, 1800.0], 0.4, [222, 180, 135], 0.3),
            ],
            Self::CtVesselShapes => vec![
                blob(ct, (260.0, 30.0), (45.0, 30.0), [215, 50, 40], 0.5),
                trapezoid(ct, [0.0, 500.0], [450.0, 3000.0], [300.0, 3000.0], 0.2, [250, 240, 220], 0.06),
                blob(ct, (-450.0, 330.0), (150.0, 90.0), [200, 150, 125], 0.03),
            ],
            Self::PetShapes => vec![
                rectangle(mr, [0.95, 6.0], [0.0, 0.4], 0.3, [255, 225, 130], 0.7),
                trapezoid(mr, [0.02, 0.3], [0.45, 0.7], [0.35, 2.5], 0.4, [215, 60, 35], 0.06),
                rectangle(mr, [0.04, 0.35], [0.004, 0.15], 0.6, [95, 115, 160], 0.012),
            ],
            _ => return None,
        };
        Some(shapes)
    }
}

/// From a preset's units to image units, of values and of gradient magnitudes.
type Units<'a> = (&'a dyn Fn(f64) -> f64, &'a dyn Fn(f64) -> f64);

fn rectangle(
    of: Units<'_>,
    values: [f64; 2],
    gradients: [f64; 2],
    soft: f64,
    color: Rgb,
    opacity: f64,
) -> Shape {
    let form = Form::Box { values: values.map(of.0), gradients_per_mm: gradients.map(of.1), soft };
    Shape { form, color, opacity }
}

fn trapezoid(
    of: Units<'_>,
    gradients: [f64; 2],
    lower: [f64; 2],
    upper: [f64; 2],
    soft: f64,
    color: Rgb,
    opacity: f64,
) -> Shape {
    let form = Form::Trapezoid {
        gradients_per_mm: gradients.map(of.1),
        lower_values: lower.map(of.0),
        upper_values: upper.map(of.0),
        soft,
    };
    Shape { form, color, opacity }
}

fn blob(
    of: Units<'_>,
    (value, gradient): (f64, f64),
    (value_deviation, gradient_deviation): (f64, f64),
    color: Rgb,
    opacity: f64,
) -> Shape {
    let form = Form::Blob {
        value: (of.0)(value),
        gradient_per_mm: (of.1)(gradient),
        value_deviation: (of.0)(value_deviation) - (of.0)(0.0),
        gradient_deviation_per_mm: (of.1)(gradient_deviation),
    };
    Shape { form, color, opacity }
}

/// Unchecked: the tables above are in order and in range, which a test verifies for all.
fn build(rows: &[Row], gradient: Option<[(f64, f64); 3]>) -> TransferFunction {
    TransferFunction {
        points: rows.iter().map(|&(value, color, opacity)| ControlPoint { value, color, opacity }).collect(),
        gradient: gradient.map(|g| g.map(|(gradient, factor)| GradientPoint { gradient, factor }).to_vec()),
        shapes: None,
    }
}
