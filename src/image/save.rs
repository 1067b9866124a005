//! Writes files completely or not at all. A symbolic link is kept, and its target is written, whether it
//! exists or not.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Reason, Result};

/// Most symbolic links that are followed.
const MAX_LINKS: usize = 40;

/// The final path of a file to be written at `path`, which is replaced if it exists, and its folder. `None`
/// for any other existing path: a device or a pipe must not be replaced by a file.
fn destination(path: &Path) -> Result<Option<(PathBuf, PathBuf)>> {
    let error = |reason: Reason| Err(Error::write(path, reason));
    let there = fs::metadata(path);
    match &there {
        Ok(m) if m.is_dir() => return error("is a folder; give the name of a file".into()),
        Ok(m) if !m.is_file() => return Ok(None),
        Ok(m) if m.permissions().readonly() => {
            return error("the file there is read-only; remove it first".into());
        }
        _ => {}
    }
    if path.file_name().is_none() || path.to_string_lossy().ends_with(std::path::is_separator) {
        return error(Reason::of_request("names no file; give the name of one"));
    }
    let file = match there {
        Err(e) if e.kind() == ErrorKind::NotADirectory => return error(no_folder(folder_of(path))),
        // An invalid name, for example too long, would otherwise be noticed only at the end.
        Err(e) if e.kind() != ErrorKind::NotFound => followed(path).and(Err(e)),
        _ => followed(path),
    };
    let file = file.map_err(|e| Error::write(path, e))?;
    let folder = folder_of(&file).to_owned();
    if !folder.is_dir() {
        return error(no_folder(&folder));
    }
    Ok(Some((file, folder)))
}

/// Why nothing can be written into `folder`, which is not a folder.
#[must_use]
pub fn no_folder(folder: &Path) -> Reason {
    match folder.ancestors().find(|part| part.exists() && !part.is_dir()) {
        Some(file) => format!("{} is a file, not a folder; give another name", file.display()).into(),
        None => format!("there is no folder {}; create it first", folder.display()).into(),
    }
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

/// Tries to create a file where [`save`] would.
pub(super) fn check(path: &Path) -> Result<()> {
    destination(path)?.map_or(Ok(()), |(_, folder)| Sink::new(path, &folder).map(drop))
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

/// The destination of the bytes of a file until it is complete.
enum Sink {
    /// A device or a pipe, written directly.
    Special(File),
    /// A file without a name, which disappears however the program ends.
    #[cfg(target_os = "linux")]
    Unnamed(File),
    /// A file that is deleted when dropped.
    Named(NamedTempFile),
}

impl Sink {
    fn new(path: &Path, folder: &Path) -> Result<Self> {
        #[cfg(target_os = "linux")]
        if let Ok(file) = unnamed(folder) {
            return Ok(Self::Unnamed(file));
        }
        builder().tempfile_in(folder).map(Self::Named).map_err(|e| {
            let place = folder.display();
            Error::write(
                path,
                Reason::from(e).reworded(|words| format!("no file can be created in {place}: {words}")),
            )
        })
    }

    /// The bare file: errors of the named one would mention its temporary name.
    fn file(&mut self) -> &mut File {
        match self {
            Self::Special(file) => file,
            #[cfg(target_os = "linux")]
            Self::Unnamed(file) => file,
            Self::Named(file) => file.as_file_mut(),
        }
    }

    /// Gives the file its name, replacing an existing file.
    fn persist(mut self, name: &Path) -> io::Result<()> {
        if !matches!(self, Self::Special(_)) {
            // Otherwise a crash of the machine could leave the name without the contents.
            self.file().sync_all()?;
        }
        match self {
            Self::Special(_) => Ok(()),
            #[cfg(target_os = "linux")]
            Self::Unnamed(file) => match link(&file, name) {
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {
                    // Only a named file can replace another.
                    let other = builder().make_in(folder_of(name), |other| link(&file, other))?;
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
        // Temporary files are private by default; an output should be as readable as the umask allows.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
}

/// A file without a name in `folder`, if the file system supports that and can name it later.
#[cfg(target_os = "linux")]
fn unnamed(folder: &Path) -> io::Result<File> {
    use rustix::fs::{Mode, OFlags};
    let mode = Mode::from_raw_mode(0o666);
    let file =
        File::from(rustix::fs::open(folder, OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC, mode)?);
    fs::symlink_metadata(place(&file)).map(|_| file)
}

/// The path of an open file in /proc.
#[cfg(target_os = "linux")]
fn place(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd;
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// Names an unnamed file; `name` must be free.
#[cfg(target_os = "linux")]
fn link(file: &File, name: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, place(file), CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

/// A file that is written piece by piece. It appears only when it is [finished](Self::finish), and leaves
/// nothing if dropped before. An existing path that is not a regular file is written to directly; a symbolic
/// link is followed.
pub struct Growing {
    path: PathBuf,
    /// The final name, after following links.
    name: PathBuf,
    to: Sink,
}

impl Growing {
    /// Begins the file `path`.
    ///
    /// # Errors
    /// [`Error::Write`] when it cannot be written.
    pub fn new(path: &Path) -> Result<Self> {
        let (name, to) = if let Some((name, folder)) = destination(path)? {
            (name, Sink::new(path, &folder)?)
        } else {
            let file = fs::OpenOptions::new().write(true).open(path);
            (path.to_owned(), Sink::Special(file.map_err(|e| Error::write(path, e))?))
        };
        Ok(Self { path: path.to_owned(), name, to })
    }

    /// Completes the file, and gives it its name.
    ///
    /// # Errors
    /// [`Error::Write`] when it cannot be written.
    pub fn finish(self) -> Result<()> {
        self.to.persist(&self.name).map_err(|e| Error::write(&self.path, e))
    }
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.to.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.file().flush()
    }
}

/// A device or a pipe may refuse.
impl Seek for Growing {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.to.file().seek(to)
    }
}

/// Writes a file completely or not at all, like [`Growing`].
///
/// # Errors
/// [`Error::Write`] when the file cannot be written.
pub fn save(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = Growing::new(path)?;
    file.write_all(bytes).map_err(|e| Error::write(path, e))?;
    file.finish()
}

/// Moves the file `staged` to `path`, which is replaced if it exists; a symbolic link is followed.
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
        // Links to a file, to a missing file, through another link, and as an absolute path.
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
        // A link into a missing folder, and a circular one.
        symlink("none/file", at("e")).unwrap();
        symlink("f", at("f")).unwrap();
        for (link, word) in [("e", "there is no folder"), ("f", "circle")] {
            let said = save(&at(link), b"").unwrap_err().to_string();
            assert!(said.contains(word) && said.contains(link), "{said}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_unfinished_file_has_no_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut made = Growing::new(&path).unwrap();
        made.write_all(b"half").unwrap();
        let Sink::Unnamed(_) = made.to else {
            // Some file systems do not support unnamed files.
            assert_eq!(count(folder.path()), 1);
            return;
        };
        assert_eq!(count(folder.path()), 0);
        made.finish().unwrap();
        // Replaces an existing file.
        save(&path, b"whole").unwrap();
        assert_eq!((fs::read_to_string(&path).unwrap().as_str(), count(folder.path())), ("whole", 1));
    }
}
