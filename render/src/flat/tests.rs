//! Whole slices compared with closed forms.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, Mask, MaskBits, Samples, Scaling, Selection, Sides, TumorIndex, Volume, grid::ijk,
};

use crate::{
    flat::*,
    scene::{MaskColors, Palette},
};

const STYLE: SliceStyle = SliceStyle::DARK;

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

fn pixels(image: &SliceImage) -> impl Iterator<Item = (DVec2, [u8; 4])> + '_ {
    let width = image.size[0] as usize;
    image.rgba.chunks_exact(4).enumerate().map(move |(i, p)| {
        let at = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        (at, [p[0], p[1], p[2], p[3]])
    })
}

fn image_only(view: &SliceView, image: &PreparedContext, window: Window) -> SliceImage {
    let context = Some(ContextLayer { image, window });
    render_slice(view, &SliceLayers { context, second: None, masks: None, style: STYLE })
}

fn mask_layer<'a>(
    index: &'a TumorIndex,
    colors: &'a MaskColors,
    selection: &'a Selection,
    overlay: Overlay,
) -> MaskLayer<'a> {
    MaskLayer {
        index,
        colors,
        selection,
        overlay,
        opacity: 1.0,
        outline_px: 1,
        outline_patterns: false,
        unfilled: None,
        counted: u32::MAX,
    }
}

fn masks_only(view: &SliceView, masks: MaskLayer<'_>) -> SliceImage {
    render_slice(view, &SliceLayers { context: None, second: None, masks: Some(masks), style: STYLE })
}

fn index_of(grid: &Grid, masks: &[&dyn Fn(DVec3) -> bool]) -> TumorIndex {
    let dims = grid.dims();
    let made: Vec<Mask> = masks
        .iter()
        .map(|inside| {
            let bits = MaskBits::from_fn(dims, |l| inside(grid.center_of_voxel_mm(ijk(dims, l))));
            Mask::new("m", grid.clone(), bits).unwrap()
        })
        .collect();
    TumorIndex::new(grid.clone(), &made.iter().collect::<Vec<_>>()).unwrap()
}

/// Oblique, sheared, flipped and far from the origin, one at a time and all together.
fn difficult_grids() -> Vec<Grid> {
    let rotation = DMat3::from_rotation_z(0.6) * DMat3::from_rotation_x(-0.4) * DMat3::from_rotation_y(0.25);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::new(-0.2, 0.25, 1.0));
    let thick = DMat3::from_diagonal(DVec3::new(0.9, 1.3, 3.0));
    let flip = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let swap = DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y);
    let far = DVec3::new(1e6, -1e6, 1e6);
    [
        (thick, DVec3::ZERO),
        (rotation * thick, DVec3::new(-20.0, 5.0, 3.0)),
        (shear * thick, DVec3::ZERO),
        (flip * thick, DVec3::ZERO),
        (thick, far),
        (rotation * shear * flip * swap * thick, far),
    ]
    .map(|(matrix3, translation)| {
        Grid::new([31, 24, 13], DAffine3 { matrix3, translation }, Sides::Known).unwrap()
    })
    .to_vec()
}

