//! A monkey at the window: seeded clicks, drags, keys, wheel turns, drops and resizes. Nothing may panic, and what is
//! then saved opens. It runs in a process and a folder of its own, and writes nowhere else.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use egui::{Event, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, TouchPhase, Vec2, pos2, vec2};
use egui_kittest::kittest::NodeT;
use glioscope::{
    command::AppCommand,
    model::{CaseRef, session},
    window::{
        autosave::Autosave,
        dialogs::{Choice, Purpose},
        recent::Recent,
    },
};
use glioscope_core::sample::write_sample;
use glioscope_tests::{
    Dropped, Window, error_text, issue, real_data, user_window, wait_for_workers, workstation, write_tck,
};

/// Number of events of each case: `GLIOSCOPE_TEST_EVENTS`, for a longer search.
const EVENTS: &str = "GLIOSCOPE_TEST_EVENTS";
/// The seeds, separated by commas.
const SEEDS: &str = "GLIOSCOPE_TEST_SEEDS";
/// Number of openings in which memory may not grow.
const OPENINGS: &str = "GLIOSCOPE_TEST_OPENINGS";
/// Names the folder of [`monkey_in_a_folder`].
const FOLDER: &str = "GLIOSCOPE_TEST_MONKEY";

/// Splitmix64: the same events on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn of<T: Clone>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())].clone()
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.next() >> 40) as f32 / (1 << 24) as f32
    }
}

struct Monkey {
    random: Random,
    window: Window,
    size: Vec2,
    at: Pos2,
    /// What may be dropped.
    files: Vec<PathBuf>,
}

impl Monkey {
    fn modifiers(&mut self) -> Modifiers {
        let all = [
            Modifiers::NONE,
            Modifiers::NONE,
            Modifiers::NONE,
            Modifiers::SHIFT,
            Modifiers::COMMAND | Modifiers::CTRL,
            Modifiers::ALT,
            Modifiers::COMMAND | Modifiers::CTRL | Modifiers::SHIFT,
        ];
        self.random.of(&all)
    }

    /// Anywhere, now and then outside the window, or in the middle of something that has a name.
    fn place(&mut self) -> Pos2 {
        let named: Vec<Pos2> = if self.random.below(2) == 0 {
            let root = self.window.root();
            let rects = root.children_recursive().filter_map(|node| node.accesskit_node().bounding_box());
            rects.map(|r| pos2(((r.x0 + r.x1) / 2.0) as f32, ((r.y0 + r.y1) / 2.0) as f32)).collect()
        } else {
            Vec::new()
        };
        if named.is_empty() {
            pos2(
                self.random.between(-10.0, self.size.x + 10.0),
                self.random.between(-10.0, self.size.y + 10.0),
            )
        } else {
            self.random.of(&named)
        }
    }

    fn event(&mut self, event: Event) {
        self.window.input_mut().events.push(event);
    }

    fn go(&mut self, to: Pos2) {
        self.at = to;
        self.event(Event::PointerMoved(to));
    }

    fn button(&mut self, button: PointerButton, pressed: bool, modifiers: Modifiers) {
        self.event(Event::PointerButton { pos: self.at, button, pressed, modifiers });
    }

    fn click(&mut self) {
        let to = self.place();
        let modifiers = self.modifiers();
        let button = self.random.of(&[
            PointerButton::Primary,
            PointerButton::Primary,
            PointerButton::Primary,
            PointerButton::Secondary,
            PointerButton::Middle,
        ]);
        self.go(to);
        for _ in 0..self.random.of(&[1, 1, 1, 2, 3]) {
            self.button(button, true, modifiers);
            self.button(button, false, modifiers);
        }
    }

