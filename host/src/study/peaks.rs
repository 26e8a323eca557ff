//! The peaks of values over a line of frequencies, with as few further simulations as they need.

use super::simulate::SimulationRecord;
use crate::failure::Failure;
use crate::simulation::Case;

/// How a metric follows the frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Smoothness {
    /// It may jump: something strikes.
    Jumps,
    /// It may have kinks: the largest cycle of a motion from rest is another one, or there is one more.
    Kinks,
    /// It is smooth: nothing strikes, and cycles are counted after others.
    Smooth,
}

impl Smoothness {
    /// Of a case.
    #[must_use]
    pub fn of(case: &Case, record: Option<SimulationRecord>) -> Self {
        let settles = match record {
            Some(record) => record.settle_cycles > 0.0 || record.settle_s > 0.0,
            None => case.run.steady_from_cycle.is_some_and(|cycle| cycle > 0),
        };
        match (case.has_impacts(), settles) {
            (true, _) => Self::Jumps,
            (false, false) => Self::Kinks,
            (false, true) => Self::Smooth,
        }
    }
}

/// Intervals of a scan.
pub(super) const SCAN: usize = 1600;

/// Intervals that a scan without jumps has at least.
const MIN_SCAN: usize = 64;

/// Share of the highest value to which one between known ones must follow from them.
pub(super) const PREDICTED: f64 = 3e-4;

/// Rounds around each peak: two bring a peak to within 1/25 of a step, where a smooth one has its value.
pub(super) const ROUNDS: usize = 2;

/// Values on each side of a peak in a round; the next round lies between the neighbours of the best.
pub(super) const EACH_SIDE: usize = 4;

/// Share of the distance between a peak's neighbours by which a value that is asked is apart from the known ones.
const APART: f64 = 1e-3;

/// Places that may decide, of which a band's value is one.
const TOPS: usize = 6;

/// Evaluates a line of the band at some frequencies.
pub(super) type EvaluateLine<'a> = &'a mut dyn FnMut(&[f64]) -> Result<Vec<LinePoint>, Failure>;

/// The value at a frequency, all later axes reduced.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinePoint {
    pub frequency: f64,
    pub value: f64,
    /// Point of the later axes.
    pub inner: usize,
}

/// The [`TOPS`] highest (lowest) of some values, best first.
pub(super) fn highest_of<T>(mut all: Vec<T>, is_minimum: bool, value: impl Fn(&T) -> f64) -> Vec<T> {
    let height = |of: &T| if is_minimum { -value(of) } else { value(of) };
    all.sort_by(|a, b| height(b).total_cmp(&height(a)));
    all.truncate(TOPS);
    all
}

pub(super) fn sort(line: &mut [LinePoint]) {
    line.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
}

/// Adds so many samples within each interval of a sorted line, and gives them.
pub(super) fn add_between(
    line: &mut Vec<LinePoint>,
    count: usize,
    evaluate: EvaluateLine,
) -> Result<Vec<LinePoint>, Failure> {
    let ends = line.windows(2).map(|ends| (ends[0].frequency, ends[1].frequency));
    let added = evaluate(&ends.flat_map(|(from, to)| between(from, to, count)).collect::<Vec<f64>>())?;
    line.extend(&added);
    sort(line);
    Ok(added)
}

/// Halves the steps of a sorted line until all added values follow from those before.
pub(super) fn halve(line: &mut Vec<LinePoint>, evaluate: EvaluateLine) -> Result<(), Failure> {
    while 2 * (line.len() - 1) <= SCAN {
        let before = line.clone();
        let added = add_between(line, 1, evaluate)?;
        let highest = before.iter().map(|sample| sample.value.abs()).fold(0.0, f64::max);
        // A cubic through two samples on each side.
        let follows = |sample: &LinePoint| {
            let after = before.partition_point(|known| known.frequency < sample.frequency);
            let from = after.saturating_sub(2).min(before.len().saturating_sub(4));
            let near = &before[from..(from + 4).min(before.len())];
            let others = |own: &LinePoint| {
                let factor =
                    |other: &LinePoint| (sample.frequency - other.frequency) / (own.frequency - other.frequency);
                near.iter().filter(|other| other.frequency != own.frequency).map(factor).product::<f64>()
            };
            let expected: f64 = near.iter().map(|own| own.value * others(own)).sum();
            (sample.value - expected).abs() <= PREDICTED * highest
        };
        if added.is_empty() || (line.len() > MIN_SCAN && added.iter().all(follows)) {
            break;
        }
    }
    Ok(())
}

