//! `glioscope accuracy`: error against run time of every approximate kernel, as numbers, plots and a page.

mod page;
mod plot;
mod svg;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::Args;
use glioscope_core::files::write_whole;
use glioscope_render::{
    Gpu,
    accuracy::{self, AccuracyError, Curve, Effort, Family},
};
use serde_json::json;

use super::{Failure, render, terminal};
use crate::{files, offscreen::Offscreen};

/// What `accuracy` can be told.
#[derive(Debug, Args)]
pub struct AccuracyArguments {
    /// Fewer settings and smaller pictures: under two minutes on two cores.
    #[arg(long)]
    pub quick: bool,
    /// Only these kernels: context, ambient, occlusion, ellipsoids, skeleton, resampling or half.
    #[arg(long, value_name = "KERNEL,...", value_delimiter = ',')]
    pub only: Vec<String>,
    /// The folder for numbers, plots and the page.
    #[arg(long, value_name = "DIR", default_value = "out/accuracy")]
    pub out: PathBuf,
    /// Also print every number as JSON.
    #[arg(long)]
    pub json: bool,
    /// Use only the software graphics adapter.
    #[arg(long)]
    pub software: bool,
}

impl From<AccuracyError> for Failure {
    fn from(error: AccuracyError) -> Self {
        Self(error.to_string())
    }
}

fn families(only: &[String]) -> Result<Vec<Family>, Failure> {
    let of = |name: &String| {
        Family::ALL.into_iter().find(|f| f.name() == name).ok_or_else(|| {
            let names = Family::ALL.map(Family::name).join(", ");
            Failure(format!("--only: found \"{name}\", expected one of {names}"))
        })
    };
    if only.is_empty() { Ok(Family::ALL.to_vec()) } else { only.iter().map(of).collect() }
}

pub(super) fn run(arguments: &AccuracyArguments) -> Result<(), Failure> {
    let families = families(&arguments.only)?;
    let effort = if arguments.quick { Effort::Quick } else { Effort::Whole };
    let gpu = render::gpu(arguments.software)?;
    let begun = page::Begun::now(&gpu);
    let mut took = Vec::new();
    let curves = terminal::with_progress(|progress| {
        let mut curves = Vec::new();
        for &family in &families {
            let start = Instant::now();
            curves.extend(accuracy::curves(&gpu, effort, &[family], progress)?);
            took.push((family, start.elapsed()));
        }
        Ok::<_, AccuracyError>(curves)
    })?;
    write(&gpu, &curves, &took, &begun, &arguments.out)?;
    if arguments.json {
        terminal::print_json(&json!({
            "adapter": gpu.describe(),
            "quick": arguments.quick,
            "seconds": took.iter().map(|(f, t)| (f.name(), t.as_secs_f64())).collect::<BTreeMap<_, _>>(),
            "curves": curves,
        }))
    } else {
        let out = arguments.out.display();
        terminal::print(&format!("{}\nnumbers, plots and page written to {out}", page::durations(&took)))
    }
}

fn write(
    gpu: &Gpu,
    curves: &[Curve],
    took: &[(Family, Duration)],
    begun: &page::Begun,
    out: &Path,
) -> Result<(), Failure> {
    let images = out.join("images");
    std::fs::create_dir_all(&images).map_err(|e| {
        Failure(format!("{}: found {e}, expected a folder that can be made", images.display()))
    })?;
    let plots = plot::plots(curves);
    let offscreen = Offscreen::new(gpu, false);
    for plot in &plots {
        let svg = svg::document(&plot.marks, plot::SIZE);
        write_whole(&images.join(format!("{}.svg", plot.name)), svg.as_bytes())?;
        let rgba = offscreen.picture(plot::SIZE, 1.0, |ui| plot::paint(ui, &plot.marks))?;
        files::write_png(&images.join(format!("{}.png", plot.name)), plot::SIZE, &rgba)?;
    }
    write_whole(&out.join("accuracy.csv"), page::csv(curves).as_bytes())?;
    write_whole(&out.join("accuracy.md"), page::markdown(curves, &plots, took, begun).as_bytes())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use glioscope_core::Progress;
    use glioscope_render::AdapterPreference;

    use super::*;

    #[test]
    fn kernels_are_named_or_refused() {
        assert_eq!(families(&[]).unwrap().len(), Family::ALL.len());
        assert_eq!(families(&["half".into(), "context".into()]).unwrap(), [Family::Half, Family::Context]);
        let Failure(line) = families(&["halves".into()]).unwrap_err();
        assert!(line.contains("--only") && line.contains("halves") && line.contains("skeleton"), "{line}");
    }

    /// Numbers of a kernel without scenes, as files: each what it says it is.
    #[test]
    fn csv_svg_and_page_are_well_formed() {
        let gpu = Gpu::headless(AdapterPreference::SoftwareOnly).expect("tests need mesa-vulkan-drivers");
        let families = [Family::Half, Family::Resampling];
        let mut curves = accuracy::curves(&gpu, Effort::Tiny, &families, &Progress::new()).unwrap();
        // What must be escaped.
        curves[0].scene = "a \"quoted\", <angled> & scene".into();
        let folder = tempfile::tempdir().unwrap();
        let took = families.map(|f| (f, Duration::from_millis(1500)));
        write(&gpu, &curves, &took, &page::Begun::now(&gpu), folder.path()).unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let csv = read("accuracy.csv");
        let columns: Vec<usize> = csv.lines().map(fields).collect();
        let points: usize = curves.iter().map(|c| c.points.len()).sum();
        assert_eq!(columns.len(), points + 1);
        assert!(columns.iter().all(|n| *n == columns[0]), "{csv}");
        let pages = read("accuracy.md");
        let plots = plot::plots(&curves);
        assert!(plots.len() >= 2);
        assert!(pages.contains("half 1.5 s, resampling 1.5 s"), "how long each family took");
        for plot in &plots {
            assert!(pages.contains(&format!("images/{}.png", plot.name)), "{}", plot.name);
            let svg = read(&format!("images/{}.svg", plot.name));
            well_formed(&svg);
            let png = image::open(folder.path().join(format!("images/{}.png", plot.name))).unwrap().to_rgb8();
            assert_eq!([png.width(), png.height()], plot::SIZE);
            let dark = png.pixels().filter(|p| p.0.iter().all(|c| *c < 128)).count();
            let light = png.pixels().filter(|p| p.0.iter().all(|c| *c > 240)).count();
            assert!(dark > 300 && light > 300_000, "{dark} {light}");
        }
    }

    /// Fields of a line of CSV, quotes counted.
    fn fields(line: &str) -> usize {
        let mut quoted = false;
        1 + line
            .chars()
            .filter(|c| {
                quoted ^= *c == '"';
                *c == ',' && !quoted
            })
            .count()
    }

    /// Tags open and close in order, and no bare < or & is in the text.
    fn well_formed(svg: &str) {
        let mut open = Vec::new();
        for part in svg.split('<').skip(1) {
            let (tag, text) = part.split_once('>').expect("a tag that ends");
            assert!(
                text.replace("&amp;", "")
                    .replace("&lt;", "")
                    .replace("&gt;", "")
                    .replace("&quot;", "")
                    .find('&')
                    .is_none()
            );
            let name = tag.split_whitespace().next().unwrap_or_default();
            assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
            if let Some(name) = name.strip_prefix('/') {
                assert_eq!(open.pop(), Some(name.to_owned()));
            } else if !tag.ends_with('/') {
                open.push(name.to_owned());
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }
}
