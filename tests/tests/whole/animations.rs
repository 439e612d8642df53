//! Animations written by `render`: frames, times, sizes, what they show, and what is refused.

use std::{
    path::Path,
    process::{Command, Output},
};

use glioscope_tests::{refusal, run, write_cube};

use crate::PROGRAM;

const SIZE: usize = 160;

/// A GIF as a viewer shows it: every frame with its hundredths of a second, RGB.
struct Shown {
    frames: Vec<Vec<[u8; 3]>>,
    delays_cs: Vec<u16>,
    size: [usize; 2],
    repeats: bool,
}

fn shown(path: &Path) -> Shown {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(std::fs::File::open(path).unwrap()).unwrap();
    let size = [usize::from(decoder.width()), usize::from(decoder.height())];
    let mut screen = vec![[0; 3]; size[0] * size[1]];
    let (mut frames, mut delays_cs) = (Vec::new(), Vec::new());
    while let Some(part) = decoder.read_next_frame().unwrap() {
        let [left, top, width] = [part.left, part.top, part.width].map(usize::from);
        for (n, rgba) in part.buffer.chunks(4).enumerate() {
            assert_eq!(rgba[3], 255, "opaque");
            screen[(top + n / width) * size[0] + left + n % width] = [rgba[0], rgba[1], rgba[2]];
        }
        frames.push(screen.clone());
        delays_cs.push(part.delay);
    }
    let repeats = decoder.repeat() == gif::Repeat::Infinite;
    Shown { frames, delays_cs, size, repeats }
}

fn render(out: &Path, more: &[&str]) -> Output {
    let size = format!("{SIZE}x{SIZE}");
    let mut all = vec!["render", "--sample", "--software", "--size", &size, "--out", out.to_str().unwrap()];
    all.extend(more);
    run(PROGRAM, &all)
}

fn rendered(out: &Path, more: &[&str]) {
    let output = render(out, more);
    assert!(output.status.success(), "{more:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Mean difference of two pictures' channels.
fn difference(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let sum: u32 =
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
    f64::from(sum) / a.as_flattened().len() as f64
}

fn png(path: &Path) -> Vec<[u8; 3]> {
    image::open(path).unwrap().to_rgb8().pixels().map(|pixel| pixel.0).collect()
}

#[test]
fn a_turntable_shows_the_view_from_all_sides() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (gif, again) = (at("turn.gif"), at("again.gif"));
    rendered(&gif, &["--camera", "30,20", "--turntable", "4"]);
    let found = shown(&gif);
    assert_eq!((found.size, found.repeats), ([SIZE; 2], true));
    assert_eq!(found.delays_cs, [5; 4]);
    // Each frame is the picture of a camera that stands there.
    let mut pictures = Vec::new();
    for (name, camera) in [("a.png", "30,20"), ("b.png", "120,20"), ("c.png", "210,20"), ("d.png", "300,20")]
    {
        rendered(&at(name), &["--camera", camera]);
        pictures.push(png(&at(name)));
    }
    for (k, frame) in found.frames.iter().enumerate() {
        let from_each: Vec<f64> = pictures.iter().map(|picture| difference(frame, picture)).collect();
        for (n, from) in from_each.iter().enumerate() {
            // Of 256 colours some remain off by a little; another side differs by much more.
            assert!((n == k) == (*from < 1.0), "frame {k}: {from_each:?}");
        }
        // The ground is exact.
        let ground = pictures[k][SIZE / 2];
        let grounds = |of: &[[u8; 3]]| of.iter().filter(|color| **color == ground).count();
        let (in_gif, in_png) = (grounds(frame), grounds(&pictures[k]));
        assert!(in_png > SIZE * SIZE / 10 && in_gif >= in_png, "{in_gif} of {in_png}");
    }

    let bytes = std::fs::read(&gif).unwrap();
    rendered(&again, &["--camera", "30,20", "--turntable", "4"]);
    assert!(std::fs::read(&again).unwrap() == bytes, "the same bytes");
    // It isn't written over unless that is said.
    let refused = render(&gif, &["--turntable", "1"]);
    let stderr = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && stderr.contains("--force"), "{stderr}");
    assert!(std::fs::read(&gif).unwrap() == bytes);
    rendered(&gif, &["--turntable", "1", "--force"]);
    assert_eq!(shown(&gif).frames.len(), 1);
    let mut left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["a.png", "again.gif", "b.png", "c.png", "d.png", "turn.gif"]);
}

#[test]
fn dates_are_played_with_their_labels() {
    let folder = tempfile::tempdir().unwrap();
    let (slices, turns) = (folder.path().join("slices.gif"), folder.path().join("turns.gif"));
    rendered(&slices, &["--view", "axial", "--play"]);
    let found = shown(&slices);
    assert_eq!((found.delays_cs, found.size, found.repeats), (vec![100; 2], [SIZE; 2], true));
    let [first, second] = [&found.frames[0], &found.frames[1]];
    // The label's line is below the slice, of the window's ground; what differs are its figures.
    let line = SIZE * (SIZE - 20);
    assert!(difference(&first[..line], &second[..line]) > 0.1, "the slice of another date");
    let differ = first[line..].iter().zip(&second[line..]).filter(|(a, b)| a != b).count();
    assert!((4..400).contains(&differ), "{differ}");

    rendered(&turns, &["--view", "context", "--play", "--turntable", "2"]);
    let found = shown(&turns);
    assert_eq!(found.delays_cs, [5; 4]);
    // Both sides of a date have the same line, dates have different ones.
    let line = |k: usize| found.frames[k][line..].to_vec();
    assert!(line(0) == line(1) && line(2) == line(3) && line(0) != line(2));
    assert!(difference(&found.frames[0], &found.frames[1]) > 1.0);
}

