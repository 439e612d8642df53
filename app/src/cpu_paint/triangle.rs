//! Filling textured triangles as graphics devices do: pixels whose centres lie inside, on shared edges exactly once.

use super::texture::{Pixel, Texture};

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Position in 1/256 pixels.
    pub at: [i32; 2],
    /// Position in the texture, texels.
    pub texel: [f32; 2],
    /// Colour by which the texture is multiplied.
    pub color: Pixel,
}

/// Subdivisions of a pixel, as a power of two.
const SUBPIXEL_BITS: i32 = 8;
const PIXEL: i64 = 1 << SUBPIXEL_BITS;
/// Positions beyond this are moved to it, 1/256 pixels: a million pixels.
const FARTHEST: f32 = (1 << 28) as f32;

/// A position in pixels as 1/256 pixels.
pub fn fixed(pixels: f32) -> i32 {
    (pixels * PIXEL as f32).round().clamp(-FARTHEST, FARTHEST) as i32
}

/// A rectangle of pixels: left, top, and right and bottom excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// Left and top.
    pub min: [i32; 2],
    /// Right and bottom, excluded.
    pub max: [i32; 2],
}

impl PixelRect {
    /// What lies in both; may be empty.
    pub fn and(self, other: Self) -> Self {
        Self {
            min: [self.min[0].max(other.min[0]), self.min[1].max(other.min[1])],
            max: [self.max[0].min(other.max[0]), self.max[1].min(other.max[1])],
        }
    }

    /// Whether there is no pixel in it.
    pub fn is_empty(self) -> bool {
        self.min[0] >= self.max[0] || self.min[1] >= self.max[1]
    }
}

/// Rows of a picture.
pub struct Rows<'a> {
    /// Pixels, row by row.
    pub pixels: &'a mut [Pixel],
    /// Pixels per row.
    pub width: usize,
    /// The picture's row that `pixels` begin with.
    pub top: i32,
}

/// Product of two colour values as fractions of 255, rounded.
fn times(a: u8, b: u8) -> u8 {
    let x = u32::from(a) * u32::from(b) + 128;
    ((x + (x >> 8)) >> 8) as u8
}

fn multiply(a: Pixel, b: Pixel) -> Pixel {
    std::array::from_fn(|i| times(a[i], b[i]))
}

/// Lays `above` over a pixel.
fn blend(pixel: &mut Pixel, above: Pixel) {
    match above {
        [.., 255] => *pixel = above,
        [0, 0, 0, 0] => {}
        _ => *pixel = std::array::from_fn(|i| above[i].saturating_add(times(pixel[i], 255 - above[3]))),
    }
}

/// Edge function of a triangle's edge on one row: at least 0 inside.
struct Edge {
    dx: i64,
    dy: i64,
    from: [i64; 2],
    /// 0 if points on the edge are inside, 1 if not.
    excluded: i64,
}

impl Edge {
    fn new(a: [i32; 2], b: [i32; 2]) -> Self {
        let (dx, dy) = (i64::from(b[0]) - i64::from(a[0]), i64::from(b[1]) - i64::from(a[1]));
        let top_left = dy < 0 || (dy == 0 && dx > 0);
        Self { dx, dy, from: a.map(i64::from), excluded: i64::from(!top_left) }
    }

    /// Narrows the columns `[first, end)` of row `y` to those inside.
    fn narrow(&self, y: i32, [first, end]: &mut [i32; 2]) {
        let center = PIXEL / 2;
        let row = i64::from(y) * PIXEL + center;
        let at_zero = self.dx * (row - self.from[1]) - self.dy * (center - self.from[0]) - self.excluded;
        let step = -self.dy * PIXEL;
        let to_i32 = |x: i64| x.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
        if step > 0 {
            // at_zero + step * x >= 0
            *first = (*first)
                .max(to_i32((-at_zero).div_euclid(step) + i64::from((-at_zero).rem_euclid(step) != 0)));
        } else if step < 0 {
            *end = (*end).min(to_i32(at_zero.div_euclid(-step) + 1));
        } else if at_zero < 0 {
            *end = *first;
        }
    }
}

/// A value that is linear over a triangle: at the centre of pixel (0, 0), and per column and row.
#[derive(Clone, Copy)]
struct Linear([f64; 3]);

impl Linear {
    fn at(self, x: i32, y: i32) -> f32 {
        let [origin, per_column, per_row] = self.0;
        (origin + per_column * f64::from(x) + per_row * f64::from(y)) as f32
    }
}

/// Fills a triangle within `area`, in either winding.
pub fn fill(rows: &mut Rows<'_>, area: PixelRect, mut corners: [Corner; 3], texture: &Texture) {
    let [a, b, c] = corners.map(|corner| corner.at.map(i64::from));
    let double_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if double_area == 0 {
        return;
    }
    if double_area < 0 {
        corners.swap(1, 2);
    }
    let [a, b, c] = corners.map(|corner| corner.at);
    let edges = [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)];
    let pixel_of = |at: i32| at >> SUBPIXEL_BITS;
    let min = [0, 1].map(|i| pixel_of(a[i].min(b[i]).min(c[i])));
    let max = [0, 1].map(|i| pixel_of(a[i].max(b[i]).max(c[i])).saturating_add(1));
    let last_row = rows.top.saturating_add((rows.pixels.len() / rows.width.max(1)) as i32);
    let here = PixelRect { min: [0, rows.top], max: [rows.width as i32, last_row] };
    let box_px = PixelRect { min, max }.and(area).and(here);
    if box_px.is_empty() {
        return;
    }
    let shade = Shade::of(&corners, texture);
    for y in box_px.min[1]..box_px.max[1] {
        let mut columns = [box_px.min[0], box_px.max[0]];
        edges.iter().for_each(|edge| edge.narrow(y, &mut columns));
        let [first, end] = columns;
        if first < end {
            let row = (y - rows.top) as usize * rows.width;
            let span = &mut rows.pixels[row + first as usize..row + end as usize];
            shade.span(span, first, y);
        }
    }
}

