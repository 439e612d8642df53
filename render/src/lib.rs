//! From a scene to a frame: the plan of passes, the passes on wgpu, and their CPU twins.
//!
//! Knows no window and no egui. `Gpu` is made once a program, `Renderer` (pipelines) once a device,
//! a scene's buffers once an input, targets once a size.

pub mod accuracy;
mod bricks;
pub mod camera;
pub mod change;
#[cfg(test)]
mod closeup_stability_tests;
#[cfg(test)]
mod closeup_tests;
mod compute;
pub mod cones;
pub mod context;
pub mod dos;
pub mod ellipsoids;
mod force_field;
#[cfg(test)]
mod force_field_tests;
pub mod frame;
pub mod gpu;
pub mod lighting;
pub mod occlusion;
pub mod palette;
pub mod plan;
pub mod quality;
mod raster;
pub mod reference;
mod region_buffers;
pub mod renderer;
pub mod scene;
mod scene_renderer;
pub mod slice_plane;
pub mod slices;
mod targets;
#[cfg(test)]
mod testing;
pub mod transfer;
pub mod tubes;
mod uniforms;

pub use camera::{AnatomicalView, Camera, Projection, Ray};
pub use change::{
    ChangeContext, ChangeFrame, ChangeLook, ChangePick, ChangeRenderer, ChangeScene, ChangeStyle,
    ChangeSurface, change_plan,
};
pub use compute::TimeSource;
pub use context::{
    ClipPlane, ContextFrame, ContextPick, ContextRenderer, ContextScene, ContextVolume, PickedFiber,
    context_plan,
};
pub use ellipsoids::{
    DrawnEllipsoid, EllipsoidFrame, EllipsoidPick, EllipsoidRenderer, EllipsoidScene, ellipsoid_plan,
};
pub use force_field::ForceField;
pub use frame::{Frame, Pick};
pub use gpu::{AdapterPreference, Gpu, GpuError};
pub use lighting::{LightWork, Lighting, Mutual, Shading};
pub use palette::{Coloring, MaskColors, Palette, Rgb, agreement_color};
pub use plan::{PassName, Plan, plan};
pub use quality::{Preset, Quality};
pub use renderer::{RenderError, Renderer};
pub use scene::{Lens, Scene};
pub use scene_renderer::{Picture, SceneRenderer};
pub use slice_plane::SlicePlane;
pub use transfer::{
    ControlPoint, GradientHistogram, GradientPoint, TransferFunction, TransferPreset, ValueHistogram,
};
pub use tubes::{DrawnTubes, TubeSet, tract_color};