#[test]
fn slices_of_a_linear_image_are_exact_on_every_grid() {
    let gradient = DVec3::new(2.0, -3.0, 5.0);
    for (n, grid) in difficult_grids().into_iter().enumerate() {
        let middle = grid.center_mm();
        let value = |world: DVec3| gradient.dot(world - middle) + 40.0;
        let dims = grid.dims();
        let stored = (0..grid.voxel_count())
            .map(|l| value(grid.center_of_voxel_mm(ijk(dims, l))))
            .map(|v| (v - 1000.0) / 0.5)
            .collect();
        let scaling = Scaling { slope: 0.5, intercept: 1000.0 };
        let volume = Volume::new(grid.clone(), Samples::F64(stored), scaling).unwrap();
        let image = PreparedContext::new(Arc::new(volume));
        for plane in Plane::ALL {
            for convention in [Convention::Radiological, Convention::Neurological] {
                let off = DVec3::new(1.3, -0.7, 0.9);
                let view = SliceView {
                    turn: DMat3::IDENTITY,
                    plane,
                    center_mm: middle + off,
                    mm_per_pixel: 0.7312,
                    size_px: [90, 80],
                    convention,
                };
                let (mut compared, mut outside) = (0, 0);
                for level in [-20.0, 40.0, 90.0] {
                    let window = Window::of_level(level, 51.0);
                    let slice = image_only(&view, &image, window);
                    for (at, color) in pixels(&slice) {
                        let world = view.world_at(at);
                        let voxel = grid.voxel_from_world().transform_point3(world);
                        if grid.voxel_at(world).is_none() {
                            assert_eq!(color, opaque(STYLE.outside), "{n} {plane:?} {at}");
                            outside += 1;
                        } else if (0..3).all(|a| voxel[a] >= 0.0 && voxel[a] <= (dims[a] - 1) as f64) {
                            let exact =
                                ((value(world) - window.low) / window.width() * 255.0).clamp(0.0, 255.0);
                            let error = (f64::from(color[0]) - exact).abs();
                            // Half a grey of rounding, and 31 greys per mm times the 5e-5 mm by which a
                            // grid's position is rounded.
                            assert!(error <= 0.502, "{n} {plane:?} {at}: {color:?}, expected {exact}");
                            assert!(color[0] == color[1] && color[1] == color[2] && color[3] == 255);
                            compared += 1;
                        }
                    }
                }
                assert!(compared > 1000 && outside > 1000, "{n} {plane:?}: {compared} {outside}");
            }
        }
    }
}

#[test]
fn the_filled_area_equals_the_mask_s_cross_section() {
    let grid = Grid::axis_aligned([40, 30, 20], DVec3::new(1.0, 2.0, 3.0), DVec3::splat(-15.0)).unwrap();
    // Voxels whose cells make up exactly this box.
    let (lo, hi) = (DVec3::new(-5.5, -4.0, 4.5), DVec3::new(12.5, 20.0, 28.5));
    let inside = |w: DVec3| w.cmpgt(lo).all() && w.cmplt(hi).all();
    let index = index_of(&grid, &[&inside]);
    let colors = MaskColors::new(Palette::Thesis, &[None]);
    for plane in Plane::ALL {
        let view = SliceView {
            turn: DMat3::IDENTITY,
            plane,
            center_mm: DVec3::new(1.1, 6.1, 13.1),
            mm_per_pixel: 0.25,
            size_px: [301, 281],
            convention: Convention::Radiological,
        };
        let selection = Selection::all();
        let slice = masks_only(&view, mask_layer(&index, &colors, &selection, Overlay::Fill));
        let red = pixels(&slice).filter(|p| p.1 == [255, 0, 0, 255]).count();
        let empty = pixels(&slice).filter(|p| p.1 == opaque(STYLE.outside)).count();
        let size = hi - lo;
        let area = size.x * size.y * size.z / size[plane.axis()];
        assert_eq!(red as f64 * 0.25 * 0.25, area, "{plane:?}");
        assert_eq!(red + empty, 301 * 281);
    }
}

#[test]
fn masks_on_difficult_grids_are_at_their_world_position() {
    for grid in difficult_grids() {
        let middle = grid.center_mm();
        let inside = |w: DVec3| (w - middle).length() < 9.0 && (w - middle).x > -3.0;
        let index = index_of(&grid, &[&inside]);
        let colors = MaskColors::new(Palette::Thesis, &[None]);
        let selection = Selection::all();
        for plane in Plane::ALL {
            let view = SliceView {
                turn: DMat3::IDENTITY,
                plane,
                center_mm: middle + DVec3::new(0.37, 0.23, -0.41),
                mm_per_pixel: 0.6137,
                size_px: [64, 50],
                convention: Convention::Radiological,
            };
            let slice = masks_only(&view, mask_layer(&index, &colors, &selection, Overlay::Fill));
            let mut active = 0;
            for (at, color) in pixels(&slice) {
                let expected = index.at_mm(view.world_at(at)) == 1;
                assert_eq!(color == [255, 0, 0, 255], expected, "{plane:?} {at}");
                active += usize::from(expected);
            }
            assert!(active > 100);
        }
    }
}

