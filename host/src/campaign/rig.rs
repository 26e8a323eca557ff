//! `[rig]` and `[telemetry]`: simulated sensors and shaker, the campaign's limits, recorded signals and their rate.

use std::collections::HashSet;

use damprig_core::control::safety::SafetyConfig;
use damprig_core::io::{DisplacementScale, TICK_HZ};
use damprig_core::rig::MOTION_SIGNALS;
use damprig_core::settings::Settings;
use damprig_protocol::MAX_SIGNALS;
use damprig_simulator::plant::table::Table;
use damprig_simulator::plant::{Amplifier, DataSheet, Shaker};

use super::keys::{campaign, rig as rig_keys, sensors_data_sheet, sensors_ideal, shaker, telemetry};
use super::limits::CampaignLimits;
use crate::input::{Number, Problem, Section, Span, Text, near};
use crate::settings::{decimal, number_of};

/// Sensors and limits.
#[derive(Clone, Debug, PartialEq)]
pub struct RigSettings {
    /// The board's settings: defaults until [`super::Campaign::on_board`] gives the board's own.
    pub board: Settings,
    /// The limits that the campaign tightens.
    pub limits: CampaignLimits,
    /// The limits in force while the campaign's experiments run: the board's, tightened by the campaign.
    pub acting: SafetyConfig,
    /// Smallest displacement step that the sensors tell apart, m; 0 for none. Simulated rigs only.
    pub sensor_resolution_m: f64,
    /// Where the resolution is written, for messages.
    pub sensor_resolution_span: Span,
    /// Standard deviation of the sensors' white noise, m; 0 for none. Simulated rigs only.
    pub sensor_noise_rms_m: f64,
    /// Seed of the simulated noise.
    pub noise_seed: u32,
    /// Errors within the sensors' data sheet; none for ideal sensors. Simulated rigs only.
    pub data_sheet: Option<DataSheet>,
    /// The simulated shaker, and the frequency at which a real one's drive is calibrated; none for a base that follows the drive
    /// exactly.
    pub shaker: Option<Shaker>,
}

impl RigSettings {
    /// Ranges of the displacement sensors of x and z, ± m: the converter's whole span by the board's calibration.
    #[must_use]
    pub fn sensor_range_m(&self) -> [f32; 2] {
        let calibration = &self.board.calibration;
        [&calibration.x, &calibration.z].map(DisplacementScale::range_m)
    }

    /// Largest allowed |x| of the structure, m: the limit in force, within its sensor's range.
    #[must_use]
    pub fn structure_limit_m(&self) -> f64 {
        number_of(self.acting.limits.structure_m.min(self.sensor_range_m()[0]))
    }

    /// As [`RigSettings::structure_limit_m`], |z| of the base.
    #[must_use]
    pub fn base_limit_m(&self) -> f64 {
        number_of(self.acting.limits.base_m.min(self.sensor_range_m()[1]))
    }
}

/// Recorded signals and their rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Telemetry {
    /// Samples of each signal in a second of rig time; 0 for none.
    pub rate_hz: f64,
    /// Names of the signals wanted, from the device's signal table; empty for the motion: x, z, drive and frequency.
    pub signals: Vec<Text>,
}

/// Most ticks from row to row in the protocol.
const MAX_TICKS: f64 = u16::MAX as f64;

/// `[rig]`. All of it has defaults: the source document's rig with ideal sensors.
pub(super) fn read_rig(root: &Section) -> Option<RigSettings> {
    let board = Settings::default();
    let rig = root.part(&campaign::RIG)?;
    refuse_sensor_range(&rig);
    let resolution = rig.placed(&rig_keys::SENSOR_RESOLUTION);
    let noise_m = rig.scalar(&rig_keys::SENSOR_NOISE);
    let seed = rig.scalar(&rig_keys::NOISE_SEED);
    let limits = CampaignLimits::read(&rig);
    let data_sheet = rig.table_of(&rig_keys::SENSORS, None).and_then(|table| read_sensors(&table));
    let shaker = match rig.table_of(&rig_keys::SHAKER, None) {
        Some(table) => read_shaker(&table).map(Some),
        None => (!rig.is_given(&rig_keys::SHAKER)).then_some(None),
    };
    rig.finish();
    let resolution = resolution?;
    Some(RigSettings {
        board,
        limits,
        acting: board.safety,
        data_sheet,
        shaker: shaker?,
        sensor_resolution_m: resolution.value,
        sensor_resolution_span: resolution.span,
        sensor_noise_rms_m: noise_m?,
        noise_seed: seed? as u32,
    })
}

