//! An image from the files of a series.

use std::path::Path;

use rayon::prelude::*;

use super::super::{FileError, Loaded, ReadOptions, printable};
use super::data_set::Unusable;
use super::pixels::{Layout, stored};
use super::scan::{Header, in_file, parsed, read_bytes};
use super::stack::{Candidate, Stack, stacks};
use super::suv::{Activity, Uptake, uptake};
use crate::{Check, Progress, Samples, Scaling, Unit, Volume};

/// The volumes of a series, before their pixels are read.
pub(super) struct Series<'a> {
    /// Files in the order of their paths.
    pub files: Vec<&'a Header>,
    pub stacks: Vec<Stack>,
    /// Findings about the whole series.
    pub checks: Vec<Check>,
    /// What values mean, in PET.
    pub uptake: Option<Uptake>,
    name: String,
}

impl<'a> Series<'a> {
    /// Of files that are images of one series. `name` is what messages call it.
    ///
    /// # Errors
    /// [`FileError::Wrong`] for files without a place, of two patients, or that exclude each other.
    pub fn of(files: Vec<&'a Header>, name: &str) -> Result<Self, FileError> {
        let wrong = |found: String, expected: &str| FileError::wrong(name, found, expected);
        let mut checks = Vec::new();
        let files = without_copies(files, name, &mut checks)?;
        let Some(&first) = files.first() else {
            return Err(wrong("no image".into(), "the files of a series"));
        };
        let patient =
            |header: &Header| (header.identity.patient.id.clone(), header.identity.patient.name.clone());
        if let Some(other) = files.iter().find(|file| patient(file) != patient(first)) {
            let found =
                format!("files of two patients in one series ({} and {})", first.name(), other.name());
            return Err(wrong(found, "one patient"));
        }
        let mut frames = Vec::new();
        for header in &files {
            match &header.image {
                Ok(image) => frames.push((*header, image)),
                Err(unusable) => return Err(in_file(&header.path, unusable)),
            }
        }
        let names: Vec<String> = files.iter().map(|file| base_name(&file.path)).collect();
        let mut candidates = Vec::new();
        for (file, (header, (format, all))) in frames.iter().enumerate() {
            candidates.extend(all.iter().map(|frame| Candidate {
                slice: super::stack::Slice { file, frame: frame.number },
                frame,
                frame_of_reference: &header.identity.frame_of_reference,
                rows: format.rows,
                columns: format.columns,
                name: &names[file],
            }));
        }
        let stacks = stacks(&candidates, name).map_err(|u| FileError::wrong(name, u.found, u.expected))?;
        let activities: Option<Vec<&Activity>> = files.iter().map(|file| file.activity.as_deref()).collect();
        let uptake = activities.map(|files| uptake(&files)).transpose();
        let uptake = uptake.map_err(|found| wrong(found, "one unit"))?;
        Ok(Self { files, stacks, checks, uptake, name: name.to_owned() })
    }

    /// Reads the volume of `options.frame`, the number of a stack.
    ///
    /// # Errors
    /// [`FileError::Wrong`] for slices that aren't equally spaced, and for any defect of pixels.
    pub fn read(&self, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
        let wrong = |unusable: &Unusable| FileError::wrong(&self.name, &unusable.found, &unusable.expected);
        let count = self.stacks.len();
        let Some(stack) = self.stacks.get(options.frame) else {
            let found = Unusable::new(format!("{count} volume(s)"), format!("more than {}", options.frame));
            return Err(wrong(&found));
        };
        let grid = stack.grid().map_err(|unusable| wrong(&unusable))?;
        let mut checks = self.checks.clone();
        checks.extend(stack.step.iter().flat_map(|step| step.checks.clone()));
        let voxels = grid.voxel_count() as u64;
        let values = self.values(stack);
        if voxels.saturating_mul(values.bytes()) > options.max_bytes {
            let found = format!("{} bytes of voxels", voxels.saturating_mul(values.bytes()));
            let expected = format!("at most {} (the limit, which can be raised)", options.max_bytes);
            return Err(FileError::wrong(&self.name, found, expected));
        }
        let (samples, padded) = self.samples(stack, values, progress)?;
        if padded > 0 {
            checks.push(Check::note(
                "dicom-padding",
                format!("{}: {padded} voxels are padding outside the measured field", self.name),
            ));
        }
        let mut scaling = match values {
            Values::Stored { scaling, .. } => scaling,
            Values::Scaled => Scaling::NONE,
        };
        if let Some(uptake) = &self.uptake {
            match uptake.factor {
                Some(factor) => {
                    scaling =
                        Scaling { slope: scaling.slope * factor, intercept: scaling.intercept * factor };
                    checks.push(Check::note("pet-suv", format!("{}: SUVbw, {}", self.name, uptake.how)));
                }
                None => checks.push(Check::warning(
                    "pet-no-suv",
                    format!("{}: no SUVbw, because {}; values are as stored", self.name, uptake.how),
                )),
            }
        }
        let volume = Volume::new(grid, samples, scaling)
            .ok_or_else(|| FileError::wrong(&self.name, "another number of voxels", "those of its slices"))?
            .in_unit(self.unit());
        let origin = self.files.get(stack.slices[0].file).map(|file| file.origin());
        Ok(Loaded { volume, frames: count, checks, origin })
    }

