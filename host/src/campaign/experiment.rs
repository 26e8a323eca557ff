//! `[[experiment]]`: keys that all kinds of experiments share. The kinds are read by [`super::stepped_sine`] and
//! [`super::transient`].

use damprig_core::control::stepped_sine::FADE_S;
use damprig_core::control::transient as core_transient;
use damprig_core::io::TICK_HZ;
use damprig_core::model::Structure;

use super::keys::{campaign, experiment};
use super::playback;
use super::stepped_sine::{self, PointStart, SteppedSine, TrackedResonance, kept_in_words};
use super::transient::{self, FreeVibration, Playback};
use super::{AroundPeak, CampaignSetUp, Plan, RigSettings};
use crate::input::{Problem, Section, Text, listed, near};

/// An experiment on some of the set-ups.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Name, for tables.
    pub name: String,
    /// Number of its `[[experiment]]` in the campaign, from 1, the same for all of its repeats.
    pub number: usize,
    /// Its name as written, the same for all of its sheets and repeats.
    pub written: String,
    /// Its name with the amplitude of its sheet where it has several; the same for all of its repeats.
    pub series: String,
    /// Which of its repeats it is, from 0.
    pub repeat: u32,
    /// Positions of the set-ups in the campaign.
    pub set_ups: Vec<usize>,
    /// What a person does before it.
    pub instruction: Option<String>,
    /// Its kind, with its parameters.
    pub kind: ExperimentKind,
}

/// The kinds of experiments.
#[derive(Clone, Debug, PartialEq)]
pub enum ExperimentKind {
    /// One frequency after another.
    SteppedSine(SteppedSine),
    /// The base follows a record or a pulse.
    Playback(Playback),
    /// The structure is held and released.
    FreeVibration(FreeVibration),
}

/// Time between two points from rest: the drive fades (without a ramp), the rest level holds.
const REST_S: f64 = 0.7;

impl Experiment {
    /// The stepped sine, if it is one.
    #[must_use]
    pub fn stepped_sine(&self) -> Option<&SteppedSine> {
        if let ExperimentKind::SteppedSine(sine) = &self.kind { Some(sine) } else { None }
    }

    /// The stepped sine that drives the base at known frequencies, if it is one.
    #[must_use]
    pub fn base_driven(&self) -> Option<&SteppedSine> {
        self.stepped_sine().filter(|sine| sine.response_loop().is_none() && sine.tracked.is_none())
    }

    /// The stepped sine that keeps the response at known frequencies, if it is one.
    #[must_use]
    pub fn response_controlled(&self) -> Option<&SteppedSine> {
        self.stepped_sine().filter(|sine| sine.response_loop().is_some() && sine.tracked.is_none())
    }

    /// The stepped sine that follows a resonance, if it is one, with what it follows.
    #[must_use]
    pub fn tracking(&self) -> Option<(&SteppedSine, &TrackedResonance)> {
        self.stepped_sine().and_then(|sine| Some((sine, sine.tracked.as_ref()?)))
    }

    /// The stepped sine whose frequency or base the controller's loops find, if it is one.
    #[must_use]
    pub fn led_by_loops(&self) -> Option<&SteppedSine> {
        self.stepped_sine().filter(|sine| sine.response_loop().is_some() || sine.tracked.is_some())
    }

    /// The playback, if it is one.
    #[must_use]
    pub fn playback(&self) -> Option<&Playback> {
        if let ExperimentKind::Playback(playback) = &self.kind { Some(playback) } else { None }
    }

    /// The free vibration, if it is one.
    #[must_use]
    pub fn free_vibration(&self) -> Option<&FreeVibration> {
        if let ExperimentKind::FreeVibration(free) = &self.kind { Some(free) } else { None }
    }

    /// |x| below which the structure counts as at rest before the experiment, m; none of a free vibration, in which a person holds
    /// the structure deflected.
    #[must_use]
    pub fn rest_level_m(&self) -> Option<f64> {
        match &self.kind {
            ExperimentKind::SteppedSine(sine) => Some(sine.rest_level_m),
            ExperimentKind::Playback(playback) => Some(playback.rest_level_m),
            ExperimentKind::FreeVibration(_) => None,
        }
    }

