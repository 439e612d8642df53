//! Loads a described case: reads files in parallel, selects masks from label maps, resamples masks onto the case
//! grid.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use rayon::prelude::*;

use super::{
    Aligned, Case, CaseError, CaseMask, CaseSpec, CaseTracts, Context, ContextSpec, LoadOptions, MAX_FILES,
    MaskSpec, TimePoint, TractsSpec,
    alignment::{self, Item, Transforms},
    case_grid, check,
    findings::{self, Finding},
    names::at_time,
    native::NativeMask,
    order,
    origin::{self, Stated},
    select::{self, Rule, Selected},
    values::{self, Meaning},
};
use crate::{
    Check, Grid, Mask, Progress, Regions, TumorIndex, Volume,
    files::{FileError, Inputs, Loaded, Source, TractOptions},
    resample,
    tumor_index::MAX_MASKS,
};

/// Maximum number of labels of one mask: more than any atlas has.
const MAX_LABELS: usize = 1 << 15;

/// One image.
struct NativeContext {
    spec: usize,
    time: usize,
    /// At its place in the case.
    volume: Arc<Volume>,
    /// The grid of its file.
    own_grid: Grid,
    /// Where a transform moved it.
    aligned: Option<Aligned>,
}

/// The labels of the time points, in the order first listed, images before masks; one empty label where no time is
/// stated.
fn time_labels(spec: &CaseSpec) -> Result<Vec<String>, CaseError> {
    let images = spec.contexts.iter().map(|c| ("image", &c.id, &c.time));
    let masks = spec.masks.iter().map(|m| ("mask", &m.id, &m.time));
    let (mut named, mut unnamed) = (None, None);
    for (kind, id, time) in images.chain(masks) {
        match time {
            Some(label) => drop(named.get_or_insert_with(|| format!("{kind} {id} at {label}"))),
            None => drop(unnamed.get_or_insert_with(|| format!("{kind} {id} without a time"))),
        }
    }
    match (named, unnamed) {
        (Some(named), Some(unnamed)) => Err(CaseError::wrong(
            &spec.name,
            format!("{unnamed} beside {named}"),
            "a time for every image and mask, or for none",
        )),
        (None, None) => Err(CaseError::wrong(&spec.name, "no image and no mask", "at least one")),
        (None, Some(_)) => Ok(vec![String::new()]),
        (Some(_), None) => Ok(spec.times()),
    }
}

fn check_names(spec: &CaseSpec) -> Result<(), CaseError> {
    let files = spec.contexts.len() + spec.masks.len() + spec.tracts.len();
    if files > MAX_FILES {
        let found = format!("{files} images, masks and tracts");
        return Err(CaseError::wrong(&spec.name, found, format!("at most {MAX_FILES}")));
    }
    let images: Vec<_> = spec.contexts.iter().map(|c| (&c.id, &c.time)).collect();
    let masks: Vec<_> = spec.masks.iter().map(|m| (&m.id, &m.time)).collect();
    for (kind, list) in [("image", images), ("mask", masks)] {
        let mut seen = HashSet::new();
        for (n, (id, time)) in list.iter().enumerate() {
            let label = at_time(id, time.as_deref().unwrap_or_default());
            if id.trim().is_empty() {
                return Err(CaseError::wrong(
                    &spec.name,
                    format!("{kind} number {} with an empty id", n + 1),
                    "a name",
                ));
            }
            if !seen.insert((id, time)) {
                let expected = format!("each {kind} id once at each time");
                return Err(CaseError::wrong(&spec.name, format!("{kind} {label} twice"), expected));
            }
        }
    }
    for (n, tracts) in spec.tracts.iter().enumerate() {
        if spec.tracts[..n].iter().any(|t| t.id == tracts.id) {
            return Err(CaseError::wrong(
                &spec.name,
                format!("tracts {} twice", tracts.id),
                "each tracts id once",
            ));
        }
    }
    for mask in &spec.masks {
        if mask.labels.as_ref().is_some_and(Vec::is_empty) {
            return Err(CaseError::wrong(
                &spec.name,
                format!("mask {} with an empty list of labels", mask.id),
                "a label",
            ));
        }
        if let Some(labels) = mask.labels.as_ref().filter(|labels| labels.len() > MAX_LABELS) {
            let found = format!("mask {} with {} labels", mask.id, labels.len());
            return Err(CaseError::wrong(&spec.name, found, format!("at most {MAX_LABELS}")));
        }
    }
    Ok(())
}

