//! `[[set_up]]`: a set-up with its name and base amplitude. Its other keys are read by [`crate::setup`].

use std::sync::Arc;

use damprig_core::io::TICK_HZ;
use damprig_core::model::{Particle, SetUp};
use damprig_motion::rig_model::RigModel;
use toml::de::DeTable;

use super::keys::{campaign, set_up};
use super::plant::{Plant, SetUpPlant};
use super::transient::two_digits_down;
use crate::input::locate::PathStep::Key;
use crate::input::{Problem, Section, Source, Span};
use crate::setup::{self, BaseAmplitude, Carrier, DamperPlaces, PARTS, SetUpSpec, SharedKeys, SpringSpec};

const FORCE_AMPLITUDE: &str = set_up::BASE_AMPLITUDE.keys[1].name;

/// The table of a case that a campaign does not have.
const MANY_PARTICLES: &str = "many_particles";

/// Starts of a particle that may start anywhere, as shares of the clearance from the centre.
const UNKNOWN_STARTS: [f64; 5] = [0.0, -1.0, -0.5, 0.5, 1.0];

/// One set-up of a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct CampaignSetUp {
    /// Its name in experiments.
    pub name: String,
    /// Its name in figures and tables.
    pub label: String,
    /// What a person does before it is measured.
    pub instruction: Option<String>,
    /// As written.
    pub spec: SetUpSpec,
    /// Z, m; greater than 0. With a force drive P/k.
    pub base_amplitude_m: f64,
    /// Where Z or P is written, for messages.
    pub base_amplitude_span: Span,
    /// It has a damper that damprig has no equations for (`damper = "unmodelled"`); the model is that of the bare structure.
    pub has_unmodelled_damper: bool,
    /// Whether its motion is predicted: not with an unmodelled damper, except on a simulated rig, where the bare structure moves. The
    /// base's motion always is.
    pub is_predicted: bool,
    /// The structure with several places that carries its dampers on a virtual rig and in predictions.
    pub plant: Option<SetUpPlant>,
}

impl CampaignSetUp {
    /// What moves on a virtual rig, and in predictions.
    #[must_use]
    pub fn rig_model(&self) -> RigModel {
        self.rig_model_at(self.base_amplitude_m)
    }

    /// The same at another base amplitude, m.
    #[must_use]
    pub fn rig_model_at(&self, base_amplitude_m: f64) -> RigModel {
        let placed = self.plant.as_ref().map(|plant| Arc::clone(&plant.placed));
        RigModel { set_up: self.model_at(base_amplitude_m), placed }
    }

    /// The set-up that the rig's twin follows, in SI units, and what moves without a plant: walls with Hertz contact as hard ones.
    #[must_use]
    pub fn model(&self) -> SetUp {
        self.model_at(self.base_amplitude_m)
    }

    /// The same at another base amplitude, m.
    #[must_use]
    pub fn model_at(&self, base_amplitude_m: f64) -> SetUp {
        self.spec.at(base_amplitude_m).without_hertz()
    }

    /// Its particle as stated: walls with Hertz contact are such.
    #[must_use]
    pub fn stated_particle(&self) -> Option<Particle> {
        self.spec.at(self.base_amplitude_m).particle
    }

    /// What acts in place of its walls with Hertz contact; `None` without one.
    #[must_use]
    pub fn hertz_as_hard(&self) -> Option<String> {
        let walls = self.stated_particle().map_or([None; 2], |particle| particle.walls().map(|wall| wall.hertz()));
        setup::hertz_as_hard(walls.into_iter().flatten())
    }

    /// What moves on a virtual rig and in predictions otherwise than the board knows it; `None` without a plant.
    #[must_use]
    pub fn moves_as_plant(&self) -> Option<String> {
        let plant = self.plant.as_ref()?;
        let structure = self.model().structure;
        Some(format!(
            "a {} moves; the board, equivalent fn and ζ, and decrements take it for one degree of freedom of {:.4} kg, {:.4} Hz and ζ = {:.5}",
            plant.in_words,
            structure.mass_kg,
            self.natural_frequency_hz(),
            structure.damping_ratio()
        ))
    }

