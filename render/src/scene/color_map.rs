//! Colours of values: of an image's, of a scalar along fibres.

use super::{Rgb, keywords::keywords};

keywords! {
    /// Colours of values, from the low end of their window to its high end.
    #[derive(Default)]
    pub enum ColorMap {
        /// Black, red, yellow, white.
        #[default]
        Hot,
        /// Black, violet, orange, light yellow: equal steps look equal.
        Inferno,
        /// Violet, green, yellow: equal steps look equal, also for colour-blind viewers.
        Viridis,
        /// Black to white.
        Grey,
        /// White to black, as PET is often read.
        InvertedGrey,
    }
}

impl ColorMap {
    /// Colour at `share` of the window, 0 to 1.
    pub fn color(self, share: f64) -> Rgb {
        let share = share.clamp(0.0, 1.0);
        let byte = |value: f64| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let of = |gradient: colorous::Gradient| {
            let colorous::Color { r, g, b } = gradient.eval_continuous(share);
            [r, g, b]
        };
        match self {
            // Three ramps one after the other, as in MATLAB's `hot`.
            Self::Hot => [share * 8.0 / 3.0, share * 8.0 / 3.0 - 1.0, share * 4.0 - 3.0].map(byte),
            Self::Inferno => of(colorous::INFERNO),
            Self::Viridis => of(colorous::VIRIDIS),
            Self::Grey => [byte(share); 3],
            Self::InvertedGrey => [byte(1.0 - share); 3],
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hot => "hot",
            Self::Inferno => "inferno",
            Self::Viridis => "viridis",
            Self::Grey => "grey",
            Self::InvertedGrey => "grey inverted",
        }
    }

    /// The colours of 256 equal steps.
    pub fn table(self) -> Vec<Rgb> {
        (0..256).map(|n| self.color(f64::from(n) / 255.0)).collect()
    }
}
