//! Every WGSL file, in the program itself.

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../wgsl/", $name)))),*]
    };
}

/// Path below `wgsl/` and text of every file.
pub(crate) const FILES: &[(&str, &str)] = files![
    "closeup_compose.wgsl",
    "closeup_occlusion.wgsl",
    "closeup_occlusion_blur.wgsl",
    "closeup_outside.wgsl",
    "closeup_surface.wgsl",
    "cones_trace.wgsl",
    "context_compose.wgsl",
    "context_march.wgsl",
    "dos_eye.wgsl",
    "dos_occlusion.wgsl",
    "dos_step.wgsl",
    "ellipsoids_compose.wgsl",
    "ellipsoids_lists.wgsl",
    "ellipsoids_rest.wgsl",
    "lib/context.wgsl",
    "lib/decay.wgsl",
    "lib/dos.wgsl",
    "lib/ellipsoid.wgsl",
    "lib/fragment.wgsl",
    "lib/lines.wgsl",
    "lib/march.wgsl",
    "lib/optics.wgsl",
    "lib/plane.wgsl",
    "lib/ring.wgsl",
    "lib/view.wgsl",
];

/// Names of all entry point files, without `.wgsl`.
pub const ALL: &[&str] = &[
    "closeup_compose",
    "closeup_occlusion",
    "closeup_occlusion_blur",
    "closeup_outside",
    "closeup_surface",
    "ellipsoids_compose",
    "ellipsoids_lists",
    "context_compose",
    "context_march",
    "ellipsoids_rest",
    "cones_trace",
    "dos_eye",
    "dos_occlusion",
    "dos_step",
];
