//! Declares the keys of a campaign other than those of structure and dampers: name, type, range, default and meaning of each.

use damprig_core::control::base_loop::{ClosedLoop, MAX_GAIN_PER_S};
use damprig_core::control::phase_lock::{self as phase_lock_limits, PhaseLock};
use damprig_core::control::response_loop::{KeptQuantity, MAX_GAIN_PER_CYCLE, ResponseLoop};
use damprig_core::control::stepped_sine::MIN_TICKS_PER_CYCLE;
use damprig_core::io::TICK_HZ;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_simulator::plant::{Amplifier, DataSheet, Shaker};

use super::shape::PulseShape;
use crate::input::key::DefaultValue::{From, Number, Word};
use crate::input::key::Need::{Default, Forbidden, If, IfWord, Optional, Required};
use crate::input::key::Range::{Above, Between, Inside, NotNegative, NotZero, Positive, Whole, ZeroOr};
use crate::input::key::{Key, KeyedQuantity, Table, ValueKind, key, number, tables, word};
use crate::motion_record::{BASE_RECORD, ENVELOPE, NOISE, OF_FILE, RECORD_NOISE, RECORD_SCALE};
use crate::setup::{self, set_up_keys};
use crate::structure::description;

/// The highest drive frequency, Hz.
const HIGHEST_HZ: f64 = TICK_HZ as f64 / MIN_TICKS_PER_CYCLE as f64;

/// Why there is a highest drive frequency.
const TICK: &str = "the controller's tick of 1000 Hz gives a period 20 samples there";
const _: () = assert!(TICK_HZ == 1000.0 && MIN_TICKS_PER_CYCLE == 20.0, "TICK states both");

/// Lowest sample rate of the controller, Hz.
pub(super) const MIN_RATE_HZ: f64 = 0.1;

/// Longest time of all dwells of a point, s: the controller counts 10⁹ ticks.
const LONGEST_DWELL_S: f64 = 1e6;

/// A tenth of a millimetre.
const REST_LEVEL_M: f64 = 1e-4;

/// Longest ramp and longest time after the end of a record or a pulse, s.
const LONGEST_END_S: f64 = 3600.0;

// Keys of several kinds of experiments.
const REST_LEVEL_KEY: Key =
    number("rest_level_m", Positive, "|x| below which the structure counts as at rest before the start")
        .usual(1e-6, 2e-3);
const SAMPLE_RATE_KEY: Key = number(
    "sample_rate_hz",
    Between(MIN_RATE_HZ, TICK_HZ as f64),
    "samples per second of the played motion; as fast as the record and the controller allow when left out",
)
.note("up to the controller's tick rate");
const END_RAMP_KEY: Key =
    number("ramp_s", Between(0.0, LONGEST_END_S), "rise and fall of the drive at both ends").usual(0.0, 60.0);
const TAIL_KEY: Key = number("tail_s", Between(0.0, LONGEST_END_S), "time measured after the end").usual(0.0, 600.0);

// Key of set-ups and experiments.
const INSTRUCTION_KEY: Key =
    key("instruction", ValueKind::Text, "what a person does before it; asked on a real rig, and noted in the journal");

/// Most times that an experiment is repeated.
const MAX_REPEATS: f64 = 100.0;

/// Least gain of the phase lock: a decimal of the controller's.
const MIN_LOCK_GAIN: f64 = 0.1;
const _: () = assert!(phase_lock_limits::MIN_GAIN_PER_CYCLE == MIN_LOCK_GAIN as f32);

/// The word of `kind` of every kind of experiment.
const KINDS: &[&str] =
    &["stepped_sine", "playback", "impulse", "free_vibration", "response_controlled", "resonance_tracking"];

/// The keys of the record that a playback plays.
const PLAYED_RECORD: Table = Table { path: "experiment", kind: Some("playback"), ..BASE_RECORD };

/// The tables of the record or the noise that a playback plays.
pub const PLAYED: [Table; 3] = [
    PLAYED_RECORD,
    Table { path: "experiment.noise", ..NOISE },
    Table { path: "experiment.noise.envelope", ..ENVELOPE },
];

