//! Files of other programs: `damprig inspect`, and signals as records of a case.

use std::path::{Path, PathBuf};

use crate::common::{damprig, field, folder_with};
use damprig::signal_file::unit::UnitKind;
use damprig::signal_file::{Contents, EvenSignal, Selector, Signal, SignalAxis, parse, read};
use serde_json::Value;
use tempfile::TempDir;

pub(crate) fn files() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files")
}

pub(crate) fn only(contents: Contents) -> Signal {
    let [signal] = contents.signals.try_into().expect("one signal");
    signal
}

fn text(text: &str) -> Result<Contents, String> {
    parse(text.as_bytes())
}

#[test]
fn mat_files_give_their_arrays_with_their_times() {
    for file in ["v5.mat", "v7.mat"] {
        let contents = read(&files().join("mat").join(file)).unwrap();
        let names: Vec<&str> = contents.signals.iter().map(|signal| signal.name.as_str()).collect();
        assert_eq!(names, ["x", "h", "run.a"], "{file}");
        let x = &contents.signals[0];
        assert_eq!((x.kind(), x.unit.map(|unit| unit.si)), (Some(UnitKind::Displacement), Some(1e-3)));
        let SignalAxis::Time { start_s, step_s } = x.axis else { panic!("{:?}", x.axis) };
        assert!(start_s == 0.0 && (step_s - 0.01).abs() < 1e-15);
        assert!(x.values.iter().enumerate().all(|(n, value)| *value == (n as f64 * 0.01).sin()));
        let h = &contents.signals[1];
        assert_eq!((h.values.as_slice(), h.imaginary.as_deref()), (&[1.0, 3.0, 5.0][..], Some(&[2.0, -4.0, 0.0][..])));
        assert!(contents.remarks.iter().any(|remark| remark == "run.n = 7"), "{:?}", contents.remarks);
        assert!(
            contents.remarks.iter().any(|remark| remark.contains("\"name\" is not read")),
            "{:?}",
            contents.remarks
        );
    }
}

#[test]
fn an_analysers_mat_file_gives_its_frequency_response_and_coherence() {
    let Some(file) = field("beam/case1.mat") else { return };
    let contents = read(&file).unwrap();
    let named = |name: &str| contents.signals.iter().find(|signal| signal.name == name).unwrap();
    let h = named("Hf_chan_2");
    let imaginary = h.imaginary.as_ref().unwrap();
    // As scipy.io.loadmat 1.15 reads them.
    let magnitudes: Vec<f64> = h.values.iter().zip(imaginary).map(|(re, im)| re.hypot(*im)).collect();
    let largest = (0..magnitudes.len()).max_by(|a, b| magnitudes[*a].total_cmp(&magnitudes[*b])).unwrap();
    assert_eq!((h.values.len(), largest), (1601, 679));
    assert!((magnitudes[largest] / 13191.726338409973 - 1.0).abs() < 1e-12);
    assert!((named("Hf_coh_chan_2").values.iter().sum::<f64>() / 543.6039864569902 - 1.0).abs() < 1e-12);
}

#[test]
fn strong_motion_records_give_acceleration_velocity_and_displacement() {
    let Some(folder) = field("csmip") else { return };
    for (file, csv) in
        [("CHAN14.V2", "melo79-ch14-up.csv"), ("CHAN15.V2", "melo79-ch15.csv"), ("CHAN001.V2", "riodell21-ch01.csv")]
    {
        let contents = read(&folder.join(file)).unwrap();
        let kinds: Vec<Option<UnitKind>> = contents.signals.iter().map(Signal::kind).collect();
        assert_eq!(
            kinds,
            [Some(UnitKind::Acceleration), Some(UnitKind::Velocity), Some(UnitKind::Displacement)],
            "{file}"
        );
        let own = &contents.signals[0];
        let table = only(read(&folder.join(csv)).unwrap());
        assert_eq!(own.values.len(), table.values.len(), "{file}");
        // Each time of the table is rounded.
        assert!((own.axis.at(100) - table.axis.at(100)).abs() < 1e-12, "{file}");
        // cm/s² with 3 to 7 decimals, and m/s² with 4 and more.
        assert!(own.values.iter().zip(&table.values).all(|(cm, m)| (cm * 0.01 - m).abs() <= 5.1e-5), "{file}");
    }
}

