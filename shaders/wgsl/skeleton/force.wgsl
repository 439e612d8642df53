// The boundary's repulsive force (Cornea et al. 2005): every charge on every place, one thread per place,
// charges staged in workgroup memory. One dispatch adds the force of a part of the charges to a part of the
// places.
//
// Coordinates of places and charges are integers of a small unit: their differences are exact, even where
// a driver reorders sums.

const TILE = 128u;

// m: the force falls with this power of the distance.
override exponent: u32 = 5u;

struct ForceWork {
    first_charge: u32,
    end_charge: u32,
    places: u32,
    is_first: u32,              // 1: no earlier dispatch wrote the result
    length_of_unit: f32,
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
}

struct Point {
    at: vec3<i32>,
    weight: f32,                // of a charge
}

@group(0) @binding(0) var<uniform> work: ForceWork;
@group(0) @binding(1) var<storage, read> charges: array<Point>;
@group(0) @binding(2) var<storage, read> places: array<Point>;
@group(0) @binding(3) var<storage, read_write> felt: array<vec4<f32>>;      // force, squared least distance

var<workgroup> tile: array<Point, TILE>;

// r^-(m+1) from r^-2.
fn power(inverse: f32) -> f32 {
    let squared = inverse * inverse;
    switch exponent {
        case 4u: { return squared * sqrt(inverse); }
        case 5u: { return squared * inverse; }
        case 6u: { return squared * inverse * sqrt(inverse); }
        case 7u: { return squared * squared; }
        case 8u: { return squared * squared * sqrt(inverse); }
        default: { return squared * squared * inverse; }
    }
}

@compute @workgroup_size(TILE)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let place = min(id.x, work.places - 1u);
    let at = places[place].at;
    var force = vec3<f32>(0.0);
    var nearest = 3.0e38;
    for (var first = work.first_charge; first < work.end_charge; first += TILE) {
        let count = min(TILE, work.end_charge - first);
        workgroupBarrier();
        if local < count {
            tile[local] = charges[first + local];
        }
        workgroupBarrier();
        // A partial sum per tile keeps small terms from vanishing in a large sum.
        var part = vec3<f32>(0.0);
        for (var i = 0u; i < count; i++) {
            let charge = tile[i];
            let d = vec3<f32>(at - charge.at) * work.length_of_unit;
            let r2 = dot(d, d);
            part += d * (charge.weight * power(1.0 / r2));
            nearest = min(nearest, r2);
        }
        force += part;
    }
    if id.x >= work.places {
        return;
    }
    if work.is_first == 0u {
        let before = felt[place];
        force += before.xyz;
        nearest = min(nearest, before.w);
    }
    felt[place] = vec4<f32>(force, nearest);
}
