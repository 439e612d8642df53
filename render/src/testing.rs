//! Graphics device and scenes shared by tests.

use std::{
    ops::{Deref, DerefMut},
    sync::{Arc, LazyLock, Mutex, MutexGuard, OnceLock, PoisonError},
};

use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{
    Grid, Mask, MaskBits, RegionVolume, Regions, Selection, Sides, TumorIndex,
    grid::ijk,
    optics::{Camera, Projection},
};

use crate::{
    device::{AdapterPreference, Gpu, gpu::device_descriptor},
    scene::{Lens, MaskColors, Palette, RegionScene},
    views::{Renderer, View3d},
};

/// Graphics device of this crate's tests, opened once: the software adapter, or with `GLIOSCOPE_TEST_ADAPTER=real` a
/// GPU, which is then required.
pub static GPU: LazyLock<Gpu> = LazyLock::new(|| {
    let real = tests_want_a_card();
    let preference = if real { AdapterPreference::RealFirst } else { AdapterPreference::SoftwareOnly };
    match Gpu::headless(preference) {
        Ok(gpu) if real && gpu.is_software() => {
            panic!("GLIOSCOPE_TEST_ADAPTER=real: found {}", gpu.describe())
        }
        Ok(gpu) => gpu,
        Err(error) => panic!("tests need mesa-vulkan-drivers: {error}"),
    }
});

/// The device with a renderer, which the tests of a view use in turn.
pub struct Bench<V: View3d> {
    pub gpu: Gpu,
    pub renderer: Renderer<V>,
}

/// A bench in a `static`, opened by the first test.
pub type SharedBench<V> = OnceLock<Mutex<Bench<V>>>;

/// Exclusive use of a bench.
pub struct BenchGuard<V: View3d + 'static>(MutexGuard<'static, Bench<V>>);

/// Waits for the other tests of a bench, then uses it.
pub fn lock<V: View3d>(bench: &'static SharedBench<V>) -> BenchGuard<V> {
    let open = || Mutex::new(Bench { gpu: GPU.clone(), renderer: Renderer::new(&GPU).unwrap() });
    BenchGuard(bench.get_or_init(open).lock().unwrap_or_else(PoisonError::into_inner))
}

impl<V: View3d> Deref for BenchGuard<V> {
    type Target = Bench<V>;

    fn deref(&self) -> &Bench<V> {
        &self.0
    }
}

impl<V: View3d> DerefMut for BenchGuard<V> {
    fn deref_mut(&mut self) -> &mut Bench<V> {
        &mut self.0
    }
}

/// Lavapipe can crash when a process exits while it still works.
impl<V: View3d> Drop for BenchGuard<V> {
    fn drop(&mut self) {
        let _ = self.0.gpu.wait();
    }
}

/// Whether tests are requested to run on a GPU.
pub fn tests_want_a_card() -> bool {
    std::env::var("GLIOSCOPE_TEST_ADAPTER").is_ok_and(|adapter| adapter == "real")
}

/// A device whose buffers hold at most `bytes`.
pub fn small_device(bytes: u64) -> Gpu {
    let adapter = GPU.adapter.clone();
    let mut descriptor = device_descriptor(&adapter);
    descriptor.required_limits.max_storage_buffer_binding_size = bytes;
    descriptor.required_limits.max_buffer_size = bytes;
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    Gpu::from_parts(adapter, device, queue)
}

/// Region volume of masks given by a function of mask number and voxel position.
pub fn volume(
    grid: &Grid,
    masks: usize,
    active: impl Fn(usize, [usize; 3]) -> bool,
) -> Option<Arc<RegionVolume>> {
    let dims = grid.dims();
    let masks: Vec<Mask> = (0..masks)
        .map(|k| {
            let bits = MaskBits::from_fn(dims, |l| active(k, ijk(dims, l)));
            Mask::new(format!("m{k}"), grid.clone(), bits).unwrap()
        })
        .collect();
    let index = TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).unwrap();
    let regions = Regions::of(&index);
    RegionVolume::of(&index, &regions).map(Arc::new)
}

