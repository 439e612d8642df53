//! Colours of masks and regions, the same in every view.
//!
//! Up to three masks: [`Palette::ColorBlindSafe`] gives their seven regions colours that every two of
//! which differ by at least 20 in ΔE00, for common vision and for each colour vision deficiency, with
//! hues near those of adding red, green and blue; single masks are dark, overlaps light.
//! [`Palette::Thesis`] gives pure red, green and blue, added in overlaps (thesis 7.3), of which the
//! closest two differ by 4 to 9 for readers with a deficiency. Four or more masks, or masks with custom colours: a
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
        /// Distinguishable with every common colour vision deficiency.
        #[default]
        ColorBlindSafe,
        /// Additive red, green and blue.
        Thesis,
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

/// The ramp's ends in Oklab (lightness, green to red, blue to yellow): a violet, legible on dark grey, and a light
/// yellow, legible on near white. Blue would mean interaction, orange and teal growth and shrinkage. Lightness increases
/// in equal steps, so the levels are distinguishable with every common colour vision deficiency.
const RAMP: [[f64; 3]; 2] = [[0.42, 0.08, -0.14], [0.92, -0.01, 0.11]];

/// Shift of the ramp's middle towards pink, away from the greys of tissue outside the lens.
const RAMP_BEND: f64 = 0.075;

