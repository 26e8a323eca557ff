//! What becomes of nominal values: each variable lies anywhere within its tolerance, and what is uncertain has any of its values. Some of
//! that is simulated, as here.
//!
//! A scenario has a place for each variable, from −1 to 1 of its tolerance, and one for each uncertain key, from 0 to 1 of its range (for a mean
//! or a quantile: of its probability).

use super::file::Optimisation;
use crate::study::axis::AxisValues;
use crate::study::over::Over;
use crate::study::sampling::{Sampling, SamplingMethod};

/// A scenario.
pub type Scenario = Vec<f64>;

/// Most dimensions whose levels are combined in a full grid.
const GRID: usize = 3;

/// Most dimensions whose corners are all taken.
const CORNERS: usize = 8;

/// Scenarios drawn from Sobol's sequence by which points are compared, and with which an optimum is verified.
const FEW: usize = 32;
const MANY: usize = 512;

/// Intervals of one dimension, and of each of two, with which an optimum is verified, at least.
const INTERVALS: [usize; 2] = [100, 20];

/// Places of a variable within a tolerance that no file states, to either side; the least shows a motion that is chaotic.
const NEAR: [f64; 3] = [1.0, 0.5, 0.01];

/// Most variables whose tolerances are combined where no file states one; of more, each counts alone.
const COMBINED: usize = 4;

/// The scenario in which every variable has its nominal value and what is uncertain has its middle value.
#[must_use]
pub fn nominal(optimisation: &Optimisation) -> Scenario {
    let mut middle = vec![0.0; optimisation.variables.len()];
    middle.extend(optimisation.uncertain.iter().map(|_| 0.5));
    middle
}

/// The values of variables and uncertain keys in a scenario of nominal values. Within a tolerance that no file states they stay in
/// their range.
#[must_use]
pub fn values(optimisation: &Optimisation, nominal: &[f64], scenario: &[f64]) -> Vec<f64> {
    let made = |(place, side): (usize, &f64)| {
        let (variable, value) = (&optimisation.variables[place], nominal[place]);
        let made = value + side * variable.tolerance(value);
        if *side == 0.0 {
            value
        } else if variable.stated.is_none() {
            made.clamp(variable.range.0, variable.range.1)
        } else {
            // Neighbouring nominal values share scenarios where their digits agree.
            format!("{made:.11e}").parse().unwrap_or(made)
        }
    };
    let (sides, shares) = scenario.split_at(optimisation.variables.len());
    let mut values: Vec<f64> = sides.iter().enumerate().map(made).collect();
    for ((axis, uncertain), share) in optimisation.uncertain_axes().iter().zip(&optimisation.uncertain).zip(shares) {
        values.push(match (&uncertain.values, &axis.values) {
            (Some(values), _) => values[((share * values.len() as f64) as usize).min(values.len() - 1)],
            // The worst counts however likely it is: its levels are even in the value.
            (None, AxisValues::Drawn(distribution)) if optimisation.over == Over::Worst => distribution.between(*share),
            (None, AxisValues::Drawn(distribution)) => distribution.quantile(*share),
            (None, _) => f64::NAN,
        });
    }
    values
}

/// Scenarios within tolerances that no file states: the end, the middle and a hundredth of each variable's alone, to either side, and
/// the corners of all together for up to four variables.
fn near(optimisation: &Optimisation) -> Vec<Scenario> {
    let count = optimisation.variables.len();
    let mut all: Vec<Scenario> = Vec::new();
    for variable in 0..count {
        for side in NEAR.into_iter().flat_map(|share| [-share, share]) {
            let mut alone = nominal(optimisation);
            alone[variable] = side;
            all.push(alone);
        }
    }
    if (2..=COMBINED).contains(&count) {
        let side = |corner: usize, variable: usize| if corner >> variable & 1 == 0 { -1.0 } else { 1.0 };
        let rest = || optimisation.uncertain.iter().map(|_| 0.5);
        all.extend((0..1 << count).map(|corner| (0..count).map(|v| side(corner, v)).chain(rest()).collect()));
    }
    all
}

/// Those by which settings are compared.
#[must_use]
pub fn compared(optimisation: &Optimisation) -> Vec<Scenario> {
    if optimisation.is_robust() { Scenarios::of(optimisation).few } else { near(optimisation) }
}

/// A dimension of the scenarios: a variable with a stated tolerance, or an uncertain key.
struct Dimension {
    place: usize,
    /// Its ends.
    ends: (f64, f64),
    /// So many values, if they are listed.
    listed: Option<usize>,
    /// Intervals by which points are compared.
    intervals: usize,
}

/// The scenarios by which points are compared, and many more with which an optimum is verified, of an optimisation that
/// [counts over some](Optimisation::is_robust).
///
/// For the worst: ends and levels between them, combined in up to three dimensions; in more the ends, the corners and some of Sobol's
/// points. Otherwise Sobol's points alone, all as likely.
pub struct Scenarios {
    /// Those by which points are compared.
    pub few: Vec<Scenario>,
    /// Those with which an optimum is verified.
    pub many: Vec<Scenario>,
    /// The distance between neighbours of them, as a share of a dimension's length.
    pub spacing: f64,
}

