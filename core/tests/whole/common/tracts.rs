//! Synthetic `.tck` and `.trk` files.

/// Fibres to write, in the file's own coordinates.
pub fn fibers() -> Vec<Vec<[f32; 3]>> {
    let line = |n: usize, at: [f32; 3], step: [f32; 3]| -> Vec<[f32; 3]> {
        (0..n).map(|i| std::array::from_fn(|a| at[a] + i as f32 * step[a] + 0.125 * (i * i) as f32)).collect()
    };
    vec![
        line(4, [1.0, 2.0, 3.0], [1.5, 0.25, 0.5]),
        line(1, [10.5, 0.0, 7.25], [0.0; 3]),
        line(7, [20.0, 15.0, 12.0], [-1.0, 0.5, -0.75]),
    ]
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    Little,
    Big,
}

impl Order {
    fn f32(self, v: f32) -> [u8; 4] {
        if self == Self::Little { v.to_le_bytes() } else { v.to_be_bytes() }
    }

    fn f64(self, v: f64) -> [u8; 8] {
        if self == Self::Little { v.to_le_bytes() } else { v.to_be_bytes() }
    }

    pub fn i32(self, v: i32) -> [u8; 4] {
        if self == Self::Little { v.to_le_bytes() } else { v.to_be_bytes() }
    }

    pub fn i16(self, v: i16) -> [u8; 2] {
        if self == Self::Little { v.to_le_bytes() } else { v.to_be_bytes() }
    }
}

/// A `.tck` file with these fibres and additional header lines.
pub fn tck(fibers: &[Vec<[f32; 3]>], order: Order, double: bool, lines: &str) -> Vec<u8> {
    let letters = if order == Order::Little { "LE" } else { "BE" };
    let bits = if double { 64 } else { 32 };
    tck_with_header(fibers, order, double, &format!("datatype: Float{bits}{letters}\n{lines}"))
}

/// As [`tck`], with all header lines but `file` given by `lines`.
pub fn tck_with_header(fibers: &[Vec<[f32; 3]>], order: Order, double: bool, lines: &str) -> Vec<u8> {
    let head = |offset: usize| format!("mrtrix tracks    \n{lines}file: . {offset:04}\nEND\n");
    let mut out = head(head(0).len()).into_bytes();
    let mut put = |p: [f32; 3]| {
        for v in p {
            if double { out.extend(order.f64(v.into())) } else { out.extend(order.f32(v)) }
        }
    };
    for fiber in fibers {
        fiber.iter().for_each(|&p| put(p));
        put([f32::NAN; 3]);
    }
    put([f32::INFINITY; 3]);
    out
}

/// A `.tsf` file with these values of each fibre and additional header lines.
pub fn tsf(fibers: &[Vec<f32>], order: Order, double: bool, lines: &str) -> Vec<u8> {
    let letters = if order == Order::Little { "LE" } else { "BE" };
    let bits = if double { 64 } else { 32 };
    let head = |offset: usize| {
        format!("mrtrix track scalars\ndatatype: Float{bits}{letters}\n{lines}file: . {offset:04}\nEND\n")
    };
    let mut out = head(head(0).len()).into_bytes();
    let mut put = |v: f32| if double { out.extend(order.f64(v.into())) } else { out.extend(order.f32(v)) };
    for fiber in fibers {
        fiber.iter().for_each(|&v| put(v));
        put(f32::NAN);
    }
    put(f32::INFINITY);
    out
}

/// Content of a `.trk` file.
#[derive(Clone, Debug)]
pub struct Trk {
    pub order: Order,
    pub version: i32,
    pub dims: [i16; 3],
    pub sizes: [f32; 3],
    pub scalars: i16,
    pub properties: i16,
    /// As the header has them: nibabel writes the number of columns after a zero.
    pub scalar_names: &'static [&'static str],
    pub property_names: &'static [&'static str],
    pub vox_to_ras: [[f32; 4]; 4],
    pub voxel_order: &'static str,
    pub count: i32,
    pub fibers: Vec<Vec<[f32; 3]>>,
}

