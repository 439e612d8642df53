// What the march leaves for a pixel of the context view.

struct Marched {
    red_green: u32,      // premultiplied, 16 bits each
    blue_opacity: u32,
    depth: f32,          // where half of what is behind is hidden; FAR where that never is
    unused: u32,
}
