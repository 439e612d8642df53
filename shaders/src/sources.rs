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
    "lib/change.wgsl",
    "lib/change_filter.wgsl",
    "lib/first_hit.wgsl",
    "closeup_compose.wgsl",
    "closeup_occlusion.wgsl",
    "closeup_occlusion_blur.wgsl",
    "closeup_outside.wgsl",
    "closeup_surface.wgsl",
    "ellipsoids_compose.wgsl",
    "ellipsoids_lists.wgsl",
    "ellipsoids_rest.wgsl",
    "lib/ellipsoid.wgsl",
    "force_field.wgsl",
    "context_compose.wgsl",
    "context_march.wgsl",
    "lib/context.wgsl",
    "lib/lines.wgsl",
    "lib/fragment.wgsl",
    "lib/march.wgsl",
    "lib/plane.wgsl",
    "lib/ring.wgsl",
    "lib/view.wgsl",
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
    "ellipsoids_compose",
    "ellipsoids_lists",
    "force_field",
    "context_compose",
    "context_march",
    "ellipsoids_rest",
];