/// The same voxels in memory order `order` (which RAS axis each voxel axis runs along), flipped along the
/// axes in `flips`, with the affine that keeps every voxel at its world position.
fn stored_as(order: [usize; 3], flips: [bool; 3], value: &dyn Fn([usize; 3]) -> i16) -> (Volume, TumorIndex) {
    const RAS_DIMS: [usize; 3] = [17, 14, 11];
    let spacing = DVec3::new(0.93, 1.1, 2.3);
    let origin = DVec3::new(-7.35, -8.0, 4.7);
    let dims = order.map(|axis| RAS_DIMS[axis]);
    let mut columns = [DVec3::ZERO; 3];
    let mut translation = origin;
    for (a, &axis) in order.iter().enumerate() {
        columns[a][axis] = if flips[a] { -spacing[axis] } else { spacing[axis] };
        if flips[a] {
            translation[axis] += spacing[axis] * (RAS_DIMS[axis] - 1) as f64;
        }
    }
    let matrix3 = DMat3::from_cols(columns[0], columns[1], columns[2]);
    let grid = Grid::new(dims, DAffine3 { matrix3, translation }, Sides::Known).unwrap();
    let ras_of = |l: usize| {
        let ijk = ijk(dims, l);
        let mut ras = [0; 3];
        for a in 0..3 {
            ras[order[a]] = if flips[a] { dims[a] - 1 - ijk[a] } else { ijk[a] };
        }
        ras
    };
    let values: Vec<i16> = (0..grid.voxel_count()).map(|l| value(ras_of(l))).collect();
    let masks: Vec<Mask> = [600, 300]
        .map(|above| {
            let bits = MaskBits::from_fn(dims, |l| values[l] > above);
            Mask::new("m", grid.clone(), bits).unwrap()
        })
        .to_vec();
    let index = TumorIndex::new(grid.clone(), &[&masks[0], &masks[1]]).unwrap();
    (Volume::new(grid, Samples::I16(values), Scaling::NONE).unwrap(), index)
}

#[test]
fn all_48_axis_orders_give_the_same_bytes() {
    let value = |[x, y, z]: [usize; 3]| ((x * 7919 + y * 104_729 + z * 1_299_709) % 1000) as i16;
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let colors = MaskColors::new(Palette::Thesis, &[None, None]);
    let selection = Selection::all();
    let mut first: Vec<SliceImage> = Vec::new();
    for order in orders {
        for flip in 0..8 {
            let flips = [flip & 1 == 1, flip & 2 == 2, flip & 4 == 4];
            let (volume, index) = stored_as(order, flips, &value);
            let image = PreparedContext::new(Arc::new(volume));
            let mut slices = Vec::new();
            for plane in Plane::ALL {
                for convention in [Convention::Radiological, Convention::Neurological] {
                    let center_mm = DVec3::new(0.4, -0.3, 15.0);
                    let view = SliceView {
                        turn: DMat3::IDENTITY,
                        plane,
                        center_mm,
                        mm_per_pixel: 0.31,
                        size_px: [80, 70],
                        convention,
                    };
                    let context =
                        Some(ContextLayer { image: &image, window: image.histogram().initial_window() });
                    let masks =
                        MaskLayer { opacity: 0.4, ..mask_layer(&index, &colors, &selection, Overlay::Both) };
                    slices.push(render_slice(
                        &view,
                        &SliceLayers { context, second: None, masks: Some(masks), style: STYLE },
                    ));
                }
            }
            if first.is_empty() {
                first = slices;
            } else {
                assert!(first == slices, "{order:?} {flips:?} differ");
            }
        }
    }
    assert!(first[0] != first[1], "the conventions mirror the axial slice");
    assert!(first[4] == first[5], "and don't change the sagittal one");
}

