//! The size of exported pictures.

use serde::{Deserialize, Serialize};

/// Largest width of a picture.
pub const MAX_WIDTH_PX: u32 = 16_384;

/// The size of an exported picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PictureSize {
    /// This many times the pixels on the screen, along each side.
    Times(u32),
    /// This width in pixels; the height follows.
    WidthPx(u32),
}

impl Default for PictureSize {
    fn default() -> Self {
        Self::Times(1)
    }
}

impl PictureSize {
    /// The factors offered.
    pub const FACTORS: [u32; 3] = [1, 2, 4];

    /// Whether a picture has the pixels of the screen, so that it can be taken from there.
    pub fn is_of_screen(self) -> bool {
        self == Self::Times(1)
    }

    /// Pixels per logical point of a picture of something `width_points` wide on a screen of `pixels_per_point`.
    pub fn pixels_per_point(self, width_points: f32, pixels_per_point: f32) -> f32 {
        match self {
            Self::Times(factor) => pixels_per_point * factor as f32,
            Self::WidthPx(pixels) => pixels.clamp(16, MAX_WIDTH_PX) as f32 / width_points.max(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_multiply_the_screen_and_widths_are_met() {
        assert_eq!(PictureSize::Times(4).pixels_per_point(300.0, 1.5), 6.0);
        let scale = PictureSize::WidthPx(1200).pixels_per_point(300.0, 1.5);
        assert_eq!(300.0 * scale, 1200.0);
        assert!(PictureSize::default().is_of_screen() && !PictureSize::Times(2).is_of_screen());
    }
}