/// The best samples around each of the best peaks of a sorted line, best first; the one that has no value, if there is one.
///
/// A peak of a smooth response is predicted from three samples, and found if what is simulated there and between the samples is as
/// predicted; otherwise that is done once more. Other peaks are looked for on even steps.
pub(super) fn highest(
    line: Vec<LinePoint>,
    is_minimum: bool,
    peaks: usize,
    smoothness: Smoothness,
    evaluate: EvaluateLine,
) -> Result<Vec<LinePoint>, Failure> {
    let height = |sample: &LinePoint| if is_minimum { -sample.value } else { sample.value };
    if let Some(missing) = line.iter().find(|sample| sample.value.is_nan()) {
        return Ok(vec![*missing]);
    }
    let predicted = if smoothness == Smoothness::Smooth { ROUNDS } else { 0 };
    let rounds = ROUNDS + predicted / 2;
    let mut open: Vec<Vec<LinePoint>> = local_maxima(&line, &height).into_iter().take(peaks).collect();
    let mut found: Vec<LinePoint> = Vec::new();
    for round in 0..rounds {
        let prediction = |peak: &Vec<LinePoint>| PeakFit::of(peak, &height).filter(|_| round < predicted);
        let predictions: Vec<Option<PeakFit>> = open.iter().map(prediction).collect();
        let asked = |(peak, prediction): (&Vec<LinePoint>, &Option<PeakFit>)| match prediction {
            Some(prediction) => prediction.checks.clone(),
            None => {
                // The middle of two samples that are all that there are.
                let count = if round < predicted { 1 } else { EACH_SIDE };
                let ends = bracket(peak, &height).windows(2).map(|ends| (ends[0].frequency, ends[1].frequency));
                ends.flat_map(|(from, to)| between(from, to, count)).collect()
            }
        };
        let asked: Vec<Vec<f64>> = open.iter().zip(&predictions).map(asked).collect();
        let mut simulated = evaluate(&asked.concat())?.into_iter();
        let mut next = Vec::new();
        for ((mut peak, asked), prediction) in open.into_iter().zip(&asked).zip(predictions) {
            let new: Vec<LinePoint> = simulated.by_ref().take(asked.len()).collect();
            if let Some(missing) = new.iter().find(|sample| sample.value.is_nan()) {
                return Ok(vec![*missing]);
            }
            peak.extend(&new);
            sort(&mut peak);
            let holds = |prediction: PeakFit| new.iter().all(|sample| prediction.holds(sample, &height));
            if prediction.is_some_and(holds) || round + 1 == rounds {
                found.extend(highest_of(peak, is_minimum, |sample| sample.value).first());
            } else {
                next.push(peak);
            }
        }
        open = next;
    }
    Ok(highest_of(found, is_minimum, |sample| sample.value))
}

/// The local maxima of a sorted line, highest first, each with its neighbours: with two samples at an end of the line.
fn local_maxima(line: &[LinePoint], height: &impl Fn(&LinePoint) -> f64) -> Vec<Vec<LinePoint>> {
    let last = line.len() - 1;
    let is_peak = |place: &usize| {
        let here = height(&line[*place]);
        (*place == 0 || here > height(&line[place - 1])) && (*place == last || here >= height(&line[place + 1]))
    };
    let mut tops: Vec<usize> = (0..=last).filter(is_peak).collect();
    tops.sort_by(|a, b| height(&line[*b]).total_cmp(&height(&line[*a])));
    let ends = |top: usize| match top {
        0 => (0, last.min(2)),
        top if top == last => (last.saturating_sub(2), last),
        top => (top - 1, top + 1),
    };
    tops.into_iter().map(|top| line[ends(top).0..=ends(top).1].to_vec()).collect()
}