#[test]
fn tables_are_read_as_labs_write_them() {
    let same = |written: &str| {
        let signal = only(text(written).unwrap_or_else(|why| panic!("{written:?}: {why}")));
        assert_eq!(signal.values, [1.5, -2.25, 3.0, 4.5], "{written:?}");
        assert_eq!((signal.kind(), signal.unit.unwrap().si), (Some(UnitKind::Acceleration), 9.80665), "{written:?}");
        assert!(
            matches!(signal.axis, SignalAxis::Time { start_s: 0.0, step_s } if (step_s - 0.01).abs() < 1e-15),
            "{written:?}"
        );
    };
    same("t_s,a_g\n0,1.5\n0.01,-2.25\n0.02,3\n0.03,4.5\n");
    same("\u{feff}Time (s);Acc (g)\r\n0;1,5\r\n0,01;-2,25\r\n0,02;3\r\n0,03;4,5\r\n");
    same("Time\tAcc\ns\tg\n0\t1.5\n0.01\t-2.25\n0.02\t3\n0.03\t4.5\n");
    same("time [ms] acc [g]\n0 1.5\n10 -2.25\n20 3\n30 4.5");
    same("Logger 7\nserial no. 12\n\nTime [s],Acc [g]\n0,1.5\n0.01,-2.25\n0.02,3\n0.03,4.5\n");
    same("\"t_s\",\"a_g\"\n\"0\",\"1,5\"\n\"0,01\",\"-2,25\"\n\"0,02\",\"3\"\n\"0,03\",\"4,5\"\n");
    same("# a comment\nt_s,a_g,\n0,1.5,\n0.01,-2.25,\n0.02,3,\n0.03,4.5,\n");
}

#[test]
fn missing_values_gaps_and_jitter_are_named() {
    let of = |written: &str| only(text(written).unwrap()).remark.unwrap_or_default();
    assert!(
        of("t_s,x_m\n0,1\n1,\n2,3\n3,4\n4,5\n")
            .contains("1 values are missing; 1 gaps, the first of 2.000000 s at 0.000000 s")
    );
    assert!(of("t_s,x_m\n0,1\n1,2\n2,3\n7,4\n8,5\n").contains("1 gaps, the first of 5.000000 s at 2.000000 s"));
    let empty = text("t_s,flag,x_m\n0,,1\n1,,2\n").unwrap();
    assert!(empty.signals.len() == 1 && empty.remarks == ["The column \"flag\" has no values."], "{empty:?}");
    let jitter = of("t_s,x_m\n0,1\n1,2\n2.2,3\n3,4\n4,5\n");
    assert!(jitter.contains("jitter from 0.800000 to 1.200000 s"), "{jitter}");
}

#[test]
fn jittering_times_are_resampled_within_the_stated_error() {
    let mut rng = fastrand::Rng::with_seed(7);
    let (step_s, omega) = (0.01, 20.0);
    let times_s: Vec<f64> = (0..400).map(|n| step_s * (f64::from(n) + 0.4 * rng.f64() - 0.2)).collect();
    let rows: String = times_s.iter().map(|t| format!("{t},{}\n", (omega * t).sin())).collect();
    let signal = only(text(&format!("t_s,x_m\n{rows}")).unwrap());
    assert!(matches!(signal.axis, SignalAxis::Times(_)));
    let EvenSignal { start_s, step_s: even_s, values, rms_error: stated } = signal.evenly().unwrap();
    let squares: f64 = (0..400).map(|n| (values[n] - (omega * (start_s + n as f64 * even_s)).sin()).powi(2)).sum();
    let rms = (squares / 400.0).sqrt();
    assert!(stated > 0.0 && rms < 3.0 * stated && rms < 1e-3, "{rms}, stated {stated}");
}

#[test]
fn a_file_that_cannot_be_read_is_refused_with_its_place() {
    for (written, why) in [
        ("", "it is empty"),
        ("t_s,x_m\n0,1\n1,nan\n", "line 3, column 2: \"nan\" is not a finite number"),
        ("t_s,x_m\n0,1\n0,2\n", "line 3: the time 0 is not later than the one before, 0"),
        ("t_s,x_m\r\n0,1\r\n1,2\r\n1,3\r\n", "line 4: the time 1 is not later"),
        ("t_s,x_m,time_ms\n0,1,0\n1,2,1000\n", "two columns of times"),
        ("t_s,x_m\n0,1\n1,2,3\n", "line 3: 3 columns where the first row has 2"),
        ("O.25,1\n0.5,2\n0.75,3\n", "line 1: \"O.25\" is not a finite number"),
        ("words and\nwords\n", "there is no row of numbers in it"),
    ] {
        let error = text(written).unwrap_err();
        assert!(error.contains(why), "{written:?}: {error}");
    }
    assert!(parse(b"\xff\xfet\0_\0").unwrap_err().contains("UTF-16"));
    assert!(parse(b"\x7fELF\x00").unwrap_err().contains("known are CSV"));
    let mut damaged = std::fs::read(files().join("mat/v5.mat")).unwrap();
    damaged.truncate(300);
    assert!(parse(&damaged).unwrap_err().contains("cut short"), "{:?}", parse(&damaged));
}

