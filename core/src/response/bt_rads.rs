//! BT-RADS as a guided form: questions in order, each with its answers, up to a category with its reason.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{check::wrong, history::HistoryError, rules::Mark};

/// A question of the form.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Question {
    /// Its key.
    pub id: &'static str,
    /// What is asked.
    pub text: &'static str,
    /// The answers, in order.
    pub answers: &'static [Answer],
}

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// Its key.
    pub id: &'static str,
    /// Its text.
    pub text: &'static str,
    /// Where it leads.
    then: Then,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Then {
    Ask(&'static str),
    Category(&'static str),
}

/// A category of BT-RADS.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Category {
    /// `0`, `1a`, `1b`, `2`, `3a`, `3b`, `3c` or `4`.
    pub id: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// How the meaning is known.
    pub mark: Mark,
    /// What the meaning rests on.
    pub source: &'static str,
}

const SITE: &str = "btrads.com";
/// What the order of questions and their numbers rest on: code that implements the flow.
const FLOW: &str = "flow in code that implements BT-RADS";

/// Days after radiotherapy up to which worse is category 3a.
const EARLY_DAYS: &str = "less than 90 days";
/// Increase above which worse is category 4.
const LARGE: &str = "more than 40 %";

const fn category(id: &'static str, meaning: &'static str) -> Category {
    Category { id, meaning, mark: Mark::Read, source: SITE }
}

static CATEGORIES: &[Category] = &[
    category("0", "baseline, or incomplete"),
    category("1a", "better"),
    category("1b", "better, by a drug"),
    category("2", "the same"),
    category("3a", "worse, favours effects of treatment"),
    category("3b", "worse, mixed"),
    category("3c", "worse, favours tumour"),
    category("4", "worse, highly suspicious of tumour"),
];

const fn to(id: &'static str, text: &'static str, next: &'static str) -> Answer {
    Answer { id, text, then: Then::Ask(next) }
}

const fn end(id: &'static str, text: &'static str, category: &'static str) -> Answer {
    Answer { id, text, then: Then::Category(category) }
}

/// The questions; the first is asked first.
static QUESTIONS: &[Question] = &[
    Question {
        id: "prior",
        text: "Is there an earlier scan to compare with, and is this one complete?",
        answers: &[to("yes", "yes", "change"), end("no", "no", "0")],
    },
    Question {
        id: "change",
        text: "How does the tumour look, compared with the earlier scan?",
        answers: &[
            to("better", "better", "drug"),
            end("same", "the same", "2"),
            to("worse", "worse", "early"),
        ],
    },
    Question {
        id: "drug",
        text: "Is it the first scan under bevacizumab, or were steroids begun or raised?",
        answers: &[end("yes", "yes", "1b"), end("no", "no", "1a")],
    },
    Question {
        id: "early",
        text: "How long ago did radiotherapy end?",
        answers: &[end("yes", EARLY_DAYS, "3a"), to("no", "longer, or there was none", "what")],
    },
    Question {
        id: "what",
        text: "What is worse?",
        answers: &[
            end("flair", "FLAIR alone", "3b"),
            end("enhancement", "enhancement alone", "3b"),
            to("both", "both", "large"),
        ],
    },
    Question {
        id: "large",
        text: "By how much?",
        answers: &[end("yes", LARGE, "4"), to("no", "less", "progressive")],
    },
    Question {
        id: "progressive",
        text: "Does it go on getting worse over several scans?",
        answers: &[end("yes", "yes", "4"), end("no", "no", "3c")],
    },
];

/// How far the answers lead.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BtRads {
    /// This question is next.
    Next(Question),
    /// The category, with the answers that led to it.
    Result {
        /// The category.
        category: Category,
        /// Questions and answers, in order, in words.
        reason: String,
        /// How the order of questions is known.
        flow_mark: Mark,
        /// What the order of questions rests on.
        flow_source: &'static str,
    },
}

/// Follows the form: `answers` has the keys of answers by those of questions. Answers to questions that aren't reached are
/// kept for later, and change nothing.
///
/// # Errors
/// [`HistoryError`] for questions and answers that the form doesn't have.
pub fn bt_rads(answers: &BTreeMap<String, String>) -> Result<BtRads, HistoryError> {
    for (question, answer) in answers {
        let known = QUESTIONS.iter().find(|known| known.id == question);
        let Some(known) = known else {
            let all = QUESTIONS.iter().map(|known| known.id).collect::<Vec<_>>().join(", ");
            return Err(wrong("BT-RADS", format!("question {question}"), format!("one of {all}")));
        };
        if !known.answers.iter().any(|known| known.id == answer) {
            let all = known.answers.iter().map(|known| known.id).collect::<Vec<_>>().join(", ");
            return Err(wrong("BT-RADS", format!("{question} = {answer}"), format!("one of {all}")));
        }
    }
    let said = bt_rads_answered(answers);
    let next = match said.last().map(|(_, given)| given.then) {
        None => QUESTIONS.first(),
        Some(Then::Ask(next)) => QUESTIONS.iter().find(|question| question.id == next),
        Some(Then::Category(id)) => {
            let category = CATEGORIES.iter().find(|category| category.id == id);
            let category = category.ok_or_else(|| wrong("BT-RADS", id, "a category"))?;
            let words = said.iter().map(|(asked, given)| format!("{} {}", asked.text, given.text));
            return Ok(BtRads::Result {
                category: *category,
                reason: words.collect::<Vec<_>>().join("; "),
                flow_mark: Mark::Secondary,
                flow_source: FLOW,
            });
        }
    };
    next.map(|next| BtRads::Next(*next))
        .ok_or_else(|| wrong("BT-RADS", "a form without an end", "a category"))
}

/// The questions that are reached and answered, in order, each with its answer.
pub fn bt_rads_answered(answers: &BTreeMap<String, String>) -> Vec<(&'static Question, &'static Answer)> {
    let mut said = Vec::new();
    let mut question = QUESTIONS.first();
    // No path is longer than the form.
    for _ in QUESTIONS {
        let Some(asked) = question else { break };
        let given = answers.get(asked.id).and_then(|id| asked.answers.iter().find(|answer| answer.id == id));
        let Some(given) = given else { break };
        said.push((asked, given));
        question = match given.then {
            Then::Ask(next) => QUESTIONS.iter().find(|question| question.id == next),
            Then::Category(_) => None,
        };
    }
    said
}