/// Found by a search that keeps hues near the additive rule, lightness L* of single masks about 40, of
/// all three above 90. Least ΔE00 of any two: 26.0, and 21.0, 20.8 and 21.6 for protanopes,
/// deuteranopes and tritanopes (Machado, Oliveira and Fernandes 2009, severity 1).
const SAFE_REGIONS: [Rgb; 8] = [
    [0, 0, 0],
    [194, 28, 5],    // A: red
    [10, 116, 100],  // B: teal
    [250, 207, 20],  // A+B: yellow
    [138, 17, 206],  // C: violet
    [250, 97, 163],  // A+C: pink
    [5, 229, 250],   // B+C: cyan
    [238, 250, 230], // all three: nearly white
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

/// The first three as for three masks, the others found by the same search: least ΔE00 of any two of the first eight
/// 23.5, and 19.4, 19.0 and 19.8 with the deficiencies; of all 12.5, 11.2, 10.9 and 10.8.
const MANY_SAFE: [Rgb; 16] = [
    [194, 28, 5],
    [10, 116, 100],
    [138, 17, 206],
    [142, 184, 17],
    [240, 79, 255],
    [102, 240, 246],
    [161, 143, 161],
    [218, 219, 190],
    [56, 173, 131],
    [156, 244, 68],
    [142, 40, 41],
    [105, 88, 133],
    [109, 130, 182],
    [208, 179, 185],
    [188, 109, 80],
    [160, 170, 210],
];

fn linear(channel: u8) -> f64 {
    srgb::decode(f64::from(channel) / 255.0)
}

fn encoded(linear: f64) -> u8 {
    (srgb::encode(linear) * 255.0).round() as u8
}

/// Colour where `masks` of `of` masks are active: violet for one, light yellow for all, in
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

/// The colour of mask `k` of many in the thesis' palette: where its own are used up, the others' last ones.
fn many_thesis(k: usize) -> Rgb {
    let further = &MANY_SAFE[8..];
    let nth = k % (MANY_THESIS.len() + further.len());
    MANY_THESIS.get(nth).copied().unwrap_or_else(|| further[nth - MANY_THESIS.len()])
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
                    (Palette::ColorBlindSafe, true) => SAFE_REGIONS[1 << k],
                    (Palette::Thesis, false) => many_thesis(k),
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
            (true, Palette::ColorBlindSafe) => SAFE_REGIONS[(bits & 7) as usize],
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

    /// Linear sRGB as seen with common vision, and without one kind of cone: protan, deutan, tritan (Machado,
    /// Oliveira and Fernandes 2009, severity 1).
    const VIEWERS: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ];

    fn product(rows: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
        rows.map(|row| row.iter().zip(v).map(|(m, c)| m * c).sum())
    }

    /// CIELAB (D65) of a colour for each viewer.
    fn lab_for_each_viewer(rgb: Rgb) -> [[f64; 3]; 4] {
        const XYZ: [[f64; 3]; 3] = [
            [0.4124564, 0.3575761, 0.1804375],
            [0.2126729, 0.7151522, 0.0721750],
            [0.0193339, 0.1191920, 0.9503041],
        ];
        let f = |t: f64| if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 };
        let white = product(XYZ, [1.0; 3]);
        VIEWERS.map(|viewer| {
            let xyz = product(XYZ, product(viewer, rgb.map(linear)).map(|c| c.clamp(0.0, 1.0)));
            let [x, y, z]: [f64; 3] = std::array::from_fn(|i| f(xyz[i] / white[i]));
            [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
        })
    }

    /// CIE 1976 lightness of a colour for each viewer.
    fn lightness_for_each_viewer(rgb: Rgb) -> [f64; 4] {
        lab_for_each_viewer(rgb).map(|lab| lab[0])
    }

    /// CIEDE2000 (Sharma, Wu and Dalal 2005).
    fn delta_e00([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
        let mean_chroma = (a1.hypot(b1) + a2.hypot(b2)) / 2.0;
        let saturation = |c: f64| (c.powi(7) / (c.powi(7) + 25.0_f64.powi(7))).sqrt();
        let stretch = 1.0 + 0.5 * (1.0 - saturation(mean_chroma));
        let (a1, a2) = (a1 * stretch, a2 * stretch);
        let (c1, c2) = (a1.hypot(b1), a2.hypot(b2));
        let hue = |a: f64, b: f64| b.atan2(a).to_degrees().rem_euclid(360.0);
        let (h1, h2) = (hue(a1, b1), hue(a2, b2));
        let grey = c1 * c2 == 0.0;
        let turn = if grey { 0.0 } else { (h2 - h1 + 180.0).rem_euclid(360.0) - 180.0 };
        let mean_hue = if grey { h1 + h2 } else { (h1 + turn / 2.0).rem_euclid(360.0) };
        let hue_step = 2.0 * (c1 * c2).sqrt() * (turn / 2.0).to_radians().sin();
        let (l, c) = ((l1 + l2) / 2.0, (c1 + c2) / 2.0);
        let cos = |degrees: f64| degrees.to_radians().cos();
        let t =
            1.0 - 0.17 * cos(mean_hue - 30.0) + 0.24 * cos(2.0 * mean_hue) + 0.32 * cos(3.0 * mean_hue + 6.0)
                - 0.20 * cos(4.0 * mean_hue - 63.0);
        let off = (l - 50.0).powi(2);
        let lightness = (l2 - l1) / (1.0 + 0.015 * off / (20.0 + off).sqrt());
        let chroma = (c2 - c1) / (1.0 + 0.045 * c);
        let hue = hue_step / (1.0 + 0.015 * c * t);
        let rotation = -2.0
            * saturation(c)
            * (2.0 * 30.0 * (-((mean_hue - 275.0) / 25.0).powi(2)).exp()).to_radians().sin();
        (lightness * lightness + chroma * chroma + hue * hue + rotation * chroma * hue).sqrt()
    }

    #[test]
    fn colour_differences_are_those_of_sharma_wu_and_dalal() {
        // Table 1 of their paper, pairs 1, 7, 10, 17, 25 and 33.
        for (a, b, expected) in [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, -0.0010, 2.4900], [50.0, 0.0009, -2.4900], 4.8045),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
            ([6.7747, -0.2908, -2.4247], [5.8714, -0.0985, -2.2286], 0.6377),
        ] {
            assert!((delta_e00(a, b) - expected).abs() < 1e-4, "{a:?} {b:?}: {}", delta_e00(a, b));
        }
    }

    #[test]
    fn the_safe_colours_differ_for_every_viewer() {
        let least = |colors: &[Rgb]| {
            let mut least = [f64::INFINITY; 4];
            for (i, a) in colors.iter().enumerate() {
                for b in &colors[..i] {
                    let pair = lab_for_each_viewer(*a).into_iter().zip(lab_for_each_viewer(*b));
                    for (least, (a, b)) in least.iter_mut().zip(pair) {
                        *least = least.min(delta_e00(a, b));
                    }
                }
            }
            least
        };
        let regions = |palette| {
            let colors = MaskColors::new(palette, &[None; 3]);
            (1..8).map(|bits| colors.region(bits)).collect::<Vec<_>>()
        };
        let safe = least(&regions(Palette::ColorBlindSafe));
        assert!(safe[0] > 25.0 && safe.iter().all(|d| *d > 20.0), "{safe:?}");
        let first = least(&MANY_SAFE[..8]);
        assert!(first[0] > 23.0 && first.iter().all(|d| *d > 18.0), "{first:?}");
        let many = least(&MANY_SAFE);
        assert!(many.iter().all(|d| *d > 10.0), "{many:?}");
        // The measure tells a palette that isn't safe.
        assert!(least(&regions(Palette::Thesis))[1] < 5.0);
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

    #[test]
    fn displacement_differs_from_growth_recession_and_the_rest_for_each_viewer() {
        use crate::views::change::ChangeLook;
        let displaced = lab_for_each_viewer(ChangeLook::DISPLACED);
        let pairs = [ChangeLook::THESIS, ChangeLook::COLOR_BLIND_SAFE];
        for other in pairs.into_iter().flatten().chain([ChangeLook::BASE]) {
            for (a, b) in displaced.into_iter().zip(lab_for_each_viewer(other)) {
                assert!(delta_e00(a, b) >= 18.0, "{other:?}: {}", delta_e00(a, b));
            }
        }
    }
}