#[test]
fn a_marker_on_the_left_is_at_the_letter_l() {
    let marker = |[x, y, z]: [usize; 3]| if [x, y, z] == [1, 11, 9] { 1000 } else { 0 };
    // x = 1 of 17 is on the left, y = 11 of 14 anterior, z = 9 of 11 superior.
    for (order, flips) in [([0, 1, 2], [false; 3]), ([1, 2, 0], [true, false, true]), ([2, 0, 1], [true; 3])]
    {
        let (volume, _) = stored_as(order, flips, &marker);
        let grid = volume.grid().clone();
        let image = PreparedContext::new(Arc::new(volume));
        let ijk = (0..grid.voxel_count())
            .find(|&l| image.volume().value(l) > 0.0)
            .map(|l| {
                [l % grid.dims()[0], l / grid.dims()[0] % grid.dims()[1], l / grid.dims()[0] / grid.dims()[1]]
            })
            .unwrap();
        for plane in Plane::ALL {
            for convention in [Convention::Radiological, Convention::Neurological] {
                let through = grid.center_of_voxel_mm(ijk);
                let view = SliceView::fit(plane, convention, grid.bounds_mm(), through, [100, 100]);
                let slice = image_only(&view, &image, Window { low: 0.0, high: 1000.0 });
                let (at, _) = pixels(&slice)
                    .filter(|p| p.1[0] == p.1[1] && p.1[1] == p.1[2])
                    .max_by_key(|p| p.1[0])
                    .unwrap();
                let [left, right, top, bottom] = view.letters();
                for (near, letter, other) in
                    [(at.x < 50.0, left, right), (at.x > 50.0, right, left), (at.y < 50.0, top, bottom)]
                {
                    let on_side = ['L', 'A', 'S'].contains(&letter);
                    assert_ne!(on_side, ['L', 'A', 'S'].contains(&other));
                    assert_eq!(near, on_side, "{plane:?} {convention:?} {at} {letter}");
                }
            }
        }
    }
}

