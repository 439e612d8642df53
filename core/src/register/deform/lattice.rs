//! A displacement as a cubic B-spline on a lattice, and how stiff it is.
//!
//! Data is gathered in cells, three along each edge of a lattice cube: within one the splines' weights are those at its
//! middle, so that there are three sets of four weights along each axis, and sums over cells are three short passes.

use glam::{DVec3, IVec3};

/// Cells along an edge of a lattice cube.
pub(crate) const CELLS: usize = 3;

/// Weights of the four control points about a place that lies at `t` (0 to 1) of its lattice cube.
fn weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    let (t2, t3) = (t * t, t * t * t);
    [
        s * s * s / 6.0,
        (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0,
        (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0,
        t3 / 6.0,
    ]
}

/// Derivatives of [`weights`] by `t`.
fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-0.5 * s * s, 1.5 * t * t - 2.0 * t, -1.5 * t * t + t + 0.5, 0.5 * t * t]
}

/// Control points of a displacement in millimetres.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lattice {
    /// Corner of the first lattice cube.
    low_mm: DVec3,
    /// Edge of a lattice cube.
    spacing_mm: f64,
    /// Cubes along each axis; three more control points.
    cubes: [usize; 3],
    /// Displacement of each control point in mm, x fastest.
    pub coefficients: Vec<DVec3>,
}

/// What a pass along one axis takes from.
#[derive(Clone, Copy)]
enum Weight {
    Plain,
    Squared,
}

impl Lattice {
    /// No displacement, over a box.
    pub fn over(low_mm: DVec3, high_mm: DVec3, spacing_mm: f64) -> Self {
        let cubes = std::array::from_fn(|a| (((high_mm - low_mm)[a] / spacing_mm).ceil() as usize).max(1));
        let control = cubes.map(|n| n + 3);
        let coefficients = vec![DVec3::ZERO; control.iter().product()];
        Self { low_mm, spacing_mm, cubes, coefficients }
    }

    pub fn spacing_mm(&self) -> f64 {
        self.spacing_mm
    }

    fn control(&self) -> [usize; 3] {
        self.cubes.map(|n| n + 3)
    }

    /// Cells along each axis.
    pub fn cells(&self) -> [usize; 3] {
        self.cubes.map(|n| n * CELLS)
    }

    /// Edge of a cell.
    pub fn cell_mm(&self) -> f64 {
        self.spacing_mm / CELLS as f64
    }

    /// The cell that contains a place; `None` outside the box.
    pub fn cell_at(&self, p_mm: DVec3) -> Option<usize> {
        let v = ((p_mm - self.low_mm) / self.cell_mm()).floor();
        let cells = self.cells();
        let inside = (0..3).all(|a| v[a] >= 0.0 && v[a] < cells[a] as f64);
        inside.then(|| crate::grid::linear(cells, v.to_array().map(|v| v as usize)))
    }

