//! Declares the keys of a set-up: name, type, range, default and meaning of each.

use std::f64::consts::FRAC_PI_2;

use damprig_core::control::friction_spring::SpringConfig;
use damprig_core::model::{DampingLaw, GRAVITY_M_PER_S2, Material, Tuning};

use crate::input::key::DefaultValue::{From, Number, Word};
use crate::input::key::Need::{Default, Forbidden, If, Optional, Required, RequiredUnless};
use crate::input::key::Range::{Any, Between, Inside, NotNegative, Positive};
use crate::input::key::{Key, KeyedQuantity, Table, ValueKind, key, names, number, tables, word};

const LAW_NAMES: &[&str] = names!(DampingLaw::ALL, law => law.name());

/// The key of a campaign or a case that names a set-up file.
pub(crate) const SET_UP_FILE: Key = key(
    "set_up_file",
    ValueKind::Text,
    "a file with tables of a set-up, for the keys that this file leaves out; relative to this file",
);

/// Tables of the wall at the positive side: those of `particle.wall`.
const POSITIVE_WALL: [Table; 4] = [
    positive(wall_restitution::TABLE),
    positive(wall_voigt::TABLE),
    positive(wall_hertz::TABLE),
    positive(wall_piezoelectric::TABLE),
];

const fn positive(table: Table) -> Table {
    Table { path: "particle.positive_wall", ..table }
}

/// Where a damper is mounted on a structure with several places.
pub(crate) const PLACE: [Key; 2] = [
    key("place", ValueKind::Text, "the place of a structure with several, by its name"),
    number("position_m", NotNegative, "the place on a beam, from its first support"),
];

/// The tables of a set-up, with all their keys.
pub const ALL_TABLES: &[Table] = &{
    let mut all = [POSITIVE_WALL[0]; TABLES.len() + POSITIVE_WALL.len()];
    let mut n = 0;
    while n < all.len() {
        all[n] = if n < TABLES.len() { TABLES[n] } else { POSITIVE_WALL[n - TABLES.len()] };
        n += 1;
    }
    all
};

/// The tables of a set-up, where each may be left out: at the top of a campaign for all its set-ups, and in a set-up file.
pub(crate) const PARTS: [KeyedQuantity; 4] = [
    set_up::STRUCTURE.optional(),
    set_up::PARTICLE.optional(),
    set_up::FRICTION_DAMPER.optional(),
    set_up::TMD.optional(),
];

