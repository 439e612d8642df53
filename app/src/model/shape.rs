//! What is measured with a line: its length, two diameters, an angle, a circle.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

/// Part of the long diameter that the one across it gets when it is drawn.
const FIRST_ACROSS: f64 = 0.5;

/// What a drag in a slice measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, VariantArray, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Tool {
    /// A length.
    #[default]
    Line,
    /// A long diameter and one across it.
    Diameters,
    /// An angle.
    Angle,
    /// A circle.
    Circle,
}

impl Tool {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Line => "Line",
            Self::Diameters => "Diameters",
            Self::Angle => "Angle",
            Self::Circle => "Circle",
        }
    }

    /// What it does.
    pub fn detail(self) -> &'static str {
        match self {
            Self::Line => "Length, in the closeup from surface to surface or in a slice",
            Self::Diameters => {
                "In a slice: the long diameter; drag the ends of the one across it, which stays at right angles"
            }
            Self::Angle => "In a slice: one arm up to the vertex; then drag the end of the other",
            Self::Circle => "In a slice: from the centre outwards; mean and spread of the image in it",
        }
    }
}

/// What belongs to a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Nothing.
    #[default]
    Line,
    /// A diameter across it, at right angles, in the plane of both.
    Diameters {
        /// Its ends, world millimetres.
        across_mm: [DVec3; 2],
    },
    /// The angle at the line's end, between its start and a third place.
    Angle {
        /// That place, world millimetres.
        third_mm: DVec3,
    },
    /// A circle about the line's start through its end.
    Circle {
        /// Unit vector across its plane.
        normal: DVec3,
    },
}

impl Shape {
    /// Whether it is a line alone.
    pub fn is_line(&self) -> bool {
        *self == Self::Line
    }

    /// Its tool.
    pub fn tool(&self) -> Tool {
        match self {
            Self::Line => Tool::Line,
            Self::Diameters { .. } => Tool::Diameters,
            Self::Angle { .. } => Tool::Angle,
            Self::Circle { .. } => Tool::Circle,
        }
    }

    /// As `tool` draws it along a line in a plane across the unit vector `normal`.
    pub fn drawn(tool: Tool, [from_mm, to_mm]: [DVec3; 2], normal: DVec3) -> Self {
        let along = to_mm - from_mm;
        let half = normal.cross(along) * FIRST_ACROSS / 2.0;
        let middle = from_mm.midpoint(to_mm);
        match tool {
            Tool::Line => Self::Line,
            Tool::Diameters => Self::Diameters { across_mm: [middle - half, middle + half] },
            // The other arm at right angles, until its end is dragged.
            Tool::Angle => Self::Angle { third_mm: to_mm + normal.cross(along) },
            Tool::Circle => Self::Circle { normal },
        }
    }
}
