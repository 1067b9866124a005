//! Films in the formats that players know: ffmpeg, where it is installed, decodes and encodes them in a process of its own.
//! Frames go between the two as YUV4MPEG2.

use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};

use mrfgs::error::in_words;
use mrfgs::image::write;
use mrfgs::{Error, Result};
use tempfile::TempDir;

/// Films that ffmpeg writes here: containers whose usual codec plays everywhere.
const WRITTEN: [&str; 6] = ["mp4", "m4v", "mkv", "mov", "webm", "avi"];
/// Kinds of pixels that are read as they are; ffmpeg turns others into the nearest of them.
const READ: &str = "gray|gray12le|yuv420p|yuv422p|yuv444p|yuv420p10le|yuv422p10le|yuv444p10le|yuv420p12le|yuv422p12le|\
                    yuv444p12le";
/// A tick for each frame: no frame is left out or repeated to keep a rate.
const EVERY_FRAME: &str = "setpts=N/FRAME_RATE/TB";
/// Players want even sizes.
const EVEN: &str = "pad=ceil(iw/2)*2:ceil(ih/2)*2";

/// Whether ffmpeg can write a film of this name.
pub(crate) fn writes(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    WRITTEN.contains(&extension.as_str())
}

/// Whether a file begins like a film that ffmpeg reads: MP4, Matroska, AVI and their kin.
pub(crate) fn reads(start: &[u8]) -> bool {
    let is_avi = start.starts_with(b"RIFF") && start.get(8..11).is_none_or(|kind| kind == b"AVI");
    is_avi || start.get(4..8) == Some(b"ftyp") || start.starts_with(b"\x1a\x45\xdf\xa3")
}

/// Finds out before any work whether ffmpeg is there to write `path`.
///
/// # Errors
/// [`Error::Write`] where it is not.
pub(crate) fn check(path: &Path) -> Result<()> {
    let found =
        ffmpeg().arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    found.map(drop).map_err(|e| Error::write(path, missing(&e, "encodes")))
}

/// The film in the file `path` as YUV4MPEG2.
pub(crate) struct Decoder {
    process: Process,
    frames: ChildStdout,
    ended: bool,
    complaint: Complaint,
}

/// The complaints of ffmpeg about a film that it decodes to its end.
#[derive(Clone, Default)]
pub(crate) struct Complaint(Arc<OnceLock<String>>);

impl Complaint {
    /// In its words, where there is one.
    pub(crate) fn said(&self) -> Option<&str> {
        self.0.get().map(String::as_str).filter(|said| !said.is_empty())
    }
}

impl Decoder {
    /// Begins to decode `path`.
    ///
    /// # Errors
    /// [`Error::Read`] where ffmpeg cannot be run.
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

    /// The complaints of ffmpeg up to the end of the film.
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

/// A film that ffmpeg encodes. It appears when it is [finished](Self::finish); dropped before, it leaves nothing.
pub(crate) struct Encoder {
    path: PathBuf,
    process: Process,
    frames: Option<ChildStdin>,
    /// Where it is made, and its name there.
    folder: TempDir,
    staged: PathBuf,
}

impl Encoder {
    /// Begins the film `path`, whose frames are written as YUV4MPEG2.
    ///
    /// # Errors
    /// [`Error::Write`] where ffmpeg cannot be run, or the film cannot be made beside its place.
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
    /// [`Error::Write`] with what ffmpeg says where it has ended.
    pub(crate) fn add(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self.frames.as_mut().map_or(Ok(()), |frames| frames.write_all(bytes));
        written.map_err(|e| {
            // It knows better why.
            let cause = if e.kind() == ErrorKind::BrokenPipe { self.process.end().err() } else { None };
            Error::write(&self.path, cause.unwrap_or(e))
        })
    }

    /// Ends the film, and gives it its name.
    ///
    /// # Errors
    /// [`Error::Write`] where it cannot be written.
    pub(crate) fn finish(mut self) -> Result<()> {
        drop(self.frames.take());
        self.process.end().map_err(|e| Error::write(&self.path, e))?;
        write::publish(&self.staged, &self.path)?;
        self.folder.close().map_err(|e| Error::write(&self.path, e))
    }
}

/// ffmpeg at work, with what it says. It ends when this is dropped.
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

    /// Waits for its end. Returns what it says last.
    ///
    /// # Errors
    /// The reason why ffmpeg failed.
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
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// ffmpeg, which only says what fails, and asks nothing.
fn ffmpeg() -> Command {
    let mut command = Command::new("ffmpeg");
    command.args(["-nostdin", "-v", "error", "-y"]);
    // Ctrl-C is for this program, which then ends the film.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

/// A path as ffmpeg takes it whatever its name holds: with a colon it could be an address.
fn file(path: &Path) -> std::ffi::OsString {
    let mut text = std::ffi::OsString::from("file:");
    text.push(path);
    text
}

/// Why ffmpeg cannot be run, which `does` something with films.
fn missing(error: &io::Error, does: &str) -> String {
    match error.kind() {
        ErrorKind::NotFound => {
            format!("ffmpeg {does} such films, and there is none on the PATH: install it, or use NAME.y4m")
        }
        _ => format!("ffmpeg, which {does} such films, cannot be run: {}", in_words(error)),
    }
}

/// The last line that ffmpeg says, which names the cause.
fn last_line(stderr: ChildStderr) -> String {
    let mut said = String::new();
    for line in io::BufRead::lines(io::BufReader::new(stderr)).map_while(io::Result::ok) {
        if !line.trim().is_empty() {
            said = line;
        }
    }
    said
}
