//! `damprig flash` and `damprig log` without a board at hand: invalid images are refused before a drive or a probe is searched; a folder
//! with the ST-LINK's files stands for its drive, and a served board for the one behind it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use crate::common::real_board::{Flashed, Memory, board_to_flash};
use crate::common::{damprig, folder_with};
use damprig_core::settings::Settings;
use damprig_device::board::DeviceInfo;
use damprig_device::settings_record::encode;
use damprig_protocol::image::{LENGTH, to_bytes};
use tempfile::TempDir;

/// The commands that read an image.
const COMMANDS: &[&str] = if cfg!(feature = "probe") { &["flash", "log"] } else { &["flash"] };

/// Exit code and messages of the command.
fn answer(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String) {
    let output = damprig(folder).args(arguments).output().expect("the command");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Both commands must refuse these bytes as an image, name the file, and print `words`.
fn refused(bytes: &[u8], words: &[&str]) {
    let folder = folder_with("");
    std::fs::write(folder.path().join("image.elf"), bytes).expect("a file");
    for command in COMMANDS {
        let (code, said) = answer(&folder, &[command, "image.elf"]);
        assert_eq!(code, Some(2), "{said}");
        assert!(!said.contains("debug probe") && !said.contains("drive"), "a probe was looked for: {said}");
        for word in words.iter().chain(&["image.elf"]) {
            assert!(said.contains(word), "no {word:?} in: {said}");
        }
    }
}

/// An image built by `tests/firmware`; `None` with a message if there is none.
fn image(name: &str) -> Option<Vec<u8>> {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../firmware/target/images/{name}.elf"));
    if path.is_file() {
        return Some(std::fs::read(path).expect("an image"));
    }
    let absent = format!("no image {}: `tests/firmware` builds it", path.display());
    assert!(std::env::var_os("DAMPRIG_IMAGES").is_none_or(|value| value != "required"), "{absent}");
    eprintln!("not tested: {absent}");
    None
}

/// The identity section of the image.
fn identity(image: &mut [u8]) -> &mut [u8] {
    let own = to_bytes("nucleo-g474re", env!("CARGO_PKG_VERSION"), "");
    // The revision at the end is that of the build.
    let own = &own[..LENGTH - 16];
    let at = image.windows(own.len()).position(|window| window == own).expect("an identity of this program's protocol");
    &mut image[at..at + LENGTH]
}

#[test]
fn a_text_file_is_refused() {
    refused(b"firmware\n", &["not an ELF file", "not .bin, .hex or .uf2"]);
    refused(b"", &["not an ELF file"]);
}

#[test]
fn a_program_for_another_processor_is_refused() {
    let own = std::fs::read(std::env::current_exe().expect("this test")).expect("this test");
    refused(&own, &["the controller is an ARM Cortex-M4 (STM32G474RETx)"]);
}

#[test]
fn an_image_for_the_emulated_board_is_refused_with_both_boards() {
    let Some(image) = image("mps2-an386") else { return };
    refused(&image, &["the image of the board mps2-an386, not of nucleo-g474re", "outside bank 1 of the flash"]);
}

#[test]
fn an_image_of_another_protocol_is_refused_with_both_sides() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    identity(&mut image)[8..10].copy_from_slice(&999_u16.to_le_bytes());
    let ours = format!("this program version {}", damprig_protocol::VERSION);
    refused(&image, &["another protocol: image version 999", "on nucleo-g474re", &ours, "from the same source"]);
}

#[test]
fn an_image_of_another_schema_is_refused_with_both_hashes() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    identity(&mut image)[10..18].copy_from_slice(&[0xab; 8]);
    let ours = damprig::client::session::hex(&damprig_protocol::SCHEMA);
    refused(&image, &["schema abababababababab", &ours]);
}

#[test]
fn an_image_without_identity_is_refused() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    identity(&mut image)[..4].fill(0);
    refused(&image, &["its section .damprig.identity", "another layout"]);
}

#[test]
fn an_image_beyond_bank_1_is_refused_with_its_address() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    // The first program header's physical address, in a 32-bit ELF file.
    let headers = u32::from_le_bytes(image[28..32].try_into().expect("four bytes")) as usize;
    image[headers + 12..headers + 16].copy_from_slice(&0x0803_fff0_u32.to_le_bytes());
    refused(&image, &["is loaded to 0x0803fff0..", "outside bank 1 of the flash 0x08000000..0x08040000"]);
}

#[test]
fn a_truncated_image_is_refused_wherever_it_ends() {
    let Some(image) = image("nucleo-g474re") else { return };
    for part in [10, 52, 300, 5_000, 90_000, image.len() / 2] {
        refused(&image[..part], &["image.elf: "]);
    }
}

