//! `[[set_up]]`: what is mounted on the shaker, and the base amplitude it is driven with.
//!
//! Clearance and friction may be given relative to the base amplitude Z (d/Z, F/(kZ)), as the literature
//! does; [`SetUpSpec`] keeps them as written, so that the same set-up can be looked at with another Z.

use std::f64::consts::TAU;

use damprig_core::control::friction_spring::SpringConfig;
use damprig_core::integrator::sampled::{LARGEST_RATE_PER_STEP, Sampled};
use damprig_core::model::{FrictionDamper, Particle, SetUp, Structure, Wall};
use damprig_core::rig::TICK_HZ;
use toml::de::DeTable;

use crate::input::{Problem, Section, Span};

/// A quantity given in its own unit, or relative to the base amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Relative {
    Absolute(f64),
    Ratio(f64),
}

/// Where the particle stands at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// Share of the clearance from the centre, −1 to 1.
    Share(f64),
    /// Distance from the centre, m.
    Metres(f64),
}

/// Steps that the simulation divides a tick into at most.
const MOST_STEPS_PER_TICK: f64 = 200.0;

#[derive(Clone, Copy, Debug, PartialEq)]
struct ParticleSpec {
    mass_kg: f64,
    clearance: Relative,
    friction_coefficient: f64,
    wall: Wall,
    place: Place,
}

/// What the friction damper's spring is set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpringTarget {
    /// γF = μe·F_N/(kZ), kept while Z changes.
    FrictionRatio(f64),
    /// F_N, N.
    NormalForce(f64),
    /// Δs from the zero reading, m.
    Deflection(f64),
}

/// A friction damper whose spring the rig tunes by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringSpec {
    /// What it is set to.
    pub target: SpringTarget,
    /// μe between block and structure; the board's unless stated.
    pub friction_coefficient: f64,
    /// k_s as far as known, N/m: the rig measures it; the board's unless stated.
    pub stiffness_n_per_m: f64,
    /// Whether the campaign states the friction coefficient, and whether the stiffness.
    states: [bool; 2],
}

impl SpringSpec {
    /// μe and k_s where the campaign states them.
    #[must_use]
    pub fn stated(&self) -> [Option<f64>; 2] {
        let [friction, stiffness] = self.states;
        [friction.then_some(self.friction_coefficient), stiffness.then_some(self.stiffness_n_per_m)]
    }

    /// The normal force that is wanted on a structure of this stiffness at base amplitude Z, N.
    #[must_use]
    pub fn normal_force_n(&self, structure_stiffness_n_per_m: f64, base_amplitude_m: f64) -> f64 {
        match self.target {
            SpringTarget::FrictionRatio(ratio) => {
                ratio * structure_stiffness_n_per_m * base_amplitude_m / self.friction_coefficient
            }
            SpringTarget::NormalForce(force) => force,
            SpringTarget::Deflection(deflection) => self.stiffness_n_per_m * deflection,
        }
    }
}

/// A set-up as written: some of it may scale with the base amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetUpSpec {
    structure: Structure,
    particle: Option<ParticleSpec>,
    friction: Option<Relative>,
    spring: Option<SpringSpec>,
    gravity_m_per_s2: f64,
}

impl SetUpSpec {
    /// Takes what the campaign does not state of the spring from the board's settings.
    pub(super) fn on_board(&mut self, board: &SpringConfig) {
        let Some(spring) = &mut self.spring else { return };
        let [friction, stiffness] = spring.stated();
        spring.friction_coefficient = friction.unwrap_or(f64::from(board.friction_coefficient));
        spring.stiffness_n_per_m = stiffness.unwrap_or(f64::from(board.stiffness_n_per_m));
    }

    /// The set-up in SI units at base amplitude Z, m.
    #[must_use]
    pub fn at(&self, base_amplitude_m: f64) -> SetUp {
        let particle = self.particle.map(|p| Particle {
            mass_kg: p.mass_kg,
            clearance_m: self.clearance(p, base_amplitude_m),
            friction_coefficient: p.friction_coefficient,
            wall: p.wall,
        });
        let friction_damper = self.friction.map(|f| FrictionDamper {
            force_n: match f {
                Relative::Absolute(force) => force,
                Relative::Ratio(ratio) => ratio * self.structure.stiffness_n_per_m * base_amplitude_m,
            },
        });
        let by_spring = self.spring.map(|spring| FrictionDamper {
            force_n: spring.friction_coefficient
                * spring.normal_force_n(self.structure.stiffness_n_per_m, base_amplitude_m),
        });
        SetUp {
            structure: self.structure,
            particle,
            friction_damper: by_spring.or(friction_damper),
            tmd: None,
            gravity_m_per_s2: self.gravity_m_per_s2,
        }
    }