/// How the pixels of a triangle get their colours.
enum Shade<'a> {
    Flat(Pixel),
    /// The texels at a distance of whole pixels, as they are; `texel`: where a span reaches beyond the texture.
    Copied {
        texture: &'a Texture,
        shift: [i32; 2],
        texel: [Linear; 2],
    },
    /// Texels as they are where `as_is`, else sampled at a linear position; times a colour.
    Textured {
        texture: &'a Texture,
        texel: [Linear; 2],
        as_is: bool,
        color: Pixel,
    },
    /// Linear colours, times one texel.
    Gradient {
        color: [Linear; 4],
        texel: Pixel,
    },
    Both {
        texture: &'a Texture,
        texel: [Linear; 2],
        color: [Linear; 4],
    },
}

impl<'a> Shade<'a> {
    fn of(corners: &[Corner; 3], texture: &'a Texture) -> Self {
        let at = corners.map(|corner| corner.at.map(|v| f64::from(v) / PIXEL as f64 - 0.5));
        let [ab, ac] = [1, 2].map(|i| [at[i][0] - at[0][0], at[i][1] - at[0][1]]);
        let area = ab[0] * ac[1] - ab[1] * ac[0];
        let linear = |value: [f64; 3]| {
            let (b, c) = (value[1] - value[0], value[2] - value[0]);
            let per_column = (b * ac[1] - c * ab[1]) / area;
            let per_row = (c * ab[0] - b * ac[0]) / area;
            Linear([value[0] - per_column * at[0][0] - per_row * at[0][1], per_column, per_row])
        };
        let [first, second, third] = corners;
        let flat_color = first.color == second.color && first.color == third.color;
        let flat_texel = first.texel == second.texel && first.texel == third.texel;
        let texel = || [0, 1].map(|i| linear(corners.map(|corner| f64::from(corner.texel[i]))));
        let color = || std::array::from_fn(|i| linear(corners.map(|corner| f64::from(corner.color[i]))));
        match (flat_texel, flat_color) {
            (true, true) => Self::Flat(multiply(first.color, texture.sample(first.texel[0], first.texel[1]))),
            (true, false) => {
                Self::Gradient { color: color(), texel: texture.sample(first.texel[0], first.texel[1]) }
            }
            (false, true) => {
                let texel = texel();
                let is_one_to_one = is_one_to_one(texel);
                if is_one_to_one && first.color == [255; 4] {
                    // Of pixel (0, 0), whose centre lies on that of a texel.
                    let shift = texel.map(|axis| axis.0[0].floor() as i32);
                    return Self::Copied { texture, shift, texel };
                }
                let as_is = !texture.is_linear() || is_one_to_one;
                Self::Textured { texture, texel, as_is, color: first.color }
            }
            (false, false) => Self::Both { texture, texel: texel(), color: color() },
        }
    }

    fn span(&self, span: &mut [Pixel], first: i32, y: i32) {
        let columns = span.iter_mut().zip(first..);
        let mixed =
            |color: &[Linear; 4], x| color.map(|channel| (channel.at(x, y) + 0.5).clamp(0.0, 255.0) as u8);
        match self {
            Self::Flat(color @ [.., 255]) => span.fill(*color),
            Self::Flat(color) => span.iter_mut().for_each(|pixel| blend(pixel, *color)),
            Self::Copied { texture, shift, texel } => {
                match texture.row([first.saturating_add(shift[0]), y.saturating_add(shift[1])], span.len()) {
                    Some(texels) => {
                        span.iter_mut().zip(texels).for_each(|(pixel, &above)| blend(pixel, above));
                    }
                    // Beyond the texture's edge, where it repeats or its edge goes on.
                    None => Self::Textured { texture, texel: *texel, as_is: true, color: [255; 4] }
                        .span(span, first, y),
                }
            }
            Self::Gradient { color, texel } => {
                columns.for_each(|(pixel, x)| blend(pixel, multiply(mixed(color, x), *texel)));
            }
            Self::Textured { texture, texel, as_is, color } => {
                let sample = |x| {
                    let [u, v] = texel.map(|axis| axis.at(x, y));
                    if *as_is {
                        texture.texel(u.floor() as i32, v.floor() as i32)
                    } else {
                        texture.sample(u, v)
                    }
                };
                if *color == [255; 4] {
                    columns.for_each(|(pixel, x)| blend(pixel, sample(x)));
                } else {
                    columns.for_each(|(pixel, x)| blend(pixel, multiply(sample(x), *color)));
                }
            }
            Self::Both { texture, texel, color } => columns.for_each(|(pixel, x)| {
                let [u, v] = texel.map(|axis| axis.at(x, y));
                blend(pixel, multiply(texture.sample(u, v), mixed(color, x)));
            }),
        }
    }
}

/// Whether each pixel's centre is a texel's centre, so that interpolation changes nothing.
fn is_one_to_one([u, v]: [Linear; 2]) -> bool {
    let near = |value: f64, whole: f64| (value - whole).abs() < 1e-5;
    let centered = |origin: f64| (origin.rem_euclid(1.0) - 0.5).abs() < 1.0 / 256.0;
    near(u.0[1], 1.0)
        && near(u.0[2], 0.0)
        && near(v.0[1], 0.0)
        && near(v.0[2], 1.0)
        && centered(u.0[0])
        && centered(v.0[0])
}
