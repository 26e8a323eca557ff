//! Where the modes are, about.

use crate::modal::ResponseLine;

/// By this factor of |H|² a peak is above both valleys beside it.
const PROMINENCE: f64 = 4.0;

/// Peaks of the sum over the places of |H|² over its median, in which neighbouring lines are averaged.
pub(super) fn peaks_of(lines: &[Vec<ResponseLine>]) -> Vec<f64> {
    // Places with the lines of the first one; others are looked at where they have them.
    let mut power = vec![0.0; lines[0].len()];
    for own in lines.iter().filter(|own| own.len() == lines[0].len()) {
        let mut all: Vec<f64> = own.iter().map(|line| line.h.norm_sqr()).collect();
        all.sort_by(f64::total_cmp);
        let median = all[all.len() / 2].max(f64::MIN_POSITIVE);
        power.iter_mut().zip(own).for_each(|(power, line)| *power += line.h.norm_sqr() / median);
    }
    let smooth: Vec<f64> = (0..power.len())
        .map(|n| {
            let around = &power[n.saturating_sub(1)..(n + 2).min(power.len())];
            around.iter().sum::<f64>() / around.len() as f64
        })
        .collect();
    let valley = |side: &mut dyn Iterator<Item = usize>, top: f64| {
        let mut least = top;
        for n in side {
            if smooth[n] > top {
                break;
            }
            least = least.min(smooth[n]);
        }
        least
    };
    let is_peak = |n: &usize| {
        let top = smooth[*n];
        let sides = [valley(&mut (0..*n).rev(), top), valley(&mut (n + 1..smooth.len()), top)];
        top > 0.0 && sides.iter().all(|least| top >= PROMINENCE * least) && (*n == 0 || smooth[n - 1] < top)
    };
    (1..smooth.len() - 1).filter(is_peak).map(|n| lines[0][n].frequency_hz).collect()
}