    fn drag(&mut self) {
        let (from, modifiers) = (self.place(), self.modifiers());
        let button =
            self.random.of(&[PointerButton::Primary, PointerButton::Primary, PointerButton::Secondary]);
        self.go(from);
        self.button(button, true, modifiers);
        for _ in 0..1 + self.random.below(4) {
            let to = self.place();
            self.go(to);
            if self.random.below(2) == 0 {
                self.window.step();
            }
        }
        match self.random.below(8) {
            // Let go outside the window.
            0 => self.event(Event::PointerGone),
            // Another window comes in between.
            1 => self.event(Event::WindowFocused(false)),
            _ => self.button(button, false, modifiers),
        }
    }

    fn wheel(&mut self) {
        let (to, modifiers) = (self.place(), self.modifiers());
        self.go(to);
        let (unit, size) = self.random.of(&[
            (MouseWheelUnit::Point, 60.0),
            (MouseWheelUnit::Line, 5.0),
            (MouseWheelUnit::Page, 2.0),
        ]);
        let delta = vec2(self.random.between(-size, size), self.random.between(-size, size));
        self.event(Event::MouseWheel {
            unit,
            delta,
            phase: TouchPhase::Move,
            modifiers,
            source: egui::MouseWheelSource::Wheel,
        });
        if self.random.below(3) == 0 {
            let factor = self.random.between(0.3, 3.0);
            self.event(Event::Zoom(factor));
        }
    }

    fn key(&mut self) {
        let (key, modifiers) = (self.random.of(Key::ALL), self.modifiers());
        self.event(Event::ModifiersChanged(modifiers));
        for pressed in [true, false] {
            self.event(Event::Key { key, physical_key: None, pressed, repeat: false, modifiers });
        }
        self.event(Event::ModifiersChanged(Modifiers::NONE));
    }

    fn text(&mut self) {
        let text =
            self.random.of(&["7", "-1", "1e39", "NaN", "0", ",", "a", "ü", "\u{202e}", "T1", "12.5", "  "]);
        self.event(Event::Text(text.into()));
    }

    fn drop_files(&mut self) {
        let files: Vec<PathBuf> =
            (0..self.random.of(&[1, 1, 1, 2, 5])).map(|_| self.random.of(&self.files.clone())).collect();
        let dropped =
            files.into_iter().map(|file| Arc::new(Dropped(file)) as Arc<dyn egui::DroppedFile + Send + Sync>);
        self.window.input_mut().dropped_files.extend(dropped);
    }

    fn resize(&mut self) {
        self.size = vec2(self.random.between(200.0, 1400.0), self.random.between(150.0, 900.0)).round();
        self.window.set_size(self.size);
    }

    fn act(&mut self) {
        match self.random.below(100) {
            0..=34 => self.click(),
            35..=54 => self.drag(),
            55..=66 => self.wheel(),
            67..=86 => self.key(),
            87..=92 => self.text(),
            93..=95 => self.drop_files(),
            96..=97 => self.resize(),
            _ => {
                let to = self.place();
                self.go(to);
            }
        }
    }
}

/// What a session can be saved from: every number finite.
fn assert_sound(window: &Window, what: &str) {
    let Some(doc) = &window.state().work.doc else { return };
    let lens = doc.edit.lens;
    assert!(
        lens.center_mm.is_finite() && lens.radius_mm.is_finite() && lens.radius_mm > 0.0,
        "{what}: {lens:?}"
    );
    let camera = &doc.nav.camera;
    assert!(camera.eye_mm().is_finite() && camera.focus_mm.is_finite(), "{what}: {camera:?}");
    assert!(camera.height_mm.is_finite() && camera.height_mm > 0.0, "{what}: {camera:?}");
    assert!(doc.nav.cursor_mm.is_finite(), "{what}");
    assert!(doc.nav.time < window.state().work.world.time_point_count(), "{what}");
}

