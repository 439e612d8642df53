//! Textures in memory, sampled as egui's renderer samples them.

use egui::{
    ImageData,
    epaint::{
        ImageDelta,
        textures::{TextureFilter, TextureOptions, TextureWrapMode},
    },
};

/// Red, green, blue and alpha, premultiplied, as on the screen.
pub type Pixel = [u8; 4];

/// A texture's pixels and how they are sampled.
#[derive(Clone, Debug)]
pub struct Texture {
    size: [usize; 2],
    pixels: Vec<Pixel>,
    linear: bool,
    wrap: TextureWrapMode,
    /// Counts changes of the content.
    pub version: u64,
}

impl Texture {
    /// A texture of `size` pixels, row by row, interpolated linearly; `None` if the number of pixels is another.
    pub fn from_rgba(size: [usize; 2], rgba: &[u8], version: u64) -> Option<Self> {
        let pixels: Vec<Pixel> = rgba.as_chunks().0.to_vec();
        let whole = size[0] > 0 && size[1] > 0 && pixels.len() == size[0] * size[1];
        whole.then_some(Self { size, pixels, linear: true, wrap: TextureWrapMode::ClampToEdge, version })
    }

    /// The texture after egui's change to it (`before`: what it was); `None` if the change doesn't fit.
    pub fn changed(before: Option<Self>, delta: &ImageDelta) -> Option<Self> {
        let ImageData::Color(image) = &delta.image;
        let [width, height] = image.size;
        let pixels = image.as_raw().as_chunks::<4>().0;
        let version = before.as_ref().map_or(0, |texture| texture.version + 1);
        let TextureOptions { magnification, wrap_mode, .. } = delta.options;
        let (linear, wrap) = (magnification == TextureFilter::Linear, wrap_mode);
        let Some([left, top]) = delta.pos else {
            let whole = width > 0 && height > 0 && image.pixels.len() == width * height;
            return whole.then(|| Self { size: image.size, pixels: pixels.to_vec(), linear, wrap, version });
        };
        let mut texture = before?;
        if left + width > texture.size[0] || top + height > texture.size[1] || width == 0 {
            return None;
        }
        let rows = texture.pixels.chunks_exact_mut(texture.size[0]).skip(top);
        for (row, new) in rows.zip(pixels.chunks_exact(width)).take(height) {
            row[left..left + width].copy_from_slice(new);
        }
        Some(Self { linear, wrap, version, ..texture })
    }

    /// Width and height in pixels, both at least 1.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Whether pixels between texels are interpolated.
    pub fn is_linear(&self) -> bool {
        self.linear
    }

    fn wrapped(&self, index: i32, axis: usize) -> usize {
        let size = i32::try_from(self.size[axis]).unwrap_or(i32::MAX);
        let index = match self.wrap {
            TextureWrapMode::ClampToEdge => index.clamp(0, size - 1),
            TextureWrapMode::Repeat => index.rem_euclid(size),
            TextureWrapMode::MirroredRepeat => {
                let phase = index.rem_euclid(size.saturating_mul(2));
                phase.min(2 * size - 1 - phase)
            }
        };
        index as usize
    }

    /// The texel at a column and row.
    pub fn texel(&self, x: i32, y: i32) -> Pixel {
        self.pixels[self.wrapped(y, 1) * self.size[0] + self.wrapped(x, 0)]
    }

    /// So many texels of a row from a column and row on; `None` where they reach beyond the texture.
    pub fn row(&self, [x, y]: [i32; 2], count: usize) -> Option<&[Pixel]> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        let end = x.checked_add(count).filter(|end| *end <= self.size[0])?;
        self.pixels.get(y * self.size[0] + x..y * self.size[0] + end)
    }

    /// The texture at a position in texels: texel (0, 0) reaches from 0 to 1.
    pub fn sample(&self, x: f32, y: f32) -> Pixel {
        if !self.linear {
            return self.texel(x.floor() as i32, y.floor() as i32);
        }
        let (x, y) = ((x - 0.5) * 256.0, (y - 0.5) * 256.0);
        let (x, y) = (x.round() as i32, y.round() as i32);
        let (right, low) = ((x & 255) as u32, (y & 255) as u32);
        let (x, y) = (x >> 8, y >> 8);
        let [x0, x1] = [x, x + 1].map(|x| self.wrapped(x, 0));
        let [y0, y1] = [y, y + 1].map(|y| self.wrapped(y, 1) * self.size[0]);
        let texels = [y0 + x0, y0 + x1, y1 + x0, y1 + x1].map(|index| self.pixels[index]);
        if texels[0] == texels[1] && texels[0] == texels[2] && texels[0] == texels[3] {
            return texels[0];
        }
        let weights = [(256 - right) * (256 - low), right * (256 - low), (256 - right) * low, right * low];
        std::array::from_fn(|channel| {
            let sum: u32 = (0..4).map(|i| u32::from(texels[i][channel]) * weights[i]).sum();
            ((sum + 32_768) >> 16) as u8
        })
    }
}
