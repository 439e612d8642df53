//! Writes pictures and numbers to files, whole or not at all.

use std::path::Path;

use egui::{ColorImage, Rect};
use glioscope_core::{
    case::Case,
    files::{Inputs, write_whole},
};
use image::{ImageEncoder, codecs::png::PngEncoder};

use crate::{
    error::AppError,
    model::{ExportFormat, Ruler, rulers},
};

/// Writes `bytes` to `path`, unless that is one of the case's `inputs`.
///
/// # Errors
/// [`AppError`] naming the file.
pub fn write(path: &Path, inputs: &Inputs, bytes: &[u8]) -> Result<(), AppError> {
    inputs.refuse_as_output(path)?;
    Ok(write_whole(path, bytes)?)
}

/// Refuses one of the `inputs` as an output, under whatever name, a file that exists where not `forced`, and one in a folder that
/// doesn't exist.
///
/// # Errors
/// [`AppError`] naming the file.
pub fn refuse(path: &Path, inputs: &Inputs, forced: bool) -> Result<(), AppError> {
    inputs.refuse_as_output(path)?;
    if path.exists() && !forced {
        return Err(AppError::file(path, "a file that exists", "a new name, or --force"));
    }
    // Said before what is written takes seconds to make.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        return Err(AppError::file(path, format!("no folder {}", folder.display()), "one that exists"));
    }
    Ok(())
}

/// An RGBA picture as PNG, 8 bits per channel. `place` names it in errors.
///
/// # Errors
/// [`AppError`] where it can't be encoded.
pub fn png(place: &str, size: [u32; 2], rgba: &[u8]) -> Result<Vec<u8>, AppError> {
    let mut bytes = Vec::new();
    let encoded =
        PngEncoder::new(&mut bytes).write_image(rgba, size[0], size[1], image::ExtendedColorType::Rgba8);
    encoded.map_err(|e| {
        AppError::wrong(place, format!("a picture that can't be encoded ({e})"), "one that can")
    })?;
    Ok(bytes)
}

/// Writes an RGBA picture as PNG, 8 bits per channel.
///
/// # Errors
/// As [`write()`].
pub fn write_png(path: &Path, inputs: &Inputs, size: [u32; 2], rgba: &[u8]) -> Result<(), AppError> {
    write(path, inputs, &png(&path.display().to_string(), size, rgba)?)
}

/// Writes a picture of the window as PNG, cropped to `crop` (logical points) where given.
///
/// # Errors
/// As [`write()`].
pub fn write_window_png(
    path: &Path,
    inputs: &Inputs,
    image: &ColorImage,
    crop: Option<Rect>,
    pixels_per_point: f32,
) -> Result<(), AppError> {
    let [width, height] = image.size;
    let to_pixels =
        |points: f32, max: usize| ((points * pixels_per_point).round().max(0.0) as usize).min(max);
    let (x0, y0, x1, y1) = crop.map_or((0, 0, width, height), |r| {
        (
            to_pixels(r.left(), width),
            to_pixels(r.top(), height),
            to_pixels(r.right(), width),
            to_pixels(r.bottom(), height),
        )
    });
    if x1 <= x0 || y1 <= y0 {
        return Err(AppError::file(path, "an empty picture", "one with pixels"));
    }
    let rgba: Vec<u8> = (y0..y1)
        .flat_map(|y| {
            image.pixels[y * width + x0..y * width + x1].iter().flat_map(|c| [c.r(), c.g(), c.b(), 255])
        })
        .collect();
    write_png(path, inputs, [(x1 - x0) as u32, (y1 - y0) as u32], &rgba)
}

fn not_json(error: &serde_json::Error) -> AppError {
    AppError::wrong("the answer", format!("numbers that JSON can't hold ({error})"), "finite ones")
}

/// Numbers as a JSON value.
///
/// # Errors
/// [`AppError`] where JSON can't hold them.
pub fn value(of: &(impl serde::Serialize + ?Sized)) -> Result<serde_json::Value, AppError> {
    serde_json::to_value(of).map_err(|e| not_json(&e))
}

/// Numbers as JSON with line breaks.
///
/// # Errors
/// [`AppError`] where JSON can't hold them.
pub fn json(value: &impl serde::Serialize) -> Result<Vec<u8>, AppError> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|e| not_json(&e))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// Writes `value` as indented JSON.
///
/// # Errors
/// As [`write()`].
pub fn write_json(path: &Path, inputs: &Inputs, value: &impl serde::Serialize) -> Result<(), AppError> {
    write(path, inputs, &json(value)?)
}

/// Writes measured lines in the format given by the extension of `path`.
///
/// # Errors
/// As [`write()`].
pub fn write_rulers(path: &Path, inputs: &Inputs, case: &Case, lines: &[Ruler]) -> Result<(), AppError> {
    match ExportFormat::of(path) {
        Some(ExportFormat::Csv) => write(path, inputs, &rulers::as_csv(case, lines)),
        Some(ExportFormat::Json) => write_json(path, inputs, &rulers::as_json(case, lines)),
        None => {
            let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
            Err(AppError::file(path, format!("the ending \"{extension}\""), ".csv or .json"))
        }
    }
}
