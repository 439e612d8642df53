//! Colours of masks and regions, the same in every view.
//!
//! Up to three masks: [`Palette::Thesis`] gives them red, green and blue and adds them in overlaps
//! (thesis 7.3); [`Palette::ColorBlindSafe`] gives seven colours of Okabe and Ito's set (2008) that
//! mix as paint does (red and yellow make orange). Four or more masks, or masks with custom colours: a
//! region has the mean of its masks' colours in linear light, moved slightly towards white with every
//! further mask, so that agreement is brighter. Views show a legend.
//!
//! [`Coloring::Agreement`] colours a region by the number of masks active in it, from a sequential ramp;
//! masks keep their own colours.

use glioscope_core::optics::srgb;

use super::keywords::keywords;

/// sRGB, 8 bits per channel, gamma-encoded.
pub type Rgb = [u8; 3];

keywords! {
    /// A colour scheme.
    #[derive(Default)]
    pub enum Palette {
        /// Additive red, green and blue.
        #[default]
        Thesis,
        /// Distinguishable with every common colour vision deficiency.
        ColorBlindSafe,
    }
}

keywords! {
    /// What a region's colour shows.
    #[derive(Default)]
    pub enum Coloring {
        /// Which masks are active.
        #[default]
        Masks,
        /// How many masks are active, whichever they are.
        Agreement,
    }
}

/// The ramp's ends in Oklab (lightness, green to red, blue to yellow): a deep blue, legible on dark
/// grey, and a light yellow, legible on near white. Blue to yellow with increasing lightness is
/// distinguishable with every common colour vision deficiency.
const RAMP: [[f64; 3]; 2] = [[0.42, -0.005, -0.145], [0.92, -0.03, 0.15]];

/// Shift of the ramp's middle towards green, away from the greys of tissue outside the lens.
const RAMP_BEND: f64 = -0.075;

const OKABE_ITO_REGIONS: [Rgb; 8] = [
    [0, 0, 0],
    [213, 94, 0],    // A: vermilion
    [0, 114, 178],   // B: blue
    [204, 121, 167], // A+B: reddish purple
    [240, 228, 66],  // C: yellow
    [230, 159, 0],   // A+C: orange
    [0, 158, 115],   // B+C: bluish green
    [255, 255, 255], // all three
];

const MANY_THESIS: [Rgb; 10] = [
    [228, 26, 28],
    [77, 175, 74],
    [55, 126, 220],
    [255, 160, 0],
    [152, 78, 200],
    [0, 190, 190],
    [247, 129, 191],
    [166, 86, 40],
    [190, 200, 30],
    [120, 120, 130],
];

const MANY_SAFE: [Rgb; 8] = [
    [213, 94, 0],
    [0, 114, 178],
    [240, 228, 66],
    [0, 158, 115],
    [86, 180, 233],
    [204, 121, 167],
    [230, 159, 0],
    [120, 120, 130],
];

fn linear(channel: u8) -> f64 {
    srgb::decode(f64::from(channel) / 255.0)
}

fn encoded(linear: f64) -> u8 {
    (srgb::encode(linear) * 255.0).round() as u8
}

/// Colour where `masks` of `of` masks are active: dark blue for one, light yellow for all, in
/// equal steps of Oklab lightness (Ottosson 2020). Levels outside 1 to `of` get the nearest end.
pub fn agreement_color(masks: u32, of: usize) -> Rgb {
    let last = of.max(1) as f64 - 1.0;
    let t = if last > 0.0 { ((f64::from(masks) - 1.0) / last).clamp(0.0, 1.0) } else { 1.0 };
    let [lightness, a, b]: [f64; 3] = std::array::from_fn(|i| RAMP[0][i] + (RAMP[1][i] - RAMP[0][i]) * t);
    let a = a + RAMP_BEND * 4.0 * t * (1.0 - t);
    let l = (lightness + 0.3963377774 * a + 0.2158037573 * b).powi(3);
    let m = (lightness - 0.1055613458 * a - 0.0638541728 * b).powi(3);
    let s = (lightness - 0.0894841775 * a - 1.2914855480 * b).powi(3);
    [
        4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
        -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
    ]
    .map(encoded)
}

