//! `damprig flash` and `damprig log` without a probe: invalid images are refused before a probe is searched.

#![cfg(feature = "probe")]

use std::path::{Path, PathBuf};

use crate::common::{damprig, folder_with};
use damprig_protocol::image::{LENGTH, to_bytes};
use tempfile::TempDir;

/// Exit code and messages of the command.
fn answer(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String) {
    let output = damprig(folder).args(arguments).output().expect("the command");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Both commands must refuse these bytes as an image, name the file, and print `words`.
fn refused(bytes: &[u8], words: &[&str]) {
    let folder = folder_with("");
    std::fs::write(folder.path().join("image.elf"), bytes).expect("a file");
    for command in ["flash", "log"] {
        let (code, said) = answer(&folder, &[command, "image.elf"]);
        assert_eq!(code, Some(2), "{said}");
        assert!(!said.contains("debug probe"), "a probe was looked for: {said}");
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
    let own = to_bytes("nucleo-g474re", env!("CARGO_PKG_VERSION"));
    let at = image.windows(LENGTH).position(|window| window == own).expect("an identity of this program's protocol");
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
    let (code, said) = answer(&folder, &["log", "other.elf"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("cannot read the image other.elf") && said.contains("`tests/firmware`"), "{said}");
}

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
