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
    assert!(section.contains("In the browser: `damprig help option bytes --web`\n"), "{section}");
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
    let mut help = assert_cmd::Command::new(&command);
    let told = help.args(["help", "laser"]).assert().success().get_output().stdout.clone();
    let told = String::from_utf8(told).unwrap();
    assert!(
        told.contains("`damprig help laser --web` opens file://") && told.contains("calibrate-lasers.html\n"),
        "{told}"
    );
    assert!(open("E_n").ends_with(".html") && !open("E_n").contains("/manual/"), "a page that this book does not have");
}

/// Each command that has the option `--NAME`, with the option's value, if it takes one, and what the help says of it.
fn with_option(page: &str, name: &str) -> Vec<(String, String, String)> {
    let mut found = Vec::new();
    for section in page.split("\n## damprig ").skip(1) {
        let command = section.lines().next().unwrap();
        for paragraph in section.split("\n\n") {
            let mut lines = paragraph.lines().map(str::trim).skip_while(|line| !line.starts_with("--"));
            let Some((option, value)) = lines.next().map(|line| line.split_once(' ').unwrap_or((line, ""))) else {
                continue;
            };
            if option == name {
                let text = lines.take_while(|line| *line != "```").collect::<Vec<_>>();
                found.push((command.to_string(), value.to_string(), text.join(" ")));
            }
        }
    }
    found
}

#[test]
fn an_option_of_several_commands_says_the_same_in_each() {
    let page = printed(&["man", "--markdown"]);
    for (name, least) in [("--json", 15), ("--force", 15), ("--quiet", 4)] {
        let found = with_option(&page, name);
        assert!(found.len() >= least, "{name}: {found:?}");
        for (command, value, text) in &found {
            assert_eq!((value.as_str(), text), ("", &found[0].2), "{command} {name}");
        }
    }
}

#[test]
fn each_out_is_a_file_or_a_folder_that_force_replaces() {
    let page = printed(&["man", "--markdown"]);
    let forced: Vec<String> = with_option(&page, "--force").into_iter().map(|(command, ..)| command).collect();
    // These begin a run in a new folder, or go on in the folder of a study.
    let without = ["run", "study run", "study work", "study status", "study verify", "study merge"];
    let found = with_option(&page, "--out");
    assert!(found.len() > 15, "{found:?}");
    for (command, value, _) in found {
        // `continue` takes either.
        assert!(["<FILE>", "<FILE.toml>", "<FOLDER>", "<PLACE>"].contains(&value.as_str()), "{command} --out {value}");
        assert_ne!(forced.contains(&command), without.contains(&command.as_str()), "{command}");
    }
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
