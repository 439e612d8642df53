//! `glioscope info`.

use std::path::{Path, PathBuf};

use glioscope_core::{
    Progress,
    files::{self, HeaderInfo, Source, nifti_header::Version},
};
use serde_json::json;

use super::{CaseArguments, Failure, arguments::MaskArguments, terminal};
use crate::{document::CaseRef, world};

pub(super) fn run(target: Option<PathBuf>, parts: &MaskArguments, as_json: bool) -> Result<(), Failure> {
    if let Some(path) = &target
        && path.is_file()
        && !is_manifest(path)
    {
        let info = files::info(&Source::File(path.clone()))?;
        return if as_json { terminal::print_json(&info) } else { terminal::print(&header_text(&info)) };
    }
    let case = CaseArguments { path: target, parts: parts.clone(), tracts: Vec::new() };
    let reference = case.reference()?.unwrap_or(CaseRef::Sample);
    let spec = world::spec_of(&reference, &case.options(), &Progress::new())?;
    if as_json {
        let masks: Vec<_> = spec
            .masks
            .iter()
            .map(|m| json!({"id": m.id, "file": m.source.name(), "labels": m.labels, "time": m.time}))
            .collect();
        let contexts: Vec<_> = spec
            .contexts
            .iter()
            .map(|c| json!({"id": c.id, "file": c.source.name(), "time": c.time}))
            .collect();
        let tracts: Vec<_> =
            spec.tracts.iter().map(|t| json!({"id": t.id, "file": t.source.name()})).collect();
        return terminal::print_json(
            &json!({"case": spec.name, "masks": masks, "contexts": contexts, "tracts": tracts, "notes": spec.notes}),
        );
    }
    let mut lines = vec![spec.name.clone()];
    let time = |t: &Option<String>| t.as_ref().map(|t| format!("  at {t}")).unwrap_or_default();
    for c in &spec.contexts {
        lines.push(format!("image {:16} {}{}", c.id, c.source.name(), time(&c.time)));
    }
    for m in &spec.masks {
        let labels = m.labels.as_ref().map(|l| format!("  labels {l:?}")).unwrap_or_default();
        lines.push(format!("mask  {:16} {}{labels}{}", m.id, m.source.name(), time(&m.time)));
    }
    for t in &spec.tracts {
        lines.push(format!("tracts {:15} {}", t.id, t.source.name()));
    }
    lines.extend(spec.notes.iter().map(|n| format!("{}: {}", n.code, n.message)));
    terminal::print(&lines.join("\n"))
}

fn is_manifest(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// A header in words: a line each.
fn header_text(info: &HeaderInfo) -> String {
    let list = |numbers: &[u64]| numbers.iter().map(u64::to_string).collect::<Vec<_>>().join(" × ");
    let spacing: Vec<String> = info.spacing_mm.iter().map(|s| format!("{s:.4}")).collect();
    let mut lines = vec![
        info.file.clone(),
        format!(
            "format      {}, {}-endian{}",
            match info.format {
                Version::One => "NIfTI-1",
                Version::Two => "NIfTI-2",
            },
            format!("{:?}", info.byte_order).to_lowercase(),
            if info.gzip { ", gzip" } else { "" }
        ),
        format!(
            "dimensions  {} ({} frame{})",
            list(&info.dims),
            info.frames,
            if info.frames == 1 { "" } else { "s" }
        ),
        format!("voxels      {:?}, {} bytes a frame", info.datatype, info.frame_bytes),
        format!("spacing     {} mm", spacing.join(" × ")),
        format!("axes        {}", info.axis_codes.as_deref().unwrap_or("side unknown")),
        format!(
            "place from  {:?} (sform code {}, qform code {})",
            info.form, info.sform_code, info.qform_code
        ),
        format!("unit        {}", info.unit.unwrap_or("unknown, mm assumed")),
        format!("values      {} × stored + {}", info.slope, info.intercept),
        format!("extensions  {}", info.extensions),
    ];
    lines.extend(
        info.checks.iter().map(|c| format!("{:?} [{}]: {}", c.severity, c.code, c.message).to_lowercase()),
    );
    lines.join("\n")
}
