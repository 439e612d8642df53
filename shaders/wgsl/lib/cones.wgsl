// Light that arrives through a cone towards the eye or a lamp: sub-cones of equal solid angle, each traced through
// levels of prefiltered extinction, finer nearby and coarser farther away (after Crassin et al. 2011).
// Shared by the image's light grid and by surfaces.
//
// The including file provides
// - `near_extinction(p)`: unfiltered extinction per millimetre at p;
// - `kept_span(c, w)`: interval in millimetres along direction w from c that no clipping plane cuts away;
// - `is_kept(c)`: whether the medium exists at c;
// - `is_hidden(c)`: whether c counts as inside opaque geometry;
// - `begin_of(c, w)`: where light to c from direction w is looked for, for `light_from_cone`;
// - `colored_extinction_at(p, level)`: colour times extinction, and extinction, if it gathers colours.
// Points p are in the medium's index space, voxel (i, j, k) filling [i, i+1) and so on; points c in camera space.

struct Level {
    dims: vec3<u32>,
    start: u32,                     // index of its first cell in `prefiltered`
    scale: vec3<f32>,               // cells per voxel
    pad: u32,
}

struct Cones {
    right: vec3<f32>,               // medium's index space, one millimetre
    tangent: f32,                   // of a sub-cone's half opening angle
    up: vec3<f32>,
    cone_step: f32,                 // cells
    forward: vec3<f32>,
    coarsest: f32,                  // level
    corner: vec3<f32>,              // index space, where the view axis meets the reference plane
    voxel_mm: f32,
    dims: vec3<u32>,                // voxels
    count: u32,                     // sub-cones
    dark: f32,                      // upper bound of the extinction, per millimetre
    rounds: u32,                    // most steps of a sub-cone
    colors: u32,                    // where colours begin in `prefiltered`, three for each cell
    unused_b: u32,
    levels: array<Level, 16>,
    // Unit: right and up perpendicular to the line of sight, and towards the eye; to a lamp in camera space.
    axes: array<vec4<f32>, 128>,
}

@group(0) @binding(26) var<uniform> cones: Cones;
@group(0) @binding(27) var<storage, read> prefiltered: array<f32>;

// Optical thickness beyond which no visible light is left.
const ENOUGH = 12.0;
const LAST_LEVEL = 15u;

// Whether sub-cones are exact voxel traversals (`exact_ray` of the including file), for label maps.
override exact: bool = false;
// Whether sub-cones gather the colours of what takes light away.
override gathers_color: bool = false;
var<private> gathered: vec3<f32>;
// Whether the cone is around the direction to a lamp far away.
override towards_lamp: bool = false;

// The eight cells about a point of a level, for trilinear interpolation: four rows along x, and two cells of each.
struct CellsAbout {
    rows: vec4<u32>,
    low: u32,
    high: u32,
    fraction: vec3<f32>,
}

fn cells_about(p: vec3<f32>, number: u32) -> CellsAbout {
    let level = cones.levels[number];
    let at = clamp(p * level.scale - 0.5, vec3<f32>(0.0), vec3<f32>(level.dims) - 1.0);
    let low = min(vec3<u32>(at), max(level.dims, vec3<u32>(2u)) - 2u);
    let high = min(low + 1u, level.dims - 1u);
    let sheet = level.dims.x * level.dims.y;
    let rows = level.start + vec4<u32>(low.z, low.z, high.z, high.z) * sheet
        + vec4<u32>(low.y, high.y, low.y, high.y) * level.dims.x;
    return CellsAbout(rows, low.x, high.x, at - vec3<f32>(low));
}

fn level_at(p: vec3<f32>, number: u32) -> f32 {
    let c = cells_about(p, number);
    let f = c.fraction;
    let a = mix(prefiltered[c.rows.x + c.low], prefiltered[c.rows.x + c.high], f.x);
    let b = mix(prefiltered[c.rows.y + c.low], prefiltered[c.rows.y + c.high], f.x);
    let d = mix(prefiltered[c.rows.z + c.low], prefiltered[c.rows.z + c.high], f.x);
    let e = mix(prefiltered[c.rows.w + c.low], prefiltered[c.rows.w + c.high], f.x);
    return mix(mix(a, b, f.y), mix(d, e, f.y), f.z);
}

