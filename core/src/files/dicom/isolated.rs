//! Decoding compressed frames in a process of its own, so that no stream can end the program: decoders may abort, loop or
//! take all memory, and none of it can be caught within a process.

use std::io::{BufReader, BufWriter, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use super::data_set::Unusable;
use super::decoders::{Codec, decode_here};

/// The argument with which a program is started as a decoder.
pub const DECODER_ARGUMENT: &str = "decode-frames";

/// Longest time for one frame.
const TIME_LIMIT: Duration = Duration::from_secs(5);

/// Memory of a decoder beside that of its frame.
#[cfg(unix)]
const MEMORY_BYTES: u64 = 512 << 20;

/// Longest stream.
const MAX_STREAM_BYTES: usize = 1 << 30;

static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
static IDLE: Mutex<Vec<Decoder>> = Mutex::new(Vec::new());

/// From now on compressed frames are decoded by `program`, which calls [`serve`] when it is started with
/// [`DECODER_ARGUMENT`]. Until then, and for programs that don't call this, they are decoded in this process.
pub fn decode_frames_with(program: PathBuf) {
    // The first one stays.
    let _ = PROGRAM.set(program);
}

/// Answers requests on standard input until it ends: the whole life of a decoder's process.
///
/// # Errors
/// Where standard input or output fail.
pub fn serve() -> std::io::Result<()> {
    #[cfg(unix)]
    {
        let limit = rustix::process::Rlimit { current: Some(MEMORY_BYTES), maximum: Some(MEMORY_BYTES) };
        rustix::process::setrlimit(rustix::process::Resource::As, limit)?;
    }
    let mut input = BufReader::new(std::io::stdin().lock());
    let mut output = BufWriter::new(std::io::stdout().lock());
    loop {
        let mut head = [0; 5];
        match input.read_exact(&mut head) {
            Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => return Ok(()),
            other => other?,
        }
        let length = u32::from_le_bytes([head[1], head[2], head[3], head[4]]) as usize;
        let mut stream = vec![0; length.min(MAX_STREAM_BYTES)];
        input.read_exact(&mut stream)?;
        let decoded = match Codec::of(head[0]) {
            Some(codec) => std::panic::catch_unwind(|| decode_here(codec, &stream))
                .unwrap_or_else(|_| Err("a stream that its decoder fails on".into())),
            None => Err("an unknown codec".into()),
        };
        let (is_right, bytes) = match decoded {
            Ok(numbers) => (1, numbers.iter().flat_map(|n| n.to_le_bytes()).collect()),
            Err(why) => (0, why.into_bytes()),
        };
        output.write_all(&[is_right])?;
        output.write_all(&(bytes.len() as u64).to_le_bytes())?;
        output.write_all(&bytes)?;
        output.flush()?;
    }
}

/// A running decoder; killed when dropped.
struct Decoder {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Drop for Decoder {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Decoder {
    fn start(program: &PathBuf) -> std::io::Result<Self> {
        let mut child = Command::new(program)
            .arg(DECODER_ARGUMENT)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let missing = || std::io::Error::other("no pipe to the decoder");
        let input = child.stdin.take().ok_or_else(missing)?;
        let output = BufReader::new(child.stdout.take().ok_or_else(missing)?);
        Ok(Self { child, input, output })
    }

    fn ask(
        &mut self,
        codec: Codec,
        stream: &[u8],
        pixels: usize,
    ) -> std::io::Result<Result<Vec<i32>, String>> {
        let length = u32::try_from(stream.len()).map_err(std::io::Error::other)?;
        self.input.write_all(&[codec as u8])?;
        self.input.write_all(&length.to_le_bytes())?;
        self.input.write_all(stream)?;
        self.input.flush()?;
        let mut head = [0; 9];
        self.output.read_exact(&mut head)?;
        let [is_right, length @ ..] = head;
        let length = usize::try_from(u64::from_le_bytes(length)).unwrap_or(usize::MAX);
        if length > pixels.saturating_mul(4).max(4096) {
            return Ok(Err("more pixels than the frame has".into()));
        }
        let mut bytes = vec![0; length];
        self.output.read_exact(&mut bytes)?;
        Ok(if is_right == 1 {
            Ok(bytes.as_chunks::<4>().0.iter().map(|&b| i32::from_le_bytes(b)).collect())
        } else {
            Err(String::from_utf8_lossy(&bytes).into_owned())
        })
    }
}

/// Decodes a stream of which `pixels` numbers are expected.
pub(super) fn decode(codec: Codec, stream: &[u8], pixels: usize) -> Result<Vec<i32>, Unusable> {
    let wrong = |why: String| {
        let why: String = why.lines().next().unwrap_or_default().chars().take(200).collect();
        Unusable::new(why, "a frame that can be decoded")
    };
    if stream.len() > MAX_STREAM_BYTES {
        return Err(wrong(format!("a compressed frame of {} bytes", stream.len())));
    }
    let Some(program) = PROGRAM.get() else {
        return decode_here(codec, stream).map_err(wrong);
    };
    let idle = IDLE.lock().ok().and_then(|mut idle| idle.pop());
    let mut decoder = match idle {
        Some(decoder) => decoder,
        None => Decoder::start(program).map_err(|e| wrong(format!("a decoder that does not start ({e})")))?,
    };
    // Whoever waits for the answer can't stop waiting, so a watch ends the process.
    let (done, is_done) = channel::<()>();
    let id = decoder.child.id();
    let watch = std::thread::Builder::new().name("decoder watch".into()).spawn(move || {
        if is_done.recv_timeout(TIME_LIMIT) == Err(RecvTimeoutError::Timeout) {
            kill(id);
        }
    });
    let answer = decoder.ask(codec, stream, pixels);
    drop(done);
    if let Ok(watch) = watch {
        let _ = watch.join();
    }
    match answer {
        Ok(answer) => {
            if let Ok(mut idle) = IDLE.lock() {
                idle.push(decoder);
            }
            answer.map_err(wrong)
        }
        // Its process ended: the next frame gets a new one.
        Err(_) => Err(wrong("a compressed frame that its decoder fails on".into())),
    }
}

/// Ends a process.
fn kill(id: u32) {
    #[cfg(unix)]
    if let Some(process) = i32::try_from(id).ok().and_then(rustix::process::Pid::from_raw) {
        let _ = rustix::process::kill_process(process, rustix::process::Signal::KILL);
    }
    #[cfg(not(unix))]
    let _ = id;
}
