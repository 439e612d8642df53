//! A picture that is kept from frame to frame: only tiles whose triangles or textures changed are painted again.

use std::collections::HashMap;

use egui::{ClippedPrimitive, TextureId, epaint::Primitive};
use rayon::prelude::*;

use super::{
    texture::{Pixel, Texture},
    triangle::{self, Corner, PixelRect, Rows},
};

/// Width and height of a tile, pixels: small enough for the first-level cache, large enough that lists are short.
const TILE: [usize; 2] = [64, 32];
/// Behind everything.
const BACKGROUND: Pixel = [0, 0, 0, 255];

/// The textures of a frame.
pub type Textures = HashMap<TextureId, Texture>;

/// Part of a row of tiles that was painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Painted {
    /// Left and top, pixels.
    pub at: [usize; 2],
    /// Width and height, pixels.
    pub size: [usize; 2],
}

/// A triangle in the list of a tile.
#[derive(Clone, Copy)]
struct Entry {
    mesh: u32,
    corners: [u32; 3],
}

/// What lies on a tile.
#[derive(Clone, Default)]
struct Tile {
    /// Of everything that the tile's pixels depend on; `None` before the first frame.
    painted: Option<u64>,
    hash: u64,
    entries: Vec<Entry>,
}

/// The picture.
#[derive(Default)]
pub struct Canvas {
    size: [usize; 2],
    pixels: Vec<Pixel>,
    tiles: Vec<Tile>,
    threads: Threads,
}

/// A mesh in pixels.
struct Mesh<'a> {
    clip: PixelRect,
    texture: &'a Texture,
    corners: Vec<Corner>,
}

/// A number that depends on both, in all bits.
fn mix(a: u64, b: u64) -> u64 {
    let product = u128::from(a ^ 0xa076_1d64_78bd_642f) * u128::from(b ^ 0xe703_7ed1_a0b4_28db);
    (product as u64) ^ ((product >> 64) as u64)
}

fn corner_hash(corner: &Corner) -> u64 {
    let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    let [x, y] = corner.at.map(i32::cast_unsigned);
    let [u, v] = corner.texel.map(f32::to_bits);
    mix(pair(x, y), mix(pair(u, v), u64::from(u32::from_le_bytes(corner.color))))
}

/// The painter's own threads, one per core: those of all other work may be busy for seconds with what a user waits for,
/// and take a frame in only afterwards. `None` where they can't be started: then a frame waits.
struct Threads(Option<rayon::ThreadPool>);

impl Default for Threads {
    fn default() -> Self {
        Self(rayon::ThreadPoolBuilder::new().thread_name(|i| format!("painter {i}")).build().ok())
    }
}

impl Canvas {
    /// Width and height in pixels.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The pixels, row by row from the top.
    pub fn pixels(&self) -> &[Pixel] {
        &self.pixels
    }

    /// Paints a frame of `size` pixels; what was painted, as few rectangles as rows of tiles. Textures that are missing
    /// and paint callbacks are left out.
    pub fn paint(
        &mut self,
        size: [usize; 2],
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
        textures: &Textures,
    ) -> Vec<Painted> {
        let columns = size[0].div_ceil(TILE[0]);
        if self.size != size {
            self.size = size;
            self.pixels = vec![BACKGROUND; size[0] * size[1]];
            self.tiles = vec![Tile::default(); columns * size[1].div_ceil(TILE[1])];
        }
        if self.pixels.is_empty() {
            return Vec::new();
        }
        for tile in &mut self.tiles {
            tile.entries.clear();
            tile.hash = 0;
        }
        let mut meshes = Vec::new();
        for primitive in primitives {
            let Primitive::Mesh(mesh) = &primitive.primitive else { continue };
            let Some(texture) = textures.get(&mesh.texture_id) else { continue };
            let clip = clip_px(primitive.clip_rect, pixels_per_point, size);
            if clip.is_empty() {
                continue;
            }
            let texture_size = texture.size().map(|v| v as f32);
            let corners = mesh.vertices.iter().map(|vertex| Corner {
                at: [vertex.pos.x, vertex.pos.y].map(|v| triangle::fixed(v * pixels_per_point)),
                texel: [vertex.uv.x * texture_size[0], vertex.uv.y * texture_size[1]],
                color: vertex.color.to_array(),
            });
            let prepared = Mesh { clip, texture, corners: corners.collect() };
            self.sort(meshes.len(), &prepared, &mesh.indices, texture_seed(mesh.texture_id, texture));
            meshes.push(prepared);
        }
        let bands = self.pixels.par_chunks_mut(size[0] * TILE[1]).zip(self.tiles.par_chunks_mut(columns));
        let painted = bands.enumerate().filter_map(|(band, (pixels, tiles))| {
            let top = band * TILE[1];
            let mut rows = Rows { pixels, width: size[0], top: top as i32 };
            let [first, end] = paint_band(&mut rows, tiles, &meshes)?;
            let left = first * TILE[0];
            let height = rows.pixels.len() / size[0];
            Some(Painted { at: [left, top], size: [(end * TILE[0]).min(size[0]) - left, height] })
        });
        match &self.threads.0 {
            Some(own) => own.install(|| painted.collect()),
            None => painted.collect(),
        }
    }