/// The highest of some sorted samples with its neighbours.
fn bracket<'a>(samples: &'a [LinePoint], height: &impl Fn(&LinePoint) -> f64) -> &'a [LinePoint] {
    let top = (0..samples.len()).fold(0, |a, b| if height(&samples[b]) > height(&samples[a]) { b } else { a });
    &samples[top.saturating_sub(1)..(top + 2).min(samples.len())]
}

/// A parabola over the square of the frequency through three samples: of 1/height² where all are positive, which it is exactly for one
/// resonance; otherwise of the height.
struct PeakFit {
    is_inverse: bool,
    nodes: [(f64, f64); 3],
    /// Frequencies where it is checked: its peak, and the middles between samples.
    checks: Vec<f64>,
}

impl PeakFit {
    /// From the highest of some sorted samples and its neighbours, or the last three at an end; `None` of fewer than three.
    fn of(samples: &[LinePoint], height: &impl Fn(&LinePoint) -> f64) -> Option<Self> {
        let within = bracket(samples, height);
        let three = match within {
            [_, _, _] => within,
            _ if within.first()?.frequency == samples.first()?.frequency => samples.get(..3)?,
            _ => samples.get(samples.len().checked_sub(3)?..)?,
        };
        let is_inverse = three.iter().all(|sample| height(sample) > 0.0);
        let node = |place: usize| {
            let (frequency, height) = (three[place].frequency, height(&three[place]));
            (frequency * frequency, if is_inverse { 1.0 / (height * height) } else { height })
        };
        let mut prediction = Self { is_inverse, nodes: [node(0), node(1), node(2)], checks: Vec::new() };
        let (from, to) = (within.first()?.frequency, within.last()?.frequency);
        let middles = within.windows(2).map(|ends| 0.5 * (ends[0].frequency + ends[1].frequency));
        let peak = prediction.peak().filter(|peak| (from..to).contains(peak));
        for check in peak.into_iter().chain(middles).map(rounded) {
            let is_apart = |known: f64| (check - known).abs() > APART * (to - from);
            if within.iter().map(|sample| sample.frequency).chain(prediction.checks.iter().copied()).all(is_apart) {
                prediction.checks.push(check);
            }
        }
        Some(prediction)
    }

    /// Newton's form of the parabola: the first node, its slope to the second, and the change of the slope.
    fn slopes(&self) -> (f64, f64) {
        let [(a, at_a), (b, at_b), (c, at_c)] = self.nodes;
        let (first, second) = ((at_b - at_a) / (b - a), (at_c - at_b) / (c - b));
        (first, (second - first) / (c - a))
    }

    fn peak(&self) -> Option<f64> {
        let ((a, _), (b, _)) = (self.nodes[0], self.nodes[1]);
        let (slope, bend) = self.slopes();
        let square = 0.5 * (a + b - slope / bend);
        Some(square.sqrt()).filter(|_| if self.is_inverse { bend > 0.0 } else { bend < 0.0 })
    }

    /// Whether a sample is as predicted.
    fn holds(&self, sample: &LinePoint, height: &impl Fn(&LinePoint) -> f64) -> bool {
        let ((a, at_a), (b, _)) = (self.nodes[0], self.nodes[1]);
        let ((slope, bend), square) = (self.slopes(), sample.frequency * sample.frequency);
        let value = at_a + (square - a) * (slope + (square - b) * bend);
        let expected = if self.is_inverse { 1.0 / value.sqrt() } else { value };
        (height(sample) - expected).abs() <= PREDICTED * height(sample).abs()
    }
}

/// So many values between two, evenly spaced, with seven significant digits so that a printed one is the simulated one; fewer where
/// the digits do not tell them apart.
fn between(from: f64, to: f64, count: usize) -> Vec<f64> {
    let at = |n: usize| from + (to - from) * n as f64 / (count + 1) as f64;
    let is_inside = |value: &f64| from < *value && *value < to;
    let mut values: Vec<f64> = (1..=count).map(|n| rounded(at(n))).filter(is_inside).collect();
    values.dedup();
    values
}

fn rounded(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}
