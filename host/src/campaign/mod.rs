//! The campaign: set-ups on the rig and the experiments to run with them, as a person writes them in TOML.
//!
//! The parts are plain data, checked when read; [`Campaign::read`] and [`Campaign::parse`] are the only constructors, so an
//! existing campaign is valid. The prediction checks whether set-ups stay within the sensors' range; the runner carries
//! experiments out.

mod difference;
mod experiment;
mod keys;
mod limits;
mod peak;
mod plan;
mod plant;
mod playback;
mod rig;
mod set_up;
mod shape;
mod stepped_sine;
pub mod transient;

use std::path::Path;

use damprig_core::settings::Settings;

use crate::failure::Failure;
use crate::input::{Section, Source};
use crate::setup::{SetUpFile, set_up_file};

pub use crate::setup::{SetUpSpec, SpringSpec, SpringTarget};
pub use difference::differences;
pub use experiment::{Experiment, ExperimentKind};
pub(crate) use experiment::{default_name, repeat_names};
pub use keys::{PLAYED, TABLES};
pub use limits::CampaignLimits;
pub use peak::{AroundPeak, GridPeak, RISE_BETWEEN_POINTS};
pub use plan::Plan;
pub use plant::SetUpPlant;
pub use rig::{RigSettings, Telemetry};
pub use set_up::CampaignSetUp;
pub use stepped_sine::{KeptAmplitude, PointStart, SteppedSine, TrackedResonance, kept_in_words};
pub use transient::{FreeVibration, Playback};

/// A campaign, read and checked.
#[derive(Debug)]
pub struct Campaign {
    /// Short name, part of the run folder's name.
    pub name: String,
    /// Sensors and limits.
    pub rig: RigSettings,
    /// Recorded signals and their rate.
    pub telemetry: Telemetry,
    /// What a person states about it, and its order.
    pub plan: Plan,
    /// Positions of the set-ups in the order in which they are mounted, each with the positions of its experiments in their order.
    pub run_order: Vec<(usize, Vec<usize>)>,
    /// The set-ups, in the order of the file.
    pub set_ups: Vec<CampaignSetUp>,
    /// The experiments, in the order of the file.
    pub experiments: Vec<Experiment>,
    /// The set-up file that completes the set-ups, if the campaign names one.
    pub set_up_file: Option<SetUpFile>,
    /// The file, to copy into the run folder and to point into.
    pub source: Source,
}

impl Campaign {
    /// Reads and checks a campaign file.
    ///
    /// # Errors
    /// All problems, each with file, line, key, value, what is allowed and the likely fix.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Self::parse(Source::read(path)?)
    }

    /// Checks a campaign given as a text.
    ///
    /// # Errors
    /// As [`Campaign::read`].
    pub fn parse(source: Source) -> Result<Self, Failure> {
        let parts = source.read_toml(source.text(), "this is not TOML", parts);
        source.verdict()?;
        let Some((name, rig, telemetry, plan, set_ups, experiments, set_up_file)) = parts else {
            return Err(Failure::Input("the campaign is incomplete".into()));
        };
        let run_order = plan.run_order(&set_ups, &experiments);
        Ok(Self { name, rig, telemetry, plan, run_order, set_ups, experiments, set_up_file, source })
    }

    /// Applies a board's settings: they are the base of every limit, and complete the spring properties that set-ups leave out.
    /// `is_simulated` boards have the campaign's sensors.
    ///
    /// # Errors
    /// Every limit of the campaign that is looser than the board's, with both values.
    pub fn on_board(&mut self, board: &Settings, is_simulated: bool) -> Result<(), Failure> {
        let rig = &mut self.rig;
        rig.board = *board;
        rig.acting = rig.limits.acting(&self.source, &board.safety);
        if is_simulated && rig.sensor_resolution_m as f32 > board.safety.resolution_m {
            self.source.report(rig::too_coarse(rig));
        }
        for set_up in &mut self.set_ups {
            set_up.spec.on_board(&board.spring);
            set_up.is_predicted = is_simulated || !set_up.has_unmodelled_damper;
        }
        self.source.verdict()
    }

    /// Points of the whole campaign: each frequency, record or release on each of its set-ups, with all points around
    /// peaks.
    #[must_use]
    pub fn points(&self) -> usize {
        self.experiments.iter().map(|e| e.set_ups.len() * e.points()).sum()
    }

    /// Set-ups and experiments by name, in the order of the file.
    #[must_use]
    pub fn in_order(&self) -> Vec<(String, String)> {
        let pairs = self.set_ups.iter().enumerate().flat_map(|(index, set_up)| {
            let own = self.experiments.iter().filter(move |e| e.set_ups.contains(&index));
            own.map(|e| (set_up.name.clone(), e.name.clone()))
        });
        pairs.collect()
    }

    /// Rig time that the whole campaign takes if every point is measured again as often as it may be, s; otherwise as
    /// [`Self::expected_s`].
    #[must_use]
    pub fn longest_s(&self) -> f64 {
        self.experiments.iter().map(|e| e.set_ups.len() as f64 * e.longest_s()).sum()
    }

    /// Rig time that the whole campaign takes when every rest is immediate, as on a virtual rig, and no closed loop waits
    /// for its base, s.
    #[must_use]
    pub fn expected_s(&self) -> f64 {
        self.experiments.iter().map(|e| e.set_ups.len() as f64 * e.expected_s()).sum()
    }
}