fn check_counts(spec: &CaseSpec, labels: &[String]) -> Result<(), CaseError> {
    for label in labels {
        let here: Vec<_> =
            spec.masks.iter().filter(|m| m.time.as_deref().unwrap_or_default() == label).collect();
        if here.len() > MAX_MASKS {
            let place = if label.is_empty() { String::new() } else { format!(" at {label}") };
            return Err(CaseError::wrong(
                &spec.name,
                format!("{} masks{place}, number {} is {}", here.len(), MAX_MASKS + 1, here[MAX_MASKS].id),
                format!("at most {MAX_MASKS} masks at one time point"),
            ));
        }
    }
    Ok(())
}

/// A file of the case, with the images and masks that are made from it (positions in the [`CaseSpec`]).
struct Job<'a> {
    source: &'a Source,
    contexts: Vec<usize>,
    masks: Vec<usize>,
}

impl Job<'_> {
    /// Id and time of the first image or mask that is made from it.
    fn first_use<'a>(&self, spec: &'a CaseSpec) -> (&'a str, Option<&'a str>) {
        match (self.contexts.first(), self.masks.first()) {
            (Some(&c), _) => (&spec.contexts[c].id, spec.contexts[c].time.as_deref()),
            (None, Some(&m)) => (&spec.masks[m].id, spec.masks[m].time.as_deref()),
            (None, None) => ("", None),
        }
    }
}

/// One job per file, in the order listed.
fn jobs<'a>(spec: &'a CaseSpec) -> Vec<Job<'a>> {
    let mut jobs: Vec<Job<'a>> = Vec::new();
    let mut places: HashMap<&Source, usize> = HashMap::new();
    let mut place_of = |jobs: &mut Vec<Job<'a>>, source: &'a Source| {
        *places.entry(source).or_insert_with(|| {
            jobs.push(Job { source, contexts: Vec::new(), masks: Vec::new() });
            jobs.len() - 1
        })
    };
    for (n, context) in spec.contexts.iter().enumerate() {
        let at = place_of(&mut jobs, &context.source);
        jobs[at].contexts.push(n);
    }
    for (n, mask) in spec.masks.iter().enumerate() {
        let at = place_of(&mut jobs, &mask.source);
        jobs[at].masks.push(n);
    }
    jobs
}

/// The result of one job: selected masks, and the image's voxels if the case uses them.
struct FileResult {
    findings: Vec<Finding>,
    grid: Grid,
    meaning: Option<Meaning>,
    label_tolerance: f64,
    image: Option<Arc<Volume>>,
    selected: Vec<(usize, Selected)>,
    stated: Option<Stated>,
}

fn read_one(
    job: &Job<'_>,
    spec: &CaseSpec,
    progress: &Progress,
    read: &(dyn Fn(&Source) -> Result<Loaded, FileError> + Sync),
) -> Result<FileResult, CaseError> {
    progress.check()?;
    let (id, time) = job.first_use(spec);
    progress.say(format!("Reading {id}"));
    let loaded = read(job.source)?;
    let mut checks = loaded.checks;
    if loaded.frames > 1 {
        let text = format!("found {} frames, expected one; the first is shown", loaded.frames);
        checks.push(Check::warning("first-frame-only", text));
    }
    if !job.contexts.is_empty() {
        checks.extend(check::image_values(&loaded.volume));
    }
    let findings = checks.into_iter().map(|check| Finding::new(id, time, job.source, check)).collect();
    let stated = loaded.origin.map(|origin| Stated {
        id: id.to_owned(),
        time: time.unwrap_or_default().to_owned(),
        origin,
    });
    // With labels given, the file is what they say it is.
    let is_open = job.masks.iter().any(|&m| spec.masks[m].labels.is_none());
    let meaning = if is_open { values::meaning(&loaded.volume, progress)? } else { None };
    let threshold = match meaning {
        Some(Meaning::Soft { full, .. }) => full / 2.0,
        _ => 0.5,
    };
    let selected = job
        .masks
        .iter()
        .map(|&m| {
            let threshold = spec.masks[m].above.unwrap_or(threshold);
            let rule = spec.masks[m].labels.as_deref().map_or(Rule::Above(threshold), Rule::Labels);
            Ok((m, select::select(&loaded.volume, rule, progress)?))
        })
        .collect::<Result<Vec<_>, CaseError>>()?;
    Ok(FileResult {
        meaning,
        label_tolerance: loaded.volume.scaling().label_tolerance(loaded.volume.samples().is_integer()),
        findings,
        grid: loaded.volume.grid().clone(),
        image: (!job.contexts.is_empty()).then(|| Arc::new(loaded.volume)),
        selected,
        stated,
    })
}