/// The sensors' range belongs to the board's settings. A campaign in a run folder may be older than this rule.
fn refuse_sensor_range(rig: &Section) {
    const KEY: &str = "sensor_range_m";
    let Some(range) = rig.number(KEY).filter(|_| !rig.source().is_recorded()) else { return };
    let per_count = DisplacementScale::over_whole_span(range.value as f32).metres_per_count;
    let help = if per_count == Settings::default().calibration.x.metres_per_count {
        "leave it out: it is the default range of a board".into()
    } else {
        format!(
            "leave it out; for a virtual rig with such sensors write `damprig settings export board.toml`, set \
             metres_per_count = {} in [calibration.x] and [calibration.z], and run with --rig virtual:board.toml",
            decimal(per_count)
        )
    };
    rig.refuse(KEY, &range.span, "the sensors' range belongs to the board's calibration", Some(help));
}

/// Simulated sensors coarser than the board's resolution setting would trip its check for a frozen signal.
pub(super) fn too_coarse(rig: &RigSettings) -> Problem {
    let own = decimal(rig.board.safety.resolution_m);
    Problem {
        title: format!("`rig.sensor_resolution_m` = {} is not allowed", rig.sensor_resolution_m),
        span: rig.sensor_resolution_span.clone(),
        allowed: format!("coarser than the board's safety.resolution_m = {own}"),
        help: Some(format!(
            "write sensor_resolution_m = {own} or less, or set safety.resolution_m in the file of --rig virtual:board.toml"
        )),
    }
}

/// `[rig.sensors]`: none for ideal sensors, or after a problem has been reported.
fn read_sensors(table: &Section) -> Option<DataSheet> {
    if table.variant(&[sensors_ideal::TABLE, sensors_data_sheet::TABLE])? == 0 {
        table.finish();
        return None;
    }
    use sensors_data_sheet::{ANTI_ALIAS, BITS, LINEARITY, OVERSAMPLING, RESPONSE, SKEW};
    let [linearity, response, skew, anti_alias, bits, oversampling] =
        [&LINEARITY, &RESPONSE, &SKEW, &ANTI_ALIAS, &BITS, &OVERSAMPLING].map(|quantity| table.scalar(quantity));
    table.finish();
    Some(DataSheet {
        linearity: linearity? as f32,
        response_s: response? as f32,
        skew_s: skew? as f32,
        anti_alias_hz: anti_alias? as f32,
        bits: bits? as u8,
        oversampling: oversampling? as u8,
    })
}

/// `[rig.shaker]`; `None` after a problem has been reported.
fn read_shaker(table: &Section) -> Option<Shaker> {
    let amplifier = table.word(&shaker::AMPLIFIER);
    let coil_resistance_ohm = table.scalar(&shaker::COIL_RESISTANCE);
    let limit_v = table.scalar(&shaker::VOLTAGE_LIMIT);
    let moving_mass_kg = table.scalar(&shaker::MOVING_MASS);
    let suspension_stiffness_n_per_m = table.scalar(&shaker::SUSPENSION_STIFFNESS);
    let suspension_damping_n_s_per_m = table.scalar(&shaker::SUSPENSION_DAMPING);
    let force_factor_n_per_a = table.scalar(&shaker::FORCE_FACTOR);
    let current_limit_a = table.scalar(&shaker::CURRENT_LIMIT);
    let half_stroke_m = table.scalar(&shaker::HALF_STROKE);
    let calibrated_at_hz = table.scalar(&shaker::CALIBRATED_AT);
    table.finish();
    let read = Shaker {
        moving_mass_kg: moving_mass_kg?,
        suspension_stiffness_n_per_m: suspension_stiffness_n_per_m?,
        suspension_damping_n_s_per_m: suspension_damping_n_s_per_m?,
        force_factor_n_per_a: force_factor_n_per_a?,
        amplifier: match amplifier? {
            0 => Amplifier::Voltage { coil_resistance_ohm: coil_resistance_ohm?, limit_v: limit_v? },
            _ => Amplifier::Current,
        },
        current_limit_a: current_limit_a?,
        half_stroke_m: half_stroke_m?,
        calibrated_at_hz: calibrated_at_hz?,
    };
    if let Err(invalid) = Table::<f64>::steps_per_sample(&read, 1.0 / f64::from(TICK_HZ)) {
        let help = Some("(force factor)²/resistance over the mass is the table's fastest rate".into());
        table.reject(shaker::MOVING_MASS.name(), format!("must be {}", invalid.allowed), help);
    }
    Some(read)
}

