//! Loops of a case's registrations: from one image to others and back to it.

use glam::DAffine3;

use super::{
    Case, CaseRegistration, TimePoint,
    registration::{aligned, masks_of, surface_points_mm},
};
use crate::{Cancelled, Progress, register, register::Model};

/// An image: the place of its date, and its own in that date.
type At = [usize; 2];

/// A loop of registrations.
enum Loop {
    /// From the fixed image to that of one registration, on to that of another one, and back: places in the list.
    Two([usize; 2]),
    /// From the fixed date to that of a registration, and back by another image that both dates have: the place in the list.
    OtherImage(usize),
}

/// A loop, what it leads through, and the two images whose registration closes it.
struct Open {
    along: Loop,
    through: String,
    closing: [At; 2],
    /// The dates at whose masks' surface it is told, the fixed one first.
    dates: [usize; 2],
}

/// Whether [`close_loops`] can have anything to close in a case: three dates, two dates that have two images in common, or a
/// date with three images.
pub fn has_loops(case: &Case) -> bool {
    let [first, others @ ..] = case.time_points.as_slice() else { return false };
    let common = |later: &TimePoint| {
        later.contexts.iter().filter(|c| first.contexts.iter().any(|own| own.id == c.id)).count()
    };
    others.len() > 1
        || others.iter().any(|later| common(later) > 1)
        || case.time_points.iter().any(|time| time.contexts.len() > 2)
}

/// Closes loops of registrations, with one more registration each, and tells each registration of a loop how far points of the
/// tumour's surface end from where they began:
///
/// - from the fixed image or date to one that was moved, on to the next one that was moved, and back;
/// - from the first date to a later one by the image that was registered, and back by another image that both have.
///
/// `found` is that of [`register_dates`](super::register_dates) or [`register_images`](super::register_images) of the same
/// `case`, before anything of it is applied. A loop takes as long as a registration without its consistency; one that can't be
/// closed is a warning.
///
/// # Errors
/// [`Cancelled`].
pub fn close_loops(
    case: &Case,
    found: &mut [CaseRegistration],
    model: Model,
    progress: &Progress,
) -> Result<(), Cancelled> {
    for Open { along, through, closing, dates } in open_loops(case, found) {
        progress.say(format!("Loop through {through}"));
        let images = closing.map(|[time, image]| (&case.time_points[time], image));
        let closed = aligned(images, model, progress, |_| Ok(()))?;
        let moving_from_fixed = |at: usize| {
            found[at].result.as_ref().map_or(DAffine3::IDENTITY, |registered| registered.moving_from_fixed)
        };
        let points_mm = surface_points_mm(&dates.map(|at| masks_of(&case.time_points[at])));
        let spread = closed.map(|(outcome, ())| {
            let closing = outcome.moving_from_fixed;
            match along {
                Loop::Two([a, b]) => register::around(
                    &[moving_from_fixed(a), closing, moving_from_fixed(b).inverse()],
                    &points_mm,
                ),
                Loop::OtherImage(a) => {
                    register::around(&[moving_from_fixed(a), closing.inverse()], &points_mm)
                }
            }
        });
        let of = match along {
            Loop::Two(both) => both.to_vec(),
            Loop::OtherImage(one) => vec![one],
        };
        for at in of {
            let Ok(registered) = &mut found[at].result else { continue };
            match &spread {
                Ok(Some(spread)) => registered.went_around(*spread, &through),
                Ok(None) => {}
                Err(why) => {
                    registered.warnings.push(format!("the loop through {through} is not closed: {why}"));
                }
            }
        }
    }
    Ok(())
}

