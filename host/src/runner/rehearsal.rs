//! Asks the controller's own code, before a run, whether it accepts every request that the run would send.
//!
//! A controller in this process has the settings of the rig. For each experiment on each of its set-ups it gets the requests of
//! a run, from the set-up to the start, without a tick between them. What it rejects is reported with its place in the
//! campaign. A spring is not homed here: its target is checked for the zero reading that the rig is expected to find.

mod place;

use damprig_core::control::friction_spring::{FrictionSpring, SpringConfig, Target, ZeroReading};
use damprig_core::integrator::sampled::Joined;
use damprig_core::io::Invalid;
use damprig_core::rig::Rejected;
use damprig_core::settings::{Settings, Source as Origin};
use damprig_device::board::DeviceInfo;
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::queues::{Outgoing, StreamItem};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_motion::rig_model::RigMotion;
use damprig_protocol::upload::{CHUNK_BYTES, UploadStage, checksum};
use damprig_protocol::{FromDevice, NumberedRequest, PlantKind, Request};
use damprig_simulator::board::{PlantScalar, SimulatedBoard};
use damprig_simulator::messages::set_plant;
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::{Load, PlantConfig};

use super::spring_setup::first_target;
use super::wire_mapping::{self, Selection};
use crate::campaign::{Campaign, CampaignSetUp, Experiment, ExperimentKind};
use crate::client::session::Session;
use crate::failure::Failure;
use crate::input::Problem;
use crate::input::locate::PathStep::{Item, Key};
use crate::prediction;

/// The prediction refuses a record beyond the drive's range, with the peak that fits.
const RECORD_PEAK: &str = "record peak (m)";

/// Campaigns with more problems than this are not asked about further.
const MAX_PROBLEMS: usize = 20;

/// Completes a campaign by the settings of the session's rig and checks all that can be checked without a prediction: limits,
/// signals, drive, the simulated rig's parts, and that the controller accepts every request. Sends nothing to the rig.
/// Returns the selected signals, and warnings.
///
/// # Errors
/// Every problem, with file, line and key.
pub fn accept(campaign: &mut Campaign, session: &Session) -> Result<(Selection, Vec<String>), Failure> {
    let (settings, plant) = (&session.settings, session.description.plant);
    let is_simulated = plant != PlantKind::Real;
    campaign.on_board(settings, is_simulated)?;
    let selection = Selection::of(campaign, session)?;
    let drive_m = f64::from(settings.calibration.drive.range().amplitude_m());
    prediction::drive::check(campaign, &[], drive_m)?;
    if !is_simulated {
        names_its_shaker(campaign)?;
    }
    let mut warnings = if is_simulated { prediction::simulated_rig::check(campaign)? } else { Vec::new() };
    warnings.extend(wire_mapping::about_twins(campaign, &selection));
    warnings.extend(campaign.set_ups.iter().filter(|set_up| set_up.has_unmodelled_damper).map(|set_up| {
        let what = if is_simulated {
            "on a simulated rig the bare structure moves"
        } else {
            "nothing is predicted for it, and the board's limits alone stop the rig"
        };
        format!("set-up {:?} has a damper without a model: {what}", set_up.name)
    }));
    rehearse(campaign, &selection, settings, plant)?;
    Ok((selection, warnings))
}

/// Refuses to keep the response on a rig whose shaker is not stated: without it the loop takes the base to follow the drive, and it is
/// unstable on a source of velocity.
///
/// # Errors
/// Each such experiment, with its line.
fn names_its_shaker(campaign: &Campaign) -> Result<(), Failure> {
    if campaign.rig.shaker.is_some() {
        return Ok(());
    }
    let keeps_response = |e: &Experiment| e.stepped_sine().is_some_and(|sine| sine.response_loop().is_some());
    let mut numbers: Vec<usize> = campaign.experiments.iter().filter(|e| keeps_response(e)).map(|e| e.number).collect();
    numbers.dedup();
    for number in numbers {
        let place = [Key("experiment"), Item(number - 1), Key("kind")];
        campaign.source.report(Problem {
            title: format!("`experiment[{number}].kind` keeps the response, which needs a shaker"),
            span: campaign.source.locate(&place).unwrap_or_default(),
            allowed: "a real rig states the frequency at which its shaker is calibrated".into(),
            help: Some("write [rig.shaker] with calibrated_at_hz".into()),
        });
    }
    campaign.source.verdict()
}

/// Checks that a controller with these settings accepts the whole campaign. `plant` is the kind of its plant: a simulated one is
/// configured with the campaign's.
///
/// # Errors
/// Everything that the controller rejects, with file, line and key.
fn rehearse(campaign: &Campaign, selection: &Selection, settings: &Settings, plant: PlantKind) -> Result<(), Failure> {
    match plant {
        PlantKind::SimulatedF32 => {
            refuse_plant(campaign)?;
            rehearse_in::<f32, Joined<f32>>(campaign, selection, settings, true)
        }
        PlantKind::SimulatedF64 => rehearse_in::<f64, RigMotion>(campaign, selection, settings, true),
        PlantKind::Real => rehearse_in::<f64, RigMotion>(campaign, selection, settings, false),
    }
}

/// Refuses a plant with several places on a simulated board, which has one degree of freedom.
fn refuse_plant(campaign: &Campaign) -> Result<(), Failure> {
    if campaign.set_ups.iter().any(|set_up| set_up.plant.is_some()) {
        campaign.source.report(Problem {
            title: "`plant` is for the virtual rig in double precision, and for real ones".into(),
            span: campaign.source.locate(&[Key("plant")]).unwrap_or_default(),
            allowed: "this simulated board has a structure of one degree of freedom".into(),
            help: Some("run it with --rig virtual, or leave out `plant`".into()),
        });
    }
    campaign.source.verdict()
}

