//! The metadata with which a Parquet file describes itself: what its rows are, the program, and the run with its set-ups. Units and
//! meanings of the columns are in the metadata of their fields.
//!
//! Only what is known when a run begins is among it: a part that is written again after a kill must have the same bytes.

use arrow_schema::Metadata;
use damprig_core::model::SetUp;
use serde_json::{Map, Value};

use super::manifest::{Manifest, SetUpRecord};
use super::set_up_parameters::parameters;
use crate::host_time::plain;
pub use crate::table::DESCRIPTION;

/// Key of the program and its version.
pub const VERSION: &str = "damprig.version";

/// The metadata of a file of this program whose table has such rows: `a row for each impact`.
#[must_use]
pub fn of_file(description: &str) -> Metadata {
    let mut about = Metadata::new();
    about.insert(VERSION, crate::VERSION_LINE);
    about.insert(DESCRIPTION, description);
    about
}

/// The metadata of the files of a run: its name, campaign and start, and the parameters of its set-ups as JSON.
#[must_use]
pub fn of_run(id: &str, manifest: &Manifest) -> Metadata {
    let set_ups: Vec<Value> = manifest.set_ups.iter().map(of_set_up).collect();
    let mut about = Metadata::new();
    about.insert(VERSION, manifest.damprig.as_str());
    about.insert("damprig.run", id);
    about.insert("damprig.campaign", manifest.campaign.as_str());
    about.insert("damprig.started", plain(&manifest.started));
    about.insert("damprig.set_ups", Value::from(set_ups).to_string());
    about
}

/// The metadata of the files of a simulated case: its name, and the parameters of its set-up as JSON, with the length that its
/// ratios refer to and the symbol of that length.
#[must_use]
pub fn of_case(name: &str, set_up: &SetUp, reference: Option<(f64, &str)>) -> Metadata {
    let mut all = parameters(set_up);
    if let Some((reference_m, symbol)) = reference {
        all.insert("reference_m".into(), reference_m.into());
        all.insert("reference".into(), symbol.into());
    }
    let mut about = Metadata::new();
    about.insert(VERSION, crate::VERSION_LINE);
    about.insert("damprig.name", name);
    about.insert("damprig.set_up", Value::Object(all).to_string());
    about
}

/// A set-up's names, Z, d/Z and F_d/F as stated, and the parameters of its model.
fn of_set_up(record: &SetUpRecord) -> Value {
    let mut all = Map::new();
    all.insert("name".into(), record.name.as_str().into());
    all.insert("label".into(), record.label.as_str().into());
    all.insert("base_amplitude_m".into(), record.base_amplitude_m.into());
    let stated = [
        ("clearance_ratio", record.clearance_ratio()),
        ("friction_ratio", record.friction_ratio()),
        ("force_amplitude_n", record.force_amplitude_n()),
    ];
    all.extend(stated.into_iter().filter_map(|(name, value)| Some((name.to_string(), value?.into()))));
    all.insert("has_unmodelled_damper".into(), record.has_unmodelled_damper.into());
    all.extend(record.model().as_ref().map(parameters).unwrap_or_default());
    Value::Object(all)
}
