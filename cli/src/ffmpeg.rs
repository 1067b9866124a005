//! Films in common formats. An installed ffmpeg decodes and encodes them in its own process; frames pass through pipes as YUV4MPEG2.

use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};

use mrfgs::error::in_words;
use mrfgs::image::write;
use mrfgs::{Error, Result};
use tempfile::TempDir;

/// Extensions that ffmpeg encodes: containers whose default codec plays everywhere.
const WRITTEN: [&str; 6] = ["mp4", "m4v", "mkv", "mov", "webm", "avi"];
/// Pixel formats read unchanged; ffmpeg converts all others to the nearest one.
const READ: &str = "gray|gray12le|yuv420p|yuv422p|yuv444p|yuv420p10le|yuv422p10le|yuv444p10le|yuv420p12le|yuv422p12le|\
                    yuv444p12le";
/// Gives each frame one tick, so that ffmpeg neither drops nor repeats frames to keep a rate.
const EVERY_FRAME: &str = "setpts=N/FRAME_RATE/TB";
/// Pads to even sizes, which players require.
const EVEN: &str = "pad=ceil(iw/2)*2:ceil(ih/2)*2";

/// Whether ffmpeg can write a film of this name.
pub(crate) fn writes(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    WRITTEN.contains(&extension.as_str())
}

/// Whether a file starts like a film that ffmpeg reads: MP4, Matroska, AVI and relatives.
pub(crate) fn reads(start: &[u8]) -> bool {
    let is_avi = start.starts_with(b"RIFF") && start.get(8..11).is_none_or(|kind| kind == b"AVI");
    is_avi || start.get(4..8) == Some(b"ftyp") || start.starts_with(b"\x1a\x45\xdf\xa3")
}

/// Checks before any work that ffmpeg is installed to write `path`.
///
/// # Errors
/// [`Error::Write`] if it is not.
pub(crate) fn check(path: &Path) -> Result<()> {
    let found =
        ffmpeg().arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    found.map(drop).map_err(|e| Error::write(path, missing(&e, "encodes")))
}

/// Decodes a film to YUV4MPEG2.
pub(crate) struct Decoder {
    process: Process,
    frames: ChildStdout,
    ended: bool,
    complaint: Complaint,
}

/// The last warning of ffmpeg about a film that it decoded to the end.
#[derive(Clone, Default)]
pub(crate) struct Complaint(Arc<OnceLock<String>>);

impl Complaint {
    /// The warning, if there is one.
    pub(crate) fn said(&self) -> Option<&str> {
        self.0.get().map(String::as_str).filter(|said| !said.is_empty())
    }
}

impl Decoder {
    /// Starts decoding `path`.
    ///
    /// # Errors
    /// [`Error::Read`] if ffmpeg cannot be run.
    pub(crate) fn new(path: &Path) -> Result<Self> {
        let mut command = ffmpeg();
        command.arg("-i").arg(file(path)).args([
            "-map",
            "0:v:0",
            "-vf",
            &format!("{EVERY_FRAME},format={READ}"),
        ]);
        command.args(["-f", "yuv4mpegpipe", "-strict", "-1", "-"]);
        let begun = Process::new(command.stdin(Stdio::null()).stdout(Stdio::piped()));
        let mut process = begun.map_err(|e| Error::read(path, missing(&e, "decodes")))?;
        let frames = process.child.stdout.take().ok_or_else(|| Error::read(path, "ffmpeg has no output"))?;
        Ok(Self { process, frames, ended: false, complaint: Complaint::default() })
    }

    /// A handle to the warning, which is set once the film has ended.
    pub(crate) fn complaint(&self) -> Complaint {
        self.complaint.clone()
    }
}

impl Read for Decoder {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.frames.read(out)?;
        if count == 0 && !out.is_empty() && !self.ended {
            self.ended = true;
            let said = self.process.end()?;
            self.complaint.0.get_or_init(|| said);
        }
        Ok(count)
    }
}

/// Encodes a film with ffmpeg. The file appears on [`finish`](Self::finish); dropped earlier, it leaves nothing.
pub(crate) struct Encoder {
    path: PathBuf,
    process: Process,
    frames: Option<ChildStdin>,
    /// The temporary folder of the film, and its path there.
    folder: TempDir,
    staged: PathBuf,
}