/// Deterministic noise in 0..1 at a voxel.
pub fn noise(p: [usize; 3], seed: u32) -> f64 {
    let mut h = (p[0] as u32).wrapping_mul(0x8da6b343)
        ^ (p[1] as u32).wrapping_mul(0xd8163841)
        ^ (p[2] as u32).wrapping_mul(0xcb1ab31f)
        ^ seed.wrapping_mul(0x9e3779b9);
    h = (h ^ h >> 16).wrapping_mul(0x7feb352d);
    h = (h ^ h >> 15).wrapping_mul(0x846ca68b);
    f64::from(h ^ h >> 16) / f64::from(u32::MAX)
}

/// Smooth noise with features of about `cell` voxels.
fn smooth_noise(p: [usize; 3], cell: usize, seed: u32) -> f64 {
    let base = p.map(|v| v / cell);
    let f = p.map(|v| (v % cell) as f64 / cell as f64);
    let mut sum = 0.0;
    for corner in 0..8 {
        let at: [usize; 3] = std::array::from_fn(|a| base[a] + (corner >> a & 1));
        let w: f64 = (0..3).map(|a| if corner >> a & 1 == 1 { f[a] } else { 1.0 - f[a] }).product();
        sum += w * noise(at, seed);
    }
    sum
}

/// Three overlapping ellipsoids with irregular borders, like T1, T2 and PET masks of a glioma.
pub fn blobs(n: usize, spacing_mm: DVec3) -> Arc<RegionVolume> {
    let origin = -spacing_mm * (n as f64 / 2.0);
    let grid = Grid::axis_aligned([n; 3], spacing_mm, origin).unwrap();
    let shapes = [
        (DVec3::new(-0.08, 0.02, 0.02), DVec3::new(0.24, 0.30, 0.25)),
        (DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.46, 0.40, 0.36)),
        (DVec3::new(0.12, -0.06, 0.08), DVec3::new(0.26, 0.24, 0.27)),
    ];
    volume(&grid, 3, |k, p| {
        let (center, radii) = shapes[k];
        let at = DVec3::new(p[0] as f64, p[1] as f64, p[2] as f64) / n as f64 - 0.5;
        let r = ((at - center) / radii).length();
        let seed = k as u32 + 1;
        let fray = (smooth_noise(p, n / 6 + 1, seed) - 0.5) * 0.7
            + (smooth_noise(p, 5, seed + 9) - 0.5) * 0.22
            + (noise(p, seed + 20) - 0.5) * 0.06;
        r + fray < 0.95
    })
    .unwrap()
}

/// A scene of a volume, viewed slightly from above, with a lens of `lens_fraction` of its size.
pub fn scene_of(tumor: Arc<RegionVolume>, masks: usize, lens_fraction: Option<f64>) -> RegionScene {
    let center_mm = tumor.grid().center_mm();
    let radius_mm = tumor.grid().corners_mm()[0].distance(center_mm) * 0.8;
    RegionScene {
        tumor: Some(tumor),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &vec![None; masks]),
        lens: lens_fraction.map(|f| Lens { center_mm, radius_mm: radius_mm * f }),
        camera: Camera::fit(center_mm, radius_mm, Camera::orientation(35.0, 20.0), Projection::Perspective),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
        plane: None,
    }
}

/// Small blobs with a lens.
pub fn balls_scene() -> RegionScene {
    scene_of(blobs(40, DVec3::ONE), 3, Some(0.5))
}

/// A grid with a matrix and an origin.
pub fn grid(dims: [usize; 3], matrix: DMat3, origin_mm: DVec3) -> Grid {
    Grid::new(dims, DAffine3 { matrix3: matrix, translation: origin_mm }, Sides::Known).unwrap()
}
