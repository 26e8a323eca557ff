//! Settings through the ordinary command, and the flash that keeps them.

use std::process::Output;

use damprig_board::Config;

use crate::common::{Served, bare, damprig, image, said};

fn settings(rig: &str, arguments: &[&str]) -> Output {
    let output = damprig().arg("settings").args(arguments).args(["--rig", rig]).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", said(&output));
    output
}

#[test]
fn a_saved_setting_is_read_back_after_the_power_was_off() {
    let Some(first) = image() else { return };
    let board = Served::new(first, Config::new(bare()), |_| {});
    let shown = said(&settings(&board.rig, &["show"]));
    assert!(shown.contains("as delivered"), "{shown}");
    settings(&board.rig, &["set", "spring.step_m=4e-6", "--save"]);
    let outcome = board.off();
    let again = Served::new(image().unwrap(), Config { bank2: Some(outcome.bank2), ..Config::new(bare()) }, |_| {});
    let shown = said(&settings(&again.rig, &["show"]));
    assert!(shown.contains("(stored)") && shown.contains("step_m = 4e-6"), "{shown}");
    assert_eq!((again.off().bytes_lost, outcome.bytes_lost), (0, 0));
}
