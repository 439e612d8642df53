//! Which unknown inputs can change a call: the evaluation is run once for every way in which the unknown inputs that it asks
//! for can turn out, as a tree, so that inputs on which nothing depends are never asked for.

use serde::Serialize;

use super::phrases as say;
use crate::phrase::Template;

/// Maximum number of ways that are followed; beyond, all inputs that were asked for are listed.
const MAX_LEAVES: usize = 2000;

/// An input that can be unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Input {
    /// The baseline scan.
    Baseline,
    /// Which lesions are targets, or what decides whether they are measurable.
    Targets,
    /// The sum of the targets.
    Sum,
    /// The sum of the targets' enhancing part, in mixed disease.
    SumEnhancing,
    /// The sum of the targets' non-enhancing part, in mixed disease.
    SumNonEnhancing,
    /// New lesions.
    NewLesion,
    /// Lesions that aren't targets.
    NonTarget,
    /// T2/FLAIR beside the targets.
    Flair,
    /// Clinical state.
    Clinical,
    /// Dose of steroids.
    Steroids,
    /// Why steroids were raised.
    SteroidsReason,
    /// Whether the technique changed.
    Technique,
    /// Where the growth lies.
    Field,
    /// Histology.
    Histology,
    /// End of radiotherapy.
    RadiotherapyEnd,
    /// Newly diagnosed or recurrent.
    Disease,
    /// Treatments and their starts.
    Treatment,
    /// The call at another scan, which lacks inputs of its own.
    CallAt,
}

/// An unknown input of one scan (`None`: of the patient).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Unknown {
    /// What.
    pub input: Input,
    /// Index of the scan.
    pub scan: Option<usize>,
}

/// One way in which unknown inputs turned out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Choice {
    unknown: Unknown,
    /// Index of the alternative; 0 is the one that is assumed.
    taken: usize,
    options: usize,
    /// Whether the first alternative is assumed as long as nothing else is stated.
    assumed: bool,
}

/// Answers the evaluation's questions for unknown inputs.
#[derive(Default)]
pub(super) struct Ask {
    path: Vec<Choice>,
    at: usize,
    /// Whether assumptions are kept, so that their other alternatives aren't followed.
    keeps_assumptions: bool,
}

impl Ask {
    /// One of `options`, which are at least one; the first if `assumed` and nothing else is explored.
    pub fn choose<T: Copy>(
        &mut self,
        input: Input,
        scan: Option<usize>,
        assumed: bool,
        options: &[T],
    ) -> Option<T> {
        let unknown = Unknown { input, scan };
        // The same question has the same answer.
        let asked = self.path.iter().take(self.at).find(|choice| choice.unknown == unknown);
        let taken = match asked {
            Some(choice) => choice.taken,
            None => {
                if self.path.len() == self.at {
                    let followed = if assumed && self.keeps_assumptions { 1 } else { options.len() };
                    self.path.push(Choice { unknown, taken: 0, options: followed, assumed });
                }
                self.at += 1;
                self.path.get(self.at - 1).map_or(0, |choice| choice.taken)
            }
        };
        options.get(taken).or(options.first()).copied()
    }

    /// Whether an input was answered on this way, by an alternative.
    fn answer(path: &[Choice], unknown: Unknown) -> Option<usize> {
        path.iter().find(|choice| choice.unknown == unknown).map(|choice| choice.taken)
    }

    /// Goes on to the next way; false after the last.
    fn advance(&mut self) -> bool {
        self.at = 0;
        while let Some(last) = self.path.last_mut() {
            last.taken += 1;
            if last.taken < last.options {
                return true;
            }
            self.path.pop();
        }
        false
    }
}

/// What exploring found.
pub(super) struct Explored<O> {
    /// The outcome under the assumptions, if all ways that follow them agree.
    pub given: Option<O>,
    /// One outcome of each key that the ways under the assumptions lead to.
    pub under_assumptions: Vec<O>,
    /// One outcome of each key that any way leads to.
    pub all: Vec<O>,
    /// Whether all ways were followed; if not, all inputs that were asked for are missing.
    pub complete: bool,
    /// The unknown inputs that can change the key, and whether their first alternative is assumed.
    pub missing: Vec<(Unknown, bool)>,
}

/// One outcome of each key, the first.
fn distinct<'a, O: Clone + 'a, K: PartialEq>(
    outcomes: impl Iterator<Item = &'a O>,
    key: &impl Fn(&O) -> K,
) -> Vec<O> {
    let mut found: Vec<O> = Vec::new();
    for outcome in outcomes {
        if !found.iter().any(|other| key(other) == key(outcome)) {
            found.push(outcome.clone());
        }
    }
    found
}

