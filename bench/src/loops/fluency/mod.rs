//! How soon the window answers: from a real X event to changed pixels on the X server. Programs take turns, gesture by
//! gesture, so that all of them meet the same load. See docs/performance.md.

mod display;

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::Args;
use display::{Spot, Window};

use crate::{
    Outcome,
    clock::{load_average, machine, quartiles},
    print_line,
};

/// The screen, and the window that fills it, pixels.
const SCREEN: [u16; 2] = [1920, 1200];
/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(30);
/// A window that has drawn nothing for this long has settled: views are refined up to 0.45 s after the last change.
const QUIET: Duration = Duration::from_millis(900);
/// Between press and release of a click, as by hand.
const CLICK: Duration = Duration::from_millis(60);

/// Arguments of `fluency`.
#[derive(Debug, Args)]
pub struct FluencyArguments {
    /// Programs to compare, each as LABEL=FILE
    #[arg(required = true)]
    programs: Vec<String>,
    /// Repetitions of each gesture
    #[arg(long, default_value_t = 12)]
    repeats: usize,
    /// Write a picture of each window before, in and after each gesture into this folder
    #[arg(long)]
    pictures: Option<PathBuf>,
    /// How each program is started
    #[arg(last = true, default_values_t = ["open".to_owned(), "--sample".to_owned(), "--software".to_owned()])]
    start: Vec<String>,
}

/// A gesture in the default layout: places in pixels of the window.
#[derive(Clone, Copy)]
struct Gesture {
    name: &'static str,
    /// Where the pointer rests before it.
    from: [i16; 2],
    /// What answers: left, top, width, height.
    watch: [i16; 4],
    deed: Deed,
}

#[derive(Clone, Copy)]
enum Deed {
    /// The pointer moves here, then back.
    Move([i16; 2]),
    Click,
    /// One notch of the wheel, down and up in turn.
    Wheel,
    /// The pointer moves here with the button held; each repetition goes on in the same direction.
    Drag([i16; 2]),
}

const GESTURES: [Gesture; 6] = [
    Gesture {
        name: "hover in the closeup",
        from: [360, 330],
        watch: [1400, 50, 500, 340],
        deed: Deed::Move([375, 340]),
    },
    Gesture {
        name: "hover in a slice",
        from: [1600, 230],
        watch: [1400, 380, 300, 24],
        deed: Deed::Move([1615, 240]),
    },
    Gesture {
        name: "hover on the menus",
        from: [22, 12],
        watch: [0, 0, 220, 24],
        deed: Deed::Move([70, 12]),
    },
    Gesture { name: "menu", from: [22, 12], watch: [10, 40, 150, 60], deed: Deed::Click },
    Gesture { name: "slice notch", from: [1600, 230], watch: [1550, 100, 200, 200], deed: Deed::Wheel },
    Gesture {
        name: "turn, first frame",
        from: [640, 560],
        watch: [285, 255, 200, 200],
        deed: Deed::Drag([652, 564]),
    },
];

/// What one repetition took.
#[derive(Clone, Copy)]
struct Answer {
    /// From the event to the first change in the watched rectangle, milliseconds.
    first_ms: f64,
    /// To the last change of the window.
    settled_ms: f64,
    /// Processor time of the program until then.
    cpu_ms: f64,
}