/// Reads every tract file; findings are appended to `checks`.
fn load_tracts(
    spec: &CaseSpec,
    options: &LoadOptions,
    progress: &Progress,
    checks: &mut Vec<Check>,
) -> Result<Vec<CaseTracts>, CaseError> {
    let limit = TractOptions { max_bytes: options.max_bytes };
    let (mut all, mut findings) = (Vec::new(), Vec::new());
    for tracts in &spec.tracts {
        let TractsSpec { id, source, .. } = tracts;
        progress.say(format!("Reading {id}"));
        let loaded = tracts.read(&limit, progress)?;
        findings.extend(loaded.checks.into_iter().map(|check| Finding::new(id, None, source, check)));
        all.push(CaseTracts { id: id.clone(), tracts: Arc::new(loaded.tracts) });
    }
    checks.extend(findings::together(findings));
    Ok(all)
}

/// All images and masks, for the checks of transforms.
fn items<'a>(spec: &'a CaseSpec, images: &'a [NativeContext], masks: &'a [NativeMask]) -> Vec<Item<'a>> {
    let images = images.iter().map(|c| {
        let ContextSpec { id, time, .. } = &spec.contexts[c.spec];
        let time = time.as_deref().unwrap_or_default();
        Item { id, time, is_mask: false, own: &c.own_grid, aligned: c.aligned.as_ref() }
    });
    let masks = masks.iter().map(|m| {
        let MaskSpec { id, time, .. } = &spec.masks[m.spec];
        let time = time.as_deref().unwrap_or_default();
        Item { id, time, is_mask: true, own: &m.own_grid, aligned: m.aligned.as_ref() }
    });
    images.chain(masks).collect()
}

