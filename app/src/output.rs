//! Pictures and numbers as files, whole or not at all.

use std::path::Path;

use egui::{ColorImage, Rect};
use glioscope_core::files::write_whole;
use image::{ImageEncoder, codecs::png::PngEncoder};

/// Writes an RGBA picture, 8 bits a channel.
///
/// # Errors
/// One line that names the file.
pub fn write_png(path: &Path, size: [u32; 2], rgba: &[u8]) -> Result<(), String> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(rgba, size[0], size[1], image::ExtendedColorType::Rgba8)
        .map_err(|e| {
            format!("{}: found a picture that can't be encoded ({e}), expected one that can", path.display())
        })?;
    write_whole(path, &bytes).map_err(|e| e.to_string())
}

/// Writes a picture of the window, or the part of it in `crop` (logical points).
///
/// # Errors
/// One line that names the file.
pub fn write_window_png(
    path: &Path,
    image: &ColorImage,
    crop: Option<Rect>,
    pixels_per_point: f32,
) -> Result<(), String> {
    let [width, height] = image.size;
    let clamp = |points: f32, most: usize| ((points * pixels_per_point).round().max(0.0) as usize).min(most);
    let (x0, y0, x1, y1) = crop.map_or((0, 0, width, height), |r| {
        (clamp(r.left(), width), clamp(r.top(), height), clamp(r.right(), width), clamp(r.bottom(), height))
    });
    if x1 <= x0 || y1 <= y0 {
        return Err(format!("{}: found an empty picture, expected one with pixels", path.display()));
    }
    let rgba: Vec<u8> = (y0..y1)
        .flat_map(|y| {
            image.pixels[y * width + x0..y * width + x1].iter().flat_map(|c| [c.r(), c.g(), c.b(), 255])
        })
        .collect();
    write_png(path, [(x1 - x0) as u32, (y1 - y0) as u32], &rgba)
}

/// Writes `value` as indented JSON.
///
/// # Errors
/// One line that names the file.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), String> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|e| {
        format!("{}: found numbers that JSON can't hold ({e}), expected finite ones", path.display())
    })?;
    bytes.push(b'\n');
    write_whole(path, &bytes).map_err(|e| e.to_string())
}