/// The colours of one case's masks and regions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskColors {
    palette: Palette,
    coloring: Coloring,
    masks: Vec<Rgb>,
    by_table: bool,
}

impl MaskColors {
    /// Colours for masks in the order of their bits; `custom[k]`, the case's own colour of mask k, takes
    /// precedence.
    pub fn new(palette: Palette, custom: &[Option<Rgb>]) -> Self {
        let by_table = custom.len() <= 3 && custom.iter().all(Option::is_none);
        let masks = custom
            .iter()
            .enumerate()
            .map(|(k, own)| {
                own.unwrap_or_else(|| match (palette, by_table) {
                    (Palette::Thesis, true) => [[255, 0, 0], [0, 255, 0], [0, 0, 255]][k],
                    (Palette::ColorBlindSafe, true) => OKABE_ITO_REGIONS[1 << k],
                    (Palette::Thesis, false) => MANY_THESIS[k % MANY_THESIS.len()],
                    (Palette::ColorBlindSafe, false) => MANY_SAFE[k % MANY_SAFE.len()],
                })
            })
            .collect();
        Self { palette, coloring: Coloring::Masks, masks, by_table }
    }

    /// The same masks' colours, with regions coloured by `coloring`.
    #[must_use]
    pub fn with_coloring(self, coloring: Coloring) -> Self {
        Self { coloring, ..self }
    }

    /// What a region's colour shows.
    pub fn coloring(&self) -> Coloring {
        self.coloring
    }

    /// Number of masks.
    pub fn mask_count(&self) -> usize {
        self.masks.len()
    }

    /// Colour of mask k; grey past the last.
    pub fn mask(&self, k: usize) -> Rgb {
        self.masks.get(k).copied().unwrap_or([128, 128, 128])
    }

    /// Colour of the region where exactly the masks in `bits` are active. Black for none.
    pub fn region(&self, bits: u32) -> Rgb {
        if self.coloring == Coloring::Agreement {
            return if bits == 0 { [0; 3] } else { agreement_color(bits.count_ones(), self.masks.len()) };
        }
        let active: Vec<Rgb> =
            (0..self.masks.len()).filter(|k| bits >> k & 1 == 1).map(|k| self.masks[k]).collect();
        match (self.by_table, self.palette) {
            (true, Palette::ColorBlindSafe) => OKABE_ITO_REGIONS[(bits & 7) as usize],
            (true, Palette::Thesis) => {
                active.iter().fold([0; 3], |sum, c| std::array::from_fn(|i| u8::saturating_add(sum[i], c[i])))
            }
            (false, _) if active.is_empty() => [0; 3],
            (false, _) => {
                let towards_white = (0.12 * (active.len() - 1) as f64).min(0.6);
                std::array::from_fn(|i| {
                    let mean = active.iter().map(|c| linear(c[i])).sum::<f64>() / active.len() as f64;
                    encoded(mean + (1.0 - mean) * towards_white)
                })
            }
        }
    }

