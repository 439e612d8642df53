//! Times to read 100,000 fibres of 50 points and to compute their distances from a ball of voxels.

use glam::DVec3;
use glioscope_core::{
    Grid, MaskBits, Progress,
    files::{TractOptions, read_tract_bytes},
    grid::ijk,
    tract_distance::{Nearness, SelectedCells},
};

use crate::{
    Outcome,
    clock::{minimum, repeated},
    print_line,
};

const FIBERS: usize = 100_000;
const POINTS: usize = 50;

/// Arcs of 1 mm steps through a head-sized box.
fn points() -> Vec<[f32; 3]> {
    let mut state = 1_u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut out = Vec::with_capacity(FIBERS * POINTS);
    for _ in 0..FIBERS {
        let mut p = [random() * 150.0, random() * 180.0, random() * 130.0];
        let (mut yaw, pitch, bend) = (random() * 6.3, random() - 0.5, (random() - 0.5) * 0.05);
        for _ in 0..POINTS {
            out.push(p);
            p = [p[0] + yaw.cos() * pitch.cos(), p[1] + yaw.sin() * pitch.cos(), p[2] + pitch.sin()];
            yaw += bend;
        }
    }
    out
}

fn tck(points: &[[f32; 3]]) -> Vec<u8> {
    let mut out = b"mrtrix tracks\ncount: 100000\ndatatype: Float32LE\nfile: . 0128\nEND\n".to_vec();
    out.resize(128.max(out.len()), b' ');
    for fiber in points.chunks(POINTS) {
        fiber.iter().flatten().for_each(|v| out.extend(v.to_le_bytes()));
        (0..3).for_each(|_| out.extend(f32::NAN.to_le_bytes()));
    }
    (0..3).for_each(|_| out.extend(f32::INFINITY.to_le_bytes()));
    out
}

fn trk(points: &[[f32; 3]]) -> Vec<u8> {
    let mut out = vec![0; 1000];
    out[..5].copy_from_slice(b"TRACK");
    (0..3).for_each(|a| out[12 + 4 * a..16 + 4 * a].copy_from_slice(&1.0_f32.to_le_bytes()));
    (0..4).for_each(|a| out[440 + 20 * a..444 + 20 * a].copy_from_slice(&1.0_f32.to_le_bytes()));
    out[948..951].copy_from_slice(b"RAS");
    out[992..996].copy_from_slice(&2_i32.to_le_bytes());
    out[996..1000].copy_from_slice(&1000_i32.to_le_bytes());
    for fiber in points.chunks(POINTS) {
        out.extend((POINTS as i32).to_le_bytes());
        fiber.iter().flatten().for_each(|v| out.extend(v.to_le_bytes()));
    }
    out
}

/// Prints the times.
///
/// # Errors
/// When the generated files can't be read.
pub fn run() -> Outcome<()> {
    let points = points();
    let (options, progress) = (TractOptions::default(), Progress::new());
    let mut loaded = None;
    for (name, bytes) in [("tck", tck(&points)), ("trk", trk(&points))] {
        let (times, found) = repeated(5, || read_tract_bytes(name, &bytes, &options, &progress))?;
        loaded = Some(found);
        let megabytes = bytes.len() as f64 / 1e6;
        print_line(format!("read {name}: {megabytes:.1} MB in {:.1} ms (minimum of 5)", minimum(&times)))?;
    }
    let tracts = loaded.ok_or("no tracts were read")?.tracts;
    for radius in [5.0, 20.0, 40.0] {
        let dims = [150, 180, 130];
        let grid = Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO)?;
        let middle = DVec3::new(75.0, 90.0, 65.0);
        let mask =
            MaskBits::from_fn(dims, |l| grid.center_of_voxel_mm(ijk(dims, l)).distance(middle) <= radius);
        let (times, near) = repeated(3, || -> Outcome<Nearness> {
            let cells = SelectedCells::new(&grid, &mask).ok_or("no voxels")?;
            Ok(Nearness::of(&cells.nearest_of_all(&tracts, &progress)?, 10.0))
        })?;
        let (voxels, ms) = (mask.count(), minimum(&times));
        print_line(format!("{voxels} voxels, {FIBERS} fibres: {ms:.0} ms (minimum of 3), {near:?}"))?;
    }
    Ok(())
}