    /// P, N, if a force drives the structure.
    #[must_use]
    pub fn force_amplitude_n(&self) -> Option<f64> {
        let model = self.model();
        model.is_force_driven.then_some(model.structure.stiffness_n_per_m * self.base_amplitude_m)
    }

    /// The key that states its amplitude.
    #[must_use]
    pub fn amplitude_key(&self) -> &'static str {
        if self.model().is_force_driven { FORCE_AMPLITUDE } else { set_up::BASE_AMPLITUDE.name() }
    }

    /// The value of that key for this Z or less, with two digits.
    #[must_use]
    pub fn amplitude_for(&self, base_amplitude_m: f64) -> f64 {
        let share = base_amplitude_m / self.base_amplitude_m;
        two_digits_down(self.force_amplitude_n().map_or(base_amplitude_m, |force_n| force_n * share))
    }

    /// Whether it may have impacts: with a particle, or a damper without a model.
    #[must_use]
    pub fn may_have_impacts(&self) -> bool {
        self.has_unmodelled_damper || self.model().particle.is_some()
    }

    /// The set-up with each start of its particle that a prediction takes: the stated one, or several between the walls where it is not
    /// known.
    #[must_use]
    pub fn starts(&self) -> Vec<Self> {
        if !self.spec.is_start_unknown() {
            return vec![self.clone()];
        }
        UNKNOWN_STARTS.iter().map(|share| Self { spec: self.spec.starting_at(*share), ..self.clone() }).collect()
    }

    /// y − x at the start, m; 0 without a particle, and where it is not known.
    #[must_use]
    pub fn particle_start_m(&self) -> f64 {
        self.spec.particle_start_m(self.base_amplitude_m)
    }

    /// The friction damper's spring, if the rig adjusts it.
    #[must_use]
    pub fn spring(&self) -> Option<SpringSpec> {
        self.spec.spring()
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
        self.model().structure.angular_frequency_rad_per_s() / std::f64::consts::TAU
    }
}

/// Leaves the set-ups, and what completes them, unread.
pub(super) fn leave_all(root: &Section) {
    [&campaign::SET_UP, &campaign::GRAVITY].into_iter().chain(&PARTS).for_each(|quantity| root.leave(quantity));
}

/// All `[[set_up]]` tables, completed by those of a set-up file; `None` when any has a problem.
pub(super) fn read_all<'a>(
    root: &Section<'a>,
    file: Option<&DeTable<'a>>,
    mut plant: Option<&mut Plant>,
) -> Option<Vec<CampaignSetUp>> {
    let shared = SharedKeys::of(root, file);
    let sections = root.tables_of(&campaign::SET_UP);
    if sections.is_empty() && root.source().is_clean() {
        let is_case = root.source().locate(&[Key("run")]).is_some();
        root.source().report(Problem {
            title: "the campaign has no set-up".into(),
            span: 0..0,
            allowed: "give at least one `[[set_up]]`".into(),
            help: is_case.then(|| format!("a file with `run` is a case: damprig simulate {}", root.source().name())),
        });
        return None;
    }
    let all = sections.iter().map(|section| read(section, &shared, plant.as_deref_mut()));
    let all: Vec<Option<(CampaignSetUp, DamperPlaces)>> = all.collect();
    let with_plant = |(own, at): (CampaignSetUp, DamperPlaces)| CampaignSetUp {
        plant: plant.as_ref().and_then(|plant| plant.under(&at)),
        ..own
    };
    let read: Vec<Option<CampaignSetUp>> = all.into_iter().map(|own| own.map(with_plant)).collect();
    let mut names: Vec<&str> = Vec::new();
    for set_up in read.iter().flatten() {
        if names.contains(&set_up.name.as_str()) {
            root.source().report(Problem {
                title: format!("two set-ups have the name {:?}", set_up.name),
                span: set_up.base_amplitude_span.clone(),
                allowed: "in this set-up; every set-up needs a name of its own".into(),
                help: None,
            });
        }
        names.push(&set_up.name);
    }
    read.into_iter().collect()
}