    /// y − x at the start at base amplitude Z, m; 0 without a particle.
    #[must_use]
    pub fn particle_start_m(&self, base_amplitude_m: f64) -> f64 {
        self.particle.map_or(0.0, |p| match p.place {
            Place::Share(share) => share * self.clearance(p, base_amplitude_m),
            Place::Metres(start) => start,
        })
    }

    fn clearance(&self, particle: ParticleSpec, base_amplitude_m: f64) -> f64 {
        match particle.clearance {
            Relative::Absolute(clearance) => clearance,
            Relative::Ratio(ratio) => ratio * base_amplitude_m,
        }
    }
}

/// One set-up of a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct CampaignSetUp {
    /// What experiments call it.
    pub name: String,
    /// What figures and tables call it.
    pub label: String,
    /// As written.
    pub spec: SetUpSpec,
    /// Z, m; greater than 0.
    pub base_amplitude_m: f64,
    /// Where Z is written, for answers.
    pub base_amplitude_span: Span,
}

impl CampaignSetUp {
    /// The set-up in SI units.
    #[must_use]
    pub fn model(&self) -> SetUp {
        self.spec.at(self.base_amplitude_m)
    }

    /// y − x at the start, m; 0 without a particle.
    #[must_use]
    pub fn particle_start_m(&self) -> f64 {
        self.spec.particle_start_m(self.base_amplitude_m)
    }

    /// The friction damper's spring, where the rig tunes it.
    #[must_use]
    pub fn spring(&self) -> Option<SpringSpec> {
        self.spec.spring
    }

    /// d/Z; `None` without a particle.
    #[must_use]
    pub fn clearance_ratio(&self) -> Option<f64> {
        self.model().particle.map(|p| p.clearance_m / self.base_amplitude_m)
    }

    /// γ_F = F/(kZ); `None` without a friction damper.
    #[must_use]
    pub fn friction_ratio(&self) -> Option<f64> {
        let model = self.model();
        model.friction_damper.map(|d| d.force_n / (model.structure.stiffness_n_per_m * self.base_amplitude_m))
    }

    /// fn = √(k/M)/2π, Hz.
    #[must_use]
    pub fn natural_frequency_hz(&self) -> f64 {
        self.spec.structure.angular_frequency_rad_per_s() / std::f64::consts::TAU
    }
}

/// All `[[set_up]]` tables; `None` when a problem was noted in any.
pub(super) fn read_all(root: &Section) -> Option<Vec<CampaignSetUp>> {
    let defaults = Defaults {
        structure: root.raw_table("structure"),
        particle: root.raw_table("particle"),
        friction_damper: root.raw_table("friction_damper"),
        gravity: root.not_negative("gravity_m_per_s2").map(|n| n.value),
    };
    let sections = root.tables("set_up");
    if sections.is_empty() && root.source().is_clean() {
        root.source().report(Problem {
            title: "the campaign has no set-up".into(),
            span: 0..0,
            allowed: "give at least one `[[set_up]]`".into(),
            help: None,
        });
        return None;
    }
    let read: Vec<Option<CampaignSetUp>> = sections.into_iter().map(|s| read(s, &defaults)).collect();
    let mut names: Vec<&str> = Vec::new();
    for set_up in read.iter().flatten() {
        if names.contains(&set_up.name.as_str()) {
            root.source().report(Problem {
                title: format!("two set-ups are called {:?}", set_up.name),
                span: set_up.base_amplitude_span.clone(),
                allowed: "in this set-up; every set-up needs a name of its own".into(),
                help: None,
            });
        }
        names.push(&set_up.name);
    }
    read.into_iter().collect()
}

/// The tables at the top of the file that set-ups inherit from.
struct Defaults<'a> {
    structure: Option<&'a DeTable<'a>>,
    particle: Option<&'a DeTable<'a>>,
    friction_damper: Option<&'a DeTable<'a>>,
    gravity: Option<f64>,
}