    /// Enters the triangles of a mesh in the lists of the tiles they touch.
    fn sort(&mut self, number: usize, mesh: &Mesh<'_>, indices: &[u32], texture_seed: u64) {
        let columns = self.size[0].div_ceil(TILE[0]);
        let [left, top] = mesh.clip.min.map(i64::from);
        let [right, bottom] = mesh.clip.max.map(i64::from);
        let seed = mix(
            mix((left << 32 | top).cast_unsigned(), (right << 32 | bottom).cast_unsigned()),
            texture_seed,
        );
        let hashes: Vec<u64> = mesh.corners.iter().map(corner_hash).collect();
        for &corners in indices.as_chunks::<3>().0 {
            let [Some(a), Some(b), Some(c)] = corners.map(|i| mesh.corners.get(i as usize)) else { continue };
            if [a, b, c].iter().all(|corner| corner.color == [0; 4]) {
                continue;
            }
            let [a_px, b_px, c_px] = [a, b, c].map(|corner| corner.at.map(|v| v >> 8));
            let bounds = PixelRect {
                min: [0, 1].map(|i| a_px[i].min(b_px[i]).min(c_px[i])),
                max: [0, 1].map(|i| a_px[i].max(b_px[i]).max(c_px[i]) + 1),
            }
            .and(mesh.clip);
            if bounds.is_empty() {
                continue;
            }
            let [a, b, c] = corners.map(|i| hashes[i as usize]);
            let hash = mix(seed, mix(a, mix(b, c)));
            let entry = Entry { mesh: number as u32, corners };
            // The clip lies on the canvas, so the bounds do.
            let [first, last] = [bounds.min, bounds.max.map(|v| v - 1)]
                .map(|[x, y]| [x as usize / TILE[0], y as usize / TILE[1]]);
            for row in first[1]..=last[1] {
                for tile in &mut self.tiles[row * columns..][first[0]..=last[0]] {
                    tile.hash = mix(tile.hash, hash);
                    tile.entries.push(entry);
                }
            }
        }
    }
}

fn texture_seed(id: TextureId, texture: &Texture) -> u64 {
    let (TextureId::Managed(number) | TextureId::User(number)) = id;
    mix(mix(number, u64::from(matches!(id, TextureId::User(_)))), texture.version)
}

/// A clip rectangle in pixels, rounded as egui's renderer rounds it, within the canvas.
fn clip_px(rect: egui::Rect, pixels_per_point: f32, size: [usize; 2]) -> PixelRect {
    let pixel = |v: f32, axis: usize| ((v * pixels_per_point).round() as i32).clamp(0, size[axis] as i32);
    PixelRect {
        min: [pixel(rect.min.x, 0), pixel(rect.min.y, 1)],
        max: [pixel(rect.max.x, 0), pixel(rect.max.y, 1)],
    }
}

/// Paints the changed tiles of a row of tiles; the columns of tiles from the first to behind the last of them.
fn paint_band(rows: &mut Rows<'_>, tiles: &mut [Tile], meshes: &[Mesh<'_>]) -> Option<[usize; 2]> {
    let mut painted: Option<[usize; 2]> = None;
    let height = rows.pixels.len() / rows.width;
    for (column, tile) in tiles.iter_mut().enumerate() {
        if tile.painted.replace(tile.hash) == Some(tile.hash) {
            continue;
        }
        let (left, right) = (column * TILE[0], ((column + 1) * TILE[0]).min(rows.width));
        rows.pixels.chunks_exact_mut(rows.width).for_each(|row| row[left..right].fill(BACKGROUND));
        let area = PixelRect { min: [left as i32, rows.top], max: [right as i32, rows.top + height as i32] };
        for entry in &tile.entries {
            let mesh = &meshes[entry.mesh as usize];
            let corners = entry.corners.map(|i| mesh.corners[i as usize]);
            triangle::fill(rows, area.and(mesh.clip), corners, mesh.texture);
        }
        painted = Some([painted.map_or(column, |[first, _]| first), column + 1]);
    }
    painted
}