impl Encoder {
    /// Starts the film `path`, whose frames are written as YUV4MPEG2.
    ///
    /// # Errors
    /// [`Error::Write`] if ffmpeg cannot be run, or the temporary folder cannot be created.
    pub(crate) fn new(path: &Path) -> Result<Self> {
        let beside = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let folder = tempfile::Builder::new().prefix(".mrfgs-").suffix(".tmp").tempdir_in(beside);
        let folder = folder.map_err(|e| Error::write(path, e))?;
        let staged = folder.path().join("film").with_extension(path.extension().unwrap_or_default());
        let mut command = ffmpeg();
        command
            .args(["-f", "yuv4mpegpipe", "-i", "-", "-vf", EVEN, "-pix_fmt", "yuv420p"])
            .arg(file(&staged));
        let begun = Process::new(command.stdin(Stdio::piped()).stdout(Stdio::null()));
        let mut process = begun.map_err(|e| Error::write(path, missing(&e, "encodes")))?;
        let frames = process.child.stdin.take();
        Ok(Self { path: path.to_owned(), process, frames, folder, staged })
    }

    /// Adds bytes of the stream.
    ///
    /// # Errors
    /// [`Error::Write`], with ffmpeg's message if it has exited.
    pub(crate) fn add(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self.frames.as_mut().map_or(Ok(()), |frames| frames.write_all(bytes));
        written.map_err(|e| {
            // ffmpeg's own message is more specific than "broken pipe".
            let cause = if e.kind() == ErrorKind::BrokenPipe { self.process.end().err() } else { None };
            Error::write(&self.path, cause.unwrap_or(e))
        })
    }

    /// Ends the film and moves it to its place.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be written.
    pub(crate) fn finish(mut self) -> Result<()> {
        drop(self.frames.take());
        self.process.end().map_err(|e| Error::write(&self.path, e))?;
        write::publish(&self.staged, &self.path)?;
        self.folder.close().map_err(|e| Error::write(&self.path, e))
    }
}

/// A running ffmpeg and the thread that collects its messages. Dropping it ends the process.
struct Process {
    child: Child,
    says: Option<JoinHandle<String>>,
}

impl Process {
    fn new(command: &mut Command) -> io::Result<Self> {
        let mut child = command.stderr(Stdio::piped()).spawn()?;
        let says = child.stderr.take().map(|stderr| thread::spawn(move || last_line(stderr)));
        Ok(Self { child, says })
    }

    /// Waits for the process to end and returns its last message.
    ///
    /// # Errors
    /// ffmpeg's message or exit status if it failed.
    fn end(&mut self) -> io::Result<String> {
        let status = self.child.wait()?;
        let said = self.says.take().and_then(|says| says.join().ok()).unwrap_or_default();
        if status.success() {
            return Ok(said);
        }
        Err(io::Error::other(if said.is_empty() {
            format!("ffmpeg: {status}")
        } else {
            format!("ffmpeg: {said}")
        }))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have exited already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The ffmpeg command, non-interactive and printing errors only.
fn ffmpeg() -> Command {
    let mut command = Command::new("ffmpeg");
    command.args(["-nostdin", "-v", "error", "-y"]);
    // Keep Ctrl-C from ffmpeg; this program ends the film.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

/// A path for ffmpeg; without the prefix, a name with a colon could be taken for a URL.
fn file(path: &Path) -> std::ffi::OsString {
    let mut text = std::ffi::OsString::from("file:");
    text.push(path);
    text
}

/// The message when ffmpeg cannot be run; `does` is "encodes" or "decodes".
fn missing(error: &io::Error, does: &str) -> String {
    match error.kind() {
        ErrorKind::NotFound => {
            let instead = if does == "decodes" { "a folder of frames or NAME.y4m" } else { "NAME.y4m" };
            format!("ffmpeg {does} this format but is not on the PATH; install it, or give {instead}")
        }
        _ => format!("ffmpeg, which {does} this format, cannot be run: {}", in_words(error)),
    }
}

/// The last line that ffmpeg prints, which names the cause.
fn last_line(stderr: ChildStderr) -> String {
    let mut said = String::new();
    for line in io::BufRead::lines(io::BufReader::new(stderr)).map_while(io::Result::ok) {
        if !line.trim().is_empty() {
            said = line;
        }
    }
    said
}
