//! Declares the keys of a case other than those of its set-up: excitation, initial state and run.

use damprig_particles::{MAX_SPHERES, MIN_RESTITUTION, MIN_STEPS};
use damprig_structures::MAX_MODES;

use crate::input::key::DefaultValue::Number;
use crate::input::key::Need::{Default, Forbidden, If, Optional, Required, RequiredUnless};
use crate::input::key::Range::{Above, Any, Between, NotNegative, Positive, Whole};
use crate::input::key::{Key, KeyedQuantity, MAX_WHOLE, Need, Table, ValueKind, key, number, tables};
use crate::setup;

/// Smallest sphere, m: smaller ones stick to each other, which the model leaves out.
const MIN_DIAMETER_M: f64 = 1e-5;

/// Largest sphere, m.
const MAX_DIAMETER_M: f64 = 1.0;

/// Largest side of a box, m.
const MAX_SIDE_M: f64 = 100.0;

/// Of the amplitude of the base's motion.
const UNLESS_STATED: Need = RequiredUnless("`base_amplitude_m` at the top gives it");

const ANGULAR: Key = number("angular_frequency_rad_per_s", Positive, "Ω, the angular frequency").usual(0.6, 12_566.0);
const HERTZ: Key = number("frequency_hz", Positive, "Ω/2π, the frequency").usual(0.1, 2000.0);
const FREQUENCY_RATIO: Key =
    number("frequency_ratio", Positive, "Ω/ωn, the frequency over the structure's natural one").usual(0.05, 20.0);

/// Where a force acts on a structure with several places.
const FORCE_PLACE: [Key; 2] = [
    key("place", ValueKind::Text, "the place of a structure with several where it acts; default: the observed one"),
    number("position_m", NotNegative, "the place on a beam where it acts"),
];