fn read<'a>(section: Section<'a>, defaults: &Defaults<'a>) -> Option<CampaignSetUp> {
    let name = section.required("name", "a name for experiments to call it by", Section::text);
    let label = section.text("label");
    let amplitude = section.required("base_amplitude_m", "Z, the base amplitude in metres", Section::positive);
    let structure = read_structure(&section, defaults);
    let has_particle = section.has_own("particle");
    let particle = section
        .table("particle", defaults.particle)
        .and_then(|s| read_particle(s, structure.as_ref().map(|s| s.mass_kg), amplitude.as_ref().map(|n| n.value)));
    let has_friction = section.has_own("friction_damper");
    let friction = section.table("friction_damper", defaults.friction_damper).and_then(read_friction);
    section.finish();
    if (has_particle && particle.is_none()) || (has_friction && friction.is_none()) {
        return None;
    }
    let (name, amplitude) = (name?.value, amplitude?);
    let spec = SetUpSpec {
        structure: structure?,
        particle,
        friction: friction.and_then(Friction::constant),
        spring: friction.and_then(Friction::tuned),
        gravity_m_per_s2: defaults.gravity.unwrap_or(damprig_core::model::GRAVITY_M_PER_S2),
    };
    let label = label.map_or_else(|| name.clone(), |l| l.value);
    Some(CampaignSetUp { name, label, spec, base_amplitude_m: amplitude.value, base_amplitude_span: amplitude.span })
}

/// The set-up's own structure table, the one for all, or both.
fn read_structure<'a>(section: &Section<'a>, defaults: &Defaults<'a>) -> Option<Structure> {
    let table = match section.table("structure", defaults.structure) {
        Some(table) => table,
        None if section.has_own("structure") => return None,
        None => section.inherited_table("structure", defaults.structure).or_else(|| {
            section.lack("structure", "give `[structure]` once for all set-ups, or one for this set-up");
            None
        })?,
    };
    let mass = table.required("mass_kg", "the structure's mass", Section::positive);
    let stiffness = table.either(["natural_frequency_hz", "stiffness_n_per_m"], Section::positive);
    let damping = table.either(["damping_ratio", "damping_n_s_per_m"], Section::not_negative);
    table.finish();
    let (mass_kg, (which_stiffness, stiffness), (which_damping, damping)) = (mass?.value, stiffness?, damping?);
    let stiffness_n_per_m = match which_stiffness {
        0 => Structure::from_modal(mass_kg, stiffness.value, 0.0).stiffness_n_per_m,
        _ => stiffness.value,
    };
    let damping_n_s_per_m = match which_damping {
        0 => 2.0 * damping.value * (stiffness_n_per_m * mass_kg).sqrt(),
        _ => damping.value,
    };
    let structure = Structure { mass_kg, stiffness_n_per_m, damping_n_s_per_m };
    if Sampled::<f64>::steps_per_sample(&SetUp::bare(structure), 1.0 / f64::from(TICK_HZ)).is_err() {
        let key = ["natural_frequency_hz", "stiffness_n_per_m"][which_stiffness];
        let highest = LARGEST_RATE_PER_STEP * MOST_STEPS_PER_TICK * f64::from(TICK_HZ) / TAU;
        let allowed =
            format!("is too fast to simulate: natural frequency at most {highest:.0} Hz, c/M at most 2π times that");
        table.refuse(key, &stiffness.span, allowed, None);
        return None;
    }
    Some(structure)
}