#[test]
fn no_damage_of_a_file_makes_a_reader_panic() {
    let mut rng = fastrand::Rng::with_seed(32);
    let mut sound = Vec::new();
    let spec =
        hound::WavSpec { channels: 2, sample_rate: 8000, bits_per_sample: 16, sample_format: hound::SampleFormat::Int };
    let mut writer = hound::WavWriter::new(std::io::Cursor::new(&mut sound), spec).unwrap();
    (0..200).for_each(|n| writer.write_sample(n as i16).unwrap());
    writer.finalize().unwrap();
    let v2 =
        "6 points of accel data equally spaced at .010 sec, in cm/sec2. (8f10.7)\n  .1 .2 .3\n -.4-.5 .6\n".to_string();
    let mut whole = vec![sound, v2.into_bytes(), b"t_s;x_mm\n0;1,5\n1;2,5\n2;3,5\n".to_vec()];
    for folder in ["uff", "mat"] {
        for entry in std::fs::read_dir(files().join(folder)).unwrap() {
            whole.push(std::fs::read(entry.unwrap().path()).unwrap());
        }
    }
    for bytes in whole {
        for _ in 0..400 {
            let mut changed = bytes.clone();
            match rng.u8(0..3) {
                0 => changed.truncate(rng.usize(0..bytes.len())),
                1 => (0..4).for_each(|_| changed[rng.usize(0..bytes.len())] = rng.u8(..)),
                _ => drop(changed.splice(rng.usize(0..bytes.len()).., b"9e999 -1\n".iter().copied())),
            }
            // Any answer is right, as long as there is one.
            let _ = parse(&changed);
        }
    }
}

#[test]
fn one_of_several_signals_is_chosen_by_number_or_name() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("two.csv");
    std::fs::write(&path, "t_s,x_m,z_m\n0,1,5\n1,2,6\n").unwrap();
    let chosen = |which: &str| {
        Selector::of(&PathBuf::from(format!("{}{which}", path.display()))).read().map(|signal| signal.name)
    };
    assert_eq!((chosen("#2").unwrap(), chosen("#x").unwrap()), ("z".into(), "x".into()));
    assert!(chosen("").unwrap_err().to_string().contains("it has 2 signals: which one?"));
    assert!(chosen("#zz").unwrap_err().to_string().contains("did you mean #z?"));
    // A file whose own name has the mark is that file.
    let marked = folder.path().join("a#2");
    std::fs::write(&marked, "t_s,y_m\n0,1\n1,2\n").unwrap();
    assert_eq!(Selector::of(&marked).read().unwrap().name, "y");
}

#[test]
fn inspect_says_what_is_in_a_file_and_reads_a_long_table_in_parts() {
    let folder = TempDir::new().unwrap();
    let rows: String =
        (0..50_000).map(|n| format!("{},{}\n", f64::from(n) * 0.001, (f64::from(n) * 0.01).sin())).collect();
    std::fs::write(folder.path().join("long.csv"), format!("t_s,x_mm\n{rows}")).unwrap();
    let said = |arguments: &[&str]| {
        let output = damprig(&folder).arg("inspect").args(arguments).assert().success().get_output().stdout.clone();
        String::from_utf8(output).unwrap()
    };
    let shown = said(&["long.csv"]);
    assert!(
        shown.contains("#1 x: displacement in mm") && shown.contains("50000 values from 0 s to 49.999 s, 1000 Hz"),
        "{shown}"
    );
    let json: Value = serde_json::from_str(&said(&["long.csv", "--json"])).unwrap();
    let signal = &json["signals"][0];
    assert_eq!((&signal["count"], &signal["quantity"]), (&50_000.into(), &"displacement".into()));
    assert!((signal["rms"].as_f64().unwrap() - 0.5f64.sqrt()).abs() < 1e-3);
    std::fs::write(folder.path().join("bad.csv"), "t_s,x_mm\n0,1\n1,x\n").unwrap();
    let error = damprig(&folder).args(["inspect", "bad.csv"]).assert().code(2).get_output().stderr.clone();
    let error = String::from_utf8(error).unwrap();
    assert!(error.contains("bad.csv: line 3, column 2: \"x\" is not a finite number"), "{error}");
}

