//! What a window or a file writer needs to know of a renderer, whichever view it draws.

use crate::{
    change::{ChangeFrame, ChangeRenderer, ChangeScene},
    compute::TimeSource,
    context::{ContextFrame, ContextRenderer, ContextScene},
    ellipsoids::{EllipsoidFrame, EllipsoidRenderer, EllipsoidScene},
    frame::Frame,
    gpu::Gpu,
    plan::{PassName, Plan},
    quality::Quality,
    renderer::{RenderError, Renderer},
    scene::Scene,
};

/// A finished picture of any 3D view.
pub trait Picture {
    /// rgba8unorm, gamma-encoded sRGB, opaque.
    fn color(&self) -> &wgpu::Texture;
    /// Pixels drawn, and pixels asked for.
    fn sizes_px(&self) -> [[u32; 2]; 2];
    /// What ran, and what was left out.
    fn plan(&self) -> &Plan;
}

/// Draws one kind of scene.
pub trait SceneRenderer: Sized {
    /// What it draws. Comparing two costs nothing a voxel.
    type Scene: Clone + PartialEq;
    /// What it makes of it.
    type Frame: Picture;

    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError`] when the driver refuses a shader.
    fn start(gpu: &Gpu) -> Result<Self, RenderError>;

    /// Draws `scene`.
    ///
    /// # Errors
    /// [`RenderError`]; there is no frame then.
    fn draw(
        &mut self,
        gpu: &Gpu,
        scene: &Self::Scene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&Self::Frame, RenderError>;

    /// The last frame.
    fn last(&self) -> Option<&Self::Frame>;

    /// Milliseconds of each of its passes, and what measured them.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    fn times(&self, gpu: &Gpu) -> Result<(Vec<(PassName, f64)>, TimeSource), RenderError>;
}

macro_rules! renderers {
    ($($renderer:ty: $scene:ty => $frame:ty),* $(,)?) => {$(
        impl Picture for $frame {
            fn color(&self) -> &wgpu::Texture {
                &self.color
            }

            fn sizes_px(&self) -> [[u32; 2]; 2] {
                [self.size_px, self.asked_px]
            }

            fn plan(&self) -> &Plan {
                &self.plan
            }
        }

        impl SceneRenderer for $renderer {
            type Scene = $scene;
            type Frame = $frame;

            fn start(gpu: &Gpu) -> Result<Self, RenderError> {
                Self::new(gpu)
            }

            fn draw(
                &mut self,
                gpu: &Gpu,
                scene: &$scene,
                quality: &Quality,
                size_px: [u32; 2],
            ) -> Result<&$frame, RenderError> {
                self.render(gpu, scene, quality, size_px)
            }

            fn last(&self) -> Option<&$frame> {
                self.frame()
            }

            fn times(&self, gpu: &Gpu) -> Result<(Vec<(PassName, f64)>, TimeSource), RenderError> {
                Ok((self.pass_times(gpu)?, self.time_source()))
            }
        }
    )*};
}

renderers! {
    Renderer: Scene => Frame,
    ContextRenderer: ContextScene => ContextFrame,
    ChangeRenderer: ChangeScene => ChangeFrame,
    EllipsoidRenderer: EllipsoidScene => EllipsoidFrame,
}
