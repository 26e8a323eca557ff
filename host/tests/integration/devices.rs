//! `damprig devices --rig`: the row of one board, over TCP and a simulated one, and what is wrong with it.

use damprig_core::io::Sensor;
use damprig_protocol::{Crash, CrashCause, FromDevice, Reply};
use predicates::prelude::*;
use predicates::str::contains;

use crate::common::{Fate, Served, damprig, folder_with, short};

#[test]
fn a_board_at_an_address_is_shown_with_what_is_wrong_with_it() {
    let folder = folder_with("");
    let rig = Served::again_and_again(|message| {
        let mut message = message.clone();
        match &mut message {
            FromDevice::Reply { answer: Ok(Reply::Description(description)), .. } => {
                description.supply_v = Some(3.2);
                let cause = CrashCause::ControlStalled;
                description.last_crash = Some(Crash { cause, tick: 4711, calls: Default::default(), count: 2 });
            }
            FromDevice::Reply { answer: Ok(Reply::Status { status, counters }), .. } => {
                status.sensors.lost.insert(Sensor::Z);
                counters.bad_frames = 3;
            }
            _ => return Fate::Pass,
        }
        Fate::Replace(Box::new(message))
    });
    let answer = damprig(&folder).args(["devices", "--rig", &rig]).assert().success();
    let shown = String::from_utf8(answer.get_output().stdout.clone()).unwrap();
    for words in [
        rig.as_str(),
        "test, firmware 0.0.0",
        "last crash: the control tick did not come in tick 4711 (2 since the supply came on)",
        "since its start: 3 frames were damaged when they reached the board",
        "sensors without signal: z",
        "warning: the supply of the board's converters is 3.20 V",
    ] {
        assert!(shown.contains(words), "no {words:?} in:\n{shown}");
    }
    // The board is as it was: it runs a campaign.
    std::fs::write(folder.path().join("test.toml"), short()).unwrap();
    damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--dry-run"]).assert().success();
}

#[test]
fn a_healthy_board_has_no_complaints_and_a_virtual_one_answers_too() {
    let folder = folder_with("");
    let rig = Served::again_and_again(|_| Fate::Pass);
    for rig in [&rig, "virtual", "virtual:f32"] {
        let answer = damprig(&folder).args(["devices", "--rig", rig]).assert().success();
        let shown = String::from_utf8(answer.get_output().stdout.clone()).unwrap();
        let rows: Vec<&str> = shown.lines().filter(|line| line.contains("firmware")).collect();
        assert!(rows.len() == 1 && rows[0].contains(rig), "{shown}");
        assert!(!shown.contains("warning") && !shown.contains("without signal"), "{shown}");
    }
}

#[test]
fn a_board_is_described_for_programs() {
    let answer = damprig(&folder_with("")).args(["devices", "--rig", "virtual", "--json"]).assert().success();
    let list: serde_json::Value = serde_json::from_slice(&answer.get_output().stdout).unwrap();
    assert_eq!((&list[0]["rig"], &list[0]["why"]), (&"virtual".into(), &serde_json::Value::Null));
    assert!(
        list[0]["board"]["firmware"].is_string() && list[0]["board"]["warnings"] == serde_json::json!([]),
        "{list}"
    );
}

#[test]
fn an_address_without_a_board_is_an_error_that_names_it() {
    let folder = folder_with("");
    let devices = |rig: &str| damprig(&folder).args(["devices", "--timeout", "0.3", "--rig", rig]).assert();
    devices("tcp:127.0.0.1:1").code(1).stdout("").stderr(contains("127.0.0.1:1"));
    devices("serial:/dev/absent").code(1).stdout("").stderr(contains("/dev/absent"));
    // Something that is no board: it is connected and says nothing.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let silent = format!("tcp:{}", listener.local_addr().unwrap());
    devices(&silent).code(1).stderr(contains(&silent).and(contains("nothing for 0.3 s")));
    devices("tcp:nowhere").code(2).stderr(contains("tcp:HOST:PORT"));
}
