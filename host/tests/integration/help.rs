//! `damprig help`: commands go before pages of the manual; pages in the terminal and in the browser.
#![cfg(unix)]

use std::os::unix::fs::PermissionsExt;

use crate::common::{damprig, folder_with};

/// Standard output of a command that succeeds.
fn printed(arguments: &[&str]) -> String {
    let output = damprig(&folder_with("")).args(arguments).assert().success().get_output().clone();
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_help_of_a_command_is_that_of_its_flag_and_names_pages() {
    for command in [&["run"][..], &["runs", "export"], &["calibrate"]] {
        let help = printed(&[&["help"], command].concat());
        let flag = printed(&[command, &["--help"]].concat());
        assert!(help.starts_with(flag.trim_end()), "{help}");
        assert!(help.contains("In the manual (damprig help PAGE): "), "{help}");
    }
    assert!(printed(&["help", "calibrate"]).contains("calibrate-lasers"));
}

#[test]
fn without_a_topic_all_commands_and_pages_are_listed() {
    let list = printed(&["help"]);
    for part in ["Rig:", "Design:", "Tutorial:", "How-to:", "Reference:", "Theory:", "For developers:", "  read-e-n "] {
        assert!(list.contains(part), "{part}: {list}");
    }
}

#[test]
fn a_topic_is_a_page_or_a_section_of_a_long_one() {
    assert!(printed(&["help", "e_n"]).starts_with("Read E_n: does the model agree?\n==="));
    let section = printed(&["help", "option", "bytes"]);
    assert!(section.starts_with("Option bytes\n") && section.contains("`damprig help lab-guide` prints all of it"));
}

#[test]
fn the_nearest_topics_are_named_for_an_unknown_one() {
    let failed = damprig(&folder_with("")).args(["help", "calibrashun"]).assert().code(2).get_output().clone();
    let told = String::from_utf8(failed.stderr).unwrap();
    assert!(told.contains("\"calibrashun\"; near it are: calibrat") && told.contains("`damprig help`"), "{told}");
}

/// A browser that notes the address; a page alone is a whole HTML file.
#[test]
fn a_page_opens_in_the_browser() {
    let folder = folder_with("");
    let browser = folder.path().join("browser");
    std::fs::write(&browser, "#!/bin/sh\necho \"$1\" > address.tmp && mv address.tmp address\n").unwrap();
    std::fs::set_permissions(&browser, std::fs::Permissions::from_mode(0o755)).unwrap();
    // A command without a book beside it.
    let command = folder.path().join("damprig");
    std::fs::copy(assert_cmd::cargo::cargo_bin("damprig"), &command).unwrap();
    let open = |topic: &str| {
        let mut help = assert_cmd::Command::new(&command);
        help.args(["help", topic, "--web"]).env("BROWSER", &browser).env("TMPDIR", folder.path());
        let output = help.current_dir(folder.path()).assert().success().get_output().clone();
        String::from_utf8(output.stdout).unwrap().trim().to_string()
    };
    let address = open("laser");
    let page = std::fs::read_to_string(address.strip_prefix("file://").unwrap()).unwrap();
    assert!(page.contains("<h1>Calibrate the lasers</h1>") && page.ends_with("</html>\n"), "{page}");
    let noted = folder.path().join("address");
    let mut waited = 0;
    while !noted.exists() && waited < 600 {
        std::thread::sleep(std::time::Duration::from_millis(50));
        waited += 1;
    }
    assert_eq!(std::fs::read_to_string(noted).unwrap().trim(), address);
    // Beside a book its pages are opened.
    let book = folder.path().join("manual");
    std::fs::create_dir_all(book.join("how-to")).unwrap();
    for file in ["index.html", "toc.html", "LAB_GUIDE.html", "how-to/calibrate-lasers.html"] {
        std::fs::write(book.join(file), "").unwrap();
    }
    assert!(open("laser").ends_with("/manual/how-to/calibrate-lasers.html"));
    assert!(open("option bytes").ends_with("/manual/LAB_GUIDE.html#option-bytes"));
    assert!(open("E_n").ends_with(".html") && !open("E_n").contains("/manual/"), "a page that this book does not have");
}

#[cfg(not(feature = "probe"))]
#[test]
fn the_page_of_all_commands_is_up_to_date() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/COMMANDS.md");
    let committed = std::fs::read_to_string(path).unwrap();
    let printed = printed(&["man", "--markdown"]);
    assert!(
        committed == printed,
        "docs/COMMANDS.md is out of date: write it anew with `damprig man --markdown > docs/COMMANDS.md`"
    );
}
