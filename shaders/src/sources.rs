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
    "dos_eye.wgsl",
    "dos_occlusion.wgsl",
    "dos_step.wgsl",
    "lib/decay.wgsl",
    "lib/dos.wgsl",
    "lib/march.wgsl",
    "lib/optics.wgsl",
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
    "cones_trace",
    "dos_eye",
    "dos_occlusion",
    "dos_step",
];