tables! {
    "All tables of a campaign other than those of structure and dampers, and [`PLAYED`]."

    "The top of a campaign. Structure and dampers at the top are for all set-ups: a set-up has the keys that it leaves out from here."
    campaign("") {
        NAME: Required, [key("name", ValueKind::Text, "a short name, part of the run folder's name: letters, digits, '-' and '_'")];
        SET_UP_FILE: Optional, [setup::SET_UP_FILE];
        RIG: Optional, [key("rig", ValueKind::Table, "simulated sensors and shaker, and the campaign's limits")];
        TELEMETRY: Optional, [key("telemetry", ValueKind::Table, "recorded signals; x, z, drive and frequency at 100 Hz when left out")];
        PLAN: Optional, [key("plan", ValueKind::Table, "who measures what, and in which order")];
        GRAVITY: set_up_keys::GRAVITY.need, [set_up_keys::GRAVITY.keys[0]];
        STRUCTURE: Optional, [set_up_keys::STRUCTURE.keys[0]];
        PARTICLE: Optional, [set_up_keys::PARTICLE.keys[0]];
        FRICTION_DAMPER: Optional, [set_up_keys::FRICTION_DAMPER.keys[0]];
        TMD: Optional, [set_up_keys::TMD.keys[0]];
        PLANT: Optional, [
            key("plant", ValueKind::Table, "a structure with several places that carries the dampers, for the virtual rig, predictions and `damprig compare`; `structure` is then what the board knows of it, its lowest mode at x when left out"),
        ];
        SET_UP: Required, [key("set_up", ValueKind::Tables, "the set-ups, in the order in which they are mounted")];
        EXPERIMENT: Required, [key("experiment", ValueKind::Tables, "the experiments")];
    }

    "A structure with several places on the rig. A damper's `place` or `position_m` says where it is mounted; when left out, where x is measured."
    plant("plant") {
        STOREYS: Optional, [description::STOREYS.keys[0]];
        BEAM: Optional, [description::BEAM.keys[0]];
        MODES: Optional, [description::MODES.keys[0]];
        PLACES: If(&MODES, "mode", &Required, &Forbidden), [description::PLACES.keys[0]];
        MODAL_DAMPING: If(&STOREYS, "storey", &Optional, &Forbidden), [description::MODAL_DAMPING.keys[0]];
        OBSERVED: Optional, [description::OBSERVED.keys[0], description::OBSERVED.keys[1]];
    }

    "Simulated sensors and shaker, and the campaign's limits: each tightens a limit of the board while the campaign runs."
    rig("rig") {
        SENSOR_RESOLUTION: Default(Number(0.0)), [
            number("sensor_resolution_m", NotNegative, "smallest displacement step of the sensors; 0 for none, simulated rigs only")
                .usual(0.0, 1e-4),
        ];
        SENSOR_NOISE: Default(Number(0.0)), [
            number("sensor_noise_rms_m", NotNegative, "RMS noise of a displacement sample; 0 for none, simulated rigs only")
                .usual(0.0, 1e-4),
        ];
        NOISE_SEED: Default(Number(1.0)), [number("noise_seed", Whole(0.0, u32::MAX as f64), "seed of the simulated noise")];
        DISPLACEMENT_LIMIT: Optional, [number("displacement_limit_m", Positive, "limit of both |x| and |z|")];
        STRUCTURE_LIMIT: If(&DISPLACEMENT_LIMIT, "displacement_limit_m", &Forbidden, &Optional), [
            number("structure_limit_m", Positive, "limit of |x|: above it the controller fades out the drive"),
        ];
        BASE_LIMIT: If(&DISPLACEMENT_LIMIT, "displacement_limit_m", &Forbidden, &Optional), [
            number("base_limit_m", Positive, "limit of |z|"),
        ];
        HALF_CYCLES_AHEAD: Optional, [
            number("half_cycles_ahead", Between(0.0, 20.0), "half-cycles for which a growing motion is predicted, to stop before a limit"),
        ];
        WALL_FORCE_LIMIT: Optional, [number("wall_force_limit_n", Positive, "limit of the force on a wall")];
        SATURATED: Optional, [number("saturated_s", Positive, "time after which a saturated drive is a fault")];
        // This program sends a message every second. 0 is compared with the board's settings, which refuse it.
        HOST_SILENT: Optional, [
            number("host_silent_s", ZeroOr(5.0, 3600.0), "time without a message after which the board stops the drive"),
        ];
        BRAKE: Optional, [number("brake_n", NotNegative, "force with which the friction damper brakes after a fault")];
        SENSORS: Optional, [key("sensors", ValueKind::Table, "errors of the simulated sensors; none when left out")];
        SHAKER: Optional, [
            key("shaker", ValueKind::Table, "a simulated shaker that feels its load; when left out the base follows the drive exactly"),
        ];
    }

    "Ideal sensors."
    sensors_ideal("rig.sensors", "ideal") {}

    "Sensors with the errors of a data sheet."
    sensors_data_sheet("rig.sensors", "data_sheet") {
        LINEARITY: Default(From(|| DataSheet::default().linearity.into())), [
            number("linearity", Between(0.0, 0.1), "largest deviation from a straight line, as a share of the range"),
        ];
        RESPONSE: Default(From(|| DataSheet::default().response_s.into())), [
            number("response_s", Between(0.0, 1.0), "time constant of the sensor"),
        ];
        SKEW: Default(From(|| DataSheet::default().skew_s.into())), [
            number("skew_s", Between(0.0, 1e-4), "delay of the conversion of z after that of x"),
        ];
        ANTI_ALIAS: Default(From(|| DataSheet::default().anti_alias_hz.into())), [
            number("anti_alias_hz", Between(1.0, 1e6), "corner frequency of the anti-alias filter"),
        ];
        BITS: Default(From(|| DataSheet::default().bits.into())), [
            number("bits", Whole(4.0, 20.0), "resolution of the converter over the whole range"),
        ];
        OVERSAMPLING: Default(From(|| DataSheet::default().oversampling.into())), [
            number("oversampling", Whole(1.0, 64.0), "conversions that are averaged into a sample"),
        ];
    }

    "A simulated electrodynamic shaker that feels its load. Of a real rig only `calibrated_at_hz` is used."
    shaker("rig.shaker") {
        MOVING_MASS: Default(From(|| Shaker::default().moving_mass_kg)), [
            number("moving_mass_kg", Positive, "mass of table and armature").usual(0.1, 500.0),
        ];
        SUSPENSION_STIFFNESS: Default(From(|| Shaker::default().suspension_stiffness_n_per_m)), [
            number("suspension_stiffness_n_per_m", NotNegative, "stiffness of the suspension").usual(0.0, 1e6),
        ];
        SUSPENSION_DAMPING: Default(From(|| Shaker::default().suspension_damping_n_s_per_m)), [
            number("suspension_damping_n_s_per_m", NotNegative, "damping of the suspension").usual(0.0, 1e4),
        ];
        FORCE_FACTOR: Default(From(|| Shaker::default().force_factor_n_per_a)), [
            number("force_factor_n_per_a", Positive, "force per current").usual(1.0, 1000.0),
        ];
        AMPLIFIER: Default(Word("voltage")), [word("amplifier", &["voltage", "current"], "the quantity that the amplifier controls")];
        COIL_RESISTANCE: IfWord(&AMPLIFIER, "voltage", &Default(From(coil_resistance_ohm)), &Forbidden), [
            number("coil_resistance_ohm", Positive, "resistance of the coil").usual(0.05, 50.0),
        ];
        VOLTAGE_LIMIT: IfWord(&AMPLIFIER, "voltage", &Default(From(voltage_limit_v)), &Forbidden), [
            number("limit_v", Positive, "limit of the voltage"),
        ];
        CURRENT_LIMIT: Default(From(|| Shaker::default().current_limit_a)), [
            number("current_limit_a", Positive, "limit of the current"),
        ];
        HALF_STROKE: Default(From(|| Shaker::default().half_stroke_m)), [
            number("half_stroke_m", Positive, "stroke to either side").usual(1e-3, 0.5),
        ];
        CALIBRATED_AT: Default(From(|| Shaker::default().calibrated_at_hz)), [
            number("calibrated_at_hz", Positive, "frequency at which the unloaded table moves by the base amplitude"),
        ];
    }

    "Who measures what, and in which order. Texts go into manifest and report."
    plan("plan") {
        OPERATOR: Optional, [key("operator", ValueKind::Text, "who runs the campaign")];
        SPECIMEN: Optional, [key("specimen", ValueKind::Text, "what is measured: serial number, material, state")];
        NOTES: Optional, [key("notes", ValueKind::Text, "anything else that a reader of the results must know")];
        ORDER: Default(Word("as_written")), [
            word(
                "order",
                &["as_written", "random"],
                "order of the set-ups, of the experiments on each, and of the frequencies that start from rest",
            ),
        ];
        ORDER_SEED: IfWord(&ORDER, "random", &Default(Number(1.0)), &Forbidden), [
            number("order_seed", Whole(0.0, u32::MAX as f64), "seed of a random order"),
        ];
    }

    "Recorded signals and their rate."
    telemetry("telemetry") {
        RATE: Required, [
            number("rate_hz", NotNegative, "samples of each signal in a second: 0 for none, or 1000 divided by a whole number"),
        ];
        SIGNALS: Optional, [key("signals", ValueKind::Texts, "names of the signals; x, z, drive and frequency when left out")];
    }

    "A set-up: what is mounted on the rig, with its base amplitude."
    set_up("set_up") {
        NAME: Required, [key("name", ValueKind::Text, "a name for experiments to call it by")];
        LABEL: Optional, [key("label", ValueKind::Text, "its name in figures and tables; `name` when left out")];
        INSTRUCTION: Optional, [INSTRUCTION_KEY];
        BASE_AMPLITUDE: Required, [
            setup::BASE_AMPLITUDE.keys[0],
            number(
                "force_amplitude_n",
                Positive,
                "P: a force on the structure over a fixed base, instead of a base that moves; P/k takes the place of Z",
            )
            .usual(1e-3, 1000.0),
        ];
        GRAVITY: Optional, [set_up_keys::GRAVITY.keys[0]];
        STRUCTURE: Optional, [set_up_keys::STRUCTURE.keys[0]];
        PARTICLE: Optional, [set_up_keys::PARTICLE.keys[0]];
        FRICTION_DAMPER: Optional, [set_up_keys::FRICTION_DAMPER.keys[0]];
        TMD: set_up_keys::TMD.need, [set_up_keys::TMD.keys[0]];
        DAMPER: Optional, [word("damper", &["unmodelled"], "a damper without a model: it is measured, not predicted")];
    }

    "An experiment on some of the set-ups: the keys of every kind."
    experiment("experiment") {
        NAME: Optional, [key("name", ValueKind::Text, "its name in tables; `experiment 1` for the first when left out")];
        KIND: Required, [word("kind", KINDS, "the kind of experiment")];
        SET_UPS: Optional, [key("set_ups", ValueKind::Texts, "names of the set-ups that it is run on; all when left out")];
        REPEATS: Default(Number(1.0)), [
            number("repeats", Whole(1.0, MAX_REPEATS), "times that it is run on each set-up; each is an experiment with a number after its name"),
        ];
        INSTRUCTION: Optional, [INSTRUCTION_KEY];
    }

    "One frequency of the base after another."
    stepped_sine("experiment", "stepped_sine") {
        FREQUENCIES: Required, [
            key("frequencies_hz", ValueKind::NumbersOrTable(Above(0.0, HIGHEST_HZ)), "a list, or { from_hz, to_hz, step_hz, resonance_points, peak_points }")
                .usual(0.1, 25.0)
                .note(TICK),
        ];
        START: Required, [
            word("start", &["from_rest", "carry_over"], "whether a point starts from rest or carries over the motion of the one before"),
        ];
        SETTLE: Default(Number(0.0)), [
            number("settle_s", NotNegative, "time from the start of a point to its dwell").usual(0.0, 600.0),
        ];
        DWELL: Required, [number("dwell_s", Positive, "the time that is measured at each frequency").usual(1.0, 600.0)];
        RAMP: Default(Number(0.0)), [
            number("ramp_s", NotNegative, "rise and fall of the drive, at most `settle_s`").usual(0.0, 60.0),
        ];
        REST_LEVEL: Default(Number(REST_LEVEL_M)), [REST_LEVEL_KEY];
        STEADY: Optional, [key("steady", ValueKind::Table, "when a point counts as steady, and how long it is measured again")];
        DRIVE: Default(Word("constant")), [
            word("drive", &["constant", "closed_loop"], "constant drive, or the base amplitude in closed loop, which needs `[rig.shaker]`"),
        ];
        CLOSED_LOOP: IfWord(&DRIVE, "closed_loop", &Optional, &Forbidden), [
            key("closed_loop", ValueKind::Table, "parameters of the closed loop"),
        ];
    }

    "One frequency after another at a constant amplitude of the structure: the drive is whatever keeps it, and Z is the result."
    response_controlled("experiment", "response_controlled") {
        AMPLITUDES: Required, [
            numbers("x_amplitudes_m", "amplitudes of x at the drive frequency, each an experiment of its own").usual(1e-5, 0.1),
            numbers("velocity_amplitudes_m_per_s", "amplitudes of the velocity of x, each an experiment of its own").usual(1e-4, 5.0),
            numbers("relative_amplitudes_m", "amplitudes of x − z, each an experiment of its own").usual(1e-5, 0.1),
        ];
        FREQUENCIES: Required, [stepped_sine::FREQUENCIES.keys[0]];
        START: Required, [stepped_sine::START.keys[0]];
        SETTLE: stepped_sine::SETTLE.need, [stepped_sine::SETTLE.keys[0]];
        DWELL: Required, [stepped_sine::DWELL.keys[0]];
        RAMP: stepped_sine::RAMP.need, [stepped_sine::RAMP.keys[0]];
        REST_LEVEL: stepped_sine::REST_LEVEL.need, [REST_LEVEL_KEY];
        STEADY: Optional, [stepped_sine::STEADY.keys[0]];
        RESPONSE_LOOP: Optional, [key("response_loop", ValueKind::Table, "parameters of the loop that keeps the amplitude")];
    }

    "The resonance at one amplitude after another: the drive's frequency follows the phase of x, and frequency and damping over the amplitude are the result."
    resonance_tracking("experiment", "resonance_tracking") {
        AMPLITUDES: Required, [
            numbers("base_amplitudes_m", "amplitudes of the base, in the order in which they are measured; a shaker keeps them with drive = \"closed_loop\"").usual(1e-5, 0.02),
            numbers("x_amplitudes_m", "amplitudes of x at the drive frequency, in the order in which they are measured; a loop keeps them").usual(1e-5, 0.1),
            numbers("velocity_amplitudes_m_per_s", "amplitudes of the velocity of x, likewise").usual(1e-4, 5.0),
            numbers("relative_amplitudes_m", "amplitudes of x − z, likewise").usual(1e-5, 0.1),
        ];
        FROM: Required, [number("from_hz", Above(0.0, HIGHEST_HZ), "lowest frequency of the drive").usual(0.1, 25.0).note(TICK)];
        TO: Required, [number("to_hz", Above(0.0, HIGHEST_HZ), "highest frequency of the drive").usual(0.1, 25.0).note(TICK)];
        START_FREQUENCY: Optional, [
            number("start_hz", Above(0.0, HIGHEST_HZ), "frequency at which the first point starts, and each from rest; the middle of the range when left out"),
        ];
        START: Required, [stepped_sine::START.keys[0]];
        SETTLE: stepped_sine::SETTLE.need, [stepped_sine::SETTLE.keys[0]];
        DWELL: Required, [stepped_sine::DWELL.keys[0]];
        RAMP: stepped_sine::RAMP.need, [stepped_sine::RAMP.keys[0]];
        REST_LEVEL: stepped_sine::REST_LEVEL.need, [REST_LEVEL_KEY];
        STEADY: Optional, [stepped_sine::STEADY.keys[0]];
        DRIVE: stepped_sine::DRIVE.need, [stepped_sine::DRIVE.keys[0]];
        CLOSED_LOOP: stepped_sine::CLOSED_LOOP.need, [stepped_sine::CLOSED_LOOP.keys[0]];
        RESPONSE_LOOP: Optional, [response_controlled::RESPONSE_LOOP.keys[0]];
        PHASE_LOCK: Optional, [key("phase_lock", ValueKind::Table, "the phase that is kept, and the loop that keeps it")];
    }

    "The loop that follows a resonance by the phase of x."
    phase_lock("experiment.phase_lock") {
        PHASE: Default(Number(-90.0)), [
            number("phase_deg", Between(-150.0, -30.0), "kept phase of x relative to z; at −90° the structure is at resonance, fn·√(1 + (Z/X)²) of a linear one"),
        ];
        GAIN: Default(From(|| default_lock().gain_per_cycle.into())), [
            number("gain_per_cycle", Between(MIN_LOCK_GAIN, phase_lock_limits::MAX_GAIN_PER_CYCLE as f64), "rate of the loop, for each cycle of the drive"),
        ];
        TOLERANCE: Default(Number(2.0)), [
            number("tolerance_deg", Between(0.1, 10.0), "deviation of the phase within which it counts as kept; the lock is lost beyond three times it"),
        ];
        WAIT: Default(From(|| default_lock().wait_s.into())), [
            number("wait_s", Between(0.0, 3600.0), "longest time after settling until the phase is kept; the longest wait of the loops in use counts"),
        ];
    }

    "Parameters of the loop that keeps the structure's amplitude."
    response_loop("experiment.response_loop") {
        GAIN: Default(From(|| default_loop().gain_per_cycle.into())), [
            number("gain_per_cycle", Above(0.0, MAX_GAIN_PER_CYCLE as f64), "rate at which a deviation is damped, for each cycle of the drive"),
        ];
        TOLERANCE: Default(From(|| default_loop().tolerance.into())), [
            number("tolerance", Between(0.001, 0.5), "relative error of the amplitude within which the response counts as held"),
        ];
        WAIT: Default(From(|| default_loop().wait_s.into())), [
            number("wait_s", Between(0.0, 3600.0), "longest time after settling until the response is held"),
        ];
        DRIVE_LIMIT: closed_loop::DRIVE_LIMIT.need, [closed_loop::DRIVE_LIMIT.keys[0]];
    }

    "Evenly spaced frequencies."
    grid("experiment.frequencies_hz") {
        FROM: Required, [number("from_hz", Above(0.0, HIGHEST_HZ), "the first frequency").usual(0.1, 25.0).note(TICK)];
        TO: Required, [number("to_hz", Above(0.0, HIGHEST_HZ), "the last frequency").usual(0.1, 25.0).note(TICK)];
        RESONANCE_POINTS: Optional, [
            number(
                "resonance_points",
                Whole(2.0, 101.0),
                "further frequencies over the half-power bandwidth of each bare structure, fn(1 − ζ) to fn(1 + ζ)",
            ),
        ];
        PEAK_POINTS: Optional, [
            number(
                "peak_points",
                Whole(2.0, 40.0),
                "further frequencies between the neighbours of the point with the highest measured X/Z (cycle maxima) and of a second maximum that may be higher, measured after the grid on each set-up; a sweep (`carry_over`) begins at the first of them from rest",
            ),
        ];
        STEP: Required, [
            number("step_hz", NotZero, "the step; negative for falling frequencies")
                .usual(-2.0, 2.0)
                .note("for one frequency write frequencies_hz = [2.5]"),
        ];
    }

    "When a point counts as steady."
    steady("experiment.steady") {
        TOLERANCE: Default(From(|| SteadyLimits::default().tolerance.into())), [
            number("tolerance", Inside(0.0, 1.0), "largest deviation of X/Z from its limit, uncertainty included"),
        ];
        SCATTER: Default(From(|| SteadyLimits::default().scatter.into())), [
            number("scatter", Positive, "largest relative scatter of the cycle maxima of a motion that repeats"),
        ];
        LONGEST_DWELL: Optional, [
            number(
                "longest_dwell_s",
                Above(0.0, LONGEST_DWELL_S),
                "time of all dwells of a point that is measured again until it is steady; one dwell when left out",
            ),
        ];
    }

    "Parameters of the closed loop of the base amplitude."
    closed_loop("experiment.closed_loop") {
        GAIN: Default(From(|| ClosedLoop::default().gain_per_s.into())), [
            number("gain_per_s", Above(0.0, MAX_GAIN_PER_S as f64), "rate at which an amplitude error decays without load"),
        ];
        TOLERANCE: Default(From(|| ClosedLoop::default().tolerance.into())), [
            number("tolerance", Between(0.001, 0.5), "relative error of the amplitude within which the base counts as held"),
        ];
        WAIT: Default(From(|| ClosedLoop::default().wait_s.into())), [
            number("wait_s", Between(0.0, 3600.0), "longest time after settling until the base is held"),
        ];
        DRIVE_LIMIT: Optional, [
            number("drive_limit_m", Positive, "limit of the drive; the range of the rig's output when left out"),
        ];
    }

    "The base follows a recorded motion, or noise from a seed."
    playback("experiment", "playback") {
        TARGET: If(&RECORD_SCALE, "scale", &Forbidden, &If(&RECORD_NOISE, "noise", &Required, &Optional)), [
            number("target_peak_m", NotZero, "peak to which the record or the noise is scaled").usual(1e-5, 0.05),
        ];
        BASELINE: OF_FILE, [
            word("baseline", &["none", "linear"], "the line that is removed; linear for an acceleration, none for a displacement when left out"),
        ];
        SAMPLE_RATE: Optional, [SAMPLE_RATE_KEY];
        RAMP: Default(Number(0.0)), [END_RAMP_KEY];
        TAIL: Default(Number(0.0)), [TAIL_KEY];
        REST_LEVEL: Default(Number(REST_LEVEL_M)), [REST_LEVEL_KEY];
    }

    "A pulse of the base."
    impulse("experiment", "impulse") {
        SHAPE: Required, [word("shape", &PulseShape::WORDS, "shape of the pulse; versine and haversine are the same")];
        AMPLITUDE: Required, [number("amplitude_m", NotZero, "height of the pulse").usual(-0.05, 0.05)];
        DURATION: Required, [number("duration_s", Positive, "length of the pulse").usual(0.01, 60.0)];
        RISE: IfWord(&SHAPE, "rectangle", &Optional, &Forbidden), [
            number("rise_s", Positive, "rise and fall of a rectangle, at most half its length; a tenth when left out"),
        ];
        SAMPLE_RATE: Optional, [SAMPLE_RATE_KEY];
        RAMP: Default(Number(0.0)), [END_RAMP_KEY];
        TAIL: Default(Number(0.0)), [TAIL_KEY];
        REST_LEVEL: Default(Number(REST_LEVEL_M)), [REST_LEVEL_KEY];
    }

    "The structure is held at a displacement and released; a simulated one starts there."
    free_vibration("experiment", "free_vibration") {
        START: Required, [number("start_m", NotZero, "x0, where the structure is released").usual(-0.1, 0.1)];
        MEASURE: Required, [number("measure_s", Positive, "time measured after the release").usual(0.5, 600.0)];
        LEVEL: Optional, [number("level_m", Positive, "|x| beyond which it counts as held, below |x0|; 0.8 |x0| when left out")];
        HOLD: Default(Number(0.5)), [number("hold_s", Between(0.1, 60.0), "how long it must be held")];
        TIMEOUT: Default(Number(300.0)), [number("timeout_s", Between(1.0, 86_400.0), "how long the release may take")];
        CYCLES: Default(Number(10.0)), [number("cycles", Whole(1.0, 1000.0), "cycles over which the decay is measured")];
    }
}

/// A list of positive numbers.
const fn numbers(name: &'static str, doc: &'static str) -> Key {
    key(name, ValueKind::Numbers(Positive), doc)
}

/// The loop of the response as delivered.
fn default_loop() -> ResponseLoop {
    ResponseLoop::new(KeptQuantity::Displacement { amplitude_m: 1.0 }, None)
}

/// The loop that follows a resonance as delivered.
fn default_lock() -> PhaseLock {
    PhaseLock::new(1.0, 2.0)
}

/// Resistance and limit of the default amplifier.
fn default_amplifier() -> (f64, f64) {
    match Shaker::default().amplifier {
        Amplifier::Voltage { coil_resistance_ohm, limit_v } => (coil_resistance_ohm, limit_v),
        Amplifier::Current => (f64::NAN, f64::NAN),
    }
}

fn coil_resistance_ohm() -> f64 {
    default_amplifier().0
}

fn voltage_limit_v() -> f64 {
    default_amplifier().1
}
