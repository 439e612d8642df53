//! Layers of light among solids on the CPU in `f64`: the twin of the pass.

use glioscope_core::optics::Sight;

use super::LayerPlan;
use crate::light::kernel::Kernel;

/// Light at each pixel of `depths_mm` (view depths from the eye, infinite on the background), past the surfaces that
/// `counts` says; rows from the top.
pub fn layers(
    plan: &LayerPlan,
    sight: &Sight,
    depths_mm: &[f64],
    counts: impl Fn(usize) -> bool,
) -> Vec<f64> {
    let [width, height] = sight.size.map(|s| s as usize);
    let [across, down] = plan.cells.map(|c| c as usize);
    let side = plan.side as usize;
    let range = |at: usize, depth: f64| depth * sight.slant([(at % width) as u32, (at / width) as u32]);
    let mut cover = vec![vec![0.0; across * down]; plan.kernels.len()];
    for (at, depth) in depths_mm.iter().enumerate().filter(|(at, d)| d.is_finite() && counts(*at)) {
        let behind = range(at, *depth) + plan.lag_mm - plan.near_mm;
        let layer = (behind / plan.slice_mm - 0.5).floor().max(0.0) as usize;
        let cell = (at / width / side) * across + at % width / side;
        if let Some(cells) = cover.get_mut(layer) {
            cells[cell] += 1.0;
        }
    }
    let mut planes = vec![vec![1.0; across * down]];
    for (layer, kernel) in plan.kernels.iter().enumerate() {
        let before = &planes[planes.len() - 1];
        let texel = |x: i64, y: i64| {
            before[y.clamp(0, down as i64 - 1) as usize * across + x.clamp(0, across as i64 - 1) as usize]
        };
        let Kernel::Lattice { side: points, stride_px, center } = *kernel else {
            unreachable!("lattices only")
        };
        let offset = |i: i64| i * i64::from(stride_px) - (i64::from(points) - 1) * i64::from(stride_px) / 2;
        let light = (0..across * down).map(|cell| {
            let (x, y) = ((cell % across) as i64, (cell / across) as i64);
            let square = (0..i64::from(points)).flat_map(|j| (0..i64::from(points)).map(move |i| (i, j)));
            let sum: f64 = square.map(|(i, j)| texel(x + offset(i), y + offset(j))).sum();
            let spread = center * texel(x, y) + (1.0 - center) * sum / f64::from(points * points);
            let pixels = |c: i64, size: usize| ((c as usize + 1) * side).min(size) - c as usize * side;
            let before: f64 = (layer.saturating_sub(2)..layer).map(|l| cover[l][cell]).sum();
            let open = (pixels(x, width) * pixels(y, height)) as f64 - before;
            spread * (1.0 - (cover[layer][cell] / open.max(1.0)).min(1.0))
        });
        planes.push(light.collect());
    }
    let at_pixel = |(at, depth): (usize, &f64)| {
        if !depth.is_finite() {
            return 1.0;
        }
        let cell = |pixel: usize, count: usize| {
            ((pixel as f64 + 0.5) / side as f64 - 0.5).clamp(0.0, count as f64 - 1.0)
        };
        let (x, y) = (cell(at % width, across), cell(at / width, down));
        let k = ((range(at, *depth) - plan.near_mm) / plan.slice_mm).clamp(0.0, plan.kernels.len() as f64);
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = [0; 3];
            for (a, (value, most)) in
                [(x, across - 1), (y, down - 1), (k, plan.kernels.len())].into_iter().enumerate()
            {
                let up = corner >> a & 1;
                weight *= if up == 1 { value.fract() } else { 1.0 - value.fract() };
                index[a] = (value as usize + up).min(most);
            }
            sum += weight * planes[index[2]][index[1] * across + index[0]];
        }
        sum
    };
    depths_mm.iter().enumerate().map(at_pixel).collect()
}
