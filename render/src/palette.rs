//! Which colour a mask and a region have, in every view.
//!
//! Up to three masks: [`Palette::Thesis`] gives them red, green and blue and adds them in overlaps
//! (thesis 7.3); [`Palette::ColorBlindSafe`] gives seven colours of Okabe and Ito's set (2008) that
//! mix as paint does (red and yellow make orange). Four masks and more, or masks with colours of
//! their own: a region has the mean of its masks' colours in linear light, moved a little towards
//! white with every further mask, so that agreement is brighter. A legend stands beside it.

use serde::{Deserialize, Serialize};

/// sRGB, 8 bits a channel, gamma-encoded.
pub type Rgb = [u8; 3];

/// A colour scheme.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Palette {
    /// Additive red, green and blue.
    #[default]
    Thesis,
    /// Told apart with every common colour vision deficiency.
    ColorBlindSafe,
}

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
    let c = f64::from(channel) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

fn encoded(linear: f64) -> u8 {
    let c = linear.clamp(0.0, 1.0);
    let c = if c <= 0.0031308 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (c * 255.0).round() as u8
}

/// The colours of one case's masks and regions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskColors {
    palette: Palette,
    masks: Vec<Rgb>,
    by_table: bool,
}

impl MaskColors {
    /// Colours for masks in the order of their bits; `asked[k]` is the colour that the case asks
    /// for mask k, which wins.
    pub fn new(palette: Palette, asked: &[Option<Rgb>]) -> Self {
        let by_table = asked.len() <= 3 && asked.iter().all(Option::is_none);
        let masks = asked
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
        Self { palette, masks, by_table }
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

    /// What the legend says about the scheme.
    pub fn scheme(&self) -> &'static str {
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
    fn three_masks_add_as_in_the_thesis() {
        let c = MaskColors::new(Palette::Thesis, &[None, None, None]);
        assert_eq!(c.region(0b011), [255, 255, 0]);
        assert_eq!(c.region(0b100), [0, 0, 255]);
        assert_eq!(c.region(0b110), [0, 255, 255]);
        assert_eq!(c.region(0b111), [255, 255, 255]);
    }

    #[test]
    fn no_two_regions_of_three_or_four_masks_look_the_same() {
        for palette in [Palette::Thesis, Palette::ColorBlindSafe] {
            for masks in 1..=4 {
                let c = MaskColors::new(palette, &vec![None; masks]);
                let all: BTreeSet<Rgb> = (1..1 << masks).map(|bits| c.region(bits)).collect();
                assert_eq!(all.len(), (1 << masks) - 1, "{palette:?} {masks}");
            }
        }
    }

    #[test]
    fn the_case_s_own_colour_wins() {
        let c = MaskColors::new(Palette::Thesis, &[Some([1, 2, 3]), None]);
        assert_eq!(c.mask(0), [1, 2, 3]);
        assert_eq!(c.region(1), [1, 2, 3]);
    }

    #[test]
    fn encoding_is_undone_by_decoding() {
        for channel in 0..=255 {
            assert_eq!(encoded(linear(channel)), channel);
        }
    }
}