#[test]
fn a_signal_of_another_programs_file_is_the_record_of_a_case() {
    let field_like = "1 g record\n\n  5 points of accel data equally spaced at .010 sec, in cm/sec2. (8f10.3)\n   100.000   200.000  -100.000-50.000000      .000\n";
    let folder = folder_with("");
    std::fs::write(folder.path().join("motion.V2"), field_like).unwrap();
    std::fs::write(folder.path().join("motion.csv"), "t_s,a\n0,1\n0.01,2\n0.02,-1\n0.03,-0.5\n0.04,0\n").unwrap();
    let result = |record: &str| {
        let text = format!(
            "structure = {{ mass_kg = 4, natural_frequency_hz = 5, damping_ratio = 0.02 }}\nbase = {{ kind = \"record\", {record} }}\nrun = {{ duration_s = 1 }}\n"
        );
        std::fs::write(folder.path().join("case.toml"), text).unwrap();
        let output = damprig(&folder).args(["simulate", "case.toml", "--json"]).output().unwrap();
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (table, error) = result("file = \"motion.csv\", quantity = \"acceleration\", unit = \"m/s2\"");
    assert!(!table.is_empty(), "{error}");
    std::fs::write(
        folder.path().join("german.csv"),
        "Zeit (s);a (cm/s2)\n0;100,0\n0,01;200\n0,02;-100\n0,03;-50\n0,04;0\n",
    )
    .unwrap();
    for record in
        ["file = \"german.csv\"", "file = \"motion.V2\"", "file = \"motion.V2#1\"", "file = \"motion.V2#acceleration\""]
    {
        let (signal, error) = result(record);
        let numbers = |text: &str| serde_json::from_str::<Value>(text).unwrap()["summary"].clone();
        assert!(!signal.is_empty(), "{record}: {error}");
        assert_eq!(numbers(&signal), numbers(&table), "{record}");
    }
    for (record, why) in [
        ("file = \"motion.V2#2\"", "there is no signal \"2\""),
        ("file = \"motion.V2\", quantity = \"displacement\"", "has the unit \"cm/s2\"; leave out `quantity`"),
    ] {
        let (_, error) = result(record);
        assert!(error.contains(why), "{record}: {error}");
    }
}

#[test]
fn values_over_stated_frequencies_and_complex_values_in_two_columns_are_signals() {
    let h = [[1.0, -2.0], [0.5, 3.0], [4.0, 0.0]];
    let rows = |row: &dyn Fn([f64; 2]) -> String| -> String {
        h.iter().enumerate().map(|(n, own)| format!("{},{}\n", 10 * (n + 1), row(*own))).collect()
    };
    let parts = rows(&|[re, im]| format!("{re},{im}"));
    let polar = rows(&|[re, im]: [f64; 2]| format!("{:.17},{:.17}", re.hypot(im), im.atan2(re).to_degrees()));
    for (header, body, name) in [
        ("frequency_hz,h_real,h_imag", &parts, "h"),
        ("Frequency (Hz),Re(H) (m/N),Im(H) (m/N)", &parts, "h"),
        ("f_hz,H real,H imaginary", &parts, "h"),
        ("f_hz,real,imag", &parts, "complex"),
        ("f_hz,h_m_per_n,phase_deg", &polar, "h"),
        ("f_hz,H_abs,H_phase_deg", &polar, "H_abs"),
    ] {
        let signal = only(text(&format!("{header}\n{body}")).unwrap_or_else(|error| panic!("{header}: {error}")));
        assert_eq!(signal.axis, SignalAxis::Frequencies(vec![10.0, 20.0, 30.0]), "{header}");
        assert_eq!(signal.name, name, "{header}");
        let imaginary = signal.imaginary.unwrap_or_else(|| panic!("{header}"));
        for (n, [re, im]) in h.iter().enumerate() {
            assert!((signal.values[n] - re).abs() < 1e-14 && (imaginary[n] - im).abs() < 1e-14, "{header}");
        }
    }
    // Not one complex value: a phase of two columns, parts of different units, two frequencies, values over time.
    for (header, names) in [
        ("f_hz,x_m,z_m,phase_deg", vec!["x", "z", "phase"]),
        ("f_hz,h_real_m,h_imag_n", vec!["h_real", "h_imag"]),
        ("low_hz,high_hz,x_m", vec!["low", "high", "x"]),
        ("t_s,f_hz,h_real,h_imag", vec!["f", "h_real", "h_imag"]),
    ] {
        let row = |n: usize| format!("{}\n", vec![(n + 1).to_string(); header.split(',').count()].join(","));
        let contents = text(&format!("{header}\n{}{}{}", row(0), row(1), row(2))).unwrap();
        let found: Vec<&str> = contents.signals.iter().map(|signal| signal.name.as_str()).collect();
        assert_eq!(found, names, "{header}");
        assert!(contents.signals.iter().all(|signal| signal.imaginary.is_none()), "{header}");
    }
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("h.csv"), format!("f_hz,h_real,h_imag\n{parts}")).unwrap();
    let output = damprig(&folder).args(["inspect", "h.csv"]).output().unwrap();
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(
        shown.contains("1 signal") && shown.contains("complex") && shown.contains("from 10 Hz to 30 Hz"),
        "{shown}"
    );
    assert!(shown.contains("damprig identify response"), "{shown}");
}