#[test]
fn non_finite_voxels_have_their_own_colour_and_do_not_spread() {
    let grid = Grid::axis_aligned([9, 9, 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let mut values = vec![100.0f32; 243];
    values[grid.linear([4, 4, 1])] = f32::NAN;
    values[grid.linear([2, 6, 1])] = f32::NEG_INFINITY;
    let image = PreparedContext::new(Arc::new(
        Volume::new(grid.clone(), Samples::F32(values), Scaling::NONE).unwrap(),
    ));
    assert_eq!(image.histogram().not_finite(), 2);
    let view = SliceView {
        turn: DMat3::IDENTITY,
        plane: Plane::Axial,
        center_mm: DVec3::new(4.0, 4.0, 1.2),
        mm_per_pixel: 0.1,
        size_px: [100, 100],
        convention: Convention::Neurological,
    };
    let slice = image_only(&view, &image, Window { low: 0.0, high: 255.0 });
    assert_eq!(slice.not_finite_pixels, 200, "two voxels of 10 by 10 pixels");
    for (at, color) in pixels(&slice) {
        let expected = match grid.voxel_at(view.world_at(at)) {
            None => STYLE.outside,
            Some([4, 4, _] | [2, 6, _]) => STYLE.not_finite,
            Some(_) => [100; 3],
        };
        assert_eq!(color, opaque(expected), "{at}");
    }
}

#[test]
fn hidden_regions_are_neither_filled_nor_outlined() {
    let grid = Grid::axis_aligned([30, 30, 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let a = |w: DVec3| w.x < 19.5;
    let b = |w: DVec3| w.x > 9.5;
    let index = index_of(&grid, &[&a, &b]);
    let colors = MaskColors::new(Palette::Thesis, &[None, None]);
    let mut selection = Selection::all();
    selection.set(0b11, false);
    let view = SliceView {
        turn: DMat3::IDENTITY,
        plane: Plane::Axial,
        center_mm: DVec3::new(14.5, 14.5, 1.0),
        mm_per_pixel: 1.0,
        size_px: [30, 30],
        convention: Convention::Neurological,
    };
    let half = MaskLayer { opacity: 0.5, ..mask_layer(&index, &colors, &selection, Overlay::Both) };
    let slice = masks_only(&view, half);
    let [r, g, b] = STYLE.outside;
    let over = |c: [u8; 3]| {
        let mean = |a: u8, b: u8| (f64::midpoint(f64::from(a), f64::from(b)) + 0.5) as u8;
        [mean(r, c[0]), mean(g, c[1]), mean(b, c[2]), 255]
    };
    for (at, color) in pixels(&slice) {
        let expected = match at.x as usize {
            9 => [255, 0, 0, 255],
            20 => [0, 255, 0, 255],
            10..20 => opaque(STYLE.outside),
            0..9 => over([255, 0, 0]),
            _ => over([0, 255, 0]),
        };
        assert_eq!(color, expected, "{at}");
    }
}

/// The other masks leave nothing: neither a colour of the overlap nor an outline.
#[test]
fn masks_that_do_not_count_are_not_drawn() {
    let grid = Grid::axis_aligned([30, 30, 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let first = |w: DVec3| w.x > 4.5 && w.x < 19.5;
    let both = index_of(&grid, &[&first, &|w: DVec3| w.x > 9.5]);
    let alone = index_of(&grid, &[&first]);
    let (colors, selection) = (MaskColors::new(Palette::Thesis, &[None; 2]), Selection::all());
    let view = SliceView {
        turn: DMat3::IDENTITY,
        plane: Plane::Axial,
        center_mm: DVec3::new(14.5, 14.5, 1.0),
        mm_per_pixel: 0.5,
        size_px: [60, 60],
        convention: Convention::Neurological,
    };
    let of = |index, counted| {
        masks_only(&view, MaskLayer { counted, ..mask_layer(index, &colors, &selection, Overlay::Both) }).rgba
    };
    assert!(of(&both, 0b01) == of(&alone, u32::MAX));
    assert!(of(&both, u32::MAX) != of(&alone, u32::MAX));
}

#[test]
fn readouts_are_the_stored_values() {
    let grid = Grid::axis_aligned([4, 4, 4], DVec3::ONE, DVec3::ZERO).unwrap();
    let stored = (0..64).collect();
    let volume =
        Volume::new(grid.clone(), Samples::U8(stored), Scaling { slope: 0.1, intercept: -1.0 }).unwrap();
    let index = index_of(&grid, &[&|w: DVec3| w.x > 1.5, &|w: DVec3| w.y > 1.5]);
    let at = DVec3::new(2.4, 0.6, 2.7);
    let found = readout(at, Some(&volume), Some(&index));
    let linear = (3.0 * 4.0 + 1.0) * 4.0 + 2.0;
    assert_eq!(found, Readout { intensity: Some(0.1 * linear - 1.0), bits: 0b01 });
    let away = readout(DVec3::splat(9.0), Some(&volume), Some(&index));
    assert_eq!(away, Readout { intensity: None, bits: 0 });
    assert_eq!(readout(at, None, None), Readout { intensity: None, bits: 0 });
}

#[test]
fn views_without_an_image_are_empty_or_background() {
    let grid = Grid::axis_aligned([1, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
    let image =
        PreparedContext::new(Arc::new(Volume::new(grid, Samples::U8(vec![9]), Scaling::NONE).unwrap()));
    let mut view = SliceView {
        turn: DMat3::IDENTITY,
        plane: Plane::Axial,
        center_mm: DVec3::ZERO,
        mm_per_pixel: 1.0,
        size_px: [0, 5],
        convention: Convention::Radiological,
    };
    let window = image.histogram().initial_window();
    assert!(image_only(&view, &image, window).rgba.is_empty());
    view.size_px = [3, 3];
    let one = image_only(&view, &image, window);
    assert_eq!(pixels(&one).filter(|p| p.1 != opaque(STYLE.outside)).count(), 1);
    for center_mm in [DVec3::splat(1e300), DVec3::splat(f64::NAN), DVec3::splat(f64::INFINITY)] {
        let away = image_only(&SliceView { center_mm, ..view }, &image, window);
        assert!(pixels(&away).all(|p| p.1 == opaque(STYLE.outside)));
    }
}

#[test]
#[ignore = "measures time: run alone"]
fn a_slice_takes_milliseconds() {
    let grid = Grid::axis_aligned([240, 240, 155], DVec3::ONE, DVec3::ZERO).unwrap();
    let middle = grid.center_mm();
    let values = (0..grid.voxel_count()).map(|l| (l * 7919 % 1000) as i16).collect();
    let image = PreparedContext::new(Arc::new(
        Volume::new(grid.clone(), Samples::I16(values), Scaling::NONE).unwrap(),
    ));
    let ball = |x: f64, r: f64| move |w: DVec3| w.distance(middle + DVec3::X * x) < r;
    let index = index_of(&grid, &[&ball(-10.0, 50.0), &ball(10.0, 45.0), &ball(0.0, 40.0)]);
    let colors = MaskColors::new(Palette::Thesis, &[None; 3]);
    let selection = Selection::all();
    for plane in Plane::ALL {
        let view = SliceView::fit(plane, Convention::Radiological, grid.bounds_mm(), middle, [512, 512]);
        let context = Some(ContextLayer { image: &image, window: Window { low: 0.0, high: 1000.0 } });
        let masks = Some(MaskLayer {
            outline_px: 2,
            outline_patterns: false,
            unfilled: None,
            opacity: 0.4,
            ..mask_layer(&index, &colors, &selection, Overlay::Both)
        });
        let mut times: Vec<f64> = (0..21)
            .map(|_| {
                let start = std::time::Instant::now();
                let slice = render_slice(&view, &SliceLayers { context, second: None, masks, style: STYLE });
                assert_eq!(slice.rgba.len(), 512 * 512 * 4);
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("{}: median {:.2} ms, fastest {:.2} ms", plane.name(), times[10], times[0]);
        assert!(times[10] <= 15.0);
    }
}

/// The folder of real files, or `None` after reporting that the test is skipped.
fn real_data(test: &str) -> Option<std::path::PathBuf> {
    let folder = std::env::var_os("GLIOSCOPE_REAL_DATA").map_or_else(
        || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        std::path::PathBuf::from,
    );
    if folder.is_dir() {
        return Some(folder);
    }
    println!("SKIPPED: {test}: no folder {}; set GLIOSCOPE_REAL_DATA", folder.display());
    None
}

#[test]
fn one_brain_in_48_files_gives_the_same_slices() {
    let Some(folder) = real_data("one_brain_in_48_files_gives_the_same_slices") else { return };
    let mut files: Vec<_> = std::fs::read_dir(folder.join("nifti-orientations"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_string_lossy().ends_with(".nii.gz"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 48);
    let mut first: Vec<SliceImage> = Vec::new();
    for path in files {
        let source = glioscope_core::files::Source::File(path.clone());
        let loaded =
            glioscope_core::files::read(&source, &Default::default(), &glioscope_core::Progress::new())
                .unwrap();
        let image = PreparedContext::new(Arc::new(loaded.volume));
        let grid = image.volume().grid();
        let mut slices = Vec::new();
        for plane in Plane::ALL {
            for convention in [Convention::Radiological, Convention::Neurological] {
                let through = DVec3::new(3.3, -12.7, 8.1);
                let view = SliceView::fit(plane, convention, grid.bounds_mm(), through, [128, 128]);
                slices.push(image_only(&view, &image, image.histogram().initial_window()));
            }
        }
        let varied = pixels(&slices[0]).filter(|p| p.1[0] > 60 && p.1[0] < 200).count();
        assert!(varied > 500, "{}: {varied} pixels of brain", path.display());
        if first.is_empty() {
            first = slices;
        } else {
            assert!(first == slices, "{} differs", path.display());
        }
    }
}