    /// Cells whose middles lie within `radius_mm` of a place.
    pub fn cells_near(&self, p_mm: DVec3, radius_mm: f64) -> impl Iterator<Item = usize> {
        let (cells, cell_mm) = (self.cells(), self.cell_mm());
        let middle = (p_mm - self.low_mm) / cell_mm - 0.5;
        let reach = radius_mm / cell_mm;
        let range = move |a: usize| {
            let first = (middle[a] - reach).ceil().max(0.0) as usize;
            let last = (middle[a] + reach).floor();
            first..if last < 0.0 { first } else { (last as usize + 1).min(cells[a]) }
        };
        let near = move |v: &[usize; 3]| DVec3::from_array(v.map(|v| v as f64)).distance(middle) <= reach;
        let all = range(2).flat_map(move |z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])));
        all.filter(near).map(move |v| crate::grid::linear(cells, v))
    }

    /// First control point of the cube about a place, and where in it the place lies; beyond the box as at its border.
    fn cube(&self, p_mm: DVec3) -> ([usize; 3], DVec3) {
        let most = DVec3::from_array(self.cubes.map(|n| n as f64));
        let v = ((p_mm - self.low_mm) / self.spacing_mm).clamp(DVec3::ZERO, most);
        let first = v.floor().min(most - 1.0);
        (first.to_array().map(|v| v as usize), v - first)
    }

    fn sum(&self, first: [usize; 3], [wx, wy, wz]: [[f64; 4]; 3]) -> DVec3 {
        let [nx, ny, _] = self.control();
        let mut all = DVec3::ZERO;
        for (z, wz) in wz.into_iter().enumerate() {
            let mut plane = DVec3::ZERO;
            for (y, wy) in wy.into_iter().enumerate() {
                let row = ((first[2] + z) * ny + first[1] + y) * nx + first[0];
                let four = self.coefficients[row..row + 4].iter().zip(wx);
                plane += four.fold(DVec3::ZERO, |sum, (c, w)| sum + *c * w) * wy;
            }
            all += plane * wz;
        }
        all
    }

    /// The displacement at a place; beyond the box as at its border.
    pub fn at(&self, p_mm: DVec3) -> DVec3 {
        let (first, t) = self.cube(p_mm);
        self.sum(first, t.to_array().map(weights))
    }

    /// How many times as large a small volume at a place becomes; negative where space folds over.
    pub fn volume_ratio(&self, p_mm: DVec3) -> f64 {
        let (first, t) = self.cube(p_mm);
        let (w, d) = (t.to_array().map(weights), t.to_array().map(slopes));
        let along = |a: usize| {
            let weights = std::array::from_fn(|axis| if axis == a { d[axis] } else { w[axis] });
            self.sum(first, weights) / self.spacing_mm
        };
        let columns = [along(0) + DVec3::X, along(1) + DVec3::Y, along(2) + DVec3::Z];
        columns[0].dot(columns[1].cross(columns[2]))
    }

    /// Values of control points at the middles of cells.
    pub fn to_cells(&self, control: &[DVec3]) -> Vec<DVec3> {
        let mut dims = self.control();
        let mut values = control.to_vec();
        for axis in 0..3 {
            values = self.gathered(&values, &mut dims, axis);
        }
        values
    }

    /// The transpose of [`Lattice::to_cells`].
    pub fn onto_control(&self, cells: Vec<DVec3>) -> Vec<DVec3> {
        self.scattered_all(cells, Weight::Plain)
    }

    /// As [`Lattice::onto_control`] with squared weights: the diagonal of a sum over cells.
    pub fn diagonal(&self, cells: Vec<DVec3>) -> Vec<DVec3> {
        self.scattered_all(cells, Weight::Squared)
    }

    fn scattered_all(&self, mut values: Vec<DVec3>, weight: Weight) -> Vec<DVec3> {
        let mut dims = self.cells();
        for axis in 0..3 {
            values = self.scattered(&values, &mut dims, axis, weight);
        }
        values
    }

    fn gathered(&self, values: &[DVec3], dims: &mut [usize; 3], axis: usize) -> Vec<DVec3> {
        let inner: usize = dims[..axis].iter().product();
        let outer: usize = dims[axis + 1..].iter().product();
        let (old, new) = (dims[axis], self.cells()[axis]);
        let phases = phases(Weight::Plain);
        let mut out = vec![DVec3::ZERO; inner * new * outer];
        for o in 0..outer {
            for cell in 0..new {
                let to = (o * new + cell) * inner;
                for (k, w) in phases[cell % CELLS].into_iter().enumerate() {
                    let from = (o * old + cell / CELLS + k) * inner;
                    let (to, from) = (&mut out[to..to + inner], &values[from..from + inner]);
                    to.iter_mut().zip(from).for_each(|(to, from)| *to += *from * w);
                }
            }
        }
        dims[axis] = new;
        out
    }

    fn scattered(&self, values: &[DVec3], dims: &mut [usize; 3], axis: usize, weight: Weight) -> Vec<DVec3> {
        let inner: usize = dims[..axis].iter().product();
        let outer: usize = dims[axis + 1..].iter().product();
        let (old, new) = (dims[axis], self.control()[axis]);
        let phases = phases(weight);
        let mut out = vec![DVec3::ZERO; inner * new * outer];
        for o in 0..outer {
            for cell in 0..old {
                let from = (o * old + cell) * inner;
                for (k, w) in phases[cell % CELLS].into_iter().enumerate() {
                    let to = (o * new + cell / CELLS + k) * inner;
                    let (to, from) = (&mut out[to..to + inner], &values[from..from + inner]);
                    to.iter_mut().zip(from).for_each(|(to, from)| *to += *from * w);
                }
            }
        }
        dims[axis] = new;
        out
    }

    /// The bending of control points, `Bᵀ B` times them with B their second differences along and across the axes.
    pub fn bending(&self, control: &[DVec3]) -> Vec<DVec3> {
        let [nx, ny, nz] = self.control();
        let dims = IVec3::new(nx as i32, ny as i32, nz as i32);
        let mut out = vec![DVec3::ZERO; control.len()];
        let at = |v: IVec3| ((v.z * dims.y + v.y) * dims.x + v.x) as usize;
        for z in 0..dims.z {
            for y in 0..dims.y {
                for x in 0..dims.x {
                    let v = IVec3::new(x, y, z);
                    for stencil in &STENCILS {
                        let places = stencil.map(|(step, weight)| (v + IVec3::from_array(step), weight));
                        let inside = |p: IVec3| p.cmpge(IVec3::ZERO).all() && p.cmplt(dims).all();
                        if !places.iter().all(|(p, _)| inside(*p)) {
                            continue;
                        }
                        let bent = places.iter().fold(DVec3::ZERO, |sum, (p, w)| sum + control[at(*p)] * *w);
                        places.iter().for_each(|(p, w)| out[at(*p)] += bent * *w);
                    }
                }
            }
        }
        out
    }
}

