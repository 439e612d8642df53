//! The rough alignment, and what speaks against it: a mirror image that fits better, another that fits as well.

use crate::{Cancelled, Progress};
use glam::{DAffine3, DMat3, DVec3};

use super::{
    pair::overlap_share,
    pose::{apart_mm, half_way, nearest_turn, quarter_turns},
    prepared::Prepared,
    search::{Found, MAX_SHIFT_MM, MAX_TURN_DEGREES, MIN_OVERLAP, Search},
    types::{Model, Options, RegisterError, Warning},
};

/// Similarity at the second level below which images have nothing in common.
const MIN_SIMILARITY: f64 = 1.045;
/// Similarity there below which an alignment must fit clearly better than others: two unrelated bodies reach 1.07.
const WEAK_SIMILARITY: f64 = 1.08;
/// Similarity there below which the images' axes may be wrong, so that turned ones are tried, and below which too small
/// an overlap is chance.
const SURE_SIMILARITY: f64 = 1.12;
/// Alignments whose similarity beyond 1 is this close to the best one's are as good.
const AS_GOOD: f64 = 0.97;
/// The same where similarity is weak.
const AS_GOOD_WEAK: f64 = 0.9;
/// Overlap below which a sure similarity is needed.
const PARTIAL_OVERLAP: f64 = 0.7;
/// How much more similarity beyond 1 a turned image must have than one as its header says.
const TURNED_GAIN: f64 = 1.2;
/// How far apart alignments as good must be to count as different, mm.
const ELSEWHERE_MM: f64 = 12.0;
/// Turned orientations that are searched.
const TURNS_SEARCHED: usize = 2;

/// The best rough alignment.
#[derive(Clone, Debug)]
pub(crate) struct Rough {
    pub pose: DAffine3,
    /// The moving image's axes are turned by this first; the identity but where a header is wrong.
    pub turn: DMat3,
    pub evaluations: usize,
    pub warnings: Vec<Warning>,
}

impl Rough {
    /// A start that is given: nothing is searched.
    pub fn given(prepared: &Prepared, moving_from_fixed: DAffine3) -> Self {
        let turn = nearest_turn(moving_from_fixed.matrix3);
        let pose = prepared.turned(turn).pose(moving_from_fixed);
        Self { pose, turn, evaluations: 0, warnings: Vec::new() }
    }
}

/// Searches as the headers lie; where that fits weakly, with the moving image's axes exchanged as well.
pub(crate) fn rough(
    prepared: &Prepared,
    options: &Options,
    progress: &Progress,
) -> Result<Rough, RegisterError> {
    progress.say("search");
    let search = Search { fixed: &prepared.fixed, moving: &prepared.moving, seed: options.seed };
    let straight = search.run(&starts(prepared), progress)?;
    progress.advance(1)?;
    progress.say("search, mirrored");
    let mut reflected = mirrored(prepared, options, progress)?;
    progress.advance(1)?;
    let mut evaluations = straight.evaluations + reflected.evaluations;
    let value = |found: &Found| found.candidates.first().map_or(1.0, |c| c.value);
    let best = value(&straight);
    let (mut found, mut turn) = (straight, DMat3::IDENTITY);
    if best < SURE_SIMILARITY || value(&reflected) - 1.0 > AS_GOOD * (best - 1.0) {
        progress.say("search, axes exchanged");
        for likely in likely_turns(prepared, options, progress)? {
            let turned = prepared.turned(likely);
            let search = Search { fixed: &turned.fixed, moving: &turned.moving, seed: options.seed };
            let other = search.run(&[masses(&turned)], progress)?;
            evaluations += other.evaluations;
            let needed = SURE_SIMILARITY.max(1.0 + TURNED_GAIN * (best - 1.0));
            if value(&other) > needed && value(&other) > value(&found) {
                (found, turn) = (other, likely);
            }
        }
    }
    let turned = prepared.turned(turn);
    if turn != DMat3::IDENTITY {
        reflected = mirrored(&turned, options, progress)?;
        evaluations += reflected.evaluations;
    }
    let mut warnings = Vec::new();
    let pose = judged(&turned, &found, &reflected, &mut warnings)?;
    if turn != DMat3::IDENTITY {
        warnings.push(Warning::AxesExchanged);
    }
    Ok(Rough { pose, turn, evaluations, warnings })
}

