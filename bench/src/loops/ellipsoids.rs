//! Draws ellipsoid diagrams and times the passes: `ellipsoids [OUT_FOLDER] [real] [quick]`.
//! Prints the adapter, where its times come from, and per pass the median of several frames.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example: it ends at the first error, and prints"
)]

use std::{sync::Arc, time::Instant};

use glam::{DMat3, DQuat, DVec3};
use glioscope_render::{
    AdapterPreference, Camera, DrawnEllipsoid, EllipsoidRenderer, EllipsoidScene, Gpu, Lens, MaskColors,
    Palette, Projection, Quality, SlicePlane,
};

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

/// Numbers in 0..1, always the same.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as f64) / f64::from(1u32 << 31)
    }
}

/// Three masks, their overlaps, and specks around them, `count` in all.
fn diagram(count: u32) -> EllipsoidScene {
    let colors = MaskColors::new(Palette::Thesis, &[None; 3]);
    let mut noise = Noise(5);
    let shapes = [
        (0b001, [-14.0, 2.0, 3.0], [20.0, 25.0, 19.0]),
        (0b010, [4.0, -2.0, 0.0], [34.0, 27.0, 24.0]),
        (0b100, [16.0, -6.0, 9.0], [17.0, 15.0, 20.0]),
        (0b011, [-8.0, 1.0, 2.0], [14.0, 19.0, 15.0]),
        (0b110, [14.0, -6.0, 6.0], [13.0, 11.0, 14.0]),
        (0b101, [3.0, -3.0, 7.0], [7.0, 9.0, 10.0]),
        (0b111, [2.0, -3.0, 6.0], [5.0, 7.0, 8.0]),
    ];
    let mut ellipsoids = Vec::new();
    for id in 0..count {
        let mut turn = || {
            DQuat::from_axis_angle(DVec3::Y, noise.next() * 0.8)
                * DQuat::from_axis_angle(DVec3::Z, noise.next() * 0.8)
        };
        let rotation = DMat3::from_quat(turn());
        let (bits, center_mm, semi_axes_mm) = match shapes.get(id as usize) {
            Some((bits, center, axes)) => (*bits, DVec3::from_array(*center), DVec3::from_array(*axes)),
            None => {
                let place = DVec3::new(noise.next(), noise.next(), noise.next()) * 2.0 - 1.0;
                let axes = DVec3::new(noise.next(), noise.next(), noise.next()) * 2.5 + 1.0;
                (1 + (noise.next() * 6.99) as u32, place * DVec3::new(44.0, 36.0, 32.0), axes)
            }
        };
        ellipsoids.push(DrawnEllipsoid {
            id,
            center_mm,
            semi_axes_mm,
            rotation,
            color: colors.region(bits),
            opacity: 0.35,
        });
    }
    EllipsoidScene {
        ellipsoids: Arc::new(ellipsoids),
        opacity: 1.0,
        lens: None,
        camera: Camera::fit(DVec3::ZERO, 44.0, Camera::orientation(25.0, 18.0), Projection::Perspective),
        background: [244, 244, 242],
        silhouette: [0, 0, 0],
        plane: None,
    }
}

/// A made-up slice: soft rings.
fn slice() -> SlicePlane {
    let n = 256;
    let rgba: Vec<u8> = (0..n * n)
        .flat_map(|i| {
            let (x, y) = (f64::from(i % n) / 128.0 - 1.0, f64::from(i / n) / 128.0 - 1.0);
            let v = (127.0 + 90.0 * ((x * x + 1.4 * y * y).sqrt() * 14.0).sin()) as u8;
            [v, v, v, 255]
        })
        .collect();
    SlicePlane {
        rgba: Arc::new(rgba),
        size_px: [n as u32; 2],
        corner_mm: DVec3::new(-42.0, 42.0, 4.0),
        right_mm: DVec3::X * 84.0,
        down_mm: DVec3::Y * -84.0,
        opacity: 0.6,
    }
}

fn main() {
    let mut args = std::env::args().skip(1);
    let folder = args.next();
    let rest: Vec<String> = args.collect();
    let real = rest.iter().any(|a| a == "real");
    let preference = if real { AdapterPreference::RealFirst } else { AdapterPreference::SoftwareOnly };
    let frames = if rest.iter().any(|a| a == "quick") { 1 } else { 7 };
    let gpu = Gpu::headless(preference).unwrap();
    let mut renderer = EllipsoidRenderer::new(&gpu).unwrap();
    println!("{}; times from {}", gpu.describe(), renderer.time_source().describe());
    let light = diagram(20);
    let lens = Some(Lens { center_mm: DVec3::new(2.0, -3.0, 6.0), radius_mm: 21.0 });
    let with_lens = EllipsoidScene { lens, ..light.clone() };
    let dark = EllipsoidScene { background: [34, 36, 40], silhouette: [205, 205, 205], ..with_lens.clone() };
    let solid = light.ellipsoids.iter().map(|e| DrawnEllipsoid { opacity: 1.0, ..*e }).collect();
    let opaque = EllipsoidScene { ellipsoids: Arc::new(solid), ..light.clone() };
    let mut sliced = EllipsoidScene { plane: Some(slice()), ..light.clone() };
    sliced.camera.world_from_camera = Camera::orientation(25.0, 45.0);
    let many = diagram(300);
    let scenes = [
        ("20", light),
        ("20_lens", with_lens),
        ("20_dark", dark),
        ("20_opaque", opaque),
        ("20_slice", sliced),
        ("300", many),
    ];
    for (name, scene) in &scenes {
        for size in [512, 1024] {
            let (mut whole, mut rows, mut names) = (Vec::new(), Vec::new(), Vec::new());
            for _ in 0..frames {
                let start = Instant::now();
                renderer.render(&gpu, scene, &Quality::FULL, [size, size]).unwrap();
                gpu.wait().unwrap();
                whole.push(start.elapsed().as_secs_f64() * 1e3);
                let times = renderer.pass_times(&gpu).unwrap();
                names = times.iter().map(|t| t.0.name()).collect();
                rows.push(times.iter().map(|t| t.1).collect::<Vec<f64>>());
            }
            print!("{name:10} {size:5}  whole {:7.1} ms ", median(whole));
            for (column, pass) in names.iter().enumerate() {
                print!(" {pass} {:6.1}", median(rows.iter().map(|r| r[column]).collect()));
            }
            println!();
            if let (Some(folder), Some(frame)) = (&folder, renderer.frame()) {
                let rgba = frame.read_rgba(&gpu).unwrap();
                let path = format!("{folder}/ellipsoids_{name}_{size}.png");
                image::RgbaImage::from_raw(size, size, rgba).unwrap().save(path).unwrap();
            }
        }
    }
}