    /// The legend's description of the scheme.
    pub fn scheme(&self) -> &'static str {
        if self.coloring == Coloring::Agreement {
            return "How many masks are active, whichever they are.";
        }
        match (self.by_table, self.palette) {
            (true, Palette::Thesis) => "Overlaps add their masks' colours.",
            (true, Palette::ColorBlindSafe) => "Overlaps mix like paint; all masks together are white.",
            (false, _) => "An overlap has the mean colour of its masks, brighter with every further mask.",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn colours_of_three_masks_add_as_in_the_thesis() {
        let c = MaskColors::new(Palette::Thesis, &[None, None, None]);
        assert_eq!(c.region(0b011), [255, 255, 0]);
        assert_eq!(c.region(0b100), [0, 0, 255]);
        assert_eq!(c.region(0b110), [0, 255, 255]);
        assert_eq!(c.region(0b111), [255, 255, 255]);
    }

    #[test]
    fn regions_of_up_to_four_masks_have_distinct_colours() {
        for palette in [Palette::Thesis, Palette::ColorBlindSafe] {
            for masks in 1..=4 {
                let c = MaskColors::new(palette, &vec![None; masks]);
                let all: BTreeSet<Rgb> = (1..1 << masks).map(|bits| c.region(bits)).collect();
                assert_eq!(all.len(), (1 << masks) - 1, "{palette:?} {masks}");
            }
        }
    }

    #[test]
    fn a_custom_colour_takes_precedence() {
        let c = MaskColors::new(Palette::Thesis, &[Some([1, 2, 3]), None]);
        assert_eq!(c.mask(0), [1, 2, 3]);
        assert_eq!(c.region(1), [1, 2, 3]);
    }

    /// CIE 1976 lightness of a colour for a viewer with normal colour vision, and for viewers without one kind of
    /// cone (Machado, Oliveira and Fernandes 2009, severity 1).
    fn lightness_for_each_viewer(rgb: Rgb) -> [f64; 4] {
        let c = rgb.map(linear);
        let lightness_of = |rows: [[f64; 3]; 3]| {
            let [r, g, b] = rows.map(|row| row.iter().zip(c).map(|(m, c)| m * c).sum::<f64>());
            let y = (0.2126 * r + 0.7152 * g + 0.0722 * b).clamp(0.0, 1.0);
            if y > 0.008856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y }
        };
        [
            lightness_of([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            lightness_of([
                [0.152286, 1.052583, -0.204868],
                [0.114503, 0.786281, 0.099216],
                [-0.003882, -0.048116, 1.051998],
            ]),
            lightness_of([
                [0.367322, 0.860646, -0.227968],
                [0.280085, 0.672501, 0.047413],
                [-0.011820, 0.042940, 0.968881],
            ]),
            lightness_of([
                [1.255528, -0.076749, -0.178779],
                [-0.078411, 0.930809, 0.147602],
                [0.004733, 0.691367, 0.303900],
            ]),
        ]
    }

    #[test]
    fn agreement_colours_get_lighter_for_every_viewer() {
        for masks in 2..=9 {
            let colors =
                MaskColors::new(Palette::Thesis, &vec![None; masks]).with_coloring(Coloring::Agreement);
            let ramp: Vec<[f64; 4]> =
                (1..=masks).map(|k| lightness_for_each_viewer(colors.region((1 << k) - 1))).collect();
            for pair in ramp.windows(2) {
                for (less, more) in pair[0].iter().zip(pair[1]) {
                    // 50 units of lightness in equal steps, with a tolerance of a quarter of a step.
                    assert!(more - less > 0.75 * 50.0 / (masks - 1) as f64, "{masks} {pair:?}");
                }
            }
            // Visible on the closeup's dark and light backgrounds, grey 36 and 244.
            let ends = [ramp[0][0], ramp[masks - 1][0]];
            assert!(ends[0] > 14.0 + 12.0 && ends[1] < 96.0 - 3.0, "{ends:?}");
        }
    }

    #[test]
    fn agreement_colours_depend_on_the_count_and_masks_keep_theirs() {
        let own = MaskColors::new(Palette::ColorBlindSafe, &[None; 5]);
        let colors = own.clone().with_coloring(Coloring::Agreement);
        assert_eq!(colors.region(0b00110), colors.region(0b11000));
        assert_ne!(colors.region(0b00110), colors.region(0b00111));
        assert_eq!(colors.region(0b00110), agreement_color(2, 5));
        assert_eq!((0..5).map(|k| colors.mask(k)).collect::<Vec<_>>(), own.masks);
        assert_eq!(agreement_color(1, 1), agreement_color(9, 9));
        assert_eq!(colors.region(0), [0; 3]);
    }

    #[test]
    fn encoding_inverts_decoding() {
        for channel in 0..=255 {
            assert_eq!(encoded(linear(channel)), channel);
        }
    }
}