pub fn run(arguments: &FluencyArguments) -> Outcome<()> {
    let mut windows = Vec::new();
    for entry in &arguments.programs {
        let (label, program) =
            entry.split_once('=').ok_or("found a program without a label, expected LABEL=FILE")?;
        let window = Window::open(Path::new(program), &arguments.start, SCREEN)?;
        windows.push((label, window));
    }
    for (_, window) in &mut windows {
        window.wait_until_quiet(3 * QUIET, PATIENCE)?;
    }
    print_line(format!("{}; load {:.1}", machine(), load_average().unwrap_or(f64::NAN)))?;
    print_line(format!(
        "{}x{} pixels, `{}`, {} repetitions, programs in turn",
        SCREEN[0],
        SCREEN[1],
        arguments.start.join(" "),
        arguments.repeats
    ))?;
    print_line(
        "| gesture | program | first change, median ms | quartiles | fastest to slowest | settled, median ms | CPU, median ms |",
    )?;
    print_line("|---|---|---:|---:|---:|---:|---:|")?;
    for gesture in &GESTURES {
        let mut answers = vec![Vec::new(); windows.len()];
        for repeat in 0..arguments.repeats {
            for ((label, window), answers) in windows.iter_mut().zip(&mut answers) {
                let picture = arguments.pictures.as_ref().filter(|_| repeat == 0).map(|folder| {
                    folder.join(format!("{}-{label}.png", gesture.name.replace([' ', ','], "-")))
                });
                answers.push(
                    play(window, gesture, repeat, picture.as_deref())
                        .map_err(|error| format!("{label}: {}: {error}", gesture.name))?,
                );
            }
        }
        for ((label, _), answers) in windows.iter().zip(&answers) {
            print_line(row(gesture.name, label, answers)?)?;
        }
    }
    print_line(format!("load at the end {:.1}", load_average().unwrap_or(f64::NAN)))
}

fn row(gesture: &str, label: &str, answers: &[Answer]) -> Outcome<String> {
    let of = |value: fn(&Answer) -> f64| answers.iter().map(value).collect::<Vec<_>>();
    let first = of(|a| a.first_ms);
    let median_of =
        |values: &[f64]| quartiles(values).map(|q| q[1]).ok_or("found no repetition, expected one or more");
    let [q1, median, q3] = quartiles(&first).ok_or("found no repetition, expected one or more")?;
    let (low, high) = first.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
    Ok(format!(
        "| {gesture} | {label} | {median:.0} | {q1:.0} to {q3:.0} | {low:.0} to {high:.0} | {:.0} | {:.0} |",
        median_of(&of(|a| a.settled_ms))?,
        median_of(&of(|a| a.cpu_ms))?,
    ))
}

/// Plays a gesture once and waits until the window has settled.
fn play(window: &mut Window, gesture: &Gesture, repeat: usize, picture: Option<&Path>) -> Outcome<Answer> {
    let spot = Spot::of(gesture.watch);
    window.move_to(gesture.from)?;
    if matches!(gesture.deed, Deed::Drag(_)) {
        window.button(1, true)?;
    }
    window.wait_until_quiet(QUIET, PATIENCE)?;
    let before = window.pixels(spot)?;
    let cpu_before = window.cpu_ms();
    if matches!(gesture.deed, Deed::Click) {
        window.button(1, true)?;
        std::thread::sleep(CLICK);
    }
    let start = Instant::now();
    match gesture.deed {
        Deed::Move(to) | Deed::Drag(to) => window.move_to(to)?,
        Deed::Click => window.button(1, false)?,
        Deed::Wheel => {
            let wheel = if repeat.is_multiple_of(2) { 5 } else { 4 };
            window.button(wheel, true)?;
            window.button(wheel, false)?;
        }
    }
    let first = window.wait_for_change(spot, &before, PATIENCE)?;
    if let Some(picture) = picture {
        window.write_picture(picture)?;
    }
    let last = window.wait_until_quiet(QUIET, PATIENCE)?.unwrap_or(first).max(first);
    let ms = |at: Instant| at.duration_since(start).as_secs_f64() * 1e3;
    let answer = Answer { first_ms: ms(first), settled_ms: ms(last), cpu_ms: window.cpu_ms() - cpu_before };
    match gesture.deed {
        Deed::Drag(_) => window.button(1, false)?,
        Deed::Click => {
            // The same place closes the menu.
            window.button(1, true)?;
            std::thread::sleep(CLICK);
            window.button(1, false)?;
        }
        Deed::Move(_) | Deed::Wheel => {}
    }
    window.wait_until_quiet(QUIET, PATIENCE)?;
    Ok(answer)
}
