//! Files that are written completely or not at all. A symbolic link stays a link: its target is written,
//! whether it exists or not.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Reason, Result};

/// Largest number of links that are followed.
const MAX_LINKS: usize = 40;

/// The destination of a file.
pub(super) enum Target {
    /// A regular file, existing or not: it is replaced once the new file is complete.
    File { file: PathBuf, folder: PathBuf },
    /// Anything else that exists: a device or a pipe must not be replaced by a file.
    Special,
}

impl Target {
    pub(super) fn of(path: &Path) -> Result<Self> {
        let error = |reason: &str| Err(Error::write(path, reason));
        let file = match fs::metadata(path) {
            Ok(m) if m.is_dir() => return error("is a folder; give the name of a file"),
            Ok(m) if !m.is_file() => return Ok(Self::Special),
            Ok(m) if m.permissions().readonly() => {
                return error("the file there is read-only; remove it first");
            }
            _ => followed(path).map_err(|e| Error::write(path, e))?,
        };
        if file.file_name().is_none() || path.to_string_lossy().ends_with(std::path::is_separator) {
            return error("names no file; give the name of one");
        }
        let folder = match file.parent() {
            Some(p) if p != Path::new("") => p.to_owned(),
            _ => PathBuf::from("."),
        };
        if !folder.is_dir() {
            return error(&format!("there is no folder {}; create it first", folder.display()));
        }
        Ok(Self::File { file, folder })
    }

    /// Tries to create a file where [`save`] would.
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        match self {
            Self::File { folder, .. } => Temporary::new(path, folder).map(drop),
            Self::Special => Ok(()),
        }
    }
}

/// The target of the chain of links that begins at `path`, or `path` itself.
fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&path) {
            // A relative target starts at the folder of the link.
            Ok(next) => path = path.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("its links lead in a circle"))
}

/// An unfinished file, which is deleted when dropped.
enum Temporary {
    /// Without a name: it disappears no matter how the program ends.
    #[cfg(target_os = "linux")]
    Unnamed(File),
    Named(NamedTempFile),
}

impl Temporary {
    fn new(path: &Path, folder: &Path) -> Result<Self> {
        #[cfg(target_os = "linux")]
        if let Ok(file) = unnamed(folder) {
            return Ok(Self::Unnamed(file));
        }
        builder().tempfile_in(folder).map(Self::Named).map_err(|e| {
            let words = format!("no file can be created in {}: {}", folder.display(), e.kind());
            Error::write(path, Reason::of(e, words))
        })
    }

    /// The bare file: with its name, errors would mention the temporary name.
    fn file(&mut self) -> &mut File {
        match self {
            #[cfg(target_os = "linux")]
            Self::Unnamed(file) => file,
            Self::Named(file) => file.as_file_mut(),
        }
    }

    /// Gives it its name, replacing an existing file.
    fn persist(self, name: &Path) -> io::Result<()> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Unnamed(file) => match link(&file, name) {
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {
                    // Only a named file can replace another.
                    let folder =
                        name.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
                    let other = builder().make_in(folder, |other| link(&file, other))?;
                    other.into_temp_path().persist(name).map_err(|e| e.error)
                }
                linked => linked,
            },
            Self::Named(file) => file.persist(name).map(drop).map_err(|e| e.error),
        }
    }
}

fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".mrfgs-").suffix(".tmp");
    #[cfg(unix)]
    {
        // Temporary files are private by default; an output is as readable as the umask allows.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
}

/// A file without a name in `folder`, where the file system supports such files and can name them later.
#[cfg(target_os = "linux")]
fn unnamed(folder: &Path) -> io::Result<File> {
    use rustix::fs::{Mode, OFlags};
    let mode = Mode::from_raw_mode(0o666);
    let file =
        File::from(rustix::fs::open(folder, OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC, mode)?);
    fs::symlink_metadata(place(&file)).map(|_| file)
}

