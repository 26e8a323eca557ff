//! What is predicted before a run is what the run measures: the same windows, the same impacts, the same peaks.

use std::path::Path;

use crate::common::{damprig, folder_with, manifest, read_parquet, short};
use damprig::table::values::{numbers, texts};
use tempfile::TempDir;

/// Runs a campaign; the folder, and what the command printed.
fn ran(campaign: &str) -> (TempDir, String) {
    let folder = folder_with(campaign);
    let said = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    let printed = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    (folder, printed)
}

fn column(folder: &TempDir, file: &str, name: &str) -> Vec<f64> {
    numbers(&read_parquet(folder.path().join("out").join(file))[0], name).unwrap()
}

/// The settling time of the short campaign is two and a half cycles: the dwell begins at the next cycle and so ends later.
#[test]
fn the_largest_displacement_of_the_dwells_is_the_predicted_one() {
    for settle_s in ["1.0", "0.0", "1.3"] {
        let (folder, printed) = ran(&short().replace("settle_s = 1.0", &format!("settle_s = {settle_s}")));
        let batch = &read_parquet(folder.path().join("out/results.parquet"))[0];
        let (set_ups, measured) = (texts(batch, "set_up").unwrap(), numbers(batch, "max_abs_x_m").unwrap());
        let manifest = manifest(&folder.path().join("out"));
        let [predicted, measured] = {
            let own = set_ups.iter().zip(&measured).filter(|(name, _)| *name == "bare").map(|(_, x)| *x);
            [manifest["set_ups"][0]["predicted_dwell_max_x_m"].as_f64().unwrap(), own.fold(0.0, f64::max)]
        };
        // A resolution step, and three standard deviations of the noise; the base moves by Z within 0.1 %.
        assert!((measured - predicted).abs() < 25e-6 + 1e-3 * predicted, "{settle_s}: {measured} {predicted}");
        assert!(printed.contains("Predicted: a simulation of the same set-up"), "{printed}");
    }
}

#[test]
fn the_shipped_release_has_the_predicted_impacts_and_rms() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns");
    let text = std::fs::read_to_string(root.join("transients.toml")).unwrap();
    let record = root.join("records/synthetic.csv").canonicalize().unwrap();
    let (folder, printed) = ran(&text.replace("records/synthetic.csv", &record.display().to_string()));
    let of = |name: &str| column(&folder, "transients.parquet", name);
    let (impacts, predicted) = (of("impacts"), of("predicted_impacts"));
    assert!(impacts.iter().any(|count| *count > 30.0), "{impacts:?}");
    assert_eq!(impacts, predicted);
    for (rms, predicted) in of("rms_x_m").iter().zip(of("predicted_rms_x_m")) {
        assert!((rms / predicted - 1.0).abs() < 3e-3, "{rms} {predicted}");
    }
    assert!(printed.contains("`damprig help predicted`"), "{printed}");
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("both may be right"), "the page explains what is predicted");
}

/// Releases onto walls of different kinds end in a chatter, of which the board counts only the impacts above its threshold.
#[test]
fn impacts_of_a_release_are_predicted_as_the_board_counts_them() {
    for (clearance_m, e, friction) in [(0.01, 0.2, 0.0), (0.015, 0.5, 0.05), (0.02, 0.7, 0.02), (0.03, 0.8, 0.0)] {
        let (folder, _) = ran(&format!(
            "name = \"t\"\n[structure]\nmass_kg = 1.6\nnatural_frequency_hz = 2.5\ndamping_ratio = 0.0038\n\
             [[set_up]]\nname = \"spid\"\nbase_amplitude_m = 0.003\nparticle = {{ mass_ratio = 0.1, clearance_m = {clearance_m}, \
             friction_coefficient = {friction}, wall = {{ kind = \"restitution\", coefficient = {e} }} }}\n\
             [[experiment]]\nkind = \"free_vibration\"\nstart_m = 0.035\nmeasure_s = 8\n"
        ));
        let of = |name: &str| column(&folder, "transients.parquet", name)[0];
        let (measured, predicted) = (of("impacts"), of("predicted_impacts"));
        // Impacts near the threshold may fall on either side of it.
        assert!((measured - predicted).abs() <= 1.0 + 0.05 * measured, "{clearance_m} {e}: {measured} {predicted}");
    }
}
