//! The drive that an ST-LINK shows: a hex file that is copied onto it is written to the board's flash.
//!
//! The file is Intel HEX, whose lines have checksums: the ST-LINK refuses a damaged one and says why in FAIL.TXT. A binary file that the
//! computer sends out of order would be written as it comes. Nobody has tried this on a board.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Name of the copied file.
pub const FILE: &str = "DAMPRIG.HEX";

/// Files of the ST-LINK on its drive.
const OWN_FILES: [&str; 2] = ["DETAILS.TXT", "MBED.HTM"];

/// File in which the ST-LINK says why it did not write an image.
const REFUSAL: &str = "FAIL.TXT";

/// Label of the drive of a NUCLEO-G474RE, and the part of it that names the board.
const LABEL: &str = "NOD_G474RE";
const BOARD: &str = "G474RE";

/// Most bytes of the ST-LINK's files that are read.
const MAX_BYTES: u64 = 64 << 10;

/// Why no drive was found.
#[derive(Debug, PartialEq, Eq)]
pub enum NoDrive {
    /// None, or not that of this board; the message.
    Missing(String),
    /// Several; the message.
    Ambiguous(String),
}

/// A mounted drive of an ST-LINK.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MountedDrive {
    folder: PathBuf,
}

impl MountedDrive {
    /// The drive that is mounted at `folder`.
    ///
    /// # Errors
    /// The folder has none of the ST-LINK's files.
    pub fn at(folder: &Path) -> Result<Self, String> {
        if !is_st_link(folder) {
            return Err(format!(
                "--drive {}: this is not the drive of an ST-LINK: it has neither {}; give the folder where {LABEL} is mounted",
                folder.display(),
                OWN_FILES.join(" nor ")
            ));
        }
        Ok(Self { folder: folder.to_path_buf() })
    }

    /// The drive of the only connected NUCLEO-G474RE.
    ///
    /// # Errors
    /// None, or several.
    pub fn find() -> Result<Self, NoDrive> {
        Self::among(&mounted())
    }

    /// As [`MountedDrive::find`], among these folders.
    ///
    /// # Errors
    /// None, or several.
    pub fn among(folders: &[PathBuf]) -> Result<Self, NoDrive> {
        let all: Vec<&PathBuf> = folders.iter().filter(|folder| is_st_link(folder)).collect();
        let list = |some: &[&PathBuf]| {
            some.iter().map(|folder| format!("\n  --drive {}", folder.display())).collect::<String>()
        };
        let of_board: Vec<&PathBuf> = all.iter().copied().filter(|folder| is_of_board(folder)).collect();
        match (&of_board[..], &all[..]) {
            ([only], _) => Ok(Self { folder: (*only).clone() }),
            ([], []) => Err(NoDrive::Missing(format!(
                "no drive of an ST-LINK is mounted: connect the board's USB connector CN1 with a data cable and mount the drive {LABEL}, \
                 or give its folder with --drive"
            ))),
            ([], others) => Err(NoDrive::Missing(format!(
                "no mounted drive names a NUCLEO-G474RE; drives of an ST-LINK, of which one can be given:{}",
                list(others)
            ))),
            (several, _) => {
                Err(NoDrive::Ambiguous(format!("{} boards are connected; select one:{}", several.len(), list(several))))
            }
        }
    }

    /// Where it is mounted.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What the ST-LINK says about an image that it did not write, now or earlier.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        text(&self.folder.join(REFUSAL)).map(|text| text.trim().to_string())
    }

    /// Copies a hex file onto the drive and waits until the drive has it.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn copy(&self, hex: &str) -> Result<(), String> {
        let path = self.folder.join(FILE);
        let failed = |error: std::io::Error| {
            format!(
                "cannot copy the image to {}: {error}; the firmware on the board may be incomplete: flash it again",
                path.display()
            )
        };
        let mut file = File::create(&path).map_err(failed)?;
        file.write_all(hex.as_bytes()).map_err(failed)?;
        match file.sync_all() {
            // The ST-LINK takes the drive away when it has all of the file; what it did with it is asked of the board.
            Err(_) if !is_st_link(&self.folder) => Ok(()),
            other => other.map_err(failed),
        }
    }
}

