//! Which trials a participant sees, in which order.
//!
//! Within a task, scenes come in groups of as many as there are lights. In a group every light is seen once, and the Latin square
//! light = (scene + participant) mod lights gives a scene another light for each of so many consecutive participants: nobody sees a scene
//! twice, and a difficult scene is no light's burden. The lights' order within a group is a row of Williams' square (1949): each light
//! follows every other one equally often. Scenes of a group are equally difficult.

use super::answer::Task;
use crate::optics::random::Random;

/// The most lights of a study.
pub const MAX_LIGHTS: usize = 16;
/// Levels of difficulty, which groups of scenes go through in turn.
pub(super) const LEVELS: u32 = 3;
/// Scenes from this number on are for practice.
const PRACTICE: u32 = 1_000_000;

/// What fixes a participant's trials.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Design {
    /// Fixes the scenes, the same for all participants.
    pub seed: u64,
    /// The participant's number.
    pub participant: u32,
    /// The tasks in their order.
    pub tasks: Vec<Task>,
    /// Number of lights, 2 to [`MAX_LIGHTS`].
    pub lights: usize,
    /// How often each light is seen in each task; at least 1.
    pub repeats: u32,
    /// Trials of practice before each task.
    pub practice: u32,
}

/// A trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trial {
    /// Its task.
    pub task: Task,
    /// Its number within the task, from 1; practice is counted on its own.
    pub number: u32,
    /// Whether it is for practice: it has an easy scene and doesn't count.
    pub practice: bool,
    /// The light, of the left picture where there are two.
    pub light: usize,
    /// The light of the right picture.
    pub other: Option<usize>,
    /// Number of the scene.
    pub scene: u32,
}

impl Trial {
    /// Which of [`LEVELS`] the scene has in a study of so many lights.
    pub(super) fn level(&self, lights: usize) -> u32 {
        self.scene / lights.max(1) as u32 % LEVELS
    }
}

/// `0..count` in a random order.
fn shuffled(count: usize, random: &mut Random) -> Vec<usize> {
    let mut all: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        all.swap(last, ((last + 1) as f64 * random.unit()) as usize);
    }
    all
}

/// Row `row` of Williams' square of `count` treatments: so many rows where that is even, twice as many where it is odd.
fn williams(count: usize, row: usize) -> Vec<usize> {
    let rows = if count.is_multiple_of(2) { count } else { 2 * count };
    let row = row % rows;
    let zigzag = |at: usize| if at.is_multiple_of(2) { count - at / 2 } else { at.div_ceil(2) };
    let mut all: Vec<usize> = (0..count).map(|at| (zigzag(at) + row) % count).collect();
    if row >= count {
        all.reverse();
    }
    all
}

impl Design {
    /// The trials of all tasks in their order, practice before each task.
    pub fn trials(&self) -> Vec<Trial> {
        self.tasks.iter().flat_map(|task| self.of_task(*task)).collect()
    }

    fn of_task(&self, task: Task) -> Vec<Trial> {
        let lights = self.lights.clamp(1, MAX_LIGHTS);
        let stream = u64::from(self.participant) << 8 | task as u64;
        let mut random = Random::new(self.seed, stream);
        // The same for all participants: which light is which treatment of the square.
        let treatments = shuffled(lights, &mut Random::new(self.seed, task as u64));
        let shift = self.participant as usize % lights;
        let practice = (0..self.practice).map(|n| Trial {
            task,
            number: n + 1,
            practice: true,
            light: (n as usize + shift) % lights,
            other: (task == Task::Preference).then_some((n as usize + shift + 1) % lights),
            scene: PRACTICE + n,
        });
        let trial = |light, other, scene| Trial { task, number: 0, practice: false, light, other, scene };
        let counted: Vec<Trial> = if task == Task::Preference {
            self.pairs(lights, &mut random)
                .into_iter()
                .map(|([a, b], scene)| trial(a, Some(b), scene))
                .collect()
        } else {
            let groups = shuffled(self.repeats as usize, &mut random);
            let place = |(at, group): (usize, usize)| {
                let row = self.participant as usize * self.repeats as usize + at;
                let treatments = &treatments;
                williams(lights, row).into_iter().map(move |treatment| {
                    let light = treatments[treatment];
                    let scene = group * lights + (light + lights - shift) % lights;
                    trial(light, None, scene as u32)
                })
            };
            groups.into_iter().enumerate().flat_map(place).collect()
        };
        practice.chain((1..).zip(counted).map(|(number, trial)| Trial { number, ..trial })).collect()
    }

    /// Every two lights twice, once on each side, in a random order, with the number of the scene.
    fn pairs(&self, lights: usize, random: &mut Random) -> Vec<([usize; 2], u32)> {
        let all: Vec<[usize; 2]> =
            (0..lights).flat_map(|a| (0..lights).filter(move |b| *b != a).map(move |b| [a, b])).collect();
        let scenes = shuffled(all.len(), random);
        let order = shuffled(all.len(), random);
        order.into_iter().map(|at| (all[at], scenes[at] as u32)).collect()
    }
}
