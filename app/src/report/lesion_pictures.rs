//! Pictures of lesions in their slices: the targets of a response, and the new ones.

use glam::DVec3;
use glioscope_core::{
    case::Case,
    lesions::{LesionDate, LesionReport, LesionsReport, PartReport, new_lesions},
    response::name_of,
};

use super::{Painter, caption_of, content::Content, document::Block, document::Picture};
use crate::{
    error::AppError,
    model::{Document, PaneId, Ruler, Shape},
    world::response::Answered,
};

/// Targets, and new lesions, that have a picture of their own.
const MOST_OF_A_KIND: usize = 3;

/// A lesion that has a picture.
struct Wanted<'a> {
    lesion: &'a LesionReport,
    /// As it is called in the report, before names are taken out.
    name: &'a str,
    is_new: bool,
}

/// The targets of the last date's calls, then its largest new lesions, each in the slice of its longest diameter, with the diameters of all dates;
/// and whether a target is among them.
pub fn blocks(
    (case, doc): (&Case, &Document),
    (pane, size): (PaneId, [u32; 2]),
    content: &Content<'_>,
    answered: Option<&Answered>,
    painter: &mut dyn Painter,
) -> Result<(Vec<Block>, bool), AppError> {
    let Some(last) = case.time_points.last() else { return Ok((Vec::new(), false)) };
    let mut wanted = answered.map(targets).unwrap_or_default();
    wanted.extend(content.lesions.map(|report| new(report, &last.label)).unwrap_or_default());
    let mut blocks = Vec::new();
    let mut counts = [0; 2];
    for Wanted { lesion, name, is_new } in wanted {
        let name = content.redactor.text(name);
        let measured: Vec<Ruler> = (0..case.time_points.len())
            .filter_map(|time| {
                let label = &case.time_points[time].label;
                ruler(largest(lesion.dates.iter().find(|date| date.time == *label)?)?, &name, time)
            })
            .collect();
        // As it is now; one that is gone, where it was.
        let Some(newest) = measured.last() else { continue };
        let mut shown = doc.clone();
        shown.nav.time = case.time_points.len() - 1;
        // The whole slice, at the lesion.
        shown.nav.mm_per_point = None;
        // Its ring would stand about another lesion.
        shown.edit.lens_on = false;
        shown.nav.pin_mm(newest.middle_mm());
        // A reader may have measured it by these already.
        let is_known = |ruler: &Ruler| {
            let same = |own: &Ruler| own.time == ruler.time && own.shape == ruler.shape;
            doc.edit.rulers.iter().any(|own| same(own) && own.from_mm == ruler.from_mm)
        };
        let added: Vec<Ruler> = measured.into_iter().filter(|ruler| !is_known(ruler)).collect();
        shown.edit.rulers.extend(added);
        painter.show(&shown);
        let rgba = painter.picture(pane, size)?;
        let (key, stem) =
            if is_new { ("picture-new-lesion", "new-lesion") } else { ("picture-target", "target") };
        let caption = content.words.with(key, &[("lesion", name)]);
        let caption = caption_of(case, &shown, pane, &caption, content.words);
        let count = &mut counts[usize::from(is_new)];
        *count += 1;
        blocks.push(Block::Picture(Picture { name: format!("{stem}-{count}"), caption, size, rgba }));
    }
    painter.show(doc);
    Ok((blocks, counts[0] > 0))
}

/// The targets that the calls by diameters of the last date rest on, in the order of the table.
fn targets(answered: &Answered) -> Vec<Wanted<'_>> {
    let Some(last) = answered.evaluated.response.dates.last() else { return Vec::new() };
    let all = last.by_diameters.sums.iter().flat_map(|sum| {
        let of = answered.lesions.iter().find(|(compartment, _)| *compartment == sum.compartment);
        let named = of.into_iter().flat_map(|(_, report)| {
            report.lesions.iter().map(|lesion| (lesion, name_of(lesion, &report.lesions)))
        });
        named.filter(|(_, name)| sum.lesions.iter().any(|of| of.target && of.lesion == *name))
    });
    all.take(MOST_OF_A_KIND).map(|(lesion, name)| Wanted { lesion, name, is_new: false }).collect()
}

/// The new lesions of a date, the largest first.
fn new<'a>(report: &'a LesionsReport, time: &str) -> Vec<Wanted<'a>> {
    let mut all: Vec<_> = new_lesions(report).filter(|(_, date)| date.time == time).collect();
    all.sort_by(|(_, a), (_, b)| b.volume_ml.unwrap_or(0.0).total_cmp(&a.volume_ml.unwrap_or(0.0)));
    let of = |date: &LesionDate| {
        report.lesions.iter().find(|lesion| lesion.dates.iter().any(|own| std::ptr::eq(own, date)))
    };
    let all =
        all.into_iter().filter_map(|(name, date)| Some(Wanted { lesion: of(date)?, name, is_new: true }));
    all.take(MOST_OF_A_KIND).collect()
}

/// The component whose diameters are the lesion's in tables: that with the largest product.
fn largest(date: &LesionDate) -> Option<&PartReport> {
    let product = |part: &PartReport| part.diameters.product_mm2;
    date.parts.iter().max_by(|a, b| product(a).total_cmp(&product(b)))
}

/// The diameters of a component; `None` without a length.
fn ruler(part: &PartReport, name: &str, time: usize) -> Option<Ruler> {
    let (d1, d2) = (part.diameters.d1, part.diameters.d2);
    let is_long = |from: DVec3, to: DVec3| from.distance(to) > 0.0;
    is_long(d1.from_mm, d1.to_mm).then(|| Ruler {
        name: name.to_owned(),
        from_mm: d1.from_mm,
        to_mm: d1.to_mm,
        shape: Shape::Diameters { across_mm: [d2.from_mm, d2.to_mm] },
        view: PaneId::Axial,
        time,
    })
}