#[test]
fn files_that_exist_are_kept_before_anything_is_read() {
    let folder = folder_with("");
    std::fs::write(folder.path().join("taken.hex"), "mine").expect("a file");
    for option in ["--hex", "--backup"] {
        let (code, said) = answer(&folder, &["flash", "absent.elf", option, "taken.hex"]);
        assert!(code == Some(2) && said.contains("cannot write taken.hex: it exists"), "{said}");
    }
    let (code, said) = answer(&folder, &["flash", "absent.elf", "--hex", "taken.hex", "--force"]);
    assert!(code == Some(2) && said.contains("absent.elf"), "{said}");
    assert_eq!(std::fs::read_to_string(folder.path().join("taken.hex")).expect("a file"), "mine");
}

#[cfg(feature = "probe")]
#[test]
fn a_missing_probe_is_reported_with_what_to_check() {
    let Some(image) = image("nucleo-g474re") else { return };
    let folder = folder_with("");
    let built = folder.path().join("firmware/target/images");
    std::fs::create_dir_all(&built).expect("folders");
    std::fs::write(built.join("nucleo-g474re.elf"), &image).expect("a file");
    if damprig::board::probe::candidates().is_empty() {
        for command in ["flash", "log"] {
            let (code, said) = answer(&folder, &[command]);
            assert_eq!(code, Some(1), "{said}");
            assert!(said.contains("no debug probe found") && said.contains("connect the board"), "{said}");
        }
    } else {
        eprintln!("not tested: no probe (there is one at this machine, and it is left alone)");
    }
}

#[test]
fn a_missing_image_is_reported_with_its_path_and_how_to_build_it() {
    let folder = folder_with("");
    let (code, said) = answer(&folder, &["flash"]);
    assert_eq!(code, Some(2), "{said}");
    for word in ["firmware/target/images/nucleo-g474re.elf", "parent folder", "`tests/firmware` builds"] {
        assert!(said.contains(word), "no {word:?} in: {said}");
    }
    let (code, said) = answer(&folder, &["flash", "other.elf"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("cannot read the image other.elf") && said.contains("`tests/firmware`"), "{said}");
}

#[cfg(feature = "probe")]
#[test]
fn an_invalid_probe_is_refused_with_the_format() {
    let (code, said) = answer(&folder_with(""), &["flash", "--probe", "stlink"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("--probe") && said.contains("VID:PID:SERIAL"), "{said}");
}

#[cfg(unix)]
#[test]
fn a_pipe_or_a_folder_is_refused_as_an_image() {
    let folder = folder_with("");
    std::fs::create_dir(folder.path().join("folder.elf")).expect("a folder");
    let pipe = folder.path().join("pipe.elf");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    for (file, kind) in [("folder.elf", "a folder"), ("pipe.elf", "a pipe")] {
        let output =
            damprig(&folder).args(["flash", file]).timeout(crate::common::PATIENCE).output().expect("the command");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("cannot read the image {file}: this is {kind}, not a regular file")), "{said}");
    }
}

/// A folder with an image and the drive of an ST-LINK, and the revision that the image states.
fn folder_with_drive(image: &mut [u8]) -> (TempDir, PathBuf, &'static str) {
    let folder = folder_with("");
    std::fs::write(folder.path().join("image.elf"), &image).expect("a file");
    let drive = folder.path().join("NOD_G474RE");
    std::fs::create_dir(&drive).expect("a folder");
    std::fs::write(drive.join("DETAILS.TXT"), "Version: 0221\r\n").expect("a file");
    let revision = String::from_utf8_lossy(&identity(image)[LENGTH - 16..]).trim_end_matches('\0').to_string();
    (folder, drive, revision.leak())
}

/// Settings that a board as delivered does not have.
fn lab() -> Settings {
    let mut settings = Settings::default();
    settings.calibration.x.zero_counts = 32_700.5;
    settings
}

/// Plays the ST-LINK: when the hex file is complete, the board has `firmware`, and its settings memory is erased.
fn st_link(drive: &Path, flashed: &Flashed, firmware: DeviceInfo) -> std::thread::JoinHandle<String> {
    let (file, flashed) = (drive.join("DAMPRIG.HEX"), Arc::clone(flashed));
    std::thread::spawn(move || {
        let mut hex = String::new();
        while !hex.ends_with(":00000001FF\n") {
            std::thread::sleep(Duration::from_millis(5));
            hex = std::fs::read_to_string(&file).unwrap_or_default();
        }
        *flashed.lock().expect("no panic") = Some((firmware, Memory::blank()));
        hex
    })
}

/// Flash contents of a hex file by their address.
fn contents(hex: &str) -> std::collections::BTreeMap<u32, u8> {
    let (mut upper, mut found) = (0, std::collections::BTreeMap::new());
    for line in hex.lines() {
        let bytes: Vec<u8> = (1..line.len())
            .step_by(2)
            .map(|at| u8::from_str_radix(&line[at..at + 2], 16).expect("hexadecimal"))
            .collect();
        assert_eq!(bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)), 0, "the checksum of {line}");
        let data = &bytes[4..bytes.len() - 1];
        match bytes[3] {
            0 => {
                let start = upper + u32::from(u16::from_be_bytes([bytes[1], bytes[2]]));
                found.extend((start..).zip(data.iter().copied()));
            }
            4 => upper = u32::from(u16::from_be_bytes([data[0], data[1]])) << 16,
            kind => assert_eq!(kind, 1),
        }
    }
    found
}