#[test]
fn hdf5_matlab_7_3_and_parquet_give_their_columns_with_their_units() {
    let contents = read(&files().join("mat/v73.mat")).unwrap();
    assert_eq!(contents.kind, "MATLAB 7.3 file (HDF5)");
    let of =
        |name: &str| contents.signals.iter().find(|signal| signal.name == name).unwrap_or_else(|| panic!("{name}"));
    let (x, a) = (of("x"), of("run/a"));
    assert_eq!((x.kind(), x.unit.unwrap().si), (Some(UnitKind::Displacement), 1e-3));
    assert_eq!((a.kind(), a.unit.unwrap().si), (Some(UnitKind::Acceleration), 9.80665));
    for (signal, of) in [(x, f64::sin as fn(f64) -> f64), (a, f64::cos)] {
        assert!(matches!(signal.axis, SignalAxis::Time { start_s: 0.0, .. }), "{:?}", signal.axis);
        assert!(signal.values.iter().enumerate().all(|(n, value)| *value == of(n as f64 * 0.01)), "{}", signal.name);
    }
    let folder = folder_with(&crate::common::short());
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let results = read(&folder.path().join("out/results.parquet")).unwrap();
    let amplitude = results.signals.iter().find(|signal| signal.name == "x_amplitude").expect("the amplitudes");
    assert_eq!((amplitude.kind(), amplitude.values.len()), (Some(UnitKind::Displacement), 6));
    assert!(amplitude.values.iter().all(|value| *value > 0.0));
    damprig(&folder).args(["runs", "export", "out", "--format", "h5", "--out", "run.h5"]).assert().success();
    let exported = read(&folder.path().join("run.h5")).unwrap();
    let same = exported.signals.iter().find(|signal| signal.values == amplitude.values).expect("the same amplitudes");
    assert_eq!(same.kind(), Some(UnitKind::Displacement), "{}", same.name);
}

#[test]
fn inspect_draws_the_signals_and_keeps_an_existing_picture() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("two.csv"), "t_s,x_mm,f_N\n0,1,5\n1,2,6\n2,1,7\n").unwrap();
    let run = |arguments: &[&str]| {
        damprig(&folder).args(["inspect", "two.csv", "--plot", "two.svg"]).args(arguments).output().unwrap()
    };
    assert!(run(&[]).status.success());
    let svg = std::fs::read_to_string(folder.path().join("two.svg")).unwrap();
    assert!(svg.contains("#1 x (mm)") && svg.contains("#2 f (N)") && svg.contains("Time (s)"), "{svg}");
    let again = run(&[]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("two.svg: it exists"));
    assert!(run(&["--force"]).status.success());
}

#[test]
fn a_sound_of_a_universal_file_is_evaluated() {
    let Some(file) = field("uff/Sample_UFF58_ascii.uff") else { return };
    let folder = TempDir::new().unwrap();
    let output =
        damprig(&folder).args(["identify", "sound"]).arg(file).args(["--weighting", "Z", "--json"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    // RMS 0.0143440 Pa about a mean of 7.2e-5 Pa, in dB re 20 µPa.
    let level = json["estimates"][0]["value"].as_f64().unwrap();
    assert!((level - 20.0 * (0.014_344_f64 / 20e-6).log10()).abs() < 0.1, "{level}");
}
