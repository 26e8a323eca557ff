//! The lines of a mode: those of a stated band, or those about the highest peak.

use std::ops::Range;

use super::ResponseLine;
use super::fit::MIN_LINES;

/// Ends of the band; what is left out is chosen about the highest peak.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wish {
    /// Lowest frequency, Hz.
    pub from_hz: Option<f64>,
    /// Highest frequency, Hz.
    pub to_hz: Option<f64>,
}

/// Half-power widths on either side of a peak: there |H| is a twentieth of it.
pub(super) const WIDTHS: f64 = 10.0;

/// Where a mode does not fit, the band is narrowed by this factor, down to this many widths: the flanks then still tell the residual terms.
pub(super) const NARROWER: f64 = 0.6;
pub(super) const MIN_WIDTHS: f64 = 2.0;

/// A peak is this many times as high as what is between it and a higher one.
const PROMINENT: f64 = 1.5;

/// A flank ends where |H| rises to this many times its least, and to this share of the peak.
const NEXT: (f64, f64) = (5.0, 0.05);

/// Lines of a band at most: the time of a fit.
const MAX_LINES: usize = 20_000;

/// Places of the lines within the ends that are stated.
pub(super) fn wished(lines: &[ResponseLine], wish: Wish) -> Result<Range<usize>, String> {
    let (Some(first), Some(last)) = (lines.first(), lines.last()) else {
        return Err("it has no lines above 0 Hz".into());
    };
    let (from, to) = (wish.from_hz.unwrap_or(first.frequency_hz), wish.to_hz.unwrap_or(last.frequency_hz));
    let range =
        lines.partition_point(|line| line.frequency_hz < from)..lines.partition_point(|line| line.frequency_hz <= to);
    if range.len() < MIN_LINES {
        return Err(format!(
            "{} lines from {from} Hz to {to} Hz: at least {MIN_LINES} are needed; it has {} lines from {} Hz to {} Hz\n  give other --from-hz and \
             --to-hz",
            range.len(),
            lines.len(),
            first.frequency_hz,
            last.frequency_hz
        ));
    }
    if wish.from_hz.is_some() && wish.to_hz.is_some() && range.len() > MAX_LINES {
        return Err(format!(
            "{} lines from {from} Hz to {to} Hz: at most {MAX_LINES} are fitted\n  give a band about one peak with --from-hz and --to-hz",
            range.len()
        ));
    }
    Ok(range)
}

/// The highest peak: a line that is higher than all to the next deep place on either side.
pub(super) fn peak(lines: &[ResponseLine]) -> Result<usize, String> {
    let size = |n: usize| lines[n].h.norm();
    let mut order: Vec<usize> = (0..lines.len()).collect();
    order.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    let is_peak = |n: usize| {
        let falls = |places: &mut dyn Iterator<Item = usize>| {
            places.take_while(|at| size(*at) <= size(n)).any(|at| PROMINENT * size(at) < size(n))
        };
        falls(&mut (0..n).rev()) && falls(&mut (n + 1..lines.len()))
    };
    order.into_iter().find(|n| is_peak(*n)).ok_or_else(|| {
        let highest = lines.iter().max_by(|a, b| a.h.norm().total_cmp(&b.h.norm())).map_or(0.0, |line| line.frequency_hz);
        format!(
            "there is no peak between {} Hz and {} Hz: |H| is highest at {highest} Hz and does not fall to two thirds of it on both sides\n  choose a \
             band about a peak with --from-hz and --to-hz",
            lines[0].frequency_hz,
            lines[lines.len() - 1].frequency_hz
        )
    })
}

/// The lines about a peak up to a distance, of some half-power widths of the lines where it is left out, and not into the next mode.
pub(super) fn about(lines: &[ResponseLine], within: &Range<usize>, peak: usize, reach_hz: Option<f64>) -> Range<usize> {
    let size = |n: usize| lines[n].h.norm();
    let at = |n: usize| lines[n].frequency_hz;
    let reach_hz = reach_hz.unwrap_or_else(|| {
        let is_low = |n: &usize| size(*n) < size(peak) / 2f64.sqrt();
        let low = (within.start..peak).rev().find(is_low).unwrap_or(within.start);
        let high = (peak..within.end).find(is_low).unwrap_or(within.end - 1);
        WIDTHS * (at(high) - at(low))
    });
    let end = |places: &mut dyn Iterator<Item = usize>| {
        let (mut last, mut lowest) = (peak, (size(peak), peak));
        for (count, n) in places.enumerate() {
            if count >= MIN_LINES && (at(n) - at(peak)).abs() > reach_hz {
                break;
            }
            // The median of three: a single line may be noise.
            let mut three = [size(n.saturating_sub(1).max(within.start)), size(n), size((n + 1).min(within.end - 1))];
            three.sort_by(f64::total_cmp);
            if three[1] < lowest.0 {
                lowest = (three[1], n);
            }
            if count >= MIN_LINES && three[1] > (NEXT.0 * lowest.0).max(NEXT.1 * size(peak)) {
                return lowest.1;
            }
            last = n;
        }
        last
    };
    let low = end(&mut (within.start..peak).rev());
    let high = end(&mut (peak + 1..within.end));
    // Never fewer lines than a fit needs: `within` has as many.
    let missing = MIN_LINES.saturating_sub(high + 1 - low);
    low.saturating_sub(missing).max(within.start)..(high + 1 + missing).min(within.end)
}