fn is_st_link(folder: &Path) -> bool {
    OWN_FILES.iter().any(|name| folder.join(name).is_file())
}

fn is_of_board(folder: &Path) -> bool {
    let label = folder.file_name().unwrap_or_default().to_string_lossy().to_ascii_uppercase();
    label.contains(LABEL)
        || OWN_FILES.iter().filter_map(|name| text(&folder.join(name))).any(|text| text.contains(BOARD))
}

/// The beginning of a text file; `None` where there is none.
fn text(path: &Path) -> Option<String> {
    use std::io::Read;
    if !fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(MAX_BYTES).read_to_end(&mut bytes).ok()?;
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

/// Where drives are mounted.
fn mounted() -> Vec<PathBuf> {
    if cfg!(windows) {
        return (b'A'..=b'Z').map(|letter| PathBuf::from(format!("{}:\\", char::from(letter)))).collect();
    }
    if cfg!(target_os = "macos") {
        let volumes = fs::read_dir("/Volumes").into_iter().flatten().flatten();
        return volumes.map(|entry| entry.path()).collect();
    }
    mount_points(&fs::read_to_string("/proc/self/mounts").unwrap_or_default())
}

/// The places of FAT file systems in Linux's list of mounts (proc_mounts(5)), where blanks are written as `\040`.
fn mount_points(mounts: &str) -> Vec<PathBuf> {
    let fat = mounts.lines().filter_map(|line| {
        let mut words = line.split(' ').skip(1);
        let (place, kind) = (words.next()?, words.next()?);
        matches!(kind, "vfat" | "msdos" | "fuseblk").then_some(place)
    });
    fat.map(|place| PathBuf::from(place.replace("\\040", " ").replace("\\011", "\t").replace("\\134", "\\"))).collect()
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;

    /// A folder with a file of an ST-LINK.
    fn drive(parent: &TempDir, label: &str, about: &str) -> PathBuf {
        let folder = parent.path().join(label);
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("MBED.HTM"), about).unwrap();
        folder
    }

    #[test]
    fn the_board_is_known_by_the_label_or_by_the_text_on_its_drive() {
        let parent = TempDir::new().unwrap();
        let stick = parent.path().join("STICK");
        fs::create_dir(&stick).unwrap();
        let other = drive(&parent, "NOD_F446RE", "a NUCLEO-F446RE");
        let by_label = drive(&parent, "NOD_G474RE1", "");
        let by_text = drive(&parent, "mnt", "Board: NUCLEO-G474RE");
        for own in [&by_label, &by_text] {
            let found = MountedDrive::among(&[stick.clone(), other.clone(), own.clone()]).unwrap();
            assert_eq!(found.folder(), own);
        }
        let Err(NoDrive::Ambiguous(text)) = MountedDrive::among(&[by_label, by_text]) else { panic!("one was chosen") };
        assert!(text.contains("2 boards") && text.contains("--drive "), "{text}");
        let Err(NoDrive::Missing(text)) = MountedDrive::among(&[stick.clone(), other]) else { panic!("one was found") };
        assert!(text.contains("NOD_F446RE"), "{text}");
        let Err(NoDrive::Missing(text)) = MountedDrive::among(std::slice::from_ref(&stick)) else {
            panic!("one was found")
        };
        assert!(text.contains("no drive of an ST-LINK") && text.contains("NOD_G474RE"), "{text}");
        assert!(MountedDrive::at(&stick).unwrap_err().contains("neither DETAILS.TXT nor MBED.HTM"));
    }

    #[test]
    fn mounts_of_fat_are_read_with_their_blanks() {
        let mounts = "/dev/sda1 / ext4 rw 0 0\n/dev/sdb /media/me/NOD_G474RE vfat rw 0 0\n/dev/sdc /media/a\\040b vfat rw 0 0\n\nx";
        assert_eq!(mount_points(mounts), [PathBuf::from("/media/me/NOD_G474RE"), PathBuf::from("/media/a b")]);
    }
}
