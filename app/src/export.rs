//! Masks and regions as files of other programs: what the command line and the window share.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use clap::ValueEnum;
use glioscope_core::{
    Check, Grid, Mask, MaskBits, Progress, Samples, Scaling, TumorIndex, Volume,
    case::{Aligned, Case, CaseSpec, TimePoint},
    export::{self, MeshError, NamedMask, NamedMesh, Provenance, SurfaceKind},
    files::{
        self, FileError, FileMark, Inputs, Part, ReadOptions, Source, WriteOptions,
        dicom::{self, SegmentToWrite, SourceImage, WriteTo},
        is_misleading,
    },
    with_samples,
};
use glioscope_render::MaskColors;

use crate::{error::AppError, output};

/// What is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum What {
    /// Each mask.
    Masks,
    /// Each region: the voxels with exactly the same masks.
    Regions,
    /// All selected regions together, as one mask.
    Selection,
}

impl What {
    /// Its word: `masks`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Masks => "masks",
            Self::Regions => "regions",
            Self::Selection => "selection",
        }
    }
}

/// The format of the files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// NIfTI: a mask of 0 and 1, or a label map where several don't overlap.
    Nifti,
    /// Segmentation of 3D Slicer, with names and colours.
    #[value(name = "seg.nrrd")]
    SegNrrd,
    /// DICOM segmentation (SEG), binary, with names and colours.
    DicomSeg,
    /// DICOM structure set (RTSTRUCT): outlines of the voxels on each slice.
    Rtstruct,
    /// Surface as STL.
    Stl,
    /// Surfaces as Wavefront OBJ with names and colours.
    Obj,
    /// Surfaces as binary glTF with names and colours.
    Gltf,
}

impl Format {
    /// Endings of its files, the usual one first.
    fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Nifti => &["nii.gz", "nii"],
            Self::SegNrrd => &["seg.nrrd"],
            Self::DicomSeg | Self::Rtstruct => &["dcm"],
            Self::Stl => &["stl"],
            Self::Obj => &["obj"],
            Self::Gltf => &["glb"],
        }
    }

    /// The format that a file's ending means; of `.dcm` a segmentation.
    pub fn of(path: &Path) -> Option<Self> {
        Self::value_variants().iter().copied().find(|format| format.names(path))
    }

    /// Whether a path ends as its files do.
    fn names(self, path: &Path) -> bool {
        let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
        self.endings().iter().any(|ending| name.ends_with(&format!(".{ending}")))
    }

    /// Whether it holds surfaces.
    pub fn is_surface(self) -> bool {
        matches!(self, Self::Stl | Self::Obj | Self::Gltf)
    }

    /// Whether it is DICOM.
    pub fn is_dicom(self) -> bool {
        matches!(self, Self::DicomSeg | Self::Rtstruct)
    }
}

/// Whether a path that doesn't exist is meant as a file: by an ending of files that are written or read.
fn is_meant_as_file(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Format::of(path).is_some() || files::format::is_volume(&name)
}

/// A mask that is exported.
pub struct Item {
    /// Its name in the file.
    pub name: String,
    /// Its colour, sRGB.
    pub color: [u8; 3],
    /// Its voxels on the case grid.
    pub mask: Mask,
}

/// The masks of a date that are wanted, with what they are called beside their ids.
pub fn masks(
    time_point: &TimePoint,
    colors: &MaskColors,
    name_of: &dyn Fn(&str) -> Option<String>,
    is_wanted: &dyn Fn(&str) -> bool,
) -> Vec<Item> {
    let all = time_point.masks.iter().enumerate().filter(|(_, m)| is_wanted(m.mask.id()));
    all.map(|(n, m)| {
        let id = m.mask.id();
        let name = name_of(id).filter(|name| !name.is_empty());
        let name = name.map_or_else(|| id.to_owned(), |name| format!("{id} {name}"));
        Item { name, color: colors.mask(n), mask: m.mask.clone() }
    })
    .collect()
}

