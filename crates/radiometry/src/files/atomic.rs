//! A file appears under its name whole, or not at all.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, IntoInnerError};
use std::path::{Path, PathBuf};

use super::FileError;

/// Writes a file of any kind under a temporary name in the same folder (`.NAME.partial-PID`), brings it to the disk and
/// renames it to `path`, replacing what was there.
///
/// When `write` or any step fails, the temporary file is removed and an older file at `path` stays as it was. A killed
/// process may leave a temporary file behind; no reader takes it for a picture and no later write stumbles over it.
///
/// # Errors
/// [`FileError::Write`] with what `write` or the operating system said.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FileError> {
    attempt(path, write).map_err(|source| FileError::Write { path: path.to_path_buf(), source })
}

fn attempt(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));

    // `partial` outlives the open file: on an error the file is closed first and removed second.
    let (mut partial, file) = Partial::create(folder, name)?;
    let mut out = BufWriter::with_capacity(1 << 16, file);
    write(&mut out)?;
    let file = out.into_inner().map_err(IntoInnerError::into_error)?;
    file.sync_all()?;
    drop(file);
    fs::rename(&partial.path, path)?;
    partial.renamed = true;
    sync_folder(folder)
}

/// The temporary file, removed unless it became the file itself.
struct Partial {
    path: PathBuf,
    renamed: bool,
}

impl Partial {
    fn create(folder: &Path, name: &OsStr) -> io::Result<(Self, File)> {
        // The number sets threads of one process apart, and steps over leavings of a killed one with the same id.
        let mut taken = None;
        for number in 0..1000 {
            let mut partial = OsStr::new(".").to_os_string();
            partial.push(name);
            partial.push(format!(".partial-{}", std::process::id()));
            if number > 0 {
                partial.push(format!("-{number}"));
            }
            let path = folder.join(partial);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => return Ok((Self { path, renamed: false }, file)),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => taken = Some(error),
                Err(error) => return Err(error),
            }
        }
        Err(taken.unwrap_or_else(|| io::ErrorKind::AlreadyExists.into()))
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if !self.renamed {
            // Nothing better can be done about a failure here, and the first error is the one to tell.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// The new name is safe only when the folder is on the disk too.
#[cfg(unix)]
fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder)?.sync_all() {
        // Some network file systems know no fsync of a folder.
        Err(error) if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
        other => other,
    }
}

#[cfg(not(unix))]
fn sync_folder(_folder: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_written_file_is_alone_in_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("note.txt");
        write_atomically(&path, |out| out.write_all(b"old")).unwrap();
        write_atomically(&path, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["note.txt"]);
    }

    #[test]
    fn a_failing_write_leaves_no_temporary_file_and_the_old_one_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("note.txt");
        fs::write(&path, "old").unwrap();
        let error = write_atomically(&path, |out| {
            out.write_all(&[7; 100_000])?;
            Err(io::ErrorKind::StorageFull.into())
        });
        let Err(FileError::Write { source, .. }) = error else { panic!("{error:?}") };
        assert_eq!(source.kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["note.txt"]);
    }

    #[test]
    fn a_panicking_write_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("note.txt");
        let result = std::panic::catch_unwind(|| write_atomically(&path, |_| panic!("encoder")));
        assert!(result.is_err());
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_rename_that_fails_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taken");
        fs::create_dir_all(path.join("by a folder")).unwrap();
        assert!(matches!(write_atomically(&path, |_| Ok(())), Err(FileError::Write { .. })));
        assert_eq!(names(folder.path()), ["taken"]);
    }

    #[test]
    fn a_leaving_of_a_killed_process_is_stepped_over() {
        let folder = tempfile::tempdir().unwrap();
        let leaving = format!(".note.txt.partial-{}", std::process::id());
        fs::write(folder.path().join(&leaving), "half").unwrap();
        write_atomically(&folder.path().join("note.txt"), |out| out.write_all(b"whole")).unwrap();
        assert_eq!(names(folder.path()), [leaving.as_str(), "note.txt"]);
    }

    #[test]
    fn threads_writing_one_name_never_mix() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("note.txt");
        std::thread::scope(|scope| {
            for letter in *b"abcdefgh" {
                let path = &path;
                scope.spawn(move || write_atomically(path, |out| out.write_all(&[letter; 10_000])).unwrap());
            }
        });
        let content = fs::read(&path).unwrap();
        assert_eq!(content, [content[0]; 10_000]);
        assert_eq!(names(folder.path()), ["note.txt"]);
    }

    #[test]
    fn a_path_without_a_file_name_is_an_error() {
        assert!(matches!(write_atomically(Path::new("/"), |_| Ok(())), Err(FileError::Write { .. })));
    }
}
