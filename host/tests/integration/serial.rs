//! Boards at a serial port, and boards with their own clock.

#[cfg(unix)]
mod unix {
    use std::io::{Read, Write};
    use std::sync::Arc;
    use std::time::Duration;

    use damprig_device::board::DeviceInfo;
    use damprig_protocol::frame::Reader;
    use damprig_protocol::{FromDevice, Reply, Request, ToDevice};
    use damprig_simulator::device::{Progress, SimulatedDevice};
    use predicates::prelude::*;
    use predicates::str::contains;
    use serialport::{SerialPort, TTYPort};

    use crate::common::real_board::{FAST, real_board};
    use crate::common::{damprig, folder_with, is_point, manifest, read_parquet, rows, short};

    /// A simulated board at one end of a pseudo-terminal until the end of the test; returns the name of the other
    /// end. From its result of this number on it sends nothing until it is asked for its identity again. If it
    /// `relapses`, it falls silent once more at its next reply to a status request.
    fn at_a_serial_line(silent_from_point: usize, relapses: bool) -> String {
        let (mut line, other) = TTYPort::pair().expect("a pseudo-terminal");
        let name = other.name().expect("a pseudo-terminal has a name");
        std::thread::spawn(move || {
            // Kept open: a pseudo-terminal without another end is broken.
            let _other = other;
            let mut board = Box::new(SimulatedDevice::<f32>::new(DeviceInfo::new("0.0.0", "at a line")));
            line.set_timeout(Duration::from_millis(20)).expect("a timeout");
            let (mut from_host, mut from_board) = (Reader::default(), Reader::default());
            let (mut bytes, mut points, mut is_silent) = ([0; 4096], 0, false);
            let (mut relapses, mut was_silent) = (relapses, false);
            loop {
                if let Ok(count) = line.read(&mut bytes) {
                    let asked = bytes[..count].iter().filter_map(|&b| from_host.push::<ToDevice>(b)).flatten();
                    for message in asked {
                        is_silent &= !matches!(message, ToDevice::Request(r) if r.request == Request::Identify);
                    }
                    board.receive(&bytes[..count]);
                }
                let mut said = Vec::new();
                while board.run(1000, |frame| said.extend_from_slice(frame)) == Progress::Running {}
                for message in said.iter().filter_map(|&b| from_board.push::<FromDevice>(b)).flatten() {
                    points += usize::from(is_point(&message));
                    is_silent |= is_point(&message) && points == silent_from_point;
                    let is_status = matches!(message, FromDevice::Reply { answer: Ok(Reply::Status { .. }), .. });
                    if relapses && was_silent && !is_silent && is_status {
                        (is_silent, relapses) = (true, false);
                    }
                    was_silent |= is_silent;
                }
                if !is_silent && line.write_all(&said).is_err() {
                    return;
                }
            }
        });
        name
    }