fn of_bits(
    time_point: &TimePoint,
    name: String,
    color: [u8; 3],
    active: &dyn Fn(u32) -> bool,
) -> Option<Item> {
    let index = &time_point.index;
    let bits = MaskBits::from_fn(index.grid().dims(), |linear| active(index.get(linear)));
    Mask::new(name.clone(), index.grid().clone(), bits).map(|mask| Item { name, color, mask })
}

/// Each region that is shown.
pub fn regions(time_point: &TimePoint, colors: &MaskColors, shows: &dyn Fn(u32) -> bool) -> Vec<Item> {
    let regions = &time_point.regions;
    let shown = regions.list().iter().map(|region| region.bits).filter(|bits| shows(*bits));
    shown
        .filter_map(|bits| {
            of_bits(time_point, regions.name(bits), colors.region(bits), &move |at| at == bits)
        })
        .collect()
}

/// All regions that are shown as one mask; none where nothing is.
pub fn selection(time_point: &TimePoint, colors: &MaskColors, shows: &dyn Fn(u32) -> bool) -> Vec<Item> {
    let regions = &time_point.regions;
    let shown: Vec<u32> =
        regions.list().iter().map(|region| region.bits).filter(|bits| shows(*bits)).collect();
    let Some(&first) = shown.first() else { return Vec::new() };
    let name = if shown.len() == regions.list().len() {
        "union of all masks".to_owned()
    } else {
        shown.iter().map(|bits| regions.name(*bits)).collect::<Vec<_>>().join(", ")
    };
    of_bits(time_point, name, colors.region(first), &|at| at != 0 && shows(at)).into_iter().collect()
}

/// Masks, and how they are written.
pub struct Export<'a> {
    /// The case.
    pub case: &'a Case,
    /// Its description.
    pub spec: &'a CaseSpec,
    /// Files that aren't written over.
    pub inputs: Inputs,
    /// The date of the masks.
    pub time_point: &'a TimePoint,
    /// The masks, at least one.
    pub items: Vec<Item>,
    /// What they are of the case, in words.
    pub what: String,
    /// The format.
    pub format: Format,
    /// Whether surfaces are smoothed.
    pub is_smooth: bool,
    /// Whether the output states whose the masks are.
    pub is_identified: bool,
    /// Whether files that exist are written over.
    pub overwrites: bool,
    /// DICOM: the image that the masks belong to.
    pub image: Option<String>,
    /// DICOM: what UIDs are made from.
    pub salt: Option<String>,
}

/// What was written.
#[derive(Debug, Default)]
pub struct Written {
    /// A line about each file.
    pub files: Vec<String>,
    /// What was assumed.
    pub notes: Vec<String>,
    /// Findings.
    pub checks: Vec<Check>,
}