/// Of [`Lattice::bending`]'s matrix within the lattice: along each axis 1 + 4 + 1, of each pair of axes four times ½.
pub(crate) const BENDING_DIAGONAL: f64 = 3.0 * 6.0 + 3.0 * 0.5;

const ACROSS: f64 = std::f64::consts::SQRT_2 / 4.0;
type Stencil = [([i32; 3], f64); 4];
/// Second differences along x, y and z, then across two axes, each of which counts twice.
const STENCILS: [Stencil; 6] = [
    [([-1, 0, 0], 1.0), ([0, 0, 0], -2.0), ([1, 0, 0], 1.0), ([0, 0, 0], 0.0)],
    [([0, -1, 0], 1.0), ([0, 0, 0], -2.0), ([0, 1, 0], 1.0), ([0, 0, 0], 0.0)],
    [([0, 0, -1], 1.0), ([0, 0, 0], -2.0), ([0, 0, 1], 1.0), ([0, 0, 0], 0.0)],
    [([1, 1, 0], ACROSS), ([1, -1, 0], -ACROSS), ([-1, 1, 0], -ACROSS), ([-1, -1, 0], ACROSS)],
    [([1, 0, 1], ACROSS), ([1, 0, -1], -ACROSS), ([-1, 0, 1], -ACROSS), ([-1, 0, -1], ACROSS)],
    [([0, 1, 1], ACROSS), ([0, 1, -1], -ACROSS), ([0, -1, 1], -ACROSS), ([0, -1, -1], ACROSS)],
];