tables! {
    "All tables of a case other than those of its set-up."

    "The top level of a case, which also has the keys of its set-up."
    case("") {
        NAME: Optional, [key("name", ValueKind::Text, "name of the case in figures; the file name when left out")];
        SET_UP_FILE: Optional, [setup::SET_UP_FILE];
        BASE: Optional, [key("base", ValueKind::Table, "motion of the base; fixed when left out")];
        FORCE: Optional, [key("force", ValueKind::Table, "force on the structure; a sine also beside a sine of the base, whose frequency it has")];
        MANY_PARTICLES: Optional, [key("many_particles", ValueKind::Table, "spheres in a box on the structure, in place of the other dampers")];
        INITIAL: Optional, [key("initial", ValueKind::Table, "initial displacements and velocities; at rest when left out")];
        RUN: Required, [key("run", ValueKind::Table, "duration and requested output, e.g. run = { duration_s = 10 }")];
    }

    "A fixed base."
    base_fixed("base", "fixed") {}

    "A sine: z = Z sin(Ωt + φ)."
    base_sine("base", "sine") {
        AMPLITUDE: UNLESS_STATED, [number("amplitude_m", NotNegative, "Z; or `base_amplitude_m` at the top of the case").usual(0.0, 0.05)];
        FREQUENCY: Required, [ANGULAR, HERTZ, FREQUENCY_RATIO];
        PHASE: Default(Number(0.0)), [number("phase_rad", Any, "φ")];
    }

    "A half sine: z = Z sin(πt/T), then 0."
    base_half_sine("base", "half_sine") {
        AMPLITUDE: UNLESS_STATED, [number("amplitude_m", Any, "Z; or `base_amplitude_m` at the top of the case").usual(-0.1, 0.1)];
        DURATION: Required, [number("duration_s", Positive, "T, the length of the pulse").usual(1e-3, 60.0)];
    }

    "A versine: z = Z/2 (1 − cos 2πt/T), then 0."
    base_versine("base", "versine") {
        AMPLITUDE: UNLESS_STATED, [number("amplitude_m", Any, "Z; or `base_amplitude_m` at the top of the case").usual(-0.1, 0.1)];
        DURATION: Required, [number("duration_s", Positive, "T, the length of the pulse").usual(1e-3, 60.0)];
    }

    "Samples of the base's motion: any sweep, sum of sines or shape, as a program computes it."
    base_samples("base", "samples") {
        VALUES: Required, [
            key("displacement_m", ValueKind::Numbers(Any), "z at each instant, joined by cubics; before the first one the base rests there, after the last one too"),
            key("acceleration_m_per_s2", ValueKind::Numbers(Any), "z″ at each instant, joined by lines; z starts from 0 at rest"),
        ];
        TIME_STEP: Required, [number("time_step_s", Positive, "time between two samples")];
    }

    "A harmonic force: P sin(Ωt + φ)."
    force_sine("force", "sine") {
        AMPLITUDE: Required, [number("amplitude_n", NotNegative, "P").usual(0.0, 1000.0)];
        FREQUENCY: RequiredUnless("a sine of the base gives it"), [ANGULAR, HERTZ, FREQUENCY_RATIO];
        PHASE: Default(Number(0.0)), [number("phase_rad", Any, "φ")];
        PLACE: Optional, [FORCE_PLACE[0], FORCE_PLACE[1]];
    }

    "A pulse of force: P sin(πt/T), then 0."
    force_half_sine("force", "half_sine") {
        AMPLITUDE: Required, [number("amplitude_n", Any, "P").usual(-1e4, 1e4)];
        DURATION: Required, [number("duration_s", Positive, "T, the length of the pulse").usual(1e-3, 60.0)];
        PLACE: Optional, [FORCE_PLACE[0], FORCE_PLACE[1]];
    }

    "Spheres of one size in a box on the structure: docs/PARTICLES.md."
    many_particles("many_particles") {
        COUNT: Required, [number("count", Whole(1.0, MAX_SPHERES as f64), "number of spheres; computing time grows with it")
                .usual(1.0, 5000.0)
                .note("more cannot be simulated in a useful time; take fewer and larger spheres of the same mass")];
        DIAMETER: Required, [number("diameter_m", Between(MIN_DIAMETER_M, MAX_DIAMETER_M), "diameter of the spheres")
                .usual(5e-4, 0.05)
                .note("smaller spheres stick to each other, which the model leaves out")];
        MASS: Required, [
            number("mass_kg", Positive, "m, the mass of all spheres together").usual(1e-3, 100.0),
            number("mass_ratio", Positive, "β = m/M, that mass over the structure's").usual(0.005, 0.5),
        ];
        RESTITUTION: Required, [
            number("restitution", Between(MIN_RESTITUTION, 1.0), "e of every contact, between spheres and with the box").usual(0.05, 0.98),
        ];
        FRICTION: Default(Number(0.0)), [
            number("friction_coefficient", NotNegative, "μ of every contact; with friction the spheres rotate").usual(0.0, 0.8),
        ];
        STIFFNESS: Required, [
            number("stiffness_n_per_m", Positive, "k, the contacts' stiffness: larger is harder and slower to compute").usual(100.0, 1e8),
            number("contact_time_s", Positive, "duration of an undamped contact of two spheres, which gives the stiffness").usual(1e-6, 0.01),
            number("youngs_modulus_pa", Positive, "E of spheres and box, with Hertz contacts in place of springs").usual(1e6, 1e12),
        ];
        POISSON_RATIO: If(&STIFFNESS, "youngs_modulus_pa", &Default(Number(0.3)), &Forbidden), [
            number("poisson_ratio", Between(0.0, 0.5), "ν of spheres and box, with `youngs_modulus_pa`").usual(0.1, 0.5),
        ];
        LENGTH: Required, [
            number("length_m", Above(0.0, MAX_SIDE_M), "inner length of the box, along the motion").usual(0.002, 1.0),
            number("clearance_m", Above(0.0, MAX_SIDE_M), "d, half the free travel: the length is 2d plus what the spheres take, packed in layers").usual(5e-4, 0.2),
        ];
        WIDTH: Required, [number("width_m", Above(0.0, MAX_SIDE_M), "inner width of the box, across the motion").usual(0.001, 1.0)];
        HEIGHT: Required, [number("height_m", Above(0.0, MAX_SIDE_M), "inner height of the box").usual(0.001, 1.0)];
        STEPS: Default(Number(25.0)), [
            number("steps_per_contact", Between(MIN_STEPS, 10_000.0), "steps of the shortest contact").usual(10.0, 500.0),
        ];
        SEED: Default(Number(1.0)), [number("seed", Whole(0.0, MAX_WHOLE), "of the spheres' places at the start")];
    }

    "Initial state, in the fixed frame."
    initial("initial") {
        X: Optional, [number("x_m", Any, "x; default: the initial z").usual(-0.5, 0.5)];
        V: Default(Number(0.0)), [number("v_m_per_s", Any, "x′").usual(-10.0, 10.0)];
        Y: Optional, [number("y_m", Any, "y of particle or tuned mass; default: x, for a particle plus its `start`").usual(-1.0, 1.0)];
        U: Optional, [number("u_m_per_s", Any, "y′; default: x′").usual(-10.0, 10.0)];
        MODE: Optional, [
            number("mode", Whole(1.0, MAX_MODES as f64), "on a structure with several modes: the mode in whose shape x and x′ are given; default: the first"),
        ];
    }

    "Duration and requested output of the run."
    run("run") {
        DURATION: RequiredUnless("the base follows a record, which has one"), [number("duration_s", Positive, "duration of the run; default with a record: that of the record").usual(0.01, 1e5)];
        SAMPLE_TIMES: Optional, [key("sample_times_s", ValueKind::Numbers(NotNegative), "times at which the state is output, rising")];
        CYCLE: Optional, [number("cycle_s", Positive, "length of a cycle; default under a sine: its period")];
        STEADY_FROM: Optional, [number("steady_from_cycle", Whole(0.0, MAX_WHOLE), "first cycle that counts as steady, from 0")];
    }
}
