//! A study of perception after chapter 6 of the thesis: how well people judge depth, size and shape in pictures that differ in their
//! light. Scenes are made by seed, and their truth follows from their geometry, never from a picture.
//!
//! [`Design::trials`] lists what a participant sees, [`Scene::of`] makes a trial's scene, [`Record`] is an answer as a row of the file of
//! answers. Lights are numbers here: who draws knows them.

mod answer;
mod design;
mod make;
mod record;
mod scene;
mod sheet;
mod solid;
mod space;
#[cfg(test)]
mod tests;

pub use answer::{Answer, Score, Task, Truth};
pub use design::{Design, MAX_LIGHTS, Trial};
pub use record::{COLUMNS, Record, records};
pub use scene::{Mark, Scene, Side};
