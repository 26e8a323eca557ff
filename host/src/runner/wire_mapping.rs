//! Maps the campaign to the device's requests, and its signals, results and faults to the run's records.

use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::ops::Range;

use damprig_core::control::fault::Fault;
use damprig_core::control::friction_spring::SpringSetUp;
use damprig_core::io::{SensorSet, TICK_HZ};
use damprig_core::measure::point::PointResult;
use damprig_core::twin::TwinConfig;
use damprig_motion::virtual_device::number_of_structure;
use damprig_protocol::Request;
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, PlantConfig, SensorModel};

use super::error::RunError;
use crate::campaign::{Campaign, CampaignSetUp, Experiment, ExperimentKind, RigSettings, SpringSpec};
use crate::client::session::Session;
use crate::failure::Failure;
use crate::input::Problem;
use crate::run_folder::ResultRow;
use crate::run_folder::schema::samples::{PointLabel, SampleColumn, column_name};
use crate::settings::number_of;

/// The signals that a campaign records on a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Their positions in the device's table.
    pub(super) positions: Vec<usize>,
    /// Names of their columns, and units.
    pub signals: Vec<SampleColumn>,
}

impl Selection {
    /// Selects the campaign's signals from the device's table.
    ///
    /// # Errors
    /// A signal or a tick rate that the device does not have.
    pub fn of(campaign: &Campaign, session: &Session) -> Result<Self, RunError> {
        let tick_hz = session.description.tick_hz;
        if tick_hz != TICK_HZ {
            let message = format!("the device ticks at {tick_hz} Hz; this program needs {TICK_HZ} Hz");
            return Err(Failure::Input(message).into());
        }
        let table = &session.signals;
        let names: Vec<String> = table.iter().map(|s| s.name.to_string()).collect();
        let positions = campaign.telemetry.select(&names).map_err(|(span, allowed)| {
            let title = "`telemetry.signals` names a signal that the device does not have".into();
            campaign.source.report(Problem { title, span, allowed, help: None });
            campaign.source.verdict().err().unwrap_or(Failure::Input("unknown signal".into()))
        })?;
        let signal = |&i: &usize| SampleColumn {
            name: column_name(&table[i].name, &table[i].unit),
            unit: table[i].unit.to_string(),
        };
        let signals = positions.iter().map(signal).collect();
        Ok(Self { positions, signals })
    }

    /// Whether a signal of the twin is recorded.
    fn has_twin(&self) -> bool {
        self.signals.iter().any(|signal| signal.name.starts_with("twin_"))
    }
}

/// Warnings on set-ups without a twin, or with one of another structure, if one of its signals is recorded.
pub(super) fn about_twins(campaign: &Campaign, selection: &Selection) -> Vec<String> {
    let about = |set_up: &CampaignSetUp| {
        let name = &set_up.name;
        if !is_followed(set_up) {
            Some(format!("set-up {name:?} has no twin: the board has no equations of its damper; the signals are 0"))
        } else if set_up.plant.is_some() {
            Some(format!(
                "set-up {name:?}: the twin follows one degree of freedom (`structure`), not the whole `plant`"
            ))
        } else {
            None
        }
    };
    campaign.set_ups.iter().filter(|_| selection.has_twin()).filter_map(about).collect()
}

pub(super) fn fault_error(set_up: &CampaignSetUp, fault: Fault) -> RunError {
    RunError::Fault {
        set_up: set_up.name.clone(),
        cause: fault.cause,
        t_s: f64::from(fault.tick) / f64::from(TICK_HZ),
        value: fault.value,
        limit: fault.limit,
    }
}

/// Stiffness of the simulated spring over the stated one: a little stiffer than its data sheet says.
const SPRING_DEVIATION: f64 = 1.074;

/// The plant of a simulated rig: the set-up, on a board whose settings match its sensors and its screw.
pub(super) fn plant(rig: &RigSettings, set_up: &CampaignSetUp, experiment: &Experiment) -> PlantConfig {
    // Repeats differ in their noise, and in where a particle starts that may start anywhere.
    let seed = u64::from(experiment.repeat) << 32 | u64::from(rig.noise_seed);
    let set_up = &if set_up.spec.is_start_unknown() { starting_anywhere(set_up, seed) } else { set_up.clone() };
    PlantConfig {
        set_up: set_up.model(),
        structure_start_m: experiment.free_vibration().map_or(0.0, |free| free.start_m),
        particle_start_m: set_up.particle_start_m(),
        base: rig.shaker.map_or(Base::Prescribed, Base::Shaker),
        sensors: SensorModel {
            range_m: rig.sensor_range_m(),
            resolution_m: rig.sensor_resolution_m as f32,
            noise_rms_m: rig.sensor_noise_rms_m as f32,
            seed,
        },
        data_sheet: rig.data_sheet,
        walls: set_up
            .model()
            .particle
            .map(|_| WallSensors { scale: rig.board.calibration.walls, ..WallSensors::default() }),
        spring: set_up.spring().map(|spring| SpringPlant {
            step_m: rig.board.spring.step_m,
            stiffness_n_per_m: (SPRING_DEVIATION * spring.stiffness_n_per_m) as f32,
            friction_coefficient: spring.friction_coefficient as f32,
            seed,
            ..SpringPlant::default()
        }),
        scales: None,
        other_structure: set_up.plant.as_ref().map(|plant| number_of_structure(&plant.placed)),
    }
}