fn extinction_at(p: vec3<f32>, level: f32) -> f32 {
    let low = u32(floor(level));
    let f = level - floor(level);
    var a = 0.0;
    if low == 0u {
        a = min(near_extinction(p), cones.dark);
    } else {
        a = level_at(p, low);
    }
    return mix(a, level_at(p, min(low + 1u, LAST_LEVEL)), f);
}

fn index_of(c: vec3<f32>) -> vec3<f32> {
    return cones.corner + c.x * cones.right + c.y * cones.up + c.z * cones.forward;
}

// Transmittance of one sub-cone from direction `w` to `c`, both in camera space: of the medium alone, and
// of the medium and opaque geometry.
fn sub_cone(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    let o = index_of(c);
    let d = w.x * cones.right + w.y * cones.up + w.z * cones.forward;
    let size = vec3<f32>(cones.dims);
    let moves = abs(d) > vec3<f32>(1e-12);
    let safe = select(vec3<f32>(1.0), d, moves);
    let ends = select(vec3<f32>(FAR), max(-o / safe, (size - o) / safe), moves);
    // The lit point may lie outside the medium, for example on a tube.
    let begins = select(vec3<f32>(-FAR), min(-o / safe, (size - o) / safe), moves);
    let misses = any(!moves & ((o < vec3<f32>(0.0)) | (o > size)));
    // Light starts at the eye plane. Not an `if`: Mesa 22.3's software driver crashes when it compiles one
    // here with a uniform read in it.
    let to_eye = (view.nearest_mm - c.z) / select(-1.0, w.z, w.z < 0.0);
    let leaves = min(min(ends.x, ends.y), ends.z);
    let far = select(min(leaves, select(FAR, to_eye, w.z < 0.0)), -1.0, misses);
    let kept = kept_span(c, w);
    let widest = cones.voxel_mm * exp2(cones.coarsest);
    var t = max(max(begins.x, max(begins.y, begins.z)), 0.0);
    var thickness = 0.0;
    var open = 1.0;
    var color = vec3<f32>(0.0);
    // No cone needs more rounds: a guard against invalid numbers. No branches in here: Mesa's software
    // driver executes both sides anyway.
    for (var round = 0u; (round < cones.rounds) & (t < far) & (thickness < ENOUGH); round++) {
        let width = clamp(2.0 * t * cones.tangent, cones.voxel_mm, widest);
        let step = min(cones.cone_step * width, far - t);
        let middle = t + 0.5 * step;
        let place = c + middle * w;
        let middle_width = clamp(2.0 * middle * cones.tangent, cones.voxel_mm, widest);
        let level = log2(middle_width / cones.voxel_mm);
        let counts = (middle >= kept.x) & (middle <= kept.y) & is_kept(place);
        if gathers_color {
            let look = colored_extinction_at(o + middle * d, level);
            let taken = exp(-thickness) * (1.0 - exp(-select(0.0, look.w * step, counts)));
            color += taken * look.rgb / max(look.w, 1e-30);
            thickness += select(0.0, look.w * step, counts);
        } else {
            thickness += select(0.0, extinction_at(o + middle * d, level) * step, counts);
        }
        open = select(open, 0.0, is_hidden(place));
        t = select(far, t + step, t + step > t);
    }
    gathered = color;
    return exp(-thickness) * vec2<f32>(1.0, open);
}

// Mean transmittance of the cone to `c` in camera space: of the medium alone, and of the medium and opaque
// geometry.
fn light_from_cone(c: vec3<f32>) -> vec2<f32> {
    // Direction to the eye, and two perpendicular to it.
    let off = c.xy * (view.mm_per_pixel_per_mm / max(footprint_mm(c.z), 1e-12));
    let axis = vec3<f32>(-off, -1.0) / sqrt(1.0 + dot(off, off));
    let u = normalize(vec3<f32>(1.0, 0.0, 0.0) - axis * axis.x);
    let v = cross(axis, u);
    var sum = vec2<f32>(0.0);
    for (var i = 0u; i < varied(cones.count); i++) {
        let a = cones.axes[i];
        var w = a.xyz;
        if !towards_lamp {
            w = u * a.x + v * a.y + axis * a.z;
        }
        if exact {
            sum += exact_ray(c, w);
        } else {
            sum += sub_cone(begin_of(c, w), w);
        }
    }
    return sum / f32(cones.count);
}