/// The best of what was found, or why it can't be relied on.
fn judged(
    prepared: &Prepared,
    found: &Found,
    reflected: &Found,
    warnings: &mut Vec<Warning>,
) -> Result<DAffine3, RegisterError> {
    let Some(best) = found.candidates.first() else {
        return Err(if found.left_range {
            RegisterError::OutOfRange { degrees: MAX_TURN_DEGREES, shift_mm: MAX_SHIFT_MM }
        } else {
            RegisterError::NoOverlap { share: found.largest_overlap, expected: MIN_OVERLAP }
        });
    };
    let straight = best.value;
    if straight < MIN_SIMILARITY {
        return Err(RegisterError::Disagree { found: straight, expected: MIN_SIMILARITY });
    }
    let as_good = if straight < WEAK_SIMILARITY { AS_GOOD_WEAK } else { AS_GOOD };
    let half = half_way(best.pose, Model::Rigid).ok_or(RegisterError::NotFinite("a transform"))?;
    let share = overlap_share(&prepared.fixed, &prepared.moving, &half);
    if share < PARTIAL_OVERLAP && straight < SURE_SIMILARITY {
        return Err(RegisterError::Disagree { found: straight, expected: SURE_SIMILARITY });
    }
    if let Some(mirrored) = reflected.candidates.first().map(|c| c.value) {
        let unsure = mirrored - 1.0 > as_good * (straight - 1.0);
        // What fits weakly and no better than its mirror image is probably no alignment at all.
        if unsure && straight < WEAK_SIMILARITY {
            return Err(RegisterError::Disagree { found: straight, expected: WEAK_SIMILARITY });
        }
        if AS_GOOD * (mirrored - 1.0) > straight - 1.0 {
            return Err(RegisterError::Mirrored { straight, mirrored });
        }
        if unsure {
            warnings.push(Warning::SidesUnsure { straight, mirrored });
        }
    }
    for other in found.candidates.iter().skip(1) {
        let apart_mm = apart_mm(best.pose, other.pose, prepared.radius_mm);
        if apart_mm > ELSEWHERE_MM && other.value - 1.0 > as_good * (straight - 1.0) {
            return Err(RegisterError::Ambiguous { best: straight, other: other.value, apart_mm });
        }
    }
    Ok(best.pose)
}

/// The search with the moving image mirrored.
fn mirrored(prepared: &Prepared, options: &Options, progress: &Progress) -> Result<Found, Cancelled> {
    let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let reflected = prepared.turned(mirror);
    let search = Search { fixed: &reflected.fixed, moving: &reflected.moving, seed: options.seed };
    // As the headers lie, mirrored about the moving image's own centre.
    let mut header = prepared.pose(DAffine3::IDENTITY);
    header.translation = mirror * header.translation;
    let mut bases = vec![masses(&reflected)];
    if is_elsewhere(header, bases[0]) {
        bases.push(header);
    }
    search.run(&bases, progress)
}

/// As the headers lie, and the foregrounds' centres on each other.
fn starts(prepared: &Prepared) -> Vec<DAffine3> {
    let mut bases = vec![prepared.pose(DAffine3::IDENTITY)];
    let masses = masses(prepared);
    if is_elsewhere(bases[0], masses) {
        bases.push(masses);
    }
    bases
}

fn masses(prepared: &Prepared) -> DAffine3 {
    DAffine3::from_translation(prepared.moving.mass_centre_mm - prepared.fixed.mass_centre_mm)
}

fn is_elsewhere(a: DAffine3, b: DAffine3) -> bool {
    apart_mm(a, b, 0.0) > 8.0
}

/// The exchanges of axes that score best at the coarsest level without further turning.
fn likely_turns(
    prepared: &Prepared,
    options: &Options,
    progress: &Progress,
) -> Result<Vec<DMat3>, Cancelled> {
    let mut scored = Vec::new();
    for turn in quarter_turns() {
        let turned = prepared.turned(turn);
        let search = Search { fixed: &turned.fixed, moving: &turned.moving, seed: options.seed };
        if let Some(value) = search.best_shift(masses(&turned), progress)? {
            scored.push((value, turn));
        }
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(scored.into_iter().take(TURNS_SEARCHED).map(|(_, turn)| turn).collect())
}
