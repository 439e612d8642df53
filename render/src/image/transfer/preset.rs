//! Initial transfer functions, fitted to an image's percentiles.

use crate::{
    flat,
    image::transfer::{ControlPoint, GradientPoint, TransferFunction},
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
            Self::PetBody => build(
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
}

/// Unchecked: the tables above are in order and in range, which a test verifies for all.
fn build(rows: &[Row], gradient: Option<[(f64, f64); 3]>) -> TransferFunction {
    TransferFunction {
        points: rows.iter().map(|&(value, color, opacity)| ControlPoint { value, color, opacity }).collect(),
        gradient: gradient.map(|g| g.map(|(gradient, factor)| GradientPoint { gradient, factor }).to_vec()),
    }
}