/// The set-up with its particle somewhere between the walls.
fn starting_anywhere(set_up: &CampaignSetUp, seed: u64) -> CampaignSetUp {
    let share = Xoshiro256PlusPlus::seed_from_u64(seed).next_u32() as f64 / f64::from(u32::MAX);
    CampaignSetUp { spec: set_up.spec.starting_at(2.0 * share - 1.0), ..set_up.clone() }
}

/// The spring properties that a set-up states.
pub(super) fn spring(set_up: &CampaignSetUp, spring: &SpringSpec) -> SpringSetUp {
    let [friction_coefficient, stiffness_n_per_m] = spring.stated().map(|value| value.map(|value| value as f32));
    SpringSetUp {
        stiffness_n_per_m,
        friction_coefficient,
        structure_stiffness_n_per_m: set_up.model().structure.stiffness_n_per_m as f32,
    }
}

/// Whether the board's twin has the equations of a set-up.
fn is_followed(set_up: &CampaignSetUp) -> bool {
    set_up.is_predicted && TwinConfig::follows(&set_up.model())
}

/// The twin of a set-up, if one of its signals is recorded. No twin during a free vibration: the base is at rest. No twin of soft
/// walls or a tuned mass.
pub(super) fn twin(selection: &Selection, set_up: &CampaignSetUp, experiment: &Experiment) -> Option<TwinConfig> {
    let is_driven = experiment.free_vibration().is_none();
    let model = set_up.model();
    (is_driven && selection.has_twin() && is_followed(set_up)).then(|| TwinConfig::new(model))
}

/// The request that configures these points of an experiment on a rig whose drive delivers ± `drive_m`.
pub(super) fn experiment(
    set_up: &CampaignSetUp,
    experiment: &Experiment,
    points: Range<usize>,
    drive_m: f32,
) -> Request {
    match &experiment.kind {
        ExperimentKind::SteppedSine(sine) => Request::Configure(sine.order(set_up.base_amplitude_m, points, drive_m)),
        ExperimentKind::Playback(playback) => Request::ConfigurePlayback(playback.order()),
        ExperimentKind::FreeVibration(free) => Request::ConfigureFreeVibration(free.order()),
    }
}

/// Names of sensors, or `none`.
pub(super) fn clipped(sensors: SensorSet) -> String {
    if sensors.is_empty() { "none".to_string() } else { sensors.to_string() }
}

/// The row of a result; a frequency that was not known before is the measured one.
pub(super) fn row(set_up: &CampaignSetUp, label: PointLabel, result: &PointResult) -> ResultRow {
    let is_known = label.frequency_hz > 0.0;
    ResultRow {
        set_up: label.id.set_up,
        experiment: label.id.experiment,
        frequency_hz: if is_known { label.frequency_hz } else { number_of(result.frequency_hz) },
        z_amplitude_m: result.z_amplitude_m,
        z_distortion: result.z_distortion,
        drive_amplitude_m: result.drive_amplitude_m,
        drive_saturated: result.drive_saturated,
        sensors_clipped: clipped(result.clipped),
        clearance_m: set_up.model().particle.map_or(f64::NAN, |p| p.clearance_m),
        x_amplitude_m: result.x_amplitude_m,
        phase_rad: result.phase_rad,
        rms_x_m: result.rms_x_m,
        mean_cycle_max_m: result.mean_cycle_max_m,
        max_abs_x_m: result.max_abs_x_m,
        last_cycle_max_m: result.last_cycle_max_m,
        change_per_cycle: result.change_per_cycle,
        scatter: result.scatter,
        cycles: result.cycles,
        x_noise_rms_m: result.x_noise_rms_m,
        deviation: result.deviation,
        deviation_uncertainty: result.deviation_uncertainty,
        interval: result.interval,
        steadiness: result.steadiness,
        start_tick: u64::from(result.start_tick),
        end_tick: u64::from(result.end_tick),
        d_over_z: set_up.clearance_ratio().unwrap_or(f64::NAN),
        point_index: label.point_index,
        segment: label.id.segment,
    }
}
