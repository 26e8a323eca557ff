//! A file that gets its name only when it is complete.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

/// Beginnings of the names of files that are not complete; the second is that of an older version.
const BEGINNINGS: [&str; 2] = [".damprig-", ".unfinished-"];
const END: &str = ".tmp";

/// Whether a name is that of a file that is not complete.
#[must_use]
pub fn is_unfinished(name: &str) -> bool {
    BEGINNINGS.iter().any(|beginning| name.starts_with(beginning)) && name.ends_with(END)
}

/// A file under construction beside its final name. Dropped, it leaves nothing.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    beside: NamedTempFile,
}

impl WholeFile {
    /// Creates it under a name that no other writer has, on any machine.
    ///
    /// # Errors
    /// The folder is missing or cannot be written.
    pub fn create(path: &Path) -> io::Result<Self> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return Err(io::Error::other(format!(
                "there is no folder {}; create it or give another path",
                folder.display()
            )));
        }
        let mut builder = Builder::new();
        builder.prefix(BEGINNINGS[0]).suffix(END).rand_bytes(12);
        // Temporary files are private by default.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        Ok(Self { path: path.to_path_buf(), beside: builder.tempfile_in(folder)? })
    }

    /// The file.
    pub fn as_file_mut(&mut self) -> &mut File {
        self.beside.as_file_mut()
    }

    /// Where it is until it has its name.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.beside.path()
    }

    /// Gives it its name, on the disk, in place of an earlier file.
    ///
    /// # Errors
    /// It cannot be written; the earlier file stays.
    pub fn replace(self) -> io::Result<()> {
        self.beside.as_file().sync_data()?;
        self.beside.persist(&self.path).map(drop).map_err(|error| error.error)
    }

    /// Gives it its name, on the disk, unless there is a file of that name, which stays; answers whether it did.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn name_new(self) -> io::Result<bool> {
        self.beside.as_file().sync_data()?;
        match self.beside.persist_noclobber(&self.path) {
            Ok(_) => Ok(true),
            Err(_) if self.path.is_file() => Ok(false),
            Err(error) => Err(error.error),
        }
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.beside.as_file_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.beside.as_file_mut().flush()
    }
}

/// Writes a whole file, on the disk, in place of an earlier one.
///
/// # Errors
/// It cannot be written; the earlier file stays.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = WholeFile::create(path)?;
    file.write_all(bytes)?;
    file.replace()
}