/// A sheared, oblique matrix whose voxel axes run roughly towards R, A and S.
pub const OBLIQUE: [[f32; 4]; 4] =
    [[1.0, -0.25, 0.125, -20.0], [0.25, 2.0, -0.375, 10.5], [-0.0625, 0.5, 3.0, 5.0], [0.0, 0.0, 0.0, 1.0]];

impl Trk {
    pub fn new() -> Self {
        Self {
            order: Order::Little,
            version: 2,
            dims: [32, 24, 16],
            sizes: [1.0, 2.0, 3.0],
            scalars: 0,
            properties: 0,
            scalar_names: &[],
            property_names: &[],
            vox_to_ras: OBLIQUE,
            voxel_order: "RAS",
            count: 3,
            fibers: fibers(),
        }
    }

    pub fn bytes(&self) -> Vec<u8> {
        let o = self.order;
        let mut out = vec![0; 1000];
        let mut put = |at: usize, bytes: &[u8]| out[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, b"TRACK\0");
        for a in 0..3 {
            put(6 + 2 * a, &o.i16(self.dims[a]));
            put(12 + 4 * a, &o.f32(self.sizes[a]));
        }
        put(36, &o.i16(self.scalars));
        put(238, &o.i16(self.properties));
        for (at, names) in [(38, self.scalar_names), (240, self.property_names)] {
            names.iter().enumerate().for_each(|(n, name)| put(at + 20 * n, name.as_bytes()));
        }
        for (n, &v) in self.vox_to_ras.as_flattened().iter().enumerate() {
            put(440 + 4 * n, &o.f32(v));
        }
        put(948, self.voxel_order.as_bytes());
        put(988, &o.i32(self.count));
        put(992, &o.i32(self.version));
        put(996, &o.i32(1000));
        for fiber in &self.fibers {
            out.extend(o.i32(fiber.len() as i32));
            for (n, point) in fiber.iter().enumerate() {
                point.iter().for_each(|&v| out.extend(o.f32(v)));
                (0..self.scalars).for_each(|s| out.extend(o.f32(1e5 + n as f32 + f32::from(s))));
            }
            (0..self.properties).for_each(|s| out.extend(o.f32(-1e5 - f32::from(s))));
        }
        out
    }
}

/// The files whose nibabel results are in `tracts_nibabel.json`, by name.
pub fn nibabel_files() -> Vec<(&'static str, Vec<u8>)> {
    let base = Trk::new();
    let lps =
        [[-1.0, 0.0, 0.25, 30.0], [0.0, -2.0, 0.125, 40.0], [0.0, 0.25, 3.0, -5.0], [0.0, 0.0, 0.0, 1.0]];
    let big = Order::Big;
    vec![
        ("le.tck", tck(&fibers(), Order::Little, false, "count: 3\nmethod: made\n")),
        ("be.tck", tck(&fibers(), big, false, "count: 3\nroi: seed a\n")),
        ("ras.trk", base.bytes()),
        ("scalars.trk", Trk { scalars: 2, properties: 3, ..base.clone() }.bytes()),
        (
            "named.trk",
            Trk {
                scalars: 4,
                properties: 2,
                scalar_names: &["FA", "colors\x003"],
                property_names: &["length", "cluster id"],
                ..base.clone()
            }
            .bytes(),
        ),
        ("big-lps.trk", Trk { order: big, scalars: 1, voxel_order: "LPS", ..base.clone() }.bytes()),
        ("lps-both.trk", Trk { voxel_order: "LPS", vox_to_ras: lps, count: 0, ..base.clone() }.bytes()),
        ("las.trk", Trk { voxel_order: "las", ..base.clone() }.bytes()),
        ("none.trk", Trk { voxel_order: "", ..base.clone() }.bytes()),
        ("swapped.trk", Trk { voxel_order: "ARS", ..base.clone() }.bytes()),
        ("one.trk", Trk { version: 1, sizes: [1.0; 3], voxel_order: "LPS", ..base.clone() }.bytes()),
        ("two-of-three.trk", Trk { count: 2, ..base.clone() }.bytes()),
        ("unset.trk", Trk { vox_to_ras: [[0.0; 4]; 4], sizes: [1.0; 3], ..base }.bytes()),
    ]
}
