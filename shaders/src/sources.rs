//! Every WGSL file, in the program itself.

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../wgsl/", $name)))),*]
    };
}

/// Path below `wgsl/` and text of every file.
pub(crate) const FILES: &[(&str, &str)] = files![
    "change_arrows.wgsl",
    "change_compose.wgsl",
    "change_filter_across.wgsl",
    "change_filter_down.wgsl",
    "change_heights.wgsl",
    "change_surface.wgsl",
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
    "force_field.wgsl",
    "lib/change.wgsl",
    "lib/change_filter.wgsl",
    "lib/context.wgsl",
    "lib/decay.wgsl",
    "lib/dos.wgsl",
    "lib/ellipsoid.wgsl",
    "lib/first_hit.wgsl",
    "lib/fragment.wgsl",
    "lib/lines.wgsl",
    "lib/march.wgsl",
    "lib/optics.wgsl",
    "lib/plane.wgsl",
    "lib/ring.wgsl",
    "lib/tube_lines.wgsl",
    "lib/tubes.wgsl",
    "lib/view.wgsl",
    "tubes.wgsl",
    "tubes_merge.wgsl",
];

/// Names of all entry point files, without `.wgsl`.
pub const ALL: &[&str] = &[
    "change_arrows",
    "change_compose",
    "change_filter_across",
    "change_filter_down",
    "change_heights",
    "change_surface",
    "closeup_compose",
    "closeup_occlusion",
    "closeup_occlusion_blur",
    "closeup_outside",
    "closeup_surface",
    "cones_trace",
    "context_compose",
    "context_march",
    "dos_eye",
    "dos_occlusion",
    "dos_step",
    "ellipsoids_compose",
    "ellipsoids_lists",
    "ellipsoids_rest",
    "force_field",
    "tubes",
    "tubes_merge",
];
