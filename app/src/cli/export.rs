//! `glioscope export`: masks and regions as files of other programs.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glioscope_core::{
    Mask, MaskBits, Progress, Samples, Scaling, TumorIndex, Volume,
    case::{Case, CaseSpec, TimePoint},
    export::{self, MeshError, NamedMask, NamedMesh, Provenance, SurfaceKind},
    files::{
        self, FileMark, Part, ReadOptions, Source, WriteOptions,
        dicom::{self, SegmentToWrite, WriteTo},
        is_misleading,
    },
    with_samples,
};
use glioscope_render::{MaskColors, Palette};

use super::{case::CaseArguments, resolve, terminal};
use crate::{error::AppError, output, world::load::ReadCase};

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

/// Arguments of `export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// What is exported.
    #[arg(long, value_enum, default_value = "masks")]
    pub what: What,
    /// Masks by their ids, or regions: T1,T1+PET. Without it, all.
    #[arg(long, value_name = "NAME,...", default_value = "all")]
    pub select: String,
    /// The format.
    #[arg(long, value_enum)]
    pub format: Format,
    /// The file, or a folder that gets a file for each.
    #[arg(long, value_name = "PATH")]
    pub out: PathBuf,
    /// The date of the masks, by its label; may be left out where there is one.
    #[arg(long, value_name = "LABEL")]
    pub time: Option<String>,
    /// Surfaces smoothed by about a voxel, of the same volume, instead of the voxels' faces.
    #[arg(long)]
    pub smooth: bool,
    /// State whose the masks are: the patient and study of the DICOM image, or the names of the case's files. Without it,
    /// DICOM gets fixed words and UIDs of its own, and other files only hashes.
    #[arg(long)]
    pub identified: bool,
    /// DICOM: the image that the masks belong to, by its id; default: the one on whose slices they lie.
    #[arg(long, value_name = "ID")]
    pub image: Option<String>,
    /// DICOM: what the UIDs of exports without identity are made from, so that those of one project fit together. Without it,
    /// they are random.
    #[arg(long, value_name = "SECRET")]
    pub salt: Option<String>,
}

/// A mask that is exported.
struct Item {
    name: String,
    color: [u8; 3],
    mask: Mask,
}

pub(super) fn run(arguments: &ExportArguments) -> Result<(), AppError> {
    let is_surface = matches!(arguments.format, Format::Stl | Format::Obj | Format::Gltf);
    if arguments.smooth && !is_surface {
        return Err(AppError::wrong("--smooth", "a format of voxels", "stl, obj or gltf"));
    }
    let is_dicom = matches!(arguments.format, Format::DicomSeg | Format::Rtstruct);
    if !is_dicom && (arguments.image.is_some() || arguments.salt.is_some()) {
        return Err(AppError::wrong("--image and --salt", "another format", "dicom-seg or rtstruct"));
    }
    let ReadCase { case, spec, .. } = arguments.case.read(false)?;
    let time_point = resolve::time_point(&case, arguments.time.as_deref())?;
    let items = items(arguments, time_point)?;
    if arguments.what == What::Masks {
        note_resampled(time_point, &items);
    }
    if is_dicom {
        return write_dicom(arguments, &case, &spec, time_point, &items);
    }
    let provenance = provenance(arguments, &case)?;
    let written = terminal::with_progress(|progress| {
        progress.say("Writing");
        write(arguments, &case, &items, &provenance, progress)
    })?;
    terminal::print(&written.join("\n"))
}

/// The masks to be written, in the order of the case.
fn items(arguments: &ExportArguments, time_point: &TimePoint) -> Result<Vec<Item>, AppError> {
    let (index, regions) = (&time_point.index, &time_point.regions);
    let own: Vec<Option<[u8; 3]>> = time_point.masks.iter().map(|m| m.color).collect();
    let colors = MaskColors::new(Palette::default(), &own);
    let of_bits = |name: String, color, active: &dyn Fn(u32) -> bool| {
        let bits = MaskBits::from_fn(index.grid().dims(), |linear| active(index.get(linear)));
        Mask::new(name.clone(), index.grid().clone(), bits).map(|mask| Item { name, color, mask })
    };
    let items: Vec<Item> = match arguments.what {
        What::Masks => {
            let ids: Vec<&str> = time_point.masks.iter().map(|m| m.mask.id()).collect();
            let wanted: Vec<&str> = match arguments.select.as_str() {
                "all" => ids.clone(),
                text => text.split(',').map(str::trim).collect(),
            };
            if let Some(unknown) = wanted.iter().find(|id| !ids.contains(id)) {
                let expected = format!("masks of the case: {}", ids.join(", "));
                return Err(AppError::option("select", unknown, expected));
            }
            let masks = time_point.masks.iter().enumerate();
            masks
                .filter(|(_, m)| wanted.contains(&m.mask.id()))
                .map(|(n, m)| {
                    let name = m
                        .name
                        .as_ref()
                        .map_or(m.mask.id().to_owned(), |name| format!("{} {name}", m.mask.id()));
                    Item { name, color: colors.mask(n), mask: m.mask.clone() }
                })
                .collect()
        }
        What::Regions => {
            let selection = resolve::selection(&arguments.select, regions)?;
            let shown = regions.list().iter().filter(|region| selection.shows(region.bits));
            shown
                .filter_map(|region| {
                    let bits = region.bits;
                    of_bits(regions.name(bits), colors.region(bits), &move |at| at == bits)
                })
                .collect()
        }
        What::Selection => {
            let selection = resolve::selection(&arguments.select, regions)?;
            let shown: Vec<String> = regions
                .list()
                .iter()
                .filter(|region| selection.shows(region.bits))
                .map(|region| regions.name(region.bits))
                .collect();
            of_bits(shown.join(", "), colors.mask(0), &|at| at != 0 && selection.shows(at))
                .into_iter()
                .collect()
        }
    };
    if items.is_empty() {
        return Err(AppError::option("select", &arguments.select, "something of the case"));
    }
    Ok(items)
}