#[test]
fn what_cannot_be_animated_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.gif");
    let png = folder.path().join("out.png");
    let (out, png) = (out.to_str().unwrap(), png.to_str().unwrap());
    let refused = |more: &[&str], words: &[&str]| {
        let line = refusal(PROGRAM, &[&["render"], more].concat());
        assert!(words.iter().all(|word| line.contains(word)), "{more:?}: {line}");
    };
    for frames in ["0", "721", "x", "-3", "1.5"] {
        let turntable = format!("--turntable={frames}");
        refused(&[&turntable, "--out", out], &["--turntable", frames]);
    }
    refused(&["--turntable", "2", "--out", png], &["out.png", ".gif or .mp4"]);
    refused(&["--turntable", "--out", "animation"], &[".gif or .mp4"]);
    refused(&["--out", out], &["out.gif", ".png", "--turntable"]);
    refused(
        &["--view", "axial", "--turntable", "--out", out],
        &["--turntable", "the axial slice", "closeup"],
    );
    refused(&["--view", "window", "--play", "--out", out], &["--play", "the window"]);
    refused(&["--view", "change", "--play", "--out", out], &["--play", "the change view", "one date"]);
    refused(&["--play", "--time", "2024-01-15", "--out", out], &["--play", "--time"]);
    refused(&["--turntable", "--plain", "--out", out], &["--turntable", "--plain"]);
    refused(&["--force", "--out", png], &["--force", "--turntable"]);
    refused(&["--turntable", "--out", "/nowhere/out.gif"], &["no folder /nowhere"]);
    refused(
        &["--turntable", "--size", "161x160", "--software", "--out", "/tmp/odd.mp4"],
        &["161 × 160", "even"],
    );
    let mask = folder.path().join("mask.nii");
    write_cube(&mask, 8, 1.0, |[x, y, z]| u8::from([x, y, z].iter().all(|i| (2..6).contains(i))));
    let of = format!("A={}", mask.display());
    refused(&["--mask", &of, "--play", "--out", out], &["--play", "one date"]);
    refused(&["--mask", &of, "--turntable", "--force", "--out", mask.to_str().unwrap()], &["mask.nii"]);
    assert!(!Path::new(out).exists() && !Path::new(png).exists() && !Path::new("/tmp/odd.mp4").exists());
}

/// A program `ffmpeg` in a folder of its own that does this, and `render` with no other on the `PATH`.
#[cfg(unix)]
fn render_with_ffmpeg(script: &str, out: &Path, more: &[&str]) -> Output {
    use std::os::unix::fs::PermissionsExt as _;

    let folder = tempfile::tempdir().unwrap();
    if !script.is_empty() {
        let program = folder.path().join("ffmpeg");
        std::fs::write(&program, format!("#!/bin/sh\nPATH=/usr/bin:/bin\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    let all = ["render", "--sample", "--software", "--size", "64x48", "--out", out.to_str().unwrap()];
    Command::new(PROGRAM).args(all).args(more).env("PATH", folder.path()).output().unwrap()
}

#[cfg(unix)]
#[test]
fn mp4_is_encoded_by_ffmpeg() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("turn.mp4");
    // It writes how many bytes it got, and its arguments, in place of a film.
    let records = r#"for name; do :; done; { wc -c; echo "$*"; } > "$name""#;
    let output = render_with_ffmpeg(records, &out, &["--turntable", "3"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let recorded = std::fs::read_to_string(&out).unwrap();
    let (bytes, arguments) = recorded.split_once('\n').unwrap();
    assert_eq!(bytes.trim(), (64 * 48 * 3 * 3).to_string());
    for part in ["-video_size 64x48", "-framerate 20", "-c:v libx264", "-pix_fmt yuv420p", "+faststart"] {
        assert!(arguments.contains(part), "{arguments}");
    }
    assert!(!arguments.contains(folder.path().to_str().unwrap()), "{arguments}");
    // A second of each date.
    let output = render_with_ffmpeg(records, &out, &["--play", "--force", "--view", "coronal"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let recorded = std::fs::read_to_string(&out).unwrap();
    assert!(recorded.trim_start().starts_with(&(64 * 48 * 3 * 20 * 2).to_string()), "{recorded}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else is left");
}

#[cfg(unix)]
#[test]
fn an_ffmpeg_that_fails_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("turn.mp4");
    let cases = [
        ("", "no program ffmpeg"),
        ("echo \"Unknown encoder 'libx264'\" >&2; exit 8", "Unknown encoder 'libx264'"),
        ("echo half > animation.mp4; cat > /dev/null; exit 1", "ffmpeg failed"),
        ("cat > /dev/null", "ffmpeg wrote nothing"),
    ];
    for (script, words) in cases {
        let output = render_with_ffmpeg(script, &out, &["--turntable", "2"]);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{script}: {stderr}");
        assert!(stderr.contains(words) && stderr.contains(".gif"), "{script}: {stderr}");
        assert_eq!(stderr.trim_end().lines().count(), 1, "{script}: {stderr}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{script}");
    }
}