/// The window in `folder`, with a file chooser that answers by chance, always inside `folder`.
fn window(folder: &Path, case: CaseRef) -> Window {
    let (state, config) = (folder.join("state"), folder.join("config"));
    fs::create_dir_all(&config).unwrap();
    let mut window = user_window(
        workstation(case),
        [900.0, 600.0],
        Recent::in_folder(&config),
        Autosave::in_folder(&state),
    );
    let (out, count) = (folder.join("out"), AtomicUsize::new(0));
    fs::create_dir_all(&out).unwrap();
    window.state_mut().chooser = Arc::new(move |purpose: &Purpose, _: Option<&Path>| {
        let n = count.fetch_add(1, Ordering::Relaxed);
        match (n % 4, purpose.file_name()) {
            (0, _) => Choice::Cancelled,
            (1, _) => Choice::Unavailable("a monkey".into()),
            (_, Some(name)) => Choice::Path(out.join(format!("{}{name}", n % 3))),
            (_, None) => Choice::Path(out.parent().unwrap_or(&out).join("case")),
        }
    });
    window.run_ok();
    // Dialogs begin in the folder of what was chosen last: this one.
    issue(&mut window, AppCommand::SaveSessionTo(folder.join("out/first.glioscope.json")));
    window.run_ok();
    assert_eq!(error_text(&window), "");
    window
}

/// Child process of [`nothing_that_a_monkey_does_panics`].
#[test]
#[ignore = "a child process of another test"]
fn monkey_in_a_folder() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let (events, seed) = (number(EVENTS), number(SEEDS));
    static PANICS: AtomicUsize = AtomicUsize::new(0);
    let hook = std::panic::take_hook();
    // Also those of workers.
    std::panic::set_hook(Box::new(move |info| {
        PANICS.fetch_add(1, Ordering::SeqCst);
        hook(info);
    }));
    let case = CaseRef::Path(folder.join("case"));
    let files = [
        "case",
        "other",
        "case/case.toml",
        "out/first.glioscope.json",
        "a.tck",
        "a.nii.gz",
        "b.txt",
        "nothing",
    ];
    let window = window(&folder, case);
    let mut monkey = Monkey {
        random: Random(seed),
        window,
        size: vec2(900.0, 600.0),
        at: pos2(0.0, 0.0),
        files: files.iter().map(|name| folder.join(name)).collect(),
    };
    for event in 0..events {
        monkey.act();
        // Some wait for their frame.
        if monkey.random.below(4) > 0 {
            monkey.window.step();
        }
        if event % 40 == 39 {
            wait_for_workers(&mut monkey.window);
        }
        if event % 100 == 99 {
            // The harness waits only so long for the software driver, which other work may slow down.
            let drawn = monkey.window.render();
            assert!(
                drawn.as_ref().err().is_none_or(|error| error.contains("timed out")),
                "{:?}",
                drawn.err()
            );
            println!("event {event}: {} MiB", resident_bytes() >> 20);
        }
        let what = format!("seed {seed}, event {event}");
        assert_sound(&monkey.window, &what);
        assert_eq!(PANICS.load(Ordering::SeqCst), 0, "{what}");
    }
    wait_for_workers(&mut monkey.window);
    let path = folder.join("out/last.glioscope.json");
    monkey.window.state_mut().work.error = None;
    if monkey.window.state().work.doc.is_some() {
        issue(&mut monkey.window, AppCommand::SaveSessionTo(path.clone()));
        assert_eq!(error_text(&monkey.window), "");
        let saved = session::load(&path).unwrap();
        assert_eq!(saved.findings, []);
    }
    assert_eq!(PANICS.load(Ordering::SeqCst), 0);
}

/// Memory of this process that is in use.
fn resident_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) << 10
}

fn number(variable: &str) -> u64 {
    std::env::var(variable).unwrap().parse().unwrap()
}

/// Runs a child test of this module with its own folder as home and current folder; returns what it printed.
fn child(test: &str, folder: &Path, variables: &[(&str, String)]) -> String {
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", &format!("monkey::{test}"), "--ignored", "--nocapture"])
        .current_dir(folder)
        .env(FOLDER, folder)
        .env("HOME", folder)
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .envs(variables.iter().map(|(name, value)| (name, value)))
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{variables:?}: {stdout}{stderr}");
    stdout
}