/// Says which masks aren't written as their files hold them.
fn note_resampled(time_point: &TimePoint, items: &[Item]) {
    let grid = time_point.index.grid();
    for mask in &time_point.masks {
        let is_written = items.iter().any(|item| item.mask.id() == mask.mask.id());
        if is_written && !mask.native_grid.same_place(grid, 1e-3) {
            terminal::assumed(&format!(
                "{}: written on the case grid ({} voxels), not on its file's ({} voxels)",
                mask.mask.id(),
                mask.mask.voxels(),
                mask.native_voxels
            ));
        }
    }
}

fn provenance(arguments: &ExportArguments, case: &Case) -> Result<Provenance, AppError> {
    let marks = terminal::with_progress(|progress| FileMark::of_all(case.inputs.paths(), progress))?;
    let line = |mark: &FileMark| {
        let name = mark.file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if arguments.identified { format!("{name} {}", mark.hash) } else { mark.hash.clone() }
    };
    let inputs = marks.iter().map(line).collect();
    let what = match arguments.what {
        What::Masks => "masks",
        What::Regions => "regions",
        What::Selection => "selection",
    };
    Ok(Provenance { inputs, selection: format!("{what}: {}", arguments.select) })
}

/// Writes the files, and returns a line about each.
fn write(
    arguments: &ExportArguments,
    case: &Case,
    items: &[Item],
    provenance: &Provenance,
    progress: &Progress,
) -> Result<Vec<String>, AppError> {
    let out = &arguments.out;
    let checked = |path: &Path| case.inputs.refuse_as_output(path).map_err(AppError::from);
    let one = |path: &Path, items: &[&Item]| -> Result<(), AppError> {
        checked(path)?;
        match arguments.format {
            Format::Nifti => write_nifti(path, items),
            Format::SegNrrd => {
                let masks: Vec<NamedMask<'_>> = items
                    .iter()
                    .map(|item| NamedMask { name: &item.name, color: item.color, mask: &item.mask })
                    .collect();
                let verify = |path: &Path| read_back(path, items, progress);
                Ok(export::write_seg_nrrd(path, &masks, provenance, progress, verify)?)
            }
            Format::Stl | Format::Obj | Format::Gltf => {
                surfaces(arguments, path, items, provenance, progress)
            }
            // Written before: they are one file.
            Format::DicomSeg | Format::Rtstruct => Ok(()),
        }
    };
    let all: Vec<&Item> = items.iter().collect();
    let is_each_alone = match arguments.format {
        Format::Stl => items.len() > 1,
        Format::Nifti => overlap(&all),
        _ => false,
    };
    let ending = match arguments.format {
        Format::Nifti => "nii.gz",
        Format::DicomSeg | Format::Rtstruct => "dcm",
        Format::SegNrrd => "seg.nrrd",
        Format::Stl => "stl",
        Format::Obj => "obj",
        Format::Gltf => "glb",
    };
    if has_ending(out, arguments.format) {
        if is_each_alone {
            let found = format!("{} masks that one file can't hold", items.len());
            return Err(AppError::file(out, found, "a folder, for a file of each"));
        }
        one(out, &all)?;
        let names: Vec<&str> = items.iter().map(|item| item.name.as_str()).collect();
        return Ok(vec![format!("{}: {}", out.display(), names.join(", "))]);
    }
    if out.is_file() {
        return Err(AppError::file(
            out,
            "a file of another kind",
            format!("a name that ends in .{ending}, or a folder"),
        ));
    }
    std::fs::create_dir_all(out)
        .map_err(|e| AppError::file(out, e.to_string(), "a folder that can be made"))?;
    let mut lines = Vec::new();
    for (n, item) in items.iter().enumerate() {
        let path = out.join(format!("{}.{ending}", file_name(&item.name, n)));
        one(&path, &[item])?;
        lines.push(format!("{}: {}", path.display(), item.name));
    }
    Ok(lines)
}

fn has_ending(path: &Path, format: Format) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
    let endings: &[&str] = match format {
        Format::Nifti => &[".nii", ".nii.gz"],
        Format::SegNrrd => &[".seg.nrrd"],
        Format::DicomSeg | Format::Rtstruct => &[".dcm"],
        Format::Stl => &[".stl"],
        Format::Obj => &[".obj"],
        Format::Gltf => &[".glb"],
    };
    endings.iter().any(|ending| name.ends_with(ending))
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