impl Scenarios {
    /// Of an optimisation.
    #[must_use]
    pub fn of(optimisation: &Optimisation) -> Self {
        let dimensions = dimensions(optimisation);
        let count = dimensions.len();
        let base = nominal(optimisation);
        if optimisation.over != Over::Worst {
            let drawn = |number: usize| sobol(&base, &dimensions, number);
            return Self { few: drawn(FEW), many: drawn(MANY), spacing: 0.0 };
        }
        if count > GRID {
            let frame = frame(&base, &dimensions);
            let with = |number: usize| [frame.clone(), sobol(&base, &dimensions, number)].concat();
            return Self { few: with(FEW), many: with(2 * MANY), spacing: 0.25 };
        }
        let levels = |least: usize| dimensions.iter().map(|dimension| dimension.levels(least)).collect::<Vec<_>>();
        let few = grid(&base, &dimensions, &levels(0));
        let Some(least) = INTERVALS.get(count - 1) else {
            let many = [few.clone(), frame(&base, &dimensions), sobol(&base, &dimensions, 2 * MANY)].concat();
            return Self { few, many, spacing: 0.125 };
        };
        Self { few, many: grid(&base, &dimensions, &levels(*least)), spacing: 1.0 / *least as f64 }
    }
}

/// Dimensions in which a neighbour of a scenario can be tried, with their ends.
#[must_use]
pub fn steps(optimisation: &Optimisation) -> Vec<(usize, (f64, f64))> {
    let free = dimensions(optimisation).into_iter().filter(|dimension| dimension.listed.is_none());
    free.map(|dimension| (dimension.place, dimension.ends)).collect()
}

fn dimensions(optimisation: &Optimisation) -> Vec<Dimension> {
    let stated = optimisation.variables.iter().enumerate().filter(|(_, variable)| variable.stated.is_some());
    let count = stated.clone().count() + optimisation.uncertain.len();
    let usual = if count < GRID { 4 } else { 2 };
    let of_variable = stated.map(|(place, variable)| {
        // Steps within the tolerance are nominal values of neighbours, which are simulated anyway.
        let steps = variable.steps_in_tolerance().filter(|steps| *steps <= 4 && count < GRID);
        let intervals = steps.map_or(usual, |steps| 2 * steps);
        Dimension { place, ends: (-1.0, 1.0), listed: None, intervals }
    });
    let of_uncertain = optimisation.uncertain.iter().enumerate().map(|(place, uncertain)| {
        let listed = uncertain.values.as_ref().map(Vec::len);
        Dimension { place: optimisation.variables.len() + place, ends: (0.0, 1.0), listed, intervals: usual }
    });
    of_variable.chain(of_uncertain).collect()
}

impl Dimension {
    /// Levels with at least so many intervals, of which those by which points are compared are some.
    fn levels(&self, least: usize) -> Vec<f64> {
        let parts = least.div_ceil(self.intervals).max(1);
        match self.listed {
            Some(values) if values <= parts * self.intervals + 1 => places(values),
            _ => even(parts * self.intervals + 1, self.ends),
        }
    }

    fn at(&self, share: f64) -> f64 {
        self.ends.0 + share * (self.ends.1 - self.ends.0)
    }
}

/// Evenly spaced levels with both ends.
fn even(count: usize, (from, to): (f64, f64)) -> Vec<f64> {
    (0..count).map(|n| from + (to - from) * n as f64 / (count - 1) as f64).collect()
}

/// A place for each of some listed values.
fn places(values: usize) -> Vec<f64> {
    (0..values).map(|n| (n as f64 + 0.5) / values as f64).collect()
}

/// All combinations of levels.
fn grid(base: &[f64], dimensions: &[Dimension], levels: &[Vec<f64>]) -> Vec<Scenario> {
    let mut all = vec![base.to_vec()];
    for (dimension, levels) in dimensions.iter().zip(levels) {
        let with = |scenario: &Scenario, level: &f64| {
            let mut scenario = scenario.clone();
            scenario[dimension.place] = *level;
            scenario
        };
        all = all.iter().flat_map(|scenario| levels.iter().map(move |level| with(scenario, level))).collect();
    }
    all
}

/// The middle, the ends of each dimension alone and, of few dimensions, all corners.
fn frame(base: &[f64], dimensions: &[Dimension]) -> Vec<Scenario> {
    let mut all = vec![base.to_vec()];
    for dimension in dimensions {
        for end in [dimension.ends.0, dimension.ends.1] {
            let mut scenario = base.to_vec();
            scenario[dimension.place] = end;
            all.push(scenario);
        }
    }
    if dimensions.len() <= CORNERS {
        let ends: Vec<Vec<f64>> = dimensions.iter().map(|dimension| vec![dimension.ends.0, dimension.ends.1]).collect();
        all.extend(grid(base, dimensions, &ends));
    }
    all
}

/// Points of Sobol's sequence after its first, which is a corner.
fn sobol(base: &[f64], dimensions: &[Dimension], count: usize) -> Vec<Scenario> {
    let sampling = Sampling { method: SamplingMethod::Sobol, count: count + 1, seed: 0 };
    let scenario = |shares: &Vec<f64>| {
        let mut scenario = base.to_vec();
        for (dimension, share) in dimensions.iter().zip(shares) {
            scenario[dimension.place] = dimension.at(*share);
        }
        scenario
    };
    sampling.shares(dimensions.len())[1..].iter().map(scenario).collect()
}