type CampaignParts = (String, RigSettings, Telemetry, Plan, Vec<CampaignSetUp>, Vec<Experiment>, Option<SetUpFile>);

/// Reads all parts; `None` only after a problem has been reported.
fn parts(root: &Section) -> Option<CampaignParts> {
    let name = name(root);
    let rig = rig::read_rig(root);
    let telemetry = rig::read_telemetry(root);
    let plan = plan::read(root);
    let source = root.source();
    let file = set_up_file::attach(root);
    let document = file.as_ref().and_then(|file| file.parse(source));
    let set_up_file = file.as_ref().zip(document.as_ref()).and_then(|(file, document)| file.check(source, document));
    let mut plant = plant::read(root);
    let file = document.as_ref().map(|document| document.get_ref());
    // A plant that cannot be read is told alone, not with what is mounted on it.
    let set_ups = match &mut plant {
        Some(plant) => set_up::read_all(root, file, plant.as_mut()),
        None => {
            set_up::leave_all(root);
            None
        }
    };
    if let Some(set_ups) = &set_ups {
        let moving = match (&rig, &plant) {
            (_, Some(Some(_))) => Some(("plant", "stands on a base that moves")),
            (Some(RigSettings { shaker: Some(_), .. }), _) => Some(("rig.shaker", "moves the base")),
            _ => None,
        };
        moving.into_iter().for_each(|table| set_up::refuse_forces(source, set_ups, table));
    }
    // A wrong value that set-ups inherit is told by them; what is left is a value that none of them uses.
    if source.is_clean() {
        set_up_file::check_parts(root);
    }
    let experiments = experiment::read_all(root, set_ups.as_deref(), rig.as_ref(), plan.as_ref());
    plant?;
    Some((name?, rig?, telemetry?, plan?, set_ups?, experiments?, set_up_file))
}

/// The campaign's name goes into a folder's name.
fn name(root: &Section) -> Option<String> {
    let name = root.text_of(&keys::campaign::NAME)?;
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.value.is_empty() || name.value.len() > 60 || !name.value.chars().all(fits) {
        let help = Some(format!("write name = {:?}", slug(&name.value)));
        root.refuse("name", &name.span, "must be 1 to 60 letters, digits, '-' or '_'", help);
        return None;
    }
    Some(name.value)
}

fn slug(text: &str) -> String {
    let kept: String =
        text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let kept = kept.trim_matches('-');
    if kept.is_empty() { "campaign".into() } else { kept.chars().take(60).collect() }
}
