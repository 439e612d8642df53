//! The sentences; the course is tested as a whole in `tests/tests/whole/study.rs`.

use glioscope_core::study::Task;
use strum::VariantArray;

use super::sentences;
use crate::words::{Language, keys};

#[test]
fn both_languages_say_the_same_and_of_every_task() {
    let [en, de] = [Language::En, Language::De].map(|language| keys(sentences::source(language)));
    assert_eq!(en, de);
    for task in Task::VARIANTS {
        for what in ["title", "what", "keys"] {
            assert!(en.contains(&format!("{task}-{what}")), "{task} {what}");
        }
    }
}
