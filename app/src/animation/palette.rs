//! The 256 colours of a GIF, and which of them stands for a pixel.
//!
//! Colours that cover much of a picture, such as its ground, are in the palette as they are. The others are divided into boxes by
//! variance, whose means are improved by Lloyd's iteration. Pixels get the nearest colour, without dithering: at one or two values
//! off there are no bands to hide, and a pattern would crawl.

/// Most colours of a GIF.
const MOST: usize = 256;
/// A colour of more than this share of all pixels is kept as it is.
const FLAT_SHARE: f64 = 0.002;
/// Most colours that are kept as they are.
const MOST_FLAT: usize = 48;
/// Iterations that improve the palette; later ones change little.
const ITERATIONS: usize = 6;
/// Number of colours of 8 bits per channel.
const COLORS: usize = 1 << 24;
/// Marks an entry of [`Palette::nearest`] that is known.
const KNOWN: u16 = 1 << 15;

fn code([r, g, b]: [u8; 3]) -> usize {
    usize::from(r) << 16 | usize::from(g) << 8 | usize::from(b)
}

fn distance2(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

/// How many pixels have each colour.
pub(super) struct Histogram(Vec<u32>);

impl Histogram {
    pub(super) fn new() -> Self {
        Self(vec![0; COLORS])
    }

    /// Counts the pixels of a picture: RGBA.
    pub(super) fn add(&mut self, rgba: &[u8]) {
        for &[r, g, b, _] in rgba.as_chunks::<4>().0 {
            let count = &mut self.0[code([r, g, b])];
            *count = count.saturating_add(1);
        }
    }
}

/// A colour and how much it counts.
#[derive(Clone, Copy)]
struct Weighted {
    rgb: [f64; 3],
    weight: f64,
}

/// Mean of colours; black where they count nothing.
fn mean(of: &[Weighted]) -> [f64; 3] {
    let weight: f64 = of.iter().map(|c| c.weight).sum();
    let sum = |channel: usize| of.iter().map(|c| c.weight * c.rgb[channel]).sum::<f64>();
    if weight > 0.0 { [sum(0), sum(1), sum(2)].map(|sum| sum / weight) } else { [0.0; 3] }
}

/// Colours that one of the palette stands for, until they are divided.
struct Group {
    colors: Vec<Weighted>,
    /// Sum of squared distances from the mean along the channel where it is largest.
    spread: f64,
    channel: usize,
}

impl Group {
    fn new(colors: Vec<Weighted>) -> Self {
        let middle = mean(&colors);
        let spread =
            |c: usize| -> f64 { colors.iter().map(|of| of.weight * (of.rgb[c] - middle[c]).powi(2)).sum() };
        let spreads = [spread(0), spread(1), spread(2)];
        let channel = (0..3).max_by(|&a, &b| spreads[a].total_cmp(&spreads[b])).unwrap_or_default();
        Self { spread: spreads[channel], channel, colors }
    }

    /// Divides it in two where the sum of squared distances from both means is least.
    fn divided(mut self) -> [Self; 2] {
        let channel = self.channel;
        self.colors.sort_by(|a, b| a.rgb[channel].total_cmp(&b.rgb[channel]));
        let total: f64 = self.colors.iter().map(|c| c.weight).sum();
        let sum: f64 = self.colors.iter().map(|c| c.weight * c.rgb[channel]).sum();
        let (mut below, mut sum_below, mut best) = (0.0, 0.0, (f64::NEG_INFINITY, 1));
        for (n, color) in self.colors.iter().enumerate().take(self.colors.len().saturating_sub(1)) {
            below += color.weight;
            sum_below += color.weight * color.rgb[channel];
            let gain = sum_below.powi(2) / below + (sum - sum_below).powi(2) / (total - below);
            if gain > best.0 {
                best = (gain, n + 1);
            }
        }
        let upper = self.colors.split_off(best.1.min(self.colors.len()));
        [Self::new(self.colors), Self::new(upper)]
    }
}

/// The colours that cover much, and the others in cells of 4 x 4 x 4 values.
fn flat_and_others(counts: &[u32]) -> (Vec<[f64; 3]>, Vec<Weighted>) {
    let total: f64 = counts.iter().map(|&n| f64::from(n)).sum();
    let rgb_of = |code: usize| [code >> 16 & 255, code >> 8 & 255, code & 255].map(|v| v as f64);
    let used = || counts.iter().enumerate().filter(|(_, n)| **n > 0);
    if used().count() <= MOST {
        return (used().map(|(code, _)| rgb_of(code)).collect(), Vec::new());
    }
    let mut flat: Vec<(u32, usize)> = used().map(|(code, n)| (*n, code)).collect();
    flat.retain(|(n, _)| f64::from(*n) >= FLAT_SHARE * total);
    flat.sort_by_key(|&(n, code)| (std::cmp::Reverse(n), code));
    flat.truncate(MOST_FLAT);
    let is_flat = |code: usize| flat.iter().any(|(_, of)| *of == code);
    let mut cells = vec![([0.0; 3], 0.0); COLORS >> 6];
    for (code, &n) in used().filter(|(code, _)| !is_flat(*code)) {
        let cell = (code >> 18 & 63) << 12 | (code >> 10 & 63) << 6 | (code >> 2 & 63);
        let (sum, pixels) = &mut cells[cell];
        let n = f64::from(n);
        *pixels += n;
        for (sum, value) in sum.iter_mut().zip(rgb_of(code)) {
            *sum += n * value;
        }
    }
    // Less than by their pixels: what covers little, such as a word or a swatch, has its colour too.
    let others = cells.into_iter().filter(|(_, pixels)| *pixels > 0.0).map(|(sum, pixels)| Weighted {
        rgb: sum.map(|sum| sum / pixels),
        weight: pixels.sqrt() * pixels.sqrt().sqrt(),
    });
    (flat.into_iter().map(|(_, code)| rgb_of(code)).collect(), others.collect())
}

/// Index of the nearest colour; 0 where there is none.
fn nearest(colors: &[[f64; 3]], to: [f64; 3]) -> usize {
    let all = colors.iter().enumerate();
    let least = all.min_by(|(_, a), (_, b)| distance2(**a, to).total_cmp(&distance2(**b, to)));
    least.map_or(0, |(n, _)| n)
}

/// The colours of an animation.
pub(super) struct Palette {
    colors: Vec<[u8; 3]>,
    points: Vec<[f64; 3]>,
    /// By colour, once it was asked for: [`KNOWN`] and the index of the nearest colour of the palette.
    nearest: Vec<u16>,
}

impl Palette {
    /// The palette for pictures with this histogram: exact where they have no more than 256 colours.
    pub(super) fn of(histogram: &Histogram) -> Self {
        let (flat, others) = flat_and_others(&histogram.0);
        let mut groups = Vec::new();
        if !others.is_empty() {
            groups.push(Group::new(others.clone()));
        }
        while flat.len() + groups.len() < MOST {
            let widest = groups.iter().enumerate().filter(|(_, group)| group.spread > 0.0);
            let Some((n, _)) = widest.max_by(|(_, a), (_, b)| a.spread.total_cmp(&b.spread)) else { break };
            let widest = groups.swap_remove(n);
            groups.extend(widest.divided());
        }
        let mut points = flat.clone();
        points.extend(groups.iter().map(|group| mean(&group.colors)));
        for _ in 0..ITERATIONS {
            let mut of_each: Vec<Vec<Weighted>> = vec![Vec::new(); points.len()];
            for color in &others {
                of_each[nearest(&points, color.rgb)].push(*color);
            }
            for (point, of) in points.iter_mut().zip(&of_each).skip(flat.len()) {
                if !of.is_empty() {
                    *point = mean(of);
                }
            }
        }
        // From 0 to 255 by construction.
        let mut colors: Vec<[u8; 3]> =
            points.iter().map(|point| point.map(|value| value.round() as u8)).collect();
        colors.sort_unstable();
        colors.dedup();
        let points = colors.iter().map(|color| color.map(f64::from)).collect();
        Self { colors, points, nearest: vec![0; COLORS] }
    }

    /// Its colours: R, G, B of each in turn.
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.colors.as_flattened().to_vec()
    }

    /// The colour of the palette for each pixel of a picture, RGBA.
    pub(super) fn indices(&mut self, rgba: &[u8]) -> Vec<u8> {
        let index = |&[r, g, b, _]: &[u8; 4]| {
            let entry = &mut self.nearest[code([r, g, b])];
            if *entry == 0 {
                // There are at most 256 colours.
                *entry = KNOWN | nearest(&self.points, [r, g, b].map(f64::from)) as u16;
            }
            (*entry & 255) as u8
        };
        rgba.as_chunks::<4>().0.iter().map(index).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(colors: &[[u8; 3]]) -> Vec<u8> {
        colors.iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect()
    }

    fn palette_of(rgba: &[u8]) -> Palette {
        let mut histogram = Histogram::new();
        histogram.add(rgba);
        Palette::of(&histogram)
    }

    /// A ground of one colour, and a smooth field of many beside it.
    fn ground_and_field() -> Vec<[u8; 3]> {
        let field = (0..128_u8).flat_map(|y| (0..128_u8).map(move |x| [60 + x, 200 - y, 40 + (x + y) / 2]));
        std::iter::repeat_n([244, 244, 242], 128 * 128).chain(field).collect()
    }

    #[test]
    fn few_colours_are_kept_as_they_are() {
        let colors: Vec<[u8; 3]> = (0..=255_u8).map(|v| [v, 255 - v, v / 2]).collect();
        let rgba = picture(&colors);
        let mut palette = palette_of(&rgba);
        let shown: Vec<[u8; 3]> =
            palette.indices(&rgba).iter().map(|&n| palette.colors[usize::from(n)]).collect();
        assert_eq!(shown, colors);
    }

    #[test]
    fn the_ground_is_exact_and_the_rest_near() {
        let colors = ground_and_field();
        let rgba = picture(&colors);
        let mut palette = palette_of(&rgba);
        assert!(palette.colors.len() <= 256 && palette.colors.len() > 200);
        let shown: Vec<[u8; 3]> =
            palette.indices(&rgba).iter().map(|&n| palette.colors[usize::from(n)]).collect();
        let (ground, field) = shown.split_at(128 * 128);
        assert!(ground.iter().all(|color| *color == [244, 244, 242]), "a flat colour");
        // 16,384 colours in three channels by some 250: cells of some 8 x 8 values.
        let mut worst = 0;
        for (shown, wanted) in field.iter().zip(&colors[128 * 128..]) {
            worst = (0..3).map(|c| shown[c].abs_diff(wanted[c])).max().unwrap().max(worst);
        }
        assert!(worst <= 12, "{worst}");
        let sum = |of: &[[u8; 3]]| of.as_flattened().iter().map(|v| f64::from(*v)).sum::<f64>();
        let shift = (sum(field) - sum(&colors[128 * 128..])).abs() / (3.0 * 128.0 * 128.0);
        assert!(shift < 0.5, "{shift}");
    }

    #[test]
    fn nothing_is_no_palette_to_fail_on() {
        let mut palette = palette_of(&[]);
        assert!(palette.bytes().is_empty());
        assert_eq!(palette.indices(&picture(&[[1, 2, 3]])), [0]);
    }
}
