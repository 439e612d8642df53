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

    /// Begins a picture that [`SceneRenderer::go_on`] draws in parts, where this renderer can; the last frame stays
    /// until it is whole. Where it can't, it is drawn at once. Drawing another drops it.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is begun then.
    fn begin(
        &mut self,
        gpu: &Gpu,
        scene: &Self::Scene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<(), RenderError> {
        self.draw(gpu, scene, quality, size_px).map(|_| ())
    }

    /// Goes on for about so many milliseconds. Whether the picture is whole, and the last frame.
    ///
    /// # Errors
    /// [`RenderError::Device`]; what was begun is dropped then.
    fn go_on(&mut self, _gpu: &Gpu, _milliseconds: f64) -> Result<bool, RenderError> {
        Ok(true)
    }

    /// How much of what was begun is done, 0 to 1; `None` where nothing is under way.
    fn share_done(&self) -> Option<f64> {
        None
    }

    /// The last frame.
    fn last(&self) -> Option<&Self::Frame>;

    /// Milliseconds of each of its passes, and what measured them.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    fn times(&self, gpu: &Gpu) -> Result<(Vec<(PassName, f64)>, TimeSource), RenderError>;
}

macro_rules! renderers {
    // As the trait has it.
    (at_once $scene:ty) => {};
    (in_parts $scene:ty) => {
        fn begin(
            &mut self,
            gpu: &Gpu,
            scene: &$scene,
            quality: &Quality,
            size_px: [u32; 2],
        ) -> Result<(), RenderError> {
            self.begin(gpu, scene, quality, size_px)
        }

        fn go_on(&mut self, gpu: &Gpu, milliseconds: f64) -> Result<bool, RenderError> {
            self.go_on(gpu, milliseconds)
        }

        fn share_done(&self) -> Option<f64> {
            self.share_done()
        }
    };
    ($($renderer:ty: $scene:ty => $frame:ty, $way:ident),* $(,)?) => {$(
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

            renderers!($way $scene);

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
    Renderer: Scene => Frame, at_once,
    ContextRenderer: ContextScene => ContextFrame, in_parts,
    ChangeRenderer: ChangeScene => ChangeFrame, in_parts,
    EllipsoidRenderer: EllipsoidScene => EllipsoidFrame, at_once,
}