/// Runs `evaluate` for all ways, or, where they are too many, for those that keep the assumptions; outcomes count as the same where their `key` is.
pub(super) fn explore<O: Clone, K: PartialEq>(
    mut evaluate: impl FnMut(&mut Ask) -> O,
    key: impl Fn(&O) -> K,
) -> Explored<O> {
    let (leaves, complete) = walk(&mut evaluate, false);
    let all = distinct(leaves.iter().map(|(_, outcome)| outcome), &key);
    let (under_assumptions, is_settled) = if complete {
        let kept = leaves.iter().filter(|(path, _)| path.iter().all(|c| !c.assumed || c.taken == 0));
        (distinct(kept.map(|(_, outcome)| outcome), &key), true)
    } else {
        // Too many ways in all; those that keep the assumptions may be few.
        let (kept, all_kept) = walk(&mut evaluate, true);
        (distinct(kept.iter().map(|(_, outcome)| outcome), &key), all_kept)
    };
    let given =
        if under_assumptions.len() == 1 && is_settled { under_assumptions.first().cloned() } else { None };
    let mut asked: Vec<(Unknown, bool)> = Vec::new();
    for choice in leaves.iter().flat_map(|(path, _)| path) {
        if !asked.iter().any(|(unknown, _)| *unknown == choice.unknown) {
            asked.push((choice.unknown, choice.assumed));
        }
    }
    if complete && all.len() == 1 {
        asked.clear();
    } else if complete {
        asked.retain(|(unknown, _)| matters(&leaves, *unknown, &key));
    }
    Explored { given, under_assumptions, all, complete, missing: asked }
}

/// Follows all ways, up to [`MAX_LEAVES`]; and whether those were all.
fn walk<O>(
    evaluate: &mut impl FnMut(&mut Ask) -> O,
    keeps_assumptions: bool,
) -> (Vec<(Vec<Choice>, O)>, bool) {
    let mut ask = Ask { keeps_assumptions, ..Ask::default() };
    let mut leaves = Vec::new();
    loop {
        let outcome = evaluate(&mut ask);
        leaves.push((ask.path.clone(), outcome));
        if !ask.advance() {
            return (leaves, true);
        }
        if leaves.len() >= MAX_LEAVES {
            return (leaves, false);
        }
    }
}

/// Whether two ways that differ in `unknown`, and in nothing else that both answer, end differently.
fn matters<O, K: PartialEq>(leaves: &[(Vec<Choice>, O)], unknown: Unknown, key: &impl Fn(&O) -> K) -> bool {
    let with: Vec<_> =
        leaves.iter().filter_map(|leaf| Some((Ask::answer(&leaf.0, unknown)?, leaf, key(&leaf.1)))).collect();
    with.iter().enumerate().any(|(k, (answer, leaf, outcome))| {
        with.iter().skip(k + 1).any(|(other_answer, other, other_outcome)| {
            answer != other_answer && outcome != other_outcome && compatible(&leaf.0, &other.0, unknown)
        })
    })
}

fn compatible(a: &[Choice], b: &[Choice], except: Unknown) -> bool {
    a.iter()
        .filter(|choice| choice.unknown != except)
        .all(|choice| Ask::answer(b, choice.unknown).is_none_or(|taken| taken == choice.taken))
}

impl Input {
    /// It in words.
    pub(super) fn template(self) -> &'static Template {
        match self {
            Self::Baseline => say::INPUT_BASELINE,
            Self::Targets => say::INPUT_TARGETS,
            Self::Sum => say::INPUT_SUM,
            Self::SumEnhancing => say::INPUT_SUM_ENHANCING,
            Self::SumNonEnhancing => say::INPUT_SUM_NON_ENHANCING,
            Self::NewLesion => say::INPUT_NEW_LESION,
            Self::NonTarget => say::INPUT_NON_TARGET,
            Self::Flair => say::INPUT_FLAIR,
            Self::Clinical => say::INPUT_CLINICAL,
            Self::Steroids => say::INPUT_STEROIDS,
            Self::SteroidsReason => say::INPUT_STEROIDS_REASON,
            Self::Technique => say::INPUT_TECHNIQUE,
            Self::Field => say::INPUT_FIELD,
            Self::Histology => say::INPUT_HISTOLOGY,
            Self::RadiotherapyEnd => say::INPUT_RADIOTHERAPY_END,
            Self::Disease => say::INPUT_DISEASE,
            Self::Treatment => say::INPUT_TREATMENT,
            Self::CallAt => say::INPUT_CALL_AT,
        }
    }
}