/// The loops that one more registration each closes.
fn open_loops(case: &Case, found: &[CaseRegistration]) -> Vec<Open> {
    let usable: Vec<usize> = (0..found.len()).filter(|at| found[*at].result.is_ok()).collect();
    let mut open = Vec::new();
    for pair in usable.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let [own, next] = [&found[a], &found[b]];
        let is_one_space = match (&own.id, &next.id) {
            (None, None) => true,
            (Some(_), Some(_)) => own.time == next.time,
            _ => false,
        };
        let images = moving_image(case, own).zip(moving_image(case, next));
        let Some((from, to)) = images.filter(|_| is_one_space) else { continue };
        let name = |of: &CaseRegistration| of.id.clone().unwrap_or_else(|| of.time.clone());
        let through = format!("{} and {}", name(own), name(next));
        let fixed = if own.id.is_some() { from[0] } else { 0 };
        open.push(Open { along: Loop::Two([a, b]), through, closing: [from, to], dates: [fixed, from[0]] });
    }
    for at in usable.into_iter().filter(|at| found[*at].id.is_none()) {
        let Some(([later, _], [used, _])) = moving_image(case, &found[at]).zip(found[at].images.as_ref())
        else {
            continue;
        };
        let [first, second] = [0, later].map(|time| &case.time_points[time].contexts);
        let other = first.iter().enumerate().filter(|(_, image)| image.id != *used).find_map(|(n, image)| {
            Some((&image.id, [[0, n], [later, second.iter().position(|other| other.id == image.id)?]]))
        });
        if let Some((through, closing)) = other {
            let (along, through) = (Loop::OtherImage(at), through.clone());
            open.push(Open { along, through, closing, dates: [0, later] });
        }
    }
    open
}

/// The image that was moved.
fn moving_image(case: &Case, of: &CaseRegistration) -> Option<At> {
    let time = case.time_at(&of.time)?;
    let [_, moving] = of.images.as_ref()?;
    Some([time, case.time_points[time].contexts.iter().position(|image| image.id == *moving)?])
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        case::{AlignedBy, Alignment, LoadOptions, Registered, load},
        register::Consistency,
        sample,
    };

    /// A registration that moves by `mm`, as if it had been found.
    fn registered(time: &str, id: Option<&str>, images: [&str; 2], mm: DVec3) -> CaseRegistration {
        let moving_from_fixed = DAffine3::from_translation(mm);
        let by = AlignedBy::matrix(moving_from_fixed, "a test");
        let alignments = vec![Alignment::of(id.map(str::to_owned), Some(time.to_owned()), by)];
        let consistency = Consistency {
            starts: None,
            direction: None,
            lesions: None,
            all: None,
            floor_mm: 0.5,
            runs: 0,
            failed: 0,
        };
        let result =
            Registered { alignments, consistency, around: None, warnings: Vec::new(), moving_from_fixed };
        let images = Some(images.map(str::to_owned));
        CaseRegistration {
            time: time.to_owned(),
            id: id.map(str::to_owned),
            images,
            result: Ok(result),
            seconds: 0.0,
        }
    }

    /// The 95th percentiles around the loops, as told and as kept with the alignment.
    fn around_mm(found: &CaseRegistration) -> (f64, f64) {
        let registered = found.result.as_ref().unwrap();
        let AlignedBy::Matrix { loop_mm: Some(kept), .. } = registered.alignments[0].by else { panic!() };
        (registered.around.as_ref().unwrap().worst.p95_mm, kept)
    }

    #[test]
    fn what_registrations_are_off_by_shows_around_their_loops() {
        let case = load(&sample::sample_spec(), &LoadOptions::default(), &Progress::new()).unwrap();
        assert!(has_loops(&case));
        let [first, later] = [0, 1].map(|at| case.time_points[at].label.clone());
        // All images of the sample lie in one space: what is put in comes out. A date, by T1c and back by FLAIR.
        let off = DVec3::new(2.0, -1.0, 2.0);
        let mut dates = [registered(&later, None, ["T1c", "T1c"], off)];
        close_loops(&case, &mut dates, Model::Rigid, &Progress::new()).unwrap();
        let (told, kept) = around_mm(&dates[0]);
        assert!((told - 3.0).abs() < 0.3 && told == kept, "{told} {kept}");
        assert_eq!(dates[0].result.as_ref().unwrap().around.as_ref().unwrap().through, ["FLAIR"]);
        // Three images of a date; what was not registered is in no loop.
        let image = |id, mm| registered(&first, Some(id), ["T1c", id], mm);
        let mut images = [image("FLAIR", DVec3::ZERO), image("PET", off), image("T2", off)];
        images[2].result = Err("it failed".into());
        close_loops(&case, &mut images, Model::Rigid, &Progress::new()).unwrap();
        for of in &images[..2] {
            let (told, kept) = around_mm(of);
            assert!((told - 3.0).abs() < 0.5 && told == kept, "{told} {kept}");
            let registered = of.result.as_ref().unwrap();
            assert_eq!(registered.around.as_ref().unwrap().through, ["FLAIR and PET"]);
            assert!(registered.warnings.is_empty(), "{:?}", registered.warnings);
        }
        assert_eq!(images[2].result, Err("it failed".into()));
    }
}