    /// The known drive frequencies in order, Hz; none unless it is a stepped sine, and none of a tracked resonance.
    #[must_use]
    pub fn frequencies_hz(&self) -> &[f64] {
        self.stepped_sine().map_or(&[], |sine| &sine.frequencies_hz)
    }

    /// The drive frequency of a point, Hz; 0 where there is none, or it is not known before.
    #[must_use]
    pub fn frequency_hz(&self, index: usize) -> f64 {
        self.frequencies_hz().get(index).copied().unwrap_or(0.0)
    }

    /// Points on each set-up: each has a result of its own. Those around the peak count although their frequencies are not known.
    #[must_use]
    pub fn points(&self) -> usize {
        self.known_points() + self.peak_points()
    }

    /// Points that are known before the experiment begins.
    #[must_use]
    pub fn known_points(&self) -> usize {
        self.stepped_sine().map_or(1, SteppedSine::known_points)
    }

    /// Points around the peak that follow when the others are measured.
    #[must_use]
    pub fn peak_points(&self) -> usize {
        self.stepped_sine().map_or(0, SteppedSine::peak_points)
    }

    /// Whether these can be its points around the peak: not more than it has, and within its grid.
    #[must_use]
    pub fn can_have_around_peak(&self, around: &AroundPeak) -> bool {
        let lowest = self.frequencies_hz().iter().copied().fold(f64::INFINITY, f64::min);
        let highest = self.frequencies_hz().iter().copied().fold(0.0, f64::max);
        let is_within = |f: &f64| lowest < *f && *f < highest;
        self.peak_points() > 0
            && around.frequencies_hz.len() <= self.peak_points()
            && around.frequencies_hz.iter().all(is_within)
    }

    /// The experiment with these points around its peak at the end of its list; no more follow. Unchanged unless it is a stepped sine.
    #[must_use]
    pub fn with_points_around_peak(&self, around: &AroundPeak) -> Self {
        let mut whole = self.clone();
        if let ExperimentKind::SteppedSine(sine) = &mut whole.kind {
            sine.frequencies_hz.extend(&around.frequencies_hz);
            sine.peak_order.clear();
        }
        whole
    }

    /// Whether each point continues the motion of the one before: after an interruption it starts from its beginning.
    #[must_use]
    pub fn carries_over(&self) -> bool {
        self.stepped_sine().is_some_and(|sine| sine.start == PointStart::CarryOver)
    }

    /// Rig time on one set-up if every point is measured again as often as it may be until it is steady, s; otherwise as
    /// [`Self::expected_s`].
    #[must_use]
    pub fn longest_s(&self) -> f64 {
        let repeated = |sine: &SteppedSine| self.points() as f64 * (sine.longest_dwell_s() - sine.dwell_s);
        self.expected_s() + self.stepped_sine().map_or(0.0, repeated)
    }

    /// Rig time on one set-up with one dwell for each point, without waiting for rest or for a closed loop, s.
    #[must_use]
    pub fn expected_s(&self) -> f64 {
        let seconds = |ticks: u64| ticks as f64 / f64::from(TICK_HZ);
        match &self.kind {
            ExperimentKind::SteppedSine(e) => {
                let is_from_rest = e.start == PointStart::FromRest;
                let rest_s = if is_from_rest { REST_S + (e.ramp_s - f64::from(FADE_S)).max(0.0) } else { 0.0 };
                self.points() as f64 * (rest_s + e.settle_s + e.dwell_s)
            }
            ExperimentKind::Playback(playback) => seconds(playback.order().expected_ticks()),
            ExperimentKind::FreeVibration(free) => {
                seconds(core_transient::FreeVibration::expected_ticks(&free.order()))
            }
        }
    }
}

