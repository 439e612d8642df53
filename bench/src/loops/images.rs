//! Times to read images: a file, or a folder with one DICOM series.

use std::path::PathBuf;

use clap::Args;
use glioscope_core::{
    Progress,
    files::{self, Part, ReadOptions, Source, Which},
};

use crate::{
    Outcome,
    clock::{minimum, peak_bytes, repeated, reset_peak},
    print_line,
};

/// Arguments of the benchmark.
#[derive(Debug, Args)]
pub struct ImagesArguments {
    /// Images: files, or folders with one DICOM series each.
    #[arg(required = true)]
    images: Vec<PathBuf>,
}

/// Prints the time, the peak of memory and the sum of the voxels, which tells whether another program read the same.
///
/// # Errors
/// When an image can't be read.
pub fn run(arguments: &ImagesArguments) -> Outcome<()> {
    let (options, progress) = (ReadOptions::default(), Progress::new());
    for path in &arguments.images {
        let source = if path.is_dir() {
            Source::Part(Part { path: path.clone(), series: None, which: Which::Frame(0) })
        } else {
            Source::File(path.clone())
        };
        reset_peak();
        let (times, loaded) = repeated(5, || files::read(&source, &options, &progress))?;
        let volume = &loaded.volume;
        let sum: f64 = (0..volume.samples().len()).map(|at| volume.value(at)).sum();
        let megabytes = peak_bytes().unwrap_or_default() as f64 / 1e6;
        print_line(format!(
            "{}: {:?} in {:.1} ms (minimum of 5), peak {megabytes:.0} MB, sum {sum:.0}",
            path.display(),
            volume.grid().dims(),
            minimum(&times),
        ))?;
    }
    Ok(())
}