impl Export<'_> {
    /// Writes `out`: a file, or a folder with a file for each mask.
    ///
    /// # Errors
    /// [`AppError`] for a file of the case, for masks that one file can't hold, and where a file can't be written.
    pub fn write(&self, out: &Path, progress: &Progress) -> Result<Written, AppError> {
        if self.items.is_empty() {
            return Err(AppError::file(out, "no mask to write", "at least one"));
        }
        let mut written = Written { notes: self.resampled(), ..Written::default() };
        if self.format.is_dicom() {
            self.write_dicom(out, &mut written, progress)?;
            return Ok(written);
        }
        let provenance = self.provenance(progress)?;
        let all: Vec<&Item> = self.items.iter().collect();
        let is_each_alone = match self.format {
            Format::Stl => self.items.len() > 1,
            Format::Nifti => overlap(&all),
            _ => false,
        };
        let ending = self.format.endings()[0];
        if self.format.names(out) {
            if is_each_alone {
                let found = format!("{} masks that one file can't hold", self.items.len());
                return Err(AppError::file(out, found, "a folder, for a file of each"));
            }
            self.write_file(out, &all, &provenance, &mut written, progress)?;
            written.files.push(self.line(out));
            return Ok(written);
        }
        // A device, too.
        let is_file = if out.exists() { !out.is_dir() } else { is_meant_as_file(out) };
        if is_file {
            let expected = format!("a name that ends in .{ending}, or a folder");
            return Err(AppError::file(out, "a file of another kind", expected));
        }
        std::fs::create_dir_all(out)
            .map_err(|e| AppError::file(out, e.to_string(), "a folder that can be made"))?;
        let mut taken = HashSet::new();
        let paths = self.items.iter().enumerate().map(|(n, item)| {
            let name = file_name(&item.name, n);
            // Names that differ in what a file's name can't hold; where capitals are one, too.
            let numbered = (2..).map(|n| format!("{name} {n}"));
            let mut names = std::iter::once(name.clone()).chain(numbered);
            let name = names.find(|name| taken.insert(name.to_lowercase())).unwrap_or(name.clone());
            out.join(format!("{name}.{ending}"))
        });
        let paths: Vec<PathBuf> = paths.collect();
        // Before the first is written: a folder half full helps nobody.
        paths.iter().try_for_each(|path| self.refuse(path))?;
        for (item, path) in self.items.iter().zip(paths) {
            self.write_file(&path, &[item], &provenance, &mut written, progress)?;
            written.files.push(format!("{}: {}", path.display(), item.name));
        }
        Ok(written)
    }

    /// Refuses files of the case, and others that exist: they may be another series, or another reader's work.
    fn refuse(&self, path: &Path) -> Result<(), AppError> {
        output::refuse(path, &self.inputs, self.overwrites)
    }

    fn line(&self, out: &Path) -> String {
        let names: Vec<&str> = self.items.iter().map(|item| item.name.as_str()).collect();
        format!("{}: {}", out.display(), names.join(", "))
    }

    /// Which masks aren't written as their files hold them.
    fn resampled(&self) -> Vec<String> {
        let grid = self.time_point.index.grid();
        let is_written = |id: &str| self.items.iter().any(|item| item.mask.id() == id);
        let masks = self.time_point.masks.iter().filter(|m| is_written(m.mask.id()));
        masks
            .filter(|m| !m.native_grid.same_place(grid, 1e-3))
            .map(|m| {
                let (id, here, own) = (m.mask.id(), m.mask.voxels(), m.native_voxels);
                format!("{id}: written on the case grid ({here} voxels), not on its file's ({own} voxels)")
            })
            .collect()
    }

    fn provenance(&self, progress: &Progress) -> Result<Provenance, AppError> {
        let marks = FileMark::of_all(self.case.inputs.paths(), progress)?;
        let line = |mark: &FileMark| {
            let name =
                mark.file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            if self.is_identified { format!("{name} {}", mark.hash) } else { mark.hash.clone() }
        };
        Ok(Provenance { inputs: marks.iter().map(line).collect(), selection: self.what.clone() })
    }

    fn write_file(
        &self,
        path: &Path,
        items: &[&Item],
        provenance: &Provenance,
        written: &mut Written,
        progress: &Progress,
    ) -> Result<(), AppError> {
        self.refuse(path)?;
        match self.format {
            Format::Nifti => write_nifti(path, items),
            Format::SegNrrd => {
                let masks: Vec<NamedMask<'_>> = items
                    .iter()
                    .map(|item| NamedMask { name: &item.name, color: item.color, mask: &item.mask })
                    .collect();
                let verify = |path: &Path| read_back(path, items, progress);
                Ok(export::write_seg_nrrd(path, &masks, provenance, progress, verify)?)
            }
            _ => self.write_surfaces(path, items, provenance, written, progress),
        }
    }

    fn write_surfaces(
        &self,
        path: &Path,
        items: &[&Item],
        provenance: &Provenance,
        written: &mut Written,
        progress: &Progress,
    ) -> Result<(), AppError> {
        let kind = if self.is_smooth { SurfaceKind::Smoothed } else { SurfaceKind::VoxelFaces };
        let mut meshes = Vec::new();
        for item in items {
            match export::mesh(&item.mask, kind, progress) {
                Ok(mesh) => meshes.push((item, mesh)),
                Err(MeshError::Empty) => {
                    written.notes.push(format!("{}: empty, so it has no surface", item.name));
                }
                Err(MeshError::Cancelled(cancelled)) => return Err(cancelled.into()),
                Err(error) => {
                    return Err(AppError::file(path, format!("{}: {error}", item.name), "a smaller mask"));
                }
            }
        }
        if let (Format::Stl, [(_, mesh)]) = (self.format, meshes.as_slice()) {
            return Ok(export::write_stl(path, mesh, progress)?);
        }
        let named: Vec<NamedMesh<'_>> = meshes
            .iter()
            .map(|(item, mesh)| NamedMesh { name: &item.name, color: item.color, mesh })
            .collect();
        if named.is_empty() {
            return Err(AppError::file(path, "only empty masks", "one with voxels"));
        }
        let result = match self.format {
            Format::Obj => {
                self.refuse(&export::material_file(path))?;
                export::write_obj(path, &named, provenance, progress)
            }
            _ => export::write_glb(path, &named, provenance, progress),
        };
        Ok(result?)
    }

    /// The DICOM image that the masks belong to: the one named, else the first on whose slices the case grid lies, else
    /// the first.
    fn dicom_image(&self) -> Result<Option<(&str, &Source)>, AppError> {
        let is_of_time = |time: &Option<String>| time.as_deref().unwrap_or_default() == self.time_point.label;
        let images: Vec<(&str, &Source)> = self
            .spec
            .contexts
            .iter()
            .filter(|image| is_of_time(&image.time) && dicom_path(&image.source).is_some())
            .map(|image| (image.id.as_str(), &image.source))
            .collect();
        if let Some(id) = &self.image {
            let ids: Vec<&str> = images.iter().map(|(id, _)| *id).collect();
            let expected = || format!("a DICOM image of the case: {}", ids.join(", "));
            let found = images.iter().find(|(known, _)| known == id);
            let found = found.ok_or_else(|| AppError::option("image", id, expected()))?;
            return Ok(Some(*found));
        }
        let grid = self.time_point.index.grid();
        let lies_on = |id: &str| {
            let context = self.time_point.contexts.iter().find(|context| context.id == id);
            context.is_some_and(|context| context.volume.grid().same_place(grid, 1e-3))
        };
        let on = images.iter().find(|(id, _)| lies_on(id)).or(images.first());
        Ok(on.copied())
    }

    /// The grid of the masks in the space of an image's files: what a transform moved is moved back. Without an image, that of
    /// the case.
    fn grid_for(&self, image: Option<&str>) -> Result<Grid, AppError> {
        let grid = self.time_point.index.grid();
        let is_it =
            |a: &&Aligned| !a.is_mask && a.time == self.time_point.label && Some(a.id.as_str()) == image;
        let Some(moved) = self.case.aligned.iter().find(is_it) else { return Ok(grid.clone()) };
        let back = moved.case_from_own.inverse() * grid.world_from_voxel();
        Grid::new(grid.dims(), back, grid.sides())
            .map_err(|e| AppError::wrong("the image's transform", e.to_string(), "one that can be undone"))
    }

    fn write_dicom(&self, out: &Path, written: &mut Written, progress: &Progress) -> Result<(), AppError> {
        if !self.format.names(out) {
            return Err(AppError::file(out, "a name without .dcm", "one that ends in .dcm"));
        }
        self.refuse(out)?;
        let named = self.dicom_image()?;
        let image = named.map(|(_, source)| dicom_image(source, progress)).transpose()?.flatten();
        if image.is_none() {
            let note = "no DICOM image of the case: the masks are of a new study of nobody";
            written.notes.push(note.to_owned());
        }
        let segments: Vec<SegmentToWrite<'_>> = self
            .items
            .iter()
            .map(|item| SegmentToWrite { name: &item.name, color: Some(item.color), mask: item.mask.bits() })
            .collect();
        let salt = self.salt.clone().unwrap_or_else(random_salt);
        let now = jiff::Timestamp::now();
        let (date, time) = (now.strftime("%Y%m%d").to_string(), now.strftime("%H%M%S").to_string());
        let grid = self.grid_for(named.map(|(id, _)| id))?;
        let to = WriteTo {
            grid: &grid,
            source: image.as_ref(),
            identified: self.is_identified,
            keeps_names: true,
            salt: &salt,
            date: &date,
            time: &time,
            version: env!("CARGO_PKG_VERSION"),
        };
        let file = match self.format {
            Format::Rtstruct => dicom::structure_set(&segments, &to)?,
            _ => dicom::segmentation(&segments, &to)?,
        };
        output::write(out, &self.inputs, &file.bytes)?;
        written.checks.extend(file.checks);
        written.files.push(self.line(out));
        Ok(())
    }
}