/// The weights of a cell's control points, by its place in its cube.
fn phases(weight: Weight) -> [[f64; 4]; CELLS] {
    std::array::from_fn(|phase| {
        let plain = weights((phase as f64 + 0.5) / CELLS as f64);
        match weight {
            Weight::Plain => plain,
            Weight::Squared => plain.map(|w| w * w),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::random::Random;

    fn lattice() -> Lattice {
        Lattice::over(DVec3::new(-20.0, 3.0, -7.0), DVec3::new(31.0, 40.0, 30.0), 12.0)
    }

    /// Control points of an affine map: cubic splines reproduce it.
    fn affine(lattice: &Lattice, map: impl Fn(DVec3) -> DVec3) -> Vec<DVec3> {
        let dims = lattice.control();
        let place = |l: usize| {
            let v = crate::grid::ijk(dims, l).map(|v| v as f64 - 1.0);
            lattice.low_mm + DVec3::from_array(v) * lattice.spacing_mm
        };
        (0..lattice.coefficients.len()).map(|l| map(place(l))).collect()
    }

    #[test]
    fn affine_maps_are_exact_and_do_not_bend() {
        let mut lattice = lattice();
        let map = |p: DVec3| DVec3::new(0.1 * p.x - 0.2 * p.y + 3.0, 0.05 * p.z, -0.3 * p.z + 0.1 * p.x);
        lattice.coefficients = affine(&lattice, map);
        for p in [DVec3::new(-19.0, 4.0, 0.0), DVec3::new(3.3, 20.1, 11.7), DVec3::new(30.9, 39.0, 29.0)] {
            assert!(lattice.at(p).distance(map(p)) < 1e-12, "{p}");
            // The determinant of the map added to the identity.
            let by_hand = glam::DMat3::from_cols(
                DVec3::new(1.1, 0.0, 0.1),
                DVec3::new(-0.2, 1.0, 0.0),
                DVec3::new(0.0, 0.05, 0.7),
            )
            .determinant();
            assert!((lattice.volume_ratio(p) - by_hand).abs() < 1e-12);
        }
        let bent = lattice.bending(&lattice.coefficients);
        assert!(bent.iter().all(|b| b.length() < 1e-12));
    }

    #[test]
    fn cells_have_the_displacement_of_their_middles_and_passes_are_each_others_transpose() {
        let mut lattice = lattice();
        let mut random = Random::new(7, 1);
        let mut any = |n: usize| -> Vec<DVec3> {
            let mut one = || 2.0 * random.unit() - 1.0;
            (0..n).map(|_| DVec3::new(one(), one(), one())).collect()
        };
        lattice.coefficients = any(lattice.coefficients.len());
        let cells = lattice.cells();
        let at_cells = lattice.to_cells(&lattice.coefficients);
        for v in [[0, 0, 0], [4, 7, 2], [cells[0] - 1, cells[1] - 1, cells[2] - 1]] {
            let middle = lattice.low_mm + (DVec3::from_array(v.map(|v| v as f64)) + 0.5) * lattice.cell_mm();
            let l = crate::grid::linear(cells, v);
            assert_eq!(lattice.cell_at(middle), Some(l));
            assert!(at_cells[l].distance(lattice.at(middle)) < 1e-12, "{v:?}");
            assert!(lattice.cells_near(middle, 0.1).eq([l]));
        }
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let weighted = any(at_cells.len());
        let back = lattice.onto_control(weighted.clone());
        let apart = dot(&at_cells, &weighted) - dot(&lattice.coefficients, &back);
        assert!(apart.abs() < 1e-9, "{apart}");
        // A symmetric matrix whose diagonal is as stated in the middle.
        let other = any(lattice.coefficients.len());
        let [ab, ba] = [
            dot(&lattice.bending(&lattice.coefficients), &other),
            dot(&lattice.coefficients, &lattice.bending(&other)),
        ];
        assert!((ab - ba).abs() < 1e-9 * ab.abs());
        let mut unit = vec![DVec3::ZERO; other.len()];
        let middle = crate::grid::linear(lattice.control(), [3, 3, 3]);
        unit[middle] = DVec3::X;
        assert!((lattice.bending(&unit)[middle].x - BENDING_DIAGONAL).abs() < 1e-12);
    }
}
