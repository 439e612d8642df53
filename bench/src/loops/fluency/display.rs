//! A program in a window on its own virtual X display: events to it, pixels and times of change from it.

use std::{
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use image::RgbImage;
use x11rb::{
    connection::Connection,
    protocol::{
        Event,
        damage::{self, ConnectionExt as _, ReportLevel},
        xproto::{
            ConfigureWindowAux, ConnectionExt as _, ImageFormat, InputFocus, MapState, Window as WindowId,
        },
        xtest::ConnectionExt as _,
    },
    rust_connection::RustConnection,
};

use crate::Outcome;

const MOTION_NOTIFY: u8 = 6;
const BUTTON_PRESS: u8 = 4;
const BUTTON_RELEASE: u8 = 5;

/// A rectangle of the window, pixels.
#[derive(Clone, Copy)]
pub struct Spot {
    at: [i16; 2],
    size: [u16; 2],
}

impl Spot {
    /// Left, top, width, height.
    pub fn of([left, top, width, height]: [i16; 4]) -> Self {
        Self { at: [left, top], size: [width.unsigned_abs(), height.unsigned_abs()] }
    }
}

/// Ends a process when dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A program's window that fills its own display.
pub struct Window {
    program: Process,
    connection: RustConnection,
    window: WindowId,
    root: WindowId,
    damage: damage::Damage,
    screen: [u16; 2],
    _server: Process,
}

impl Window {
    /// Starts Xvfb and the program, and makes its window as large as the screen.
    pub fn open(program: &Path, arguments: &[String], screen: [u16; 2]) -> Outcome<Self> {
        let size = format!("{}x{}x24", screen[0], screen[1]);
        // -displayfd lets the server choose a free number and report it once it listens.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &size, "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("Xvfb: {error}"))?;
        let mut line = String::new();
        let stdout = server.stdout.take();
        let server = Process(server);
        BufReader::new(stdout.ok_or("Xvfb has no output")?).read_line(&mut line)?;
        let display = format!(":{}", line.trim());
        let folder = std::env::temp_dir().join(format!("glioscope-fluency-{}{display}", std::process::id()));
        std::fs::create_dir_all(&folder)?;
        // As large as the screen from the start, as the program remembers it.
        let remembered = format!("{{\"size_points\": [{}, {}]}}", screen[0], screen[1]);
        glioscope_core::files::write_whole(&folder.join("window.json"), remembered.as_bytes())
            .map_err(|e| e.to_string())?;
        let child = Command::new(program)
            .args(arguments)
            .env("DISPLAY", &display)
            .env("XDG_RUNTIME_DIR", &folder)
            .env("GLIOSCOPE_CONFIG", &folder)
            .env_remove("WAYLAND_DISPLAY")
            .stdout(Stdio::null())
            .spawn()
            .map_err(|error| format!("{}: {error}", program.display()))?;
        let mut program = Process(child);
        let (connection, number) = x11rb::connect(Some(&display))?;
        let root = connection.setup().roots.get(number).ok_or("the display has no screen")?.root;
        connection.damage_query_version(1, 1)?.reply()?;
        let deadline = Instant::now() + Duration::from_secs(60);
        let window = loop {
            if let Some(window) = largest_window(&connection, root)? {
                break window;
            }
            if let Some(status) = program.0.try_wait()? {
                return Err(format!("the program ended without a window: {status}").into());
            }
            if Instant::now() > deadline {
                return Err("the program opened no window within a minute".into());
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        // Programs that remember no size open smaller.
        let size = screen.map(u32::from);
        let place = ConfigureWindowAux::new().x(0).y(0).width(size[0]).height(size[1]);
        connection.configure_window(window, &place)?;
        connection.set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME)?;
        let damage = connection.generate_id()?;
        connection.damage_create(damage, window, ReportLevel::NON_EMPTY)?.check()?;
        Ok(Self { program, connection, window, root, damage, screen, _server: server })
    }

    /// Moves the pointer.
    pub fn move_to(&self, [x, y]: [i16; 2]) -> Outcome<()> {
        self.connection.xtest_fake_input(MOTION_NOTIFY, 0, x11rb::CURRENT_TIME, self.root, x, y, 0)?;
        Ok(self.connection.flush()?)
    }

    /// Presses or releases a button of the pointer.
    pub fn button(&self, button: u8, press: bool) -> Outcome<()> {
        let kind = if press { BUTTON_PRESS } else { BUTTON_RELEASE };
        self.connection.xtest_fake_input(kind, button, x11rb::CURRENT_TIME, self.root, 0, 0, 0)?;
        Ok(self.connection.flush()?)
    }

    /// Whether the window has changed since the last call.
    fn changed(&self) -> Outcome<bool> {
        let mut changed = false;
        while let Some(event) = self.connection.poll_for_event()? {
            changed |= matches!(event, Event::DamageNotify(_));
        }
        if changed {
            self.connection.damage_subtract(self.damage, x11rb::NONE, x11rb::NONE)?;
            self.connection.flush()?;
        }
        Ok(changed)
    }

    /// Waits until the window has drawn nothing for `quiet`; when it drew last, if it did.
    pub fn wait_until_quiet(&mut self, quiet: Duration, patience: Duration) -> Outcome<Option<Instant>> {
        let start = Instant::now();
        let mut last = None;
        while last.unwrap_or(start).elapsed() < quiet {
            if self.changed()? {
                last = Some(Instant::now());
            }
            if start.elapsed() > patience {
                return Err("the window draws without end".into());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(last)
    }

    /// Waits until the pixels of `spot` differ from `before`; when they did.
    pub fn wait_for_change(&mut self, spot: Spot, before: &[u8], patience: Duration) -> Outcome<Instant> {
        let start = Instant::now();
        loop {
            if self.changed()? {
                let at = Instant::now();
                if self.pixels(spot)? != before {
                    return Ok(at);
                }
            }
            if let Some(status) = self.program.0.try_wait()? {
                return Err(format!("the program ended: {status}").into());
            }
            if start.elapsed() > patience {
                return Err("nothing changed where the answer was expected".into());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// The pixels of `spot`: blue, green, red and one unused byte each, row by row.
    pub fn pixels(&self, spot: Spot) -> Outcome<Vec<u8>> {
        let ([x, y], [width, height]) = (spot.at, spot.size);
        let image = self.connection.get_image(ImageFormat::Z_PIXMAP, self.window, x, y, width, height, !0)?;
        Ok(image.reply()?.data)
    }

    /// Writes the window's pixels as PNG.
    pub fn write_picture(&self, path: &Path) -> Outcome<()> {
        let [width, height] = self.screen;
        let data = self.pixels(Spot { at: [0, 0], size: self.screen })?;
        let rgb = data.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]).collect();
        let picture = RgbImage::from_raw(u32::from(width), u32::from(height), rgb);
        Ok(picture.ok_or("the server sent too few pixels")?.save(path)?)
    }

    /// Processor time that the program's live threads have used, milliseconds; NaN on systems other than Linux.
    pub fn cpu_ms(&self) -> f64 {
        crate::clock::cpu_ms_of(&self.program.0.id().to_string()).unwrap_or(f64::NAN)
    }
}

/// The largest mapped window on `root`; `None` if there is none of 200 pixels or more.
fn largest_window(connection: &RustConnection, root: WindowId) -> Outcome<Option<WindowId>> {
    let mut largest = None;
    for window in connection.query_tree(root)?.reply()?.children {
        // A window may vanish meanwhile.
        let (Ok(attributes), Ok(geometry)) =
            (connection.get_window_attributes(window)?.reply(), connection.get_geometry(window)?.reply())
        else {
            continue;
        };
        let area = u32::from(geometry.width) * u32::from(geometry.height);
        if attributes.map_state == MapState::VIEWABLE && area > 200 * 200 {
            largest = largest.max(Some((area, window)));
        }
    }
    Ok(largest.map(|(_, window)| window))
}
