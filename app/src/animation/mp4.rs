//! MP4 by the program ffmpeg, which gets the frames on its stdin.

use std::{
    io::{BufReader, Read, Write as _},
    path::Path,
    process::{Child, ChildStdin, Command, Stdio},
    thread::{self, JoinHandle},
    time::Duration,
};

use glioscope_core::{
    Progress,
    files::{temporary_folder, write_whole_by},
};

use super::{Animation, Draw, TURN_CS};
use crate::error::AppError;

/// The file that ffmpeg writes, in a folder of its own.
const NAME: &str = "animation.mp4";
/// Conversion to BT.709, and its mark.
const COLORS: &str = "scale=out_color_matrix=bt709:out_range=tv,setparams=color_primaries=bt709:color_trc=bt709:colorspace=bt709";
/// Most bytes of what ffmpeg says that are kept.
const MOST_SAID: u64 = 4096;
/// Most characters of what ffmpeg says that are told.
const MOST_TOLD: usize = 160;
/// Time between two looks at whether ffmpeg has ended.
const PAUSE: Duration = Duration::from_millis(20);

pub(super) fn write(
    animation: &Animation<'_>,
    draw: &mut Draw<'_>,
    progress: &Progress,
) -> Result<(), AppError> {
    let [width, height] = animation.size;
    if width % 2 != 0 || height % 2 != 0 {
        let found = format!("a picture of {width} × {height} pixels");
        return Err(AppError::file(animation.path, found, "even numbers for .mp4"));
    }
    progress.expect(animation.frames.len() as u64);
    let parent = animation.path.parent().filter(|parent| !parent.as_os_str().is_empty());
    let folder = temporary_folder(parent.unwrap_or(Path::new(".")))?;
    let mut encoder = Encoder::start(folder.path(), animation)?;
    let mut rgb = Vec::new();
    for frame in animation.frames {
        rgb.clear();
        rgb.extend(draw(frame)?.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]));
        for _ in 0..frame.shown_cs / TURN_CS {
            encoder.write(&rgb, animation, progress)?;
        }
        progress.advance(1)?;
    }
    progress.say("Encoding");
    encoder.finish(animation, progress)?;
    let path = folder.path().join(NAME);
    let written = std::fs::File::open(&path).ok().filter(|file| file.metadata().is_ok_and(|m| m.len() > 0));
    let Some(written) = written else {
        return Err(AppError::file(
            animation.path,
            "ffmpeg wrote nothing",
            "an ffmpeg that encodes it, or a .gif",
        ));
    };
    write_whole_by(animation.path, |out| {
        std::io::copy(&mut BufReader::new(written), out).map(drop).map_err(|e| animation.failed(&e))
    })
}

/// ffmpeg while it runs; killed when dropped.
struct Encoder {
    child: Child,
    /// `None` once all frames were written.
    stdin: Option<ChildStdin>,
    /// Reads what it says on stderr.
    said: Option<JoinHandle<Vec<u8>>>,
}

impl Drop for Encoder {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Encoder {
    fn start(folder: &Path, animation: &Animation<'_>) -> Result<Self, AppError> {
        let [width, height] = animation.size;
        let not_started = |e: std::io::Error| {
            let found = match e.kind() {
                std::io::ErrorKind::NotFound => "no program ffmpeg on the PATH".to_owned(),
                _ => format!("ffmpeg can't be started: {e}"),
            };
            AppError::file(animation.path, found, "ffmpeg, which .mp4 needs; .gif works without it")
        };
        // Nothing of the case is among the arguments.
        let mut child = Command::new("ffmpeg")
            .args(["-hide_banner", "-loglevel", "error", "-f", "rawvideo", "-pixel_format", "rgb24"])
            .args(["-video_size", &format!("{width}x{height}")])
            .args(["-framerate", &format!("{}", 100 / TURN_CS), "-i", "pipe:0"])
            // Players take what isn't marked for BT.709, which ffmpeg doesn't convert to of itself.
            .args(["-vf", COLORS])
            .args(["-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart"])
            .args(["-fflags", "+bitexact", "-flags:v", "+bitexact", "-map_metadata", "-1", NAME])
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(not_started)?;
        let (stdin, stderr) = (child.stdin.take(), child.stderr.take());
        let mut encoder = Self { child, stdin, said: None };
        if let Some(mut stderr) = stderr {
            // All of it is read, else ffmpeg would wait for a reader.
            let read = move || {
                let mut said = Vec::new();
                let _ = stderr.by_ref().take(MOST_SAID).read_to_end(&mut said);
                let _ = std::io::copy(&mut stderr, &mut std::io::sink());
                said
            };
            encoder.said = Some(thread::Builder::new().spawn(read).map_err(not_started)?);
        }
        Ok(encoder)
    }

    fn write(&mut self, rgb: &[u8], animation: &Animation<'_>, progress: &Progress) -> Result<(), AppError> {
        let written = self.stdin.as_mut().is_some_and(|stdin| stdin.write_all(rgb).is_ok());
        if written { Ok(()) } else { Err(self.failure(animation, progress)) }
    }

    /// Waits until it has encoded what it got.
    fn finish(mut self, animation: &Animation<'_>, progress: &Progress) -> Result<(), AppError> {
        drop(self.stdin.take());
        loop {
            progress.check()?;
            match self.child.try_wait() {
                Ok(Some(status)) if status.success() => return Ok(()),
                Ok(Some(_)) | Err(_) => return Err(self.failure(animation, progress)),
                Ok(None) => thread::sleep(PAUSE),
            }
        }
    }

    /// Why it failed: that it was cancelled, or the first line that it said.
    fn failure(&mut self, animation: &Animation<'_>, progress: &Progress) -> AppError {
        drop(self.stdin.take());
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Err(cancelled) = progress.check() {
            // Ctrl+C reaches ffmpeg, too.
            return cancelled.into();
        }
        let said = self.said.take().and_then(|said| said.join().ok()).unwrap_or_default();
        let said = String::from_utf8_lossy(&said);
        let line = said.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("it doesn't say why");
        let line: String = line.chars().take(MOST_TOLD).collect();
        let expected = "an ffmpeg with the encoder libx264, or a .gif";
        AppError::file(animation.path, format!("ffmpeg failed: {line}"), expected)
    }
}