fn read<'a>(
    section: &Section<'a>,
    shared: &'a SharedKeys<'a>,
    plant: Option<&mut Plant>,
) -> Option<(CampaignSetUp, DamperPlaces)> {
    let name = section.text_of(&set_up::NAME);
    let label = section.text_of(&set_up::LABEL);
    let instruction = section.text_of(&set_up::INSTRUCTION).map(|text| text.value);
    let amplitude = section.placed(&set_up::BASE_AMPLITUDE);
    let is_force = section.written(&set_up::BASE_AMPLITUDE).is_some_and(|key| key.name == FORCE_AMPLITUDE);
    let base = match &amplitude {
        Some(amplitude) if is_force => BaseAmplitude::Force(amplitude.value),
        Some(amplitude) => BaseAmplitude::Is(amplitude.value),
        None => BaseAmplitude::Unread,
    };
    if section.has_own(MANY_PARTICLES) {
        let help = "write damper = \"unmodelled\" to measure one; `damprig simulate` and `damprig study` compute it";
        let allowed = "is for cases: the simulated plant and the predictions of a campaign have no spheres";
        section.reject(MANY_PARTICLES, allowed, Some(help.into()));
    }
    let mut carrier = plant.map(|plant| Carrier {
        places: &mut plant.places,
        structure: plant.structure,
        at: DamperPlaces::default(),
    });
    let spec = setup::read(section, shared, base, Some(1.0 / f64::from(TICK_HZ)), carrier.as_mut());
    let at = carrier.map_or(DamperPlaces::default(), |carrier| carrier.at);
    let has_unmodelled_damper = section.word(&set_up::DAMPER).is_some();
    if has_unmodelled_damper && let Some(modelled) = spec.as_ref().and_then(SetUpSpec::damper) {
        let unmodelled = set_up::DAMPER.name();
        let help = Some(format!("leave out `{unmodelled}` or `{modelled}`"));
        section.reject(unmodelled, format!("means a damper without a model; `{modelled}` gives one"), help);
        return None;
    }
    if spec.as_ref().is_some_and(SetUpSpec::harvests) {
        let allowed = "has a piezoelectric wall, which is for cases: the simulated plant has none";
        let help = "write damper = \"unmodelled\" to measure one; `damprig simulate` and `damprig study` compute it";
        section.reject(set_up::PARTICLE.name(), allowed, Some(help.into()));
        return None;
    }
    section.finish();
    let (name, amplitude, spec) = (name?.value, amplitude?, spec?);
    let base_amplitude_m = if is_force { spec.static_deflection_m(amplitude.value) } else { amplitude.value };
    let own = CampaignSetUp {
        label: label.map_or_else(|| name.clone(), |label| label.value),
        name,
        instruction,
        spec,
        base_amplitude_m,
        base_amplitude_span: amplitude.span,
        has_unmodelled_damper,
        is_predicted: !has_unmodelled_damper,
        plant: None,
    };
    Some((own, at))
}

/// Refuses set-ups with a force drive on a rig whose base moves, as the campaign's `table` has it in words.
pub(super) fn refuse_forces(source: &Source, set_ups: &[CampaignSetUp], (table, words): (&str, &str)) {
    for set_up in set_ups.iter().filter(|set_up| set_up.model().is_force_driven) {
        source.report(Problem {
            title: format!("set-up {:?} is driven by a force, and `[{table}]` {words}", set_up.name),
            span: set_up.base_amplitude_span.clone(),
            allowed: "one of both".into(),
            help: Some(format!("leave out `[{table}]`, or give base_amplitude_m")),
        });
    }
}