fn read_particle(table: Section, structure_mass_kg: Option<f64>, amplitude: Option<f64>) -> Option<ParticleSpec> {
    const STARTS: [&str; 3] = ["centre", "at_negative_wall", "at_positive_wall"];
    let mass = table.either(["mass_kg", "mass_ratio"], Section::positive);
    let clearance = table.either(["clearance_m", "clearance_ratio"], Section::positive);
    let friction = table.not_negative("friction_coefficient");
    let wall = table
        .required("wall", "write wall = { kind = \"restitution\", coefficient = 0.5 }", |s, key| s.table(key, None));
    let wall = wall.and_then(read_wall);
    let start = table.choice("start", &STARTS);
    let start_m = table.number("start_m");
    if let (true, Some(n)) = (table.has_own("start"), &start_m) {
        table.refuse("start_m", &n.span, "`start` is given too", Some("leave out `start` or `start_m`".into()));
    }
    let clearance =
        clearance.map(|(which, n)| if which == 0 { Relative::Absolute(n.value) } else { Relative::Ratio(n.value) });
    if let (Some(n), Some(clearance), Some(amplitude)) = (&start_m, clearance, amplitude) {
        let room = match clearance {
            Relative::Absolute(d) => d,
            Relative::Ratio(ratio) => ratio * amplitude,
        };
        if n.value.abs() > room {
            table.refuse("start_m", &n.span, format!("must be within the clearance, −{room} to {room}"), None);
        }
    }
    table.finish();
    let (which_mass, mass) = mass?;
    Some(ParticleSpec {
        mass_kg: if which_mass == 0 { mass.value } else { mass.value * structure_mass_kg? },
        clearance: clearance?,
        friction_coefficient: friction.map_or(0.0, |n| n.value),
        wall: wall?,
        place: match (start_m, start) {
            (Some(n), _) => Place::Metres(n.value),
            (None, Some(1)) => Place::Share(-1.0),
            (None, Some(2)) => Place::Share(1.0),
            _ => Place::Share(0.0),
        },
    })
}

fn read_wall(table: Section) -> Option<Wall> {
    let kind = table.required("kind", "write kind = \"restitution\"", |s, key| s.choice(key, &["restitution"]));
    let from_0_to_1 = |s: &Section, key| s.number_if(key, |v| (0.0..=1.0).contains(&v), "from 0 to 1");
    let coefficient = table.required("coefficient", "e, the coefficient of restitution", from_0_to_1);
    table.finish();
    kind?;
    Some(Wall::Restitution { coefficient: coefficient?.value })
}

/// A friction damper of constant force, or one whose spring the rig tunes.
#[derive(Clone, Copy)]
enum Friction {
    Constant(Relative),
    Tuned(SpringSpec),
}

impl Friction {
    fn constant(self) -> Option<Relative> {
        if let Self::Constant(force) = self { Some(force) } else { None }
    }

    fn tuned(self) -> Option<SpringSpec> {
        if let Self::Tuned(spring) = self { Some(spring) } else { None }
    }
}

fn read_friction(table: Section) -> Option<Friction> {
    if !table.has_own("spring") {
        let force = table.either(["force_n", "friction_ratio"], Section::not_negative);
        table.finish();
        let (which, force) = force?;
        let force = if which == 0 { Relative::Absolute(force.value) } else { Relative::Ratio(force.value) };
        return Some(Friction::Constant(force));
    }
    for key in ["force_n", "friction_ratio"] {
        if let Some(force) = table.number(key) {
            let help = Some(format!("leave out `{key}`, or put it into `spring` to have the rig tune it"));
            table.refuse(key, &force.span, "`spring` is given too, and gives the force", help);
        }
    }
    let spring = table.table("spring", None).and_then(read_spring);
    table.finish();
    spring.map(Friction::Tuned)
}

/// One target, and what is known of the spring.
fn read_spring(table: Section) -> Option<SpringSpec> {
    const KEYS: [&str; 3] = ["friction_ratio", "normal_force_n", "deflection_m"];
    let given: Vec<_> = KEYS.iter().filter_map(|key| table.not_negative(key).map(|number| (*key, number))).collect();
    let default = SpringConfig::default();
    let friction = table.positive("friction_coefficient");
    let stiffness = table.positive("stiffness_n_per_m");
    if let [_, (key, number), ..] = &given[..] {
        let help = Some(format!("leave one of `{}` and `{key}` out", given[0].0));
        table.refuse(key, &number.span, "a spring has one target", help);
        table.finish();
        return None;
    }
    if given.is_empty() && KEYS.iter().all(|key| !table.has_own(key)) {
        table.lack(KEYS[0], "give `friction_ratio`, `normal_force_n` or `deflection_m`");
    }
    table.finish();
    let (key, number) = given.into_iter().next()?;
    Some(SpringSpec {
        target: match key {
            "friction_ratio" => SpringTarget::FrictionRatio(number.value),
            "normal_force_n" => SpringTarget::NormalForce(number.value),
            _ => SpringTarget::Deflection(number.value),
        },
        states: [friction.is_some(), stiffness.is_some()],
        friction_coefficient: friction.map_or(f64::from(default.friction_coefficient), |n| n.value),
        stiffness_n_per_m: stiffness.map_or(f64::from(default.stiffness_n_per_m), |n| n.value),
    })
}
