//! Renders a scene to a frame: the plan of passes, and the passes on wgpu.
//!
//! Knows no window and no egui. Modules, each depending only on those before it: [`device`], [`scene`], [`solid`],
//! [`flat`], [`image`], [`light`], [`views`].

pub mod device;
pub mod flat;
pub mod force_field;
pub mod image;
#[cfg(test)]
mod layouts;
pub mod light;
pub mod scene;
pub mod solid;
#[cfg(test)]
mod testing;
pub mod views;

pub use device::{AdapterPreference, Gpu, GpuError, PassName, RenderError, TimeSource};
pub use force_field::ForceField;
pub use image::{
    ClipPlane, ContextVolume, ControlPoint, Form as TransferForm, GradientHistogram, GradientPoint,
    Shape as TransferShape, TransferFunction, TransferPreset, ValueHistogram,
};
pub use scene::{
    ColorMap, Coloring, Knob, KnobRow, Knobs, Lamp, LampFrame, Lens, LightSettings, LightingMode, MaskColors,
    MutualOcclusion, Palette, PathSettings, Plan, Preset, Quality, RegionScene, Rgb, SlicePlane,
    SliceVariant, agreement_color,
};
pub use solid::tubes::{DrawnTubes, TubeLook, TubeSet, TubeShape, TubeValues, tract_color};
pub use views::{
    ChangeRenderer, CloseupRenderer, ContextRenderer, EllipsoidRenderer, Frame, Renderer, View3d,
    change::{ChangeContext, ChangeLook, ChangePick, ChangeScene, ChangeStyle, ChangeSurface, change_plan},
    closeup::{Pick, closeup_plan},
    context::{ContextPick, ContextScene, PickedFiber, context_plan},
    ellipsoids::{DrawnEllipsoid, EllipsoidPick, EllipsoidScene, ellipsoid_plan},
};