/// All `[[experiment]]` tables, each as often as it is repeated; the other parts of the campaign are `None` when they could not be read.
pub(super) fn read_all(
    root: &Section,
    set_ups: Option<&[CampaignSetUp]>,
    rig: Option<&RigSettings>,
    plan: Option<&Plan>,
) -> Option<Vec<Experiment>> {
    let sections = root.tables_of(&campaign::EXPERIMENT);
    if sections.is_empty() && root.source().is_clean() {
        root.source().report(Problem {
            title: "the campaign has no experiment".into(),
            span: 0..0,
            allowed: "give at least one `[[experiment]]`".into(),
            help: None,
        });
        return None;
    }
    let mut names = Vec::new();
    // All are read, so that one answer has the problems of all.
    let read: Vec<Option<Vec<(Experiment, usize)>>> =
        sections.into_iter().enumerate().map(|(i, s)| read(s, i, &mut names, set_ups, rig)).collect();
    let read: Vec<(Experiment, usize)> = read.into_iter().collect::<Option<Vec<_>>>()?.concat();
    let plan = plan?;
    let mut all = Vec::new();
    for (experiment, repeats) in read {
        for (repeat, name) in repeat_names(&experiment.series, repeats).into_iter().enumerate() {
            let mut one = Experiment { repeat: repeat as u32, name, ..experiment.clone() };
            if let ExperimentKind::SteppedSine(sine) = &mut one.kind
                && sine.start == PointStart::FromRest
            {
                plan.order(&mut sine.frequencies_hz, FREQUENCIES_PLACE + all.len() as u64);
                if let Some(tracked) = &mut sine.tracked {
                    plan.order(&mut tracked.amplitudes, FREQUENCIES_PLACE + all.len() as u64);
                }
                plan.order(&mut sine.peak_order, PEAKS_PLACE + all.len() as u64);
            }
            all.push(one);
        }
    }
    Some(all)
}

/// Where the orders of frequencies begin among those of a campaign: after its set-ups.
const FREQUENCIES_PLACE: u64 = 1 << 16;

/// Where those of the points around peaks begin.
const PEAKS_PLACE: u64 = 1 << 24;

/// Name of the `[[experiment]]` of this number, from 1, if it has none of its own.
pub(crate) fn default_name(number: usize) -> String {
    format!("experiment {number}")
}

/// Names of the repeats of an experiment.
pub(crate) fn repeat_names(series: &str, repeats: usize) -> Vec<String> {
    if repeats > 1 {
        (1..=repeats).map(|repeat| format!("{series} {repeat} of {repeats}")).collect()
    } else {
        vec![series.to_string()]
    }
}