/// The file or folder of a source, if it is DICOM.
fn dicom_path(source: &Source) -> Option<&Path> {
    source.path().filter(|path| path.is_dir() || dicom::is_dicom(path))
}

/// The DICOM image that a source is; `None` for another format.
///
/// # Errors
/// As [`dicom::source_image`].
pub fn dicom_image(source: &Source, progress: &Progress) -> Result<Option<SourceImage>, FileError> {
    let series = match source {
        Source::Part(Part { series, .. }) => series.as_deref(),
        _ => None,
    };
    dicom_path(source).map(|path| dicom::source_image(path, series, progress)).transpose()
}

/// A name for a file: letters, digits and a few signs, which every system allows; never empty, never a path.
fn file_name(name: &str, number: usize) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_+., ".contains(c) { c } else { '_' };
    let name: String = name.chars().filter(|c| !is_misleading(*c)).map(plain).take(80).collect();
    let name = name.trim_matches(['.', ' ']);
    if name.is_empty() { format!("mask {}", number + 1) } else { name.to_owned() }
}

fn overlap(items: &[&Item]) -> bool {
    let masks: Vec<&Mask> = items.iter().map(|item| &item.mask).collect();
    let Some(first) = masks.first() else { return false };
    let index = TumorIndex::new(first.grid().clone(), &masks);
    index.is_ok_and(|index| (0..first.grid().voxel_count()).any(|at| index.get(at).count_ones() > 1))
}

