//! Section of the report page on repeated experiments: mean and scatter of what was measured several times.

use maud::{Markup, html};

use super::data::PageData;
use super::tables::{label, number, short};
use crate::campaign::{Campaign, CampaignSetUp, Experiment};
use crate::identify::statistics::student_95;

/// Results of repeats: which, and the values that were measured.
struct Repeated<'a> {
    set_up: &'a str,
    series: &'a str,
    /// Hz; none for a transient.
    frequency_hz: Option<f64>,
    quantity: &'static str,
    values: Vec<f64>,
}

impl Repeated<'_> {
    fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len() as f64
    }

    /// Standard deviation of one measurement.
    fn scatter(&self) -> f64 {
        let mean = self.mean();
        let squares: f64 = self.values.iter().map(|value| (value - mean).powi(2)).sum();
        (squares / (self.values.len() as f64 - 1.0)).sqrt()
    }

    /// Half-width of the 95 % interval of the mean (Student's distribution).
    fn half_width(&self) -> f64 {
        let count = self.values.len() as f64;
        student_95(count - 1.0) * self.scatter() / count.sqrt()
    }
}

/// Mean and scatter of each quantity that was measured at least twice.
pub(super) fn repeats(data: &PageData) -> Markup {
    let Ok(campaign) = &data.campaign else { return html! {} };
    let rows = repeated(data, campaign);
    html! {
        @if !rows.is_empty() {
            h3 { "Repeats" }
            div.wide { table {
                thead { tr {
                    th.word { "Set-up" } th.word { "Experiment" } th { "f" small { "Hz" } } th.word { "Quantity" } th { "Repeats" }
                    th { "Mean" } th { "Standard deviation" small { "% of the mean" } } th { "Interval of the mean" small { "95 %, ± %" } }
                } }
                tbody {
                    @for row in &rows {
                        @let percent = 100.0 / row.mean().abs();
                        tr {
                            td.word { (label(data, row.set_up)) } td.word { (row.series) }
                            td { (short(row.frequency_hz.unwrap_or(f64::NAN), 4)) }
                            td.word { (row.quantity) }
                            td { (row.values.len()) }
                            td { (number(row.mean(), 5)) }
                            td { (number(percent * row.scatter(), 3)) }
                            td { (number(percent * row.half_width(), 3)) }
                        }
                    }
                }
            } }
        }
    }
}

fn repeated<'a>(data: &'a PageData, campaign: &'a Campaign) -> Vec<Repeated<'a>> {
    let mut series: Vec<&Experiment> = campaign.experiments.iter().filter(|e| e.name != e.series).collect();
    series.dedup_by_key(|e| &e.series);
    let pairs = series.into_iter().flat_map(|e| e.set_ups.iter().map(move |place| (&campaign.set_ups[*place], e)));
    let all = pairs.flat_map(|(set_up, experiment)| of_pair(data, campaign, set_up, experiment));
    all.filter(|row| row.values.len() > 1).collect()
}

/// The quantities of one experiment with its repeats, on one set-up.
fn of_pair<'a>(
    data: &'a PageData,
    campaign: &'a Campaign,
    set_up: &'a CampaignSetUp,
    experiment: &'a Experiment,
) -> Vec<Repeated<'a>> {
    let is_own = |name: &str| campaign.experiments.iter().any(|e| e.name == name && e.series == experiment.series);
    let row = |frequency_hz, quantity, values: Vec<f64>| Repeated {
        set_up: &set_up.name,
        series: &experiment.series,
        frequency_hz,
        quantity,
        values: values.into_iter().filter(|value| value.is_finite()).collect(),
    };
    if experiment.stepped_sine().is_some() {
        let points = data.points_of(&set_up.name).filter(|p| is_own(&p.experiment));
        let mut frequencies_hz: Vec<f64> = points.map(|p| p.frequency_hz).collect();
        frequencies_hz.sort_by(f64::total_cmp);
        frequencies_hz.dedup();
        let at = |frequency_hz: f64| {
            let own = data.points_of(&set_up.name).filter(|p| is_own(&p.experiment));
            let points = own.filter(|p| p.frequency_hz == frequency_hz);
            row(Some(frequency_hz), "X/Z (cycle maxima)", points.map(|p| p.x_over_z()).collect())
        };
        return frequencies_hz.into_iter().map(at).collect();
    }
    let own = || data.taken.transients().iter().filter(|t| t.set_up == set_up.name && is_own(&t.experiment));
    let mut rows = vec![row(None, "RMS of x (mm)", own().map(|t| 1e3 * f64::from(t.rms_x_m)).collect())];
    if experiment.free_vibration().is_some() {
        rows.push(row(None, "ζ from decay", own().map(|t| t.damping_ratio).collect()));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_scatter_and_interval_of_four_values() {
        let row =
            Repeated { set_up: "", series: "", frequency_hz: None, quantity: "", values: vec![1.0, 2.0, 3.0, 4.0] };
        // By hand: mean 2.5, s² = 5/3, t(3) = 3.18245, t·s/√4 = 2.0543; the quantile is exact to 0.2 %.
        assert_eq!(row.mean(), 2.5);
        assert!((row.scatter() - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((row.half_width() / 2.0543 - 1.0).abs() < 2e-3, "{}", row.half_width());
    }
}