/// `[telemetry]`; without it the motion is recorded.
pub(super) fn read_telemetry(root: &Section) -> Option<Telemetry> {
    if !root.is_given(&campaign::TELEMETRY) {
        return Some(Telemetry { rate_hz: 100.0, signals: Vec::new() });
    }
    let table = root.table_of(&campaign::TELEMETRY, None)?;
    let rate = table.placed(&telemetry::RATE);
    let rate = rate.filter(|rate| is_carried(&table, rate));
    let signals = table.texts_of(&telemetry::SIGNALS).unwrap_or_default();
    check_signals(&table, &signals);
    table.finish();
    Some(Telemetry { rate_hz: rate?.value, signals })
}

/// Reports a signal that is named twice, which no table can hold, and more signals than a message has room for. A campaign
/// in a run folder may be older than this rule.
fn check_signals(table: &Section, signals: &[Text]) {
    if table.source().is_recorded() {
        return;
    }
    let mut seen = HashSet::new();
    if let Some(again) = signals.iter().find(|signal| !seen.insert(signal.value.as_str())) {
        table.refuse("signals", &again.span, "is named twice", Some("leave one of them out".into()));
    } else if let Some(first) = signals.get(MAX_SIGNALS) {
        let allowed =
            format!("is signal {} of {}; a device sends at most {MAX_SIGNALS}", MAX_SIGNALS + 1, signals.len());
        table.refuse("signals", &first.span, allowed, None);
    }
}

/// Whether the rate is a whole fraction of the tick rate.
fn is_carried(table: &Section, rate: &Number) -> bool {
    let tick_hz = f64::from(TICK_HZ);
    let every = tick_hz / rate.value;
    // Allows decimals such as 333.333… for a third of the tick rate.
    if rate.value == 0.0 || ((every - every.round()).abs() < 1e-9 * every && (1.0..=MAX_TICKS).contains(&every.round()))
    {
        return true;
    }
    // The nearest allowed rates on both sides.
    let near = every.clamp(1.0, MAX_TICKS);
    let (above, below) = (tick_hz / near.floor(), tick_hz / near.ceil());
    let help =
        if above == below { format!("write rate_hz = {above}") } else { format!("write rate_hz = {below} or {above}") };
    let allowed = format!("must be 0 or the tick rate of {tick_hz} Hz divided by a whole number up to {MAX_TICKS}");
    table.refuse("rate_hz", &rate.span, allowed, Some(help));
    false
}

impl Telemetry {
    /// Ticks from row to row; 0 for none.
    #[must_use]
    pub fn every_ticks(&self) -> u16 {
        if self.rate_hz > 0.0 { (f64::from(TICK_HZ) / self.rate_hz).round() as u16 } else { 0 }
    }

    /// Positions of the wanted signals in the device's table.
    ///
    /// # Errors
    /// The first wanted name that the device does not have, with what it does have.
    pub fn select(&self, available: &[String]) -> Result<Vec<usize>, (Span, String)> {
        if self.signals.is_empty() {
            return Ok((0..available.len().min(MOTION_SIGNALS)).collect());
        }
        let find = |wanted: &Text| {
            available.iter().position(|a| *a == wanted.value).ok_or_else(|| {
                let hint = match near(&wanted.value, available.iter().map(String::as_str)).first() {
                    Some(name) => format!("; did you mean {name:?}?"),
                    None => String::new(),
                };
                (wanted.span.clone(), format!("the device has the signals {}{hint}", available.join(", ")))
            })
        };
        self.signals.iter().map(find).collect()
    }
}