/// A folder with the case in `case`, and more to drop.
fn prepared(real: Option<&Path>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_sample(&at("other")).unwrap();
    match real {
        None => write_sample(&at("case")).unwrap(),
        Some(real) => {
            fs::create_dir(at("case")).unwrap();
            for entry in fs::read_dir(real).unwrap() {
                let path = entry.unwrap().path();
                if path.is_file() {
                    fs::copy(&path, at("case").join(path.file_name().unwrap())).unwrap();
                }
            }
        }
    }
    write_tck(&at("a.tck"), &[vec![[0.0; 3], [10.0, 0.0, 0.0], [20.0, 5.0, 0.0]]]);
    fs::copy(at("other/t1-mask-2024-01-15.nii.gz"), at("a.nii.gz")).unwrap();
    fs::write(at("b.txt"), "nothing of ours").unwrap();
    folder
}

#[test]
fn nothing_that_a_monkey_does_panics() {
    let events = std::env::var(EVENTS).unwrap_or("120".into());
    let seeds = std::env::var(SEEDS).unwrap_or("1".into());
    let cases = [None, real_data("sarcoma-ct-mr-pet")];
    for (number, case) in cases.iter().enumerate().filter(|(number, case)| *number == 0 || case.is_some()) {
        for seed in seeds.split(',') {
            let folder = prepared(case.as_deref());
            let variables = [(EVENTS, events.clone()), (SEEDS, seed.to_owned())];
            let printed = child("monkey_in_a_folder", folder.path(), &variables);
            println!(
                "case {number}, seed {seed}: {events} events; {}",
                printed.lines().rfind(|l| l.contains("MiB")).unwrap_or("")
            );
        }
    }
}

/// Child process of [`memory_is_flat_over_many_openings`].
#[test]
#[ignore = "a child process of another test"]
fn open_and_close_in_a_folder() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let mut window = window(&folder, CaseRef::Path(folder.join("case")));
    let mut cases = Vec::new();
    let mut at_first = 0;
    // The least of the last ten: what is kept of a case stays, what a worker still holds or the allocator returns late
    // doesn't.
    let mut at_last = i64::MAX;
    for opened in 0..10 + number(OPENINGS) {
        let command = match opened % 3 {
            0 => AppCommand::Open(CaseRef::Path(folder.join("other"))),
            1 => AppCommand::OpenSession(folder.join("out/first.glioscope.json")),
            _ => AppCommand::Open(CaseRef::Path(folder.join("case"))),
        };
        cases.push(Arc::downgrade(window.state().work.world.case().unwrap()));
        issue(&mut window, command);
        wait_for_workers(&mut window);
        assert_eq!(error_text(&window), "", "{opened}");
        let alive = cases.iter().filter(|case| case.strong_count() > 0).count();
        assert_eq!(alive, 0, "cases that were closed are still in memory");
        if opened == 9 {
            at_first = resident_bytes();
        }
        if opened >= number(OPENINGS) {
            at_last = at_last.min(resident_bytes() as i64);
        }
        if opened % 10 == 9 {
            println!("opened {opened}: {} MiB", resident_bytes() >> 20);
        }
    }
    println!("GREW {}", at_last - at_first as i64);
}

/// After ten openings every cache is filled. An image of the sample has 4 million voxels of at least a byte: were only one
/// kept of each case, memory would grow by twice the bound.
#[cfg(target_os = "linux")]
#[test]
fn memory_is_flat_over_many_openings() {
    let openings = std::env::var(OPENINGS).unwrap_or("20".into());
    let folder = prepared(None);
    let printed = child("open_and_close_in_a_folder", folder.path(), &[(OPENINGS, openings.clone())]);
    print!("{printed}");
    let grew = printed.lines().find_map(|line| line.strip_prefix("GREW ")?.parse::<i64>().ok()).unwrap();
    let bound = openings.parse::<i64>().unwrap() * (2 << 20);
    assert!(grew < bound, "{} MiB more after {openings} openings", grew >> 20);
}