fn rehearse_in<S: PlantScalar, L: Load<S>>(
    campaign: &Campaign,
    selection: &Selection,
    settings: &Settings,
    is_simulated: bool,
) -> Result<(), Failure> {
    let mut upload = Box::new(UploadBuffer::new());
    let mut problems = 0;
    for (index, set_up) in campaign.set_ups.iter().enumerate() {
        for (place, experiment) in campaign.experiments.iter().enumerate() {
            if !experiment.set_ups.contains(&index) || problems >= MAX_PROBLEMS {
                continue;
            }
            let mut device = RehearsedDevice::<S, L>::new(settings, &mut upload);
            if let Err(refused) = device.configure(campaign, selection, set_up, experiment, is_simulated) {
                if matches!(&refused.why, Rejected::AboveLimit { parameter, .. } if parameter == RECORD_PEAK) {
                    continue;
                }
                problems += 1;
                campaign.source.report(place::problem(campaign, index, place, &refused));
            }
        }
    }
    campaign.source.verdict()
}

/// A rejected request.
struct RefusedRequest {
    /// The request, in words.
    what: &'static str,
    why: Rejected,
}

/// Keeps the last reply.
#[derive(Default)]
struct LastReply(Option<Result<(), Rejected>>);

impl Outgoing for LastReply {
    fn message(&mut self, message: FromDevice) -> Result<usize, ()> {
        if let FromDevice::Reply { answer, .. } = message {
            self.0 = Some(answer.map(|_| ()));
        }
        Ok(0)
    }

    fn stream(&mut self, _: StreamItem) -> Result<usize, ()> {
        Ok(0)
    }
}

/// A controller in this process; no tick passes on it.
struct RehearsedDevice<'a, S, L> {
    controller: Controller,
    board: SimulatedBoard<S, L>,
    upload: &'a mut UploadBuffer,
    replies: LastReply,
    seq: u16,
}

impl<'a, S: PlantScalar, L: Load<S>> RehearsedDevice<'a, S, L> {
    fn new(settings: &Settings, upload: &'a mut UploadBuffer) -> Self {
        let mut controller = Controller::new(DeviceInfo::new("", ""), BootInfo::default());
        controller.start_with(settings, Origin::Stored);
        Self { controller, board: SimulatedBoard::default(), upload, replies: LastReply::default(), seq: 0 }
    }

    fn ask(&mut self, what: &'static str, request: Request) -> Result<(), RefusedRequest> {
        self.seq = self.seq.wrapping_add(1);
        let request = NumberedRequest { seq: self.seq, at_tick: None, request };
        self.controller.serve(&request, &mut self.board, self.upload, &mut self.replies);
        // Every request is answered at once.
        self.replies.0.take().unwrap_or(Ok(())).map_err(|why| RefusedRequest { what, why })
    }

    /// The requests of a run, in its order.
    fn configure(
        &mut self,
        campaign: &Campaign,
        selection: &Selection,
        set_up: &CampaignSetUp,
        experiment: &Experiment,
        is_simulated: bool,
    ) -> Result<(), RefusedRequest> {
        // Without a plant a simulated board does not start.
        let mut plant = PlantConfig::ideal(set_up.model());
        if is_simulated {
            plant = wire_mapping::plant(&campaign.rig, set_up, experiment);
        }
        self.ask("take the simulated set-up", set_plant(plant))?;
        let twin = wire_mapping::twin(selection, set_up, experiment);
        self.ask("take the twin's set-up", Request::SetTwin(twin))?;
        if let ExperimentKind::Playback(playback) = &experiment.kind {
            self.upload(&playback.bytes())?;
        }
        let drive_m = self.controller.settings().calibration.drive.range().amplitude_m();
        let request = wire_mapping::experiment(set_up, experiment, 0..experiment.known_points(), drive_m);
        self.ask("take the experiment", request)?;
        self.ask("take the campaign's limits", Request::SetLimits(campaign.rig.limits.of_experiment()))?;
        if let Some(spring) = set_up.spring() {
            let properties = wire_mapping::spring(set_up, &spring);
            self.ask("take the set-up's spring", Request::SetSpring(properties))?;
            let config = self.controller.settings().spring.for_set_up(&properties);
            check_target(&config, first_target(set_up, &spring), plant.spring.as_ref())
                .map_err(|invalid| RefusedRequest { what: "move the friction damper's spring", why: invalid.into() })?;
        }
        self.ask("start", Request::Start)
    }

    fn upload(&mut self, bytes: &[u8]) -> Result<(), RefusedRequest> {
        const WHAT: &str = "take a record";
        self.ask(WHAT, Request::BeginUpload { bytes: bytes.len() as u32, crc32: checksum(0, bytes) })?;
        for (n, chunk) in bytes.chunks(CHUNK_BYTES).enumerate() {
            let offset = (n * CHUNK_BYTES) as u32;
            self.ask(WHAT, Request::UploadChunk { offset, data: chunk.iter().copied().collect() })?;
        }
        while self.upload.progress().stage == UploadStage::Checking {
            self.upload.check();
        }
        Ok(())
    }
}

/// Checks a target as the controller does after its touch-off: against the simulated spring, or on a real rig against the
/// stated stiffness with the zero reading as near as it can be.
fn check_target(config: &SpringConfig, target: Target, plant: Option<&SpringPlant>) -> Result<(), Invalid> {
    let (zero_m, stiffness_n_per_m) =
        plant.map_or((config.back_off_m, config.stiffness_n_per_m), |plant| (plant.touch_m, plant.stiffness_n_per_m));
    FrictionSpring::new(config)?.allows(&ZeroReading { zero_m, zero_error_m: 0.0, stiffness_n_per_m }, target)
}