tables! {
    "The tables of a set-up but those of the second wall."

    "What is mounted: at the top of a case, and in each `[[set_up]]` of a campaign."
    set_up("") {
        BASE_AMPLITUDE: Optional, [
            number("base_amplitude_m", Positive, "Z: what a campaign's sine and a case's base move by, and ratios refer to").usual(1e-5, 0.05),
        ];
        GRAVITY: Default(Number(GRAVITY_M_PER_S2)), [
            number("gravity_m_per_s2", NotNegative, "g in the weight of the particle, and so in the friction between particle and structure").usual(9.7, 9.9),
        ];
        STRUCTURE: RequiredUnless("the file of `set_up_file` has it"), [key("structure", ValueKind::Table, "the structure: mass, stiffness, damping")];
        PARTICLE: Optional, [key("particle", ValueKind::OneOrMoreTables, "the impact damper")];
        FRICTION_DAMPER: Optional, [key("friction_damper", ValueKind::OneOrMoreTables, "the friction damper, between structure and base")];
        TMD: If(&PARTICLE, "particle", &Forbidden, &Optional), [key("tmd", ValueKind::OneOrMoreTables, "the tuned mass damper")];
    }

    "The structure: a mass on a spring and a viscous damper."
    structure("structure") {
        MASS: Required, [number("mass_kg", Positive, "M, the structure's mass").usual(0.05, 1000.0)];
        STIFFNESS: Required, [
            number("natural_frequency_hz", Positive, "f_n = √(k/M)/2π, the undamped natural frequency").usual(0.2, 50.0),
            number("stiffness_n_per_m", Positive, "k, the spring's stiffness"),
        ];
        DAMPING: Required, [
            number("damping_ratio", NotNegative, "ζ = c/(2√(kM))").usual(0.0, 0.05),
            number("damping_n_s_per_m", NotNegative, "c, the viscous damping"),
        ];
    }

    "A single particle that slides between two walls on the structure."
    particle("particle") {
        MASS: Required, [
            number("mass_kg", Positive, "m, the particle's mass").usual(1e-3, 100.0),
            number("mass_ratio", Positive, "m/M, the particle's mass over the structure's").usual(0.005, 0.5),
        ];
        CLEARANCE: Required, [
            number("clearance_m", Positive, "d, half the free travel").usual(1e-4, 0.5),
            number("clearance_ratio", Positive, "d/Z, half the free travel over the base amplitude; over P/k of a force, over x0 of a free vibration").usual(0.5, 100.0),
        ];
        FRICTION: Default(Number(0.0)), [
            number("friction_coefficient", NotNegative, "μi of the dry friction between particle and structure").usual(0.0, 0.6),
        ];
        WALL: Required, [
            key("wall", ValueKind::Table, "both walls, e.g. wall = { kind = \"restitution\", coefficient = 0.5 }"),
        ];
        POSITIVE_WALL: Optional, [
            key("positive_wall", ValueKind::Table, "the wall at the positive side, where it differs from `wall`: all its keys"),
        ];
        OFFSET: Default(Number(0.0)), [
            number("offset_m", Any, "y − x in the middle between the walls: they are at y − x = offset ± d").usual(-0.5, 0.5),
        ];
        INCLINATION: Default(Number(0.0)), [
            number("inclination_deg", Between(-90.0, 90.0), "angle of the motion to the horizontal; above 0, +x and +y point upwards"),
        ];
        START: Default(Word("centre")), [
            word("start", &["centre", "at_negative_wall", "at_positive_wall", "unknown"], "where the particle starts in its cavity"),
            number("start_m", Any, "y − x at the start, within the clearance"),
        ];
        PLACE: Optional, [super::PLACE[0], super::PLACE[1]];
    }

    "A hard wall: an impact takes no time."
    wall_restitution("particle.wall", "restitution") {
        COEFFICIENT: Required, [
            number("coefficient", Between(0.0, 1.0), "e, the coefficient of restitution; with an exponent, that at the reference speed")
                .usual(0.05, 0.98),
            key("coefficients", ValueKind::Numbers(Between(0.0, 1.0)), "e at each of `speeds_m_per_s`, 2 to 6 numbers less than 1: linear in the approach speed between them, constant beyond"),
        ];
        SPEEDS: If(&COEFFICIENT, "coefficients", &Required, &Forbidden), [
            key("speeds_m_per_s", ValueKind::Numbers(Positive), "approach speeds of `coefficients`, rising").usual(0.001, 20.0),
        ];
        EXPONENT: If(&COEFFICIENT, "coefficients", &Forbidden, &Optional), [
            number("exponent", Between(0.0, 1.0), "p of e(v) = min(coefficient·(v/reference speed)^(−p), maximum), with the approach speed v; without it e is the same at every speed")
                .usual(0.0, 0.5),
        ];
        REFERENCE_SPEED: If(&EXPONENT, "exponent", &Required, &Forbidden), [
            number("reference_speed_m_per_s", Positive, "approach speed at which e is the coefficient").usual(0.01, 10.0),
        ];
        MAXIMUM: If(&EXPONENT, "exponent", &Required, &Forbidden), [
            number("maximum", Inside(0.0, 1.0), "largest e, that of slow impacts").usual(0.3, 0.98),
        ];
        CONTACT: Optional, [
            number("contact_time_s", Positive, "τ, the duration of a contact, from which the wall's force in a case follows; the motion does not depend on it")
                .usual(1e-5, 0.05),
            number("hertz_stiffness_n_per_m15", Positive, "k of an elastic contact of spheres, F = k·δ^(3/2), from which the wall's force in a case follows")
                .usual(1e5, 1e12),
        ];
        PULSE_FACTOR: If(&CONTACT, "contact_time_s", &Default(From(|| FRAC_PI_2)), &Forbidden), [
            number("pulse_factor", Between(1.0, 10.0), "peak of the contact's force times its duration over its impulse; π/2 of a half-sine"),
        ];
    }

    "A soft wall: a spring k1 and a dashpot c1 in parallel (Voigt)."
    wall_voigt("particle.wall", "voigt") {
        STIFFNESS: Required, [
            word("material", names!(Material::ALL, material => material.name()), "a measured pad: gives k1 and the loss factor"),
            number("stiffness_n_per_m", Positive, "k1, the wall's stiffness").usual(10.0, 1e7),
            number("storage_modulus_pa", Positive, "E_s of the pad: k1 = ν·E_s with the shape factor").usual(1e4, 1e10),
        ];
        SHAPE: If(&STIFFNESS, "storage_modulus_pa", &Required, &Forbidden), [
            number("shape_factor_m", Positive, "ν of the pad: k1 = ν·E_s needs both").usual(1e-5, 1.0),
        ];
        DAMPING: If(&STIFFNESS, "material", &Optional, &Required), [
            number("damping_n_s_per_m", NotNegative, "c1, the wall's viscous damping").usual(0.0, 1e4),
            number("loss_factor", NotNegative, "η of the pad: c1 follows by `law`").usual(0.005, 2.0),
        ];
        LAW: If(&DAMPING, "damping_n_s_per_m", &Forbidden, &Default(Word(LAW_NAMES[0]))), [
            word("law", LAW_NAMES, "the frequency at which c1 loses what η says: of the structure, or of the contact"),
        ];
        RELEASE: Required, [
            word("release", &["zero_penetration", "zero_force"], "when the contact ends"),
        ];
    }

    "A wall with Hertz contact and dissipation: F = k·δ^1.5·(1 + β·δ′), δ the penetration. Cases follow it, but those with one degree of freedom on a recorded motion; there, and in campaigns, a hard wall with the restitution of its free impacts acts in its place."
    wall_hertz("particle.wall", "hertz") {
        STIFFNESS: Required, [
            number("stiffness_n_per_m15", Positive, "k, the stiffness of the contact").usual(1e4, 1e12),
            number("youngs_modulus_pa", Positive, "E of the wall: k = 4/3·E*·√R with 1/E* = Σ(1 − ν²)/E of wall and particle").usual(1e5, 1e12),
        ];
        POISSON: If(&STIFFNESS, "youngs_modulus_pa", &Required, &Forbidden), [
            number("poisson_ratio", Inside(-1.0, 0.5001), "ν of the wall").usual(0.0, 0.5),
        ];
        RADIUS: If(&STIFFNESS, "youngs_modulus_pa", &Required, &Forbidden), [
            number("radius_m", Positive, "R of the particle where it touches the wall").usual(1e-4, 1.0),
        ];
        PARTICLE_MODULUS: If(&STIFFNESS, "youngs_modulus_pa", &Optional, &Forbidden), [
            number("particle_youngs_modulus_pa", Positive, "E of the particle; that of the wall unless given").usual(1e5, 1e12),
        ];
        PARTICLE_POISSON: If(&STIFFNESS, "youngs_modulus_pa", &Optional, &Forbidden), [
            number("particle_poisson_ratio", Inside(-1.0, 0.5001), "ν of the particle; that of the wall unless given").usual(0.0, 0.5),
        ];
        DISSIPATION: Required, [
            number("hunt_crossley_s_per_m", NotNegative, "α of Hunt and Crossley: β = 1.5·α; e is about 1 − α·v at slow impacts; 0: no loss").usual(0.0, 10.0),
            number("lankarani_nikravesh_coefficient", Between(0.0, 1.0), "e of Lankarani and Nikravesh: β = 0.75·(1 − e²)/v with the approach speed v of the contact").usual(0.1, 1.0),
        ];
    }

    "A wall that harvests, in a case: F = k·δ + θ·V with V = (θ·δ − Q)/C and R·Q′ = V, δ the penetration and Q the charge through its load. It has no mass."
    wall_piezoelectric("particle.wall", "piezoelectric") {
        STIFFNESS: Required, [
            number("stiffness_n_per_m", Positive, "k at short circuit").usual(1e3, 1e8),
        ];
        COUPLING: Required, [
            number("coupling_n_per_v", NotNegative, "θ, the force per voltage at rest").usual(1e-5, 1.0),
        ];
        CAPACITANCE: Required, [
            number("capacitance_f", Positive, "C of the wall that cannot move").usual(1e-11, 1e-5),
        ];
        LOAD: Required, [
            number("load_ohm", Positive, "R across its electrodes").usual(10.0, 1e9),
        ];
    }

    "A dry friction damper between structure and base."
    friction_damper("friction_damper") {
        FORCE: Required, [
            key("spring", ValueKind::Table, "a spring that the rig tunes presses the block"),
            number("force_n", NotNegative, "F, the friction force while slipping").usual(0.0, 1000.0),
            number("friction_ratio", NotNegative, "γF = F/(kZ), the friction force over stiffness times base amplitude")
                .usual(0.0, 2.0),
        ];
        PLACE: Optional, [super::PLACE[0], super::PLACE[1]];
        OTHER_PLACE: Optional, [
            key("other_place", ValueKind::Text, "the place of its other end, by its name; the base when left out"),
            number("other_position_m", NotNegative, "the place of its other end on a beam; the base when left out"),
        ];
    }

    "The friction damper's spring: what it is tuned to, and what is known of it."
    spring("friction_damper.spring") {
        TARGET: Required, [
            number("friction_ratio", NotNegative, "γF = μe·F_N/(kZ), kept while Z changes").usual(0.0, 2.0),
            number("normal_force_n", NotNegative, "F_N, the normal force").usual(0.0, 500.0),
            number("deflection_m", NotNegative, "Δs from the zero reading").usual(0.0, 0.05),
        ];
        FRICTION: Default(From(|| f64::from(SpringConfig::default().friction_coefficient))), [
            number("friction_coefficient", Positive, "μe between block and base").usual(0.05, 1.0),
        ];
        STIFFNESS: Default(From(|| f64::from(SpringConfig::default().stiffness_n_per_m))), [
            number("stiffness_n_per_m", Positive, "k_s as far as known: the rig measures it").usual(10.0, 1e5),
        ];
    }

    "A tuned mass damper: a mass on a spring and a dashpot from the structure."
    tmd("tmd") {
        MASS: Required, [
            number("mass_kg", Positive, "m, the damper's mass").usual(1e-3, 100.0),
            number("mass_ratio", Positive, "m/M, the damper's mass over the structure's").usual(0.005, 0.5),
        ];
        SPRING: Required, [
            word("tuning", names!(Tuning::ALL, tuning => tuning.name()), "the rule that gives spring and dashpot"),
            number("stiffness_n_per_m", Positive, "k1, the damper's stiffness"),
            number("frequency_ratio", Positive, "γ, the damper's own frequency over the structure's").usual(0.5, 2.0),
        ];
        DASHPOT: If(&SPRING, "tuning", &Forbidden, &Required), [
            number("damping_ratio", NotNegative, "ζ = c1/(2√(k1·m))").usual(0.0, 0.5),
            number("damping_n_s_per_m", NotNegative, "c1, the damper's viscous damping"),
        ];
        PLACE: Optional, [super::PLACE[0], super::PLACE[1]];
    }
}