/// The DICOM image that the masks belong to: the one named, else the first on whose slices the case grid lies, else the
/// first.
fn image_of<'a>(
    arguments: &ExportArguments,
    spec: &'a CaseSpec,
    time_point: &TimePoint,
) -> Result<Option<&'a Source>, AppError> {
    let is_of_time = |time: &Option<String>| time.as_deref().unwrap_or_default() == time_point.label;
    let is_dicom = |source: &Source| source.path().is_some_and(|path| path.is_dir() || dicom::is_dicom(path));
    let images: Vec<(&str, &Source)> = spec
        .contexts
        .iter()
        .filter(|image| is_of_time(&image.time) && is_dicom(&image.source))
        .map(|image| (image.id.as_str(), &image.source))
        .collect();
    if let Some(id) = &arguments.image {
        let ids: Vec<&str> = images.iter().map(|(id, _)| *id).collect();
        let expected = || format!("a DICOM image of the case: {}", ids.join(", "));
        let found = images.iter().find(|(known, _)| known == id);
        return found
            .map(|(_, source)| Some(*source))
            .ok_or_else(|| AppError::option("image", id, expected()));
    }
    let grid = time_point.index.grid();
    let lies_on = |id: &str| {
        let context = time_point.contexts.iter().find(|context| context.id == id);
        context.is_some_and(|context| context.volume.grid().same_place(grid, 1e-3))
    };
    let on = images.iter().find(|(id, _)| lies_on(id)).or(images.first());
    Ok(on.map(|(_, source)| *source))
}

fn write_dicom(
    arguments: &ExportArguments,
    case: &Case,
    spec: &CaseSpec,
    time_point: &TimePoint,
    items: &[Item],
) -> Result<(), AppError> {
    let out = &arguments.out;
    if !has_ending(out, arguments.format) {
        return Err(AppError::file(out, "a name without .dcm", "one that ends in .dcm"));
    }
    let image = match image_of(arguments, spec, time_point)? {
        Some(source) => {
            let series = match source {
                Source::Part(Part { series, .. }) => series.as_deref(),
                _ => None,
            };
            let path = source.path().unwrap_or(out);
            Some(terminal::with_progress(|progress| dicom::source_image(path, series, progress))?)
        }
        None => None,
    };
    if image.is_none() {
        terminal::assumed("no DICOM image of the case: the masks are of a new study of nobody");
    }
    let segments: Vec<SegmentToWrite<'_>> = items
        .iter()
        .map(|item| SegmentToWrite { name: &item.name, color: Some(item.color), mask: item.mask.bits() })
        .collect();
    let salt = arguments.salt.clone().unwrap_or_else(random_salt);
    let now = jiff::Timestamp::now();
    let (date, time) = (now.strftime("%Y%m%d").to_string(), now.strftime("%H%M%S").to_string());
    let to = WriteTo {
        grid: time_point.index.grid(),
        source: image.as_ref(),
        identified: arguments.identified,
        keeps_names: true,
        salt: &salt,
        date: &date,
        time: &time,
        version: env!("CARGO_PKG_VERSION"),
    };
    let written = match arguments.format {
        Format::DicomSeg => dicom::segmentation(&segments, &to)?,
        _ => dicom::structure_set(&segments, &to)?,
    };
    terminal::notes(&written.checks);
    output::write(out, &case.inputs, &written.bytes)?;
    let names: Vec<&str> = items.iter().map(|item| item.name.as_str()).collect();
    terminal::print(&format!("{}: {}", out.display(), names.join(", ")))
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

fn surfaces(
    arguments: &ExportArguments,
    path: &Path,
    items: &[&Item],
    provenance: &Provenance,
    progress: &Progress,
) -> Result<(), AppError> {
    let kind = if arguments.smooth { SurfaceKind::Smoothed } else { SurfaceKind::VoxelFaces };
    let mut meshes = Vec::new();
    for item in items {
        match export::mesh(&item.mask, kind, progress) {
            Ok(mesh) => meshes.push((item, mesh)),
            Err(MeshError::Empty) => {
                terminal::assumed(&format!("{}: empty, so it has no surface", item.name));
            }
            Err(MeshError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) => {
                return Err(AppError::file(path, format!("{}: {error}", item.name), "a smaller mask"));
            }
        }
    }
    if let (Format::Stl, [(_, mesh)]) = (arguments.format, meshes.as_slice()) {
        return Ok(export::write_stl(path, mesh, progress)?);
    }
    let named: Vec<NamedMesh<'_>> =
        meshes.iter().map(|(item, mesh)| NamedMesh { name: &item.name, color: item.color, mesh }).collect();
    if named.is_empty() {
        return Err(AppError::file(path, "only empty masks", "one with voxels"));
    }
    let written = match arguments.format {
        Format::Obj => export::write_obj(path, &named, provenance, progress),
        _ => export::write_glb(path, &named, provenance, progress),
    };
    Ok(written?)
}