    /// What the values are measured in.
    fn unit(&self) -> Unit {
        let is_suv = self.uptake.as_ref().is_some_and(|uptake| uptake.factor.is_some());
        if is_suv { Unit::SuvBw } else { Unit::Unknown }
    }

    /// How the voxels of `stack` are kept.
    fn values(&self, stack: &Stack) -> Values {
        let mut one: Option<(f64, f64)> = None;
        let (mut is_signed, mut bits, mut is_float) = (false, 0, false);
        for slice in &stack.slices {
            let Ok((format, frames)) = &self.files[slice.file].image else { continue };
            let frame = &frames[slice.frame];
            is_signed |= format.is_signed;
            is_float |= format.is_float;
            bits = bits.max(format.bits_stored);
            let own = (frame.slope, frame.intercept);
            if *one.get_or_insert(own) != own {
                return Values::Scaled;
            }
        }
        let (slope, intercept) = one.unwrap_or((1.0, 0.0));
        // Compressed streams have a sign of their own, so 16 bits without a sign may not hold them.
        let is_compressed = stack.slices.iter().any(|slice| {
            !matches!(
                self.files[slice.file].transfer_syntax.strip_prefix("1.2.840.10008.1.2"),
                Some("" | ".1" | ".2" | ".1.99" | ".1.98" | ".5" | ".8.1")
            )
        });
        let kept = match (is_float || bits > 16, is_signed || is_compressed, bits) {
            (true, ..) => Kept::F32,
            (_, true, 16) if is_compressed => Kept::I32,
            (_, true, _) => Kept::I16,
            (_, false, 0..=8) => Kept::U8,
            (_, false, _) => Kept::U16,
        };
        Values::Stored { kept, scaling: Scaling { slope, intercept } }
    }

    fn samples(
        &self,
        stack: &Stack,
        values: Values,
        progress: &Progress,
    ) -> Result<(Samples, u64), FileError> {
        macro_rules! read {
            ($t:ty, $variant:ident, $convert:expr) => {{
                let (samples, padded) = self.each_slice::<$t>(stack, progress, $convert)?;
                (Samples::$variant(samples), padded)
            }};
        }
        #[allow(clippy::cast_possible_truncation, reason = "bits were checked for each type")]
        Ok(match values {
            Values::Scaled => read!(f32, F32, |stored, slope, intercept| (slope * stored + intercept) as f32),
            Values::Stored { kept: Kept::F32, .. } => read!(f32, F32, |stored, _, _| stored as f32),
            Values::Stored { kept: Kept::U8, .. } => read!(u8, U8, |stored, _, _| stored as u8),
            Values::Stored { kept: Kept::U16, .. } => read!(u16, U16, |stored, _, _| stored as u16),
            Values::Stored { kept: Kept::I16, .. } => read!(i16, I16, |stored, _, _| stored as i16),
            Values::Stored { kept: Kept::I32, .. } => read!(i32, I32, |stored, _, _| stored as i32),
        })
    }

