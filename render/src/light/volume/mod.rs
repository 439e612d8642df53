//! Light kept in cells of the context image, which its ray march looks up: what modes share that fill such cells.
//!
//! Lifetimes: the cells (8 bytes each, 16 where light has colours) once per image and cell size; the uniform once per frame.

#[cfg(test)]
mod face_tests;

use glioscope_core::Grid;

use super::{
    cones::{GRID_BINDINGS, grid::Cells, uniforms::LightGrid},
    lit::{LitImage, LitMarch, LitScene},
};
use crate::device::{Gpu, RenderError, buffers::WRITTEN};

const TINT_BINDING: u32 = 39;

struct Held {
    grid: Grid,
    cells: Cells,
    /// For each cell what the image lets through, and what both the image and opaque geometry do.
    light: wgpu::Buffer,
    /// Light of a colour, as lib/light_tints has it, which the ray march then looks up instead.
    tints: Option<wgpu::Buffer>,
}

/// The cells on the device.
pub(crate) struct CellLight {
    uniform: wgpu::Buffer,
    held: Option<Held>,
}

impl CellLight {
    pub fn new(gpu: &Gpu) -> Self {
        Self { uniform: gpu.uniform::<LightGrid>("CellLight::uniform"), held: None }
    }

    /// Frees the cells.
    pub fn release(&mut self) {
        self.held = None;
    }

    /// Room for these cells of an image; `tinted`: whether light has a colour.
    ///
    /// # Errors
    /// [`RenderError`]: they don't fit.
    pub fn reserve(
        &mut self,
        gpu: &Gpu,
        image: &LitImage<'_>,
        cells: Cells,
        tinted: bool,
    ) -> Result<&Cells, RenderError> {
        let grid = &image.buffers.shape().grid;
        let known = self
            .held
            .take()
            .filter(|held| held.grid == *grid && held.cells == cells && held.tints.is_some() == tinted);
        let held = match known {
            Some(held) => held,
            None => {
                let bytes = 8 * cells.count() as u64;
                gpu.check_size("cells of light", bytes)?;
                let light = gpu.buffer("CellLight::light", bytes, WRITTEN);
                let tints = tinted.then(|| gpu.buffer("CellLight::tints", bytes, WRITTEN));
                Held { grid: grid.clone(), cells, light, tints }
            }
        };
        Ok(&self.held.insert(held).cells)
    }

    /// Fills the uniform for a frame in which `needed` cells are computed.
    pub fn write(&self, gpu: &Gpu, scene: &LitScene<'_>, image: &LitImage<'_>, needed: u32) {
        let Some(held) = &self.held else { return };
        let uniform = LightGrid {
            needed,
            strength: scene.quality.strength(),
            ..LightGrid::of(&image.buffers.shape().grid, &held.cells, scene.camera, scene.reference_mm)
        };
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
    }

    /// The cells of the last frame, if it has any.
    pub fn cells(&self) -> Option<&Cells> {
        self.held.as_ref().map(|held| &held.cells)
    }

    /// The uniform, of no use without cells.
    pub fn uniform(&self) -> &wgpu::Buffer {
        &self.uniform
    }

    /// The light of the cells, and their uniform, at the binding numbers of lib/light_grid.
    pub fn entries(&self) -> Option<[(u32, wgpu::BindingResource<'_>); 2]> {
        let [light, uniform] = self.buffers()?;
        let [to_light, to_uniform] = GRID_BINDINGS;
        Some([(to_light, light.as_entire_binding()), (to_uniform, uniform.as_entire_binding())])
    }

    /// The cells' light of a colour, if it has one, at the binding number of lib/light_tints.
    pub fn tint_entry(&self) -> Option<(u32, wgpu::BindingResource<'_>)> {
        self.tints().map(|tints| (TINT_BINDING, tints.as_entire_binding()))
    }

    /// The same.
    pub fn tints(&self) -> Option<&wgpu::Buffer> {
        self.held.as_ref()?.tints.as_ref()
    }

    /// The ray march that looks them up.
    pub fn lit_march(&self) -> Option<LitMarch<'_>> {
        let [light, uniform] = self.entries()?;
        Some(match self.tint_entry() {
            Some(tints) => LitMarch { shader: "volume/march", entries: vec![uniform, tints] },
            None => LitMarch { shader: "cones/march", entries: vec![light, uniform] },
        })
    }

    /// The light of the cells, and their uniform.
    pub fn buffers(&self) -> Option<[&wgpu::Buffer; 2]> {
        self.held.as_ref().map(|held| [&held.light, &self.uniform])
    }
}