/// Label k for mask k: 1 where there is one mask.
fn write_nifti(path: &Path, items: &[&Item]) -> Result<(), AppError> {
    let Some(first) = items.first() else { return Ok(()) };
    let grid = first.mask.grid();
    let mut labels = vec![0_u8; grid.voxel_count()];
    for (n, item) in items.iter().enumerate() {
        // At most 32 masks; more regions than a byte holds are refused.
        let label = u8::try_from(n + 1)
            .map_err(|_| AppError::file(path, format!("{} regions", items.len()), "at most 255"))?;
        item.mask.bits().for_each(|linear| labels[linear] = label);
    }
    let volume = Volume::new(grid.clone(), Samples::U8(labels), Scaling::NONE)
        .ok_or_else(|| AppError::file(path, "other voxels", "those of the case grid"))?;
    Ok(files::write_nifti(path, &volume, &WriteOptions::default())?)
}

/// Text that nobody can guess: the keys of the standard library's hash maps are random.
fn random_salt() -> String {
    use std::hash::{BuildHasher, Hasher};
    let word = || std::collections::hash_map::RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", word(), word())
}

/// Reads a segmentation back, and compares every mask voxel for voxel.
fn read_back(path: &Path, items: &[&Item], progress: &Progress) -> Result<(), String> {
    let source = Source::File(path.to_owned());
    let segments = files::segments(&source, progress).map_err(|e| e.to_string())?;
    if segments.len() != items.len() {
        return Err(format!("{} segments for {} masks", segments.len(), items.len()));
    }
    for (segment, item) in segments.iter().zip(items) {
        let options = ReadOptions { frame: segment.frame, max_bytes: u64::MAX };
        let volume = files::read(&source, &options, progress).map_err(|e| e.to_string())?.volume;
        let label = segment.label.unwrap_or(1);
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
        let bits = with_samples!(volume.samples(), v => MaskBits::from_fn(
            volume.grid().dims(),
            |at| v[at] as i64 == label
        ));
        if &bits != item.mask.bits() || !volume.grid().same_place(item.mask.grid(), 1e-6) {
            return Err(format!("{} differs", item.name));
        }
    }
    Ok(())
}
