//! The study of perception in the program's own lights, after chapter 6 of the thesis: docs/study.md.
//!
//! [`Study`] is its course: which page is shown, what a key does, when an answer is written. It knows neither a window nor a device.
//! [`pictures`] draws the trials' scenes on a thread of its own, [`view`] shows the pages, [`robot`] is a participant for tests, which
//! presses the same keys.

mod answers;
mod course;
mod page;
pub mod pictures;
pub mod robot;
mod sentences;
#[cfg(test)]
mod tests;
pub mod view;

pub use course::{Settings, Study};
pub use page::{Page, Prepared};