/// The path under which the system shows an open file.
#[cfg(target_os = "linux")]
fn place(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd;
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// Gives a file without a name the name `name`, which must be free.
#[cfg(target_os = "linux")]
fn link(file: &File, name: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, place(file), CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

/// A file that is written piece by piece. It appears when it is [finished](Self::finish), and until then what was there before
/// stays; dropped before, it leaves nothing. An existing path that is not a regular file is written to directly; a symbolic
/// link is followed.
pub struct Growing {
    path: PathBuf,
    to: Sink,
}

/// Where the pieces go.
enum Sink {
    Special(File),
    /// Gets its name when it is finished.
    Whole(Temporary, PathBuf),
}

impl Growing {
    /// Begins the file `path`.
    ///
    /// # Errors
    /// [`Error::Write`] when it cannot be written.
    pub fn new(path: &Path) -> Result<Self> {
        let to = match Target::of(path)? {
            Target::Special => {
                let file = fs::OpenOptions::new().write(true).open(path);
                Sink::Special(file.map_err(|e| Error::write(path, e))?)
            }
            Target::File { file, folder } => Sink::Whole(Temporary::new(path, &folder)?, file),
        };
        Ok(Self { path: path.to_owned(), to })
    }

    /// Ends the file, and gives it its name.
    ///
    /// # Errors
    /// [`Error::Write`] when it cannot be written.
    pub fn finish(self) -> Result<()> {
        let Self { path, to } = self;
        let Sink::Whole(mut temporary, name) = to else { return Ok(()) };
        // Otherwise a crash of the machine could leave the name without the contents.
        let written = temporary.file().sync_all().and_then(|()| temporary.persist(&name));
        written.map_err(|e| Error::write(&path, e))
    }

    fn file(&mut self) -> &mut File {
        match &mut self.to {
            Sink::Special(file) => file,
            Sink::Whole(temporary, _) => temporary.file(),
        }
    }
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file().flush()
    }
}

/// Writes a file completely or not at all, as [`Growing`] does.
///
/// # Errors
/// [`Error::Write`] when the file cannot be written.
pub fn save(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = Growing::new(path)?;
    file.write_all(bytes).map_err(|e| Error::write(path, e))?;
    file.finish()
}

/// Moves the file `staged` to `path`, replacing what is there; a symbolic link is followed.
///
/// # Errors
/// [`Error::Write`] for `path` when it cannot be moved.
pub fn publish(staged: &Path, path: &Path) -> Result<()> {
    let error = |e: io::Error| Error::write(path, e);
    let place = followed(path).map_err(error)?;
    match fs::rename(staged, &place) {
        // A link may lead to another disk.
        Err(e) if e.kind() == ErrorKind::CrossesDevices => {
            save(path, &fs::read(staged).map_err(error)?)?;
            fs::remove_file(staged).map_err(error)
        }
        moved => moved.map_err(error),
    }
}

/// Removes the file at `path`, or at the target of its links. A missing file is no error.
///
/// # Errors
/// [`Error::Write`] for `path` when it cannot be removed.
pub fn remove(path: &Path) -> Result<()> {
    match followed(path).and_then(fs::remove_file) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::write(path, e)),
        _ => Ok(()),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn count(folder: &Path) -> usize {
        fs::read_dir(folder).expect("it is there").count()
    }

    #[test]
    fn a_link_is_followed_wherever_it_leads() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("below")).unwrap();
        // Links to a file, to nothing yet, through another link, and as an absolute path.
        fs::write(at("below/there"), "old").unwrap();
        for (link, to) in [("a", "below/there"), ("b", "below/new"), ("c", "a")] {
            symlink(to, at(link)).unwrap();
        }
        symlink(at("below/far"), at("d")).unwrap();
        for (link, file) in
            [("a", "below/there"), ("b", "below/new"), ("c", "below/there"), ("d", "below/far")]
        {
            save(&at(link), link.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(at(file)).unwrap(), link);
            fs::write(at("staged"), "moved").unwrap();
            publish(&at("staged"), &at(link)).unwrap();
            assert_eq!(fs::read_to_string(at(file)).unwrap(), "moved");
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
        }
        assert_eq!((count(folder.path()), count(&at("below"))), (5, 3), "nothing else is left");
        remove(&at("c")).unwrap();
        assert!(!at("below/there").exists() && fs::symlink_metadata(at("a")).unwrap().is_symlink());
        remove(&at("c")).unwrap();
        // Into no folder, and in a circle.
        symlink("none/file", at("e")).unwrap();
        symlink("f", at("f")).unwrap();
        for (link, word) in [("e", "there is no folder"), ("f", "circle")] {
            let said = save(&at(link), b"").unwrap_err().to_string();
            assert!(said.contains(word) && said.contains(link), "{said}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_in_the_making_has_no_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut made = Temporary::new(&path, folder.path()).unwrap();
        made.file().write_all(b"half").unwrap();
        let Temporary::Unnamed(_) = &made else {
            // Some file systems have none; then it has one.
            assert_eq!(count(folder.path()), 1);
            return;
        };
        assert_eq!(count(folder.path()), 0);
        made.persist(&path).unwrap();
        // Over one that is there.
        let mut made = Temporary::new(&path, folder.path()).unwrap();
        made.file().write_all(b"whole").unwrap();
        made.persist(&path).unwrap();
        assert_eq!((fs::read_to_string(&path).unwrap().as_str(), count(folder.path())), ("whole", 1));
    }
}