    #[test]
    fn a_campaign_over_a_serial_line_gives_the_results_of_the_virtual_rig() {
        let folder = folder_with(&short());
        let rig = format!("serial:{}", at_a_serial_line(usize::MAX, false));
        damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "line"]).assert().success();
        damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "direct"]).assert().success();
        for file in ["results.parquet", "samples.parquet"] {
            let read = |run: &str| read_parquet(folder.path().join(run).join(file));
            assert_eq!(read("line"), read("direct"), "{file}");
        }
    }

    #[test]
    fn a_silent_serial_port_is_closed_and_reopened() {
        let folder = folder_with(&short());
        let rig = format!("serial:{}", at_a_serial_line(3, false));
        let arguments = ["run", "test.toml", "--rig", &rig, "--out", "line", "--timeout", "1"];
        let answer = damprig(&folder).args(arguments).assert().success();
        answer.stderr(contains("stopped answering: nothing for 1 s").and(contains("the link is back")));
        damprig(&folder).args(["run", "test.toml", "--rig", "virtual:f32", "--out", "direct"]).assert().success();
        let read = |run: &str| {
            let batches = read_parquet(folder.path().join(run).join("results.parquet"));
            let numbers = |name| damprig::table::values::numbers(&batches[0], name).unwrap();
            ["frequency_hz", "x_over_z", "phase_rad", "rms_x_m", "scatter"].map(numbers)
        };
        assert_eq!(read("line"), read("direct"));
    }

    #[test]
    fn a_serial_port_that_is_silent_again_before_its_rig_is_idle_is_reopened_again() {
        let folder = folder_with(&short());
        let rig = format!("serial:{}", at_a_serial_line(3, true));
        let arguments = ["run", "test.toml", "--rig", &rig, "--out", "line", "--timeout", "1"];
        let answer = damprig(&folder).args(arguments).assert().success();
        answer.stderr(contains("the link is back").and(contains("exclusive lock").not()));
    }

    #[test]
    fn auto_without_a_board_names_what_to_write_instead() {
        let folder = folder_with(&short());
        // Only where no board is plugged in.
        if damprig::client::devices::ports().is_ok_and(|ports| ports.iter().any(|p| p.usb.is_some())) {
            eprintln!("not tested: a USB serial device is plugged in");
            return;
        }
        let answer = damprig(&folder).args(["run", "test.toml", "--rig", "auto"]).assert().code(1);
        answer.stderr(contains("no board answers").and(contains("--rig virtual")));
        damprig(&folder).args(["devices"]).assert().success();
    }

    /// A board behind a TCP port with a real structure, which follows the base at twice its amplitude.
    fn with_its_own_clock() -> String {
        real_board(&Arc::default())
    }

    #[test]
    fn the_clock_of_a_board_is_fitted_to_the_hosts() {
        let campaign = short().replace("start = \"from_rest\"", "start = \"from_rest\"\nset_ups = [\"bare\"]");
        let folder = folder_with(&campaign);
        let rig = with_its_own_clock();
        damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out", "--yes"]).assert().success();
        let run = folder.path().join("out");
        assert_eq!(rows(run.join("results.parquet")), 3);
        let ratio = damprig::table::values::numbers(&read_parquet(run.join("results.parquet"))[0], "x_over_z").unwrap();
        assert!(ratio.iter().all(|r| (r - 2.0).abs() < 1e-3), "{ratio:?}");
        let manifest = manifest(&run);
        assert_eq!(manifest["device"]["clock"], "real time");
        assert_eq!(manifest["counters"]["lost_rows"], 0, "{}", manifest["counters"]);
        let clock = &manifest["segments"][0]["clock"];
        let rate = clock["drift_ppm"].as_f64().unwrap() / 1e6 + 1.0;
        // 17 s of device time in 3.4 s of host time.
        assert!(clock["pairs"].as_u64().unwrap() >= 3 && (rate - FAST).abs() < 0.05 * FAST, "{clock}");
    }

    #[test]
    fn nobody_there_to_do_what_a_set_up_needs_ends_the_run_with_the_instruction() {
        let text = short().replace("name = \"bare\"", "name = \"bare\"\ninstruction = \"Lock the particle\"");
        let folder = folder_with(&text);
        let rig = with_its_own_clock();
        damprig(&folder)
            .args(["run", "test.toml", "--rig", &rig, "--out", "out"])
            .assert()
            .failure()
            .stderr(contains("Mount set-up \"bare\"").and(contains("Lock the particle.")).and(contains("use --yes")));
    }

    #[test]
    fn a_damper_without_a_model_is_not_predicted_on_a_board_but_its_base_is_checked() {
        let unmodelled = |text: String| text.replace("label = \"Bare structure\"", "damper = \"unmodelled\"");
        let only_bare =
            |text: String| text.replace("start = \"from_rest\"", "start = \"from_rest\"\nset_ups = [\"bare\"]");
        let campaign = unmodelled(only_bare(short()));
        // The bare structure would leave its limit.
        let folder = folder_with(&campaign.replace("base_amplitude_m = 0.0004", "base_amplitude_m = 0.004"));
        let dry = |folder: &tempfile::TempDir| {
            let rig = with_its_own_clock();
            damprig(folder).args(["run", "test.toml", "--rig", &rig, "--dry-run"]).assert()
        };
        let said = "nothing is predicted for it, and the board's limits alone stop the rig";
        dry(&folder).success().stderr(contains(said)).stdout(contains("All set-ups with a model stay within"));
        let folder = folder_with(&campaign.replace("base_amplitude_m = 0.0004", "base_amplitude_m = 0.06"));
        dry(&folder).code(2).stderr(contains("base_amplitude_m"));
    }
}