/// As [`super::load`], with images and masks read by `read`: for cases already in memory, and for tests.
///
/// # Errors
/// [`CaseError`].
pub fn load_with(
    spec: &CaseSpec,
    options: &LoadOptions,
    progress: &Progress,
    read: &(dyn Fn(&Source) -> Result<Loaded, FileError> + Sync),
) -> Result<Case, CaseError> {
    let listed = time_labels(spec)?;
    let stated = if options.order.is_empty() { &spec.order } else { &options.order };
    let (labels, order) = order::arrange(spec, &listed, stated)?;
    check_names(spec)?;
    check_counts(spec, &labels)?;
    let time_of = |time: &Option<String>| labels.iter().position(|l| Some(l) == time.as_ref()).unwrap_or(0);

    let transforms = Transforms::read(spec, &options.alignments)?;
    let jobs = jobs(spec);
    let mut checks = spec.notes.clone();
    checks.extend(check::time_order(&listed, &labels, order));
    checks.extend(check::names(spec));
    let (mut images, mut masks) = (Vec::new(), Vec::new());
    let (mut findings, mut stated) = (Vec::new(), Vec::new());
    let reads = jobs.par_iter().map(|job| read_one(job, spec, progress, read)).collect::<Vec<_>>();
    let is_one_space = spec.one_space || options.one_space;
    for (job, outcome) in jobs.iter().zip(reads) {
        let outcome = outcome?;
        findings.extend(outcome.findings);
        let own_grid = outcome.grid;
        let frame = outcome.stated.as_ref().map(|stated| stated.origin.frame_of_reference.clone());
        let frame = frame.filter(|_| !is_one_space).unwrap_or_default();
        let mut all_moved = true;
        for (m, selected) in outcome.selected {
            let MaskSpec { id, time, .. } = &spec.masks[m];
            let moved = transforms.moved(&spec.name, (id, time.as_deref()), true, &own_grid)?;
            all_moved &= moved.is_some();
            let is_in_case = moved.as_ref().is_some_and(|moved| moved.aligned.with_date);
            let (grid, aligned) =
                moved.map_or_else(|| (own_grid.clone(), None), |moved| (moved.grid, Some(moved.aligned)));
            let mask = Mask::new(id.clone(), grid, selected.bits).ok_or_else(|| {
                CaseError::wrong(&spec.name, "a mask of another size than its file", "the same size")
            })?;
            let (missing_labels, invalid) = (selected.missing_labels, selected.invalid);
            masks.push(NativeMask {
                spec: m,
                time: time_of(&spec.masks[m].time),
                mask,
                own_grid: own_grid.clone(),
                frame_of_reference: if is_in_case { String::new() } else { frame.clone() },
                aligned,
                missing_labels,
                invalid,
                meaning: outcome.meaning.filter(|_| spec.masks[m].labels.is_none()),
                label_tolerance: outcome.label_tolerance,
            });
        }
        if let Some(volume) = outcome.image {
            for &c in &job.contexts {
                let ContextSpec { id, time, .. } = &spec.contexts[c];
                let moved = transforms.moved(&spec.name, (id, time.as_deref()), false, &own_grid)?;
                all_moved &= moved.is_some();
                let (volume, aligned) = match moved {
                    None => (Arc::clone(&volume), None),
                    Some(moved) => (Arc::new(volume.with_grid(moved.grid)), Some(moved.aligned)),
                };
                let (time, own_grid) = (time_of(time), own_grid.clone());
                images.push(NativeContext { spec: c, time, volume, own_grid, aligned });
            }
        }
        // What is moved lies in the case's space, whatever its file claims.
        stated.extend(outcome.stated.map(|mut stated| {
            if all_moved {
                stated.origin.frame_of_reference.clear();
            }
            stated
        }));
    }
    checks.extend(findings::together(findings));
    let aligned: Vec<Aligned> = images
        .iter()
        .filter_map(|c| c.aligned.clone())
        .chain(masks.iter().filter_map(|m: &NativeMask| m.aligned.clone()))
        .collect();
    checks.extend(alignment::checks(&items(spec, &images, &masks)));
    let patient = origin::patient(&stated);
    checks.extend(origin::check(&spec.name, &stated, spec.one_patient, is_one_space)?);
    let tracts = load_tracts(spec, options, progress, &mut checks)?;
    images.sort_by_key(|c| c.spec);
    // One id is one mask over time: bits are assigned in the order in which ids are first listed.
    let mut ranks: HashMap<&str, usize> = HashMap::new();
    for (n, mask) in spec.masks.iter().enumerate() {
        ranks.entry(&mask.id).or_insert(n);
    }
    let rank = |m: &NativeMask| ranks.get(spec.masks[m.spec].id.as_str()).copied();
    masks.sort_by_key(|m| m.spec);
    let image_grids: Vec<(usize, &str, &Grid)> =
        images.iter().map(|c| (c.time, spec.contexts[c.spec].id.as_str(), c.volume.grid())).collect();
    let (grid, grid_id) = case_grid::choose(spec, &options.case_grid, &masks, &image_grids)?;
    let whole = case_grid::covering(&spec.name, &grid, &masks, options.max_bytes)?;
    masks.sort_by_key(|m| (m.time, rank(m)));

    checks.extend(check::before_resampling(spec, &labels, &masks, &image_grids, (&grid, &grid_id)));
    checks.extend(check::extended(&grid, &whole, &grid_id));
    let grid = whole;

    progress.say("Bringing the masks onto the case grid");
    let on_grid = masks
        .par_iter()
        .map(|m| {
            let bits = resample::mask_onto(&m.mask, &grid, progress)?;
            Mask::new(m.mask.id(), grid.clone(), bits).ok_or_else(|| {
                CaseError::wrong(&spec.name, "a mask of another size than the case grid", "the same size")
            })
        })
        .collect::<Result<Vec<_>, CaseError>>()?;
    checks.extend(check::after_resampling(&labels, &masks, &on_grid));

    let mut placed: Vec<(usize, CaseMask)> = masks
        .iter()
        .zip(on_grid)
        .map(|(native, mask)| {
            let case_mask = CaseMask {
                mask,
                frame_of_reference: native.frame_of_reference.clone(),
                native_grid: native.mask.grid().clone(),
                native_voxels: native.mask.voxels(),
                native_volume_ml: native.own_grid.volume_ml(native.mask.voxels()),
                expected_volume_ml: native.expected_volume_ml(),
                color: spec.masks[native.spec].color,
                name: spec.masks[native.spec].name.clone(),
            };
            (native.time, case_mask)
        })
        .collect();
    drop(masks);
    progress.say("Counting regions");
    let mut time_points = Vec::new();
    for (number, label) in labels.into_iter().enumerate() {
        progress.check()?;
        let later = placed.iter().position(|(time, _)| *time != number).unwrap_or(placed.len());
        let here: Vec<CaseMask> = placed.drain(..later).map(|(_, mask)| mask).collect();
        let index = TumorIndex::new(grid.clone(), &here.iter().map(|m| &m.mask).collect::<Vec<_>>())
            .map_err(|e| CaseError::wrong(&spec.name, e.to_string(), "masks on the case grid"))?;
        let regions = Regions::of(&index);
        checks.extend(check::isolated_masks(&label, &here, &regions));
        let contexts = images
            .iter()
            .filter(|c| c.time == number)
            .map(|c| Context { id: spec.contexts[c.spec].id.clone(), volume: Arc::clone(&c.volume) })
            .collect();
        time_points.push(TimePoint {
            label,
            contexts,
            masks: here,
            index: Arc::new(index),
            regions: Arc::new(regions),
        });
    }
    // Most severe first, else in the order found.
    checks.sort_by_key(|c| std::cmp::Reverse(c.severity));
    checks.dedup();
    let transform_files = options.alignments.iter().flat_map(|alignment| alignment.by.files());
    let inputs = transform_files.fold(spec.inputs(), Inputs::with);
    Ok(Case {
        name: spec.name.clone(),
        patient,
        grid,
        time_points,
        order,
        tracts,
        one_space: is_one_space,
        aligned,
        checks,
        inputs,
    })
}