    /// Reads each slice in place, and counts padding. Files are read in parallel, each once.
    fn each_slice<T: Copy + Default + Send + Sync>(
        &self,
        stack: &Stack,
        progress: &Progress,
        convert: impl Fn(f64, f64, f64) -> T + Sync,
    ) -> Result<(Vec<T>, u64), FileError> {
        let [columns, rows, count] = stack.dims;
        let pixels = columns * rows;
        let mut voxels = Vec::new();
        voxels.try_reserve_exact(pixels * count).map_err(|_| {
            FileError::wrong(
                &self.name,
                format!("{columns} × {rows} × {count} voxels"),
                "no more than fit in memory",
            )
        })?;
        // In parallel: most of its time is the system's, which gives memory page by page.
        voxels.par_extend(rayon::iter::repeat_n(T::default(), pixels * count));
        let mut by_file: Vec<Vec<(usize, &mut [T])>> = self.files.iter().map(|_| Vec::new()).collect();
        for (slice, out) in stack.slices.iter().zip(voxels.chunks_exact_mut(pixels)) {
            by_file[slice.file].push((slice.frame, out));
        }
        let jobs: Vec<_> =
            self.files.iter().copied().zip(by_file).filter(|(_, slices)| !slices.is_empty()).collect();
        progress.expect(jobs.iter().map(|(header, _)| header.file_bytes).sum());
        let padded: Result<Vec<u64>, FileError> = jobs
            .into_par_iter()
            .map(|(header, slices)| {
                progress.check()?;
                let bytes = read_bytes(&header.path)?;
                let parsed = parsed(&header.path, &bytes)?;
                let in_header = |unusable: Unusable| in_file(&header.path, &unusable);
                let (format, frames) = header.image.as_ref().map_err(|u| in_file(&header.path, u))?;
                let layout = Layout::of(&parsed, format).map_err(in_header)?;
                // Frames of one file are decoded one after the other where files are many.
                let decode = |(number, out): (usize, &mut [T])| {
                    progress.check()?;
                    let frame = &frames[number];
                    let mut padded = 0;
                    let numbers = stored(&parsed, &layout, format, number).map_err(in_header)?;
                    numbers.fill(out, |value| convert(value, frame.slope, frame.intercept));
                    if let Some((low, high)) = header.padding {
                        numbers.for_each(|_, value| padded += u64::from((low..=high).contains(&value)));
                    }
                    Ok(padded)
                };
                let counts: Result<Vec<u64>, FileError> = slices.into_par_iter().map(decode).collect();
                progress.advance(header.file_bytes)?;
                Ok(counts?.into_iter().sum::<u64>())
            })
            .collect();
        Ok((voxels, padded?.into_iter().sum()))
    }
}

/// How voxels are kept in memory.
#[derive(Clone, Copy)]
enum Values {
    /// As stored, with one scaling.
    Stored { kept: Kept, scaling: Scaling },
    /// Scaled: slices differ in slope or intercept.
    Scaled,
}

#[derive(Clone, Copy)]
enum Kept {
    U8,
    U16,
    I16,
    I32,
    F32,
}

impl Values {
    fn bytes(self) -> u64 {
        match self {
            Self::Stored { kept: Kept::U8, .. } => 1,
            Self::Stored { kept: Kept::U16 | Kept::I16, .. } => 2,
            Self::Stored { kept: Kept::I32 | Kept::F32, .. } | Self::Scaled => 4,
        }
    }
}

/// The files without those that are byte for byte copies of another instance.
fn without_copies<'a>(
    files: Vec<&'a Header>,
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<Vec<&'a Header>, FileError> {
    let mut sorted: Vec<&Header> = files.clone();
    sorted.sort_by(|a, b| a.identity.sop_instance.cmp(&b.identity.sop_instance));
    let mut copies: Vec<&Path> = Vec::new();
    for same in sorted.chunk_by(|a, b| a.identity.sop_instance == b.identity.sop_instance) {
        if same.len() < 2 || same[0].identity.sop_instance.is_empty() {
            continue;
        }
        let first = read_bytes(&same[0].path)?;
        for other in &same[1..] {
            if read_bytes(&other.path)? != first {
                let found = format!(
                    "{} and {} with one SOP Instance UID and other content",
                    base_name(&same[0].path),
                    base_name(&other.path)
                );
                return Err(FileError::wrong(name, found, "one file per instance"));
            }
            copies.push(&other.path);
        }
    }
    if !copies.is_empty() {
        let names: Vec<String> = copies.iter().map(|path| base_name(path)).collect();
        let names = crate::check::listed(&names, 3);
        checks.push(Check::warning(
            "dicom-copies",
            format!("{name}: {names}: copies of other files, left out"),
        ));
    }
    Ok(files.into_iter().filter(|file| !copies.contains(&file.path.as_path())).collect())
}

/// A file's name without its folder, for messages.
pub(super) fn base_name(path: &Path) -> String {
    printable(&path.file_name().unwrap_or(path.as_os_str()).to_string_lossy())
}
