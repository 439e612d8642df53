//! The real window, on a virtual display.

use std::{
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use glioscope_tests::{MASK_COLORS, count_color};

use crate::PROGRAM;

struct Display {
    server: Child,
    name: String,
}

impl Display {
    fn start() -> Self {
        // -displayfd lets the server choose a free display number and report it once it listens.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1500x950x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb is installed (./x test installs it)");
        let mut line = String::new();
        let mut stdout = std::io::BufReader::new(server.stdout.take().unwrap());
        std::io::BufRead::read_line(&mut stdout, &mut line).unwrap();
        Self { server, name: format!(":{}", line.trim()) }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

#[test]
fn the_window_opens_on_the_sample_and_shows_its_views() {
    let display = Display::start();
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("window.png");
    let mut window = Command::new(PROGRAM)
        .args(["open", "--sample", "--software", "--picture"])
        .arg(&picture)
        .env("DISPLAY", &display.name)
        .env("XDG_RUNTIME_DIR", folder.path())
        .env("GLIOSCOPE_CONFIG", folder.path())
        .env_remove("WAYLAND_DISPLAY")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(120);
    let status = loop {
        if let Some(status) = window.try_wait().unwrap() {
            break status;
        }
        if Instant::now() > deadline {
            let _ = window.kill();
            panic!("no screenshot of the window within two minutes");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let mut stderr = String::new();
    std::io::Read::read_to_string(&mut window.stderr.take().unwrap(), &mut stderr).unwrap();
    assert!(status.success(), "{stderr}");
    let picture = image::open(&picture).unwrap().to_rgba8();
    assert!(picture.width() >= 1000 && picture.height() >= 600, "{:?}", picture.dimensions());
    // The overlap diagram and the closeup show each mask's colour over large areas; slices are grey.
    for color in MASK_COLORS {
        assert!(count_color(&picture, color, 8) > 3000, "{color:?}");
    }
}