fn read(
    section: Section,
    index: usize,
    names: &mut Vec<String>,
    set_ups: Option<&[CampaignSetUp]>,
    rig: Option<&RigSettings>,
) -> Option<Vec<(Experiment, usize)>> {
    let own = section.text_of(&experiment::NAME);
    let number = index + 1;
    let name = own.as_ref().map_or_else(|| default_name(number), |t| t.value.clone());
    let name_span = own.map_or(section.span(), |text| text.span);
    let repeats = section.scalar(&experiment::REPEATS).map(|repeats| repeats as usize);
    let instruction = section.text_of(&experiment::INSTRUCTION).map(|text| text.value);
    let own_names = repeat_names(&name, repeats.unwrap_or(1));
    if own_names.iter().any(|name| names.contains(name)) {
        let help = Some("give each experiment a name of its own: tables and --resume tell them apart by it".into());
        section.refuse("name", &name_span, "is the name of an earlier experiment", help);
    }
    names.extend(own_names);
    let kind = section.word(&experiment::KIND);
    let wanted = section.texts_of(&experiment::SET_UPS);
    let chosen = set_ups.and_then(|set_ups| choose(&section, wanted.as_deref(), set_ups));
    if kind.is_none() && section.is_given(&experiment::KIND) {
        // Its kind, and so its keys, are unknown.
        return None;
    }
    let structures = structures(chosen.as_deref(), set_ups);
    let read: Option<Vec<ExperimentKind>> = match kind {
        Some(1) => playback::read(&section, number).map(|own| vec![ExperimentKind::Playback(own)]),
        Some(2) => transient::impulse(&section).map(|own| vec![ExperimentKind::Playback(own)]),
        Some(3) => transient::free_vibration(&section, rig).map(|own| vec![ExperimentKind::FreeVibration(own)]),
        Some(4) => stepped_sine::read_response_controlled(&section, rig, &structures)
            .map(|all| all.into_iter().map(ExperimentKind::SteppedSine).collect()),
        Some(5) => stepped_sine::read_tracking(&section, rig).map(|own| vec![ExperimentKind::SteppedSine(own)]),
        // Without a kind, the keys of the most frequent one are checked.
        _ => stepped_sine::read(&section, rig, &structures).map(|own| vec![ExperimentKind::SteppedSine(own)]),
    };
    if let (Some(1 | 2 | 4 | 5), Some(chosen), Some(set_ups)) = (kind, &chosen, set_ups)
        && let Some(forced) = chosen.iter().map(|&place| &set_ups[place]).find(|s| s.model().is_force_driven)
    {
        let allowed = format!("moves the base, and set-up {:?} is driven by a force over a fixed base", forced.name);
        section.reject("kind", allowed, Some("name other set-ups in `set_ups`, or give it base_amplitude_m".into()));
    }
    section.finish();
    kind?;
    let (read, repeats, set_ups) = (read?, repeats?, chosen?);
    let is_one = read.len() == 1;
    let of = |kind: ExperimentKind| {
        let sheet = match &kind {
            ExperimentKind::SteppedSine(sine) if !is_one => sine.response_loop(),
            _ => None,
        };
        let series = sheet.map_or_else(|| name.clone(), |own| format!("{name}, {}", kept_in_words(&own.response)));
        let (written, set_ups, instruction) = (name.clone(), set_ups.clone(), instruction.clone());
        let one = Experiment { number, written, name: series.clone(), series, repeat: 0, set_ups, instruction, kind };
        (one, repeats)
    };
    let all: Vec<(Experiment, usize)> = read.into_iter().map(of).collect();
    if !is_one {
        let own_names: Vec<String> =
            all.iter().flat_map(|(one, repeats)| repeat_names(&one.series, *repeats)).collect();
        if let Some(taken) = own_names.iter().find(|name| names.contains(name)) {
            let allowed = format!("gives a sheet the name {taken:?}, which is that of an earlier experiment");
            section.refuse("name", &name_span, allowed, Some("give each experiment a name of its own".into()));
            return None;
        }
        names.extend(own_names);
    }
    Some(all)
}

/// The structures of the set-ups at these positions.
fn structures(chosen: Option<&[usize]>, set_ups: Option<&[CampaignSetUp]>) -> Vec<Structure> {
    let (Some(chosen), Some(set_ups)) = (chosen, set_ups) else { return Vec::new() };
    chosen.iter().map(|&place| set_ups[place].model().structure).collect()
}

/// The set-ups that the experiment names; all of them when it names none.
fn choose(section: &Section, wanted: Option<&[Text]>, set_ups: &[CampaignSetUp]) -> Option<Vec<usize>> {
    let Some(wanted) = wanted else {
        return (!section.is_given(&experiment::SET_UPS)).then(|| (0..set_ups.len()).collect());
    };
    let names: Vec<&str> = set_ups.iter().map(|s| s.name.as_str()).collect();
    let mut chosen = Vec::new();
    for text in wanted {
        match names.iter().position(|n| *n == text.value) {
            Some(index) if chosen.contains(&index) => {
                section.refuse("set_ups", &text.span, "is named twice", None);
                return None;
            }
            Some(index) => chosen.push(index),
            None => {
                let help = near(&text.value, names.iter().copied()).first().map(|n| format!("did you mean {n:?}?"));
                section.source().report(Problem {
                    title: format!("`{}` names an unknown set-up {:?}", section.full("set_ups"), text.value),
                    span: text.span.clone(),
                    allowed: format!("the set-ups are {}", listed(names.iter().copied())),
                    help,
                });
                return None;
            }
        }
    }
    if chosen.is_empty() {
        let help = Some("leave out `set_ups` to run all".into());
        section.refuse("set_ups", &section.span(), "must name at least one set-up", help);
        return None;
    }
    Some(chosen)
}