#[test]
fn an_image_goes_onto_the_drive_and_the_board_gets_its_settings_back() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    let (folder, drive, revision) = folder_with_drive(&mut image);
    let flashed = Flashed::default();
    let rig = board_to_flash(Memory::with(&encode(3, &lab()).unwrap()), &flashed);
    let firmware = DeviceInfo { revision, ..DeviceInfo::new(env!("CARGO_PKG_VERSION"), "nucleo-g474re") };
    let st_link = st_link(&drive, &flashed, firmware);
    let arguments = ["flash", "image.elf", "--drive", "NOD_G474RE", "--rig", &rig, "--backup", "kept.toml"];
    let (code, said) = answer(&folder, &arguments);
    assert_eq!(code, Some(0), "{said}");
    for part in ["settings of the board kept in kept.toml", "copied", "settings restored, saved and verified"] {
        assert!(said.contains(part), "no {part:?} in: {said}");
    }
    let output =
        damprig(&folder).args(["settings", "restore", "kept.toml", "--rig", &rig]).output().expect("the command");
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains("already"), "{text}");
    // The file has the image's flash contents.
    let hex = contents(&st_link.join().expect("no panic"));
    let read = damprig::board::image::Image::read(&folder.path().join("image.elf")).expect("an image");
    let expected = read.pieces.iter().flat_map(|(at, bytes)| (*at as u32..).zip(bytes.iter().copied())).collect();
    assert_eq!(hex, expected);
    // --hex writes the same file and touches no board.
    let (code, said) = answer(&folder, &["flash", "image.elf", "--hex", "image.hex"]);
    assert_eq!(code, Some(0), "{said}");
    let written = std::fs::read_to_string(folder.path().join("image.hex")).expect("a file");
    assert_eq!(written, std::fs::read_to_string(drive.join("DAMPRIG.HEX")).expect("a file"));
}

#[test]
fn firmware_of_another_revision_is_no_success_and_gets_no_settings() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    let (folder, drive, _) = folder_with_drive(&mut image);
    let flashed = Flashed::default();
    let rig = board_to_flash(Memory::with(&encode(3, &lab()).unwrap()), &flashed);
    let firmware = DeviceInfo { revision: "other", ..DeviceInfo::new(env!("CARGO_PKG_VERSION"), "nucleo-g474re") };
    let _st_link = st_link(&drive, &flashed, firmware);
    let (code, said) = answer(&folder, &["flash", "image.elf", "--drive", "NOD_G474RE", "--rig", &rig]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("another board or firmware answers") && said.contains("(other)"), "{said}");
    assert!(!said.contains("restored"), "{said}");
}

#[test]
fn a_board_that_goes_on_with_the_old_firmware_is_reported() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    let (folder, _, _) = folder_with_drive(&mut image);
    let rig = board_to_flash(Memory::blank(), &Flashed::default());
    let arguments = ["flash", "image.elf", "--drive", "NOD_G474RE", "--rig", &rig, "--timeout", "3"];
    let (code, said) = answer(&folder, &arguments);
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("has not restarted with it within 3 s") && said.contains("has been running for 30"),
        "{said}"
    );
}

#[test]
fn the_refusal_of_the_st_link_is_shown_and_an_earlier_one_is_not() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    let (folder, drive, _) = folder_with_drive(&mut image);
    let rig = board_to_flash(Memory::blank(), &Flashed::default());
    let arguments = ["flash", "image.elf", "--drive", "NOD_G474RE", "--rig", &rig, "--timeout", "2"];
    std::fs::write(drive.join("FAIL.TXT"), "an earlier failure\r\n").expect("a file");
    let (code, said) = answer(&folder, &arguments);
    assert!(code == Some(1) && !said.contains("an earlier failure"), "{said}");
    let place = drive.clone();
    let writer = std::thread::spawn(move || {
        while std::fs::metadata(place.join("DAMPRIG.HEX")).map_or(0, |file| file.len()) == 0 {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::fs::write(place.join("FAIL.TXT"), "The flash programming has failed.\r\n").expect("a file");
    });
    std::fs::remove_file(drive.join("DAMPRIG.HEX")).expect("the copy");
    let (code, said) = answer(&folder, &arguments);
    writer.join().expect("no panic");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("did not write the image: The flash programming has failed."), "{said}");
}

#[test]
fn nothing_is_copied_before_the_settings_are_kept() {
    let Some(mut image) = image("nucleo-g474re") else { return };
    let (folder, drive, _) = folder_with_drive(&mut image);
    let arguments = ["flash", "image.elf", "--drive", "NOD_G474RE", "--rig", "tcp:127.0.0.1:9"];
    let (code, said) = answer(&folder, &arguments);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("cannot be kept before") && said.contains("nothing was written"), "{said}");
    assert!(!drive.join("DAMPRIG.HEX").exists());
    let (code, said) = answer(&folder, &["flash", "image.elf", "--drive", ".", "--rig", "tcp:127.0.0.1:9"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("--drive .: this is not the drive of an ST-LINK"), "{said}");
}
