//! The figures of a campaign: its set-ups' curves, with what is special about each and how they were measured.

use super::axis::Scale;
use super::frequency_response::{Curve, CurvePoint, Notes, Quantity, draw};
use super::{FigureError, Picture};
use crate::campaign::{Campaign, CampaignSetUp, Experiment, Start};
use crate::run_folder::ResultRow;

/// What the figures show of a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Name of the set-up.
    pub set_up: String,
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
    /// X/Z.
    pub x_over_z: f64,
    /// Phase of x relative to z, rad.
    pub phase_rad: f64,
    /// Whether the point counts as steady.
    pub steady: bool,
}

impl From<&ResultRow> for Shown {
    fn from(row: &ResultRow) -> Self {
        Self {
            set_up: row.set_up.clone(),
            frequency_hz: row.frequency_hz,
            x_over_z: row.x_over_z(),
            phase_rad: f64::from(row.phase_rad),
            steady: row.steady,
        }
    }
}

/// Up to `decimals`, without trailing zeros.
#[must_use]
pub fn trimmed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// What is special about a set-up: `d/Z = 10, γF = 0.6, Z = 1.5 mm`.
#[must_use]
pub fn describe(set_up: &CampaignSetUp) -> String {
    let clearance = set_up.clearance_ratio().map(|r| format!("d/Z = {}", trimmed(r, 2)));
    let friction = set_up.friction_ratio().map(|r| format!("γF = {}", trimmed(r, 2)));
    let amplitude = Some(format!("Z = {} mm", trimmed(set_up.base_amplitude_m * 1e3, 3)));
    [clearance, friction, amplitude].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// X/Z over frequency, all set-ups.
///
/// # Errors
/// What the drawing library says.
pub fn response(campaign: &Campaign, points: &[Shown]) -> Result<Picture, FigureError> {
    let quantity = Quantity { label: "Vibration amplitude ratio X/Z", scale: Scale::Log };
    let about = "X: mean over the cycles of max|x|; Z: amplitude of the base";
    curves(campaign, points, &quantity, about, |p| p.x_over_z)
}

/// Phase of x relative to z over frequency, all set-ups.
///
/// # Errors
/// What the drawing library says.
pub fn phase(campaign: &Campaign, points: &[Shown]) -> Result<Picture, FigureError> {
    // Beyond resonance x lags by half a turn: the scale must not break there.
    let unbroken = |degrees: f64| if degrees > 90.0 { degrees - 360.0 } else { degrees };
    let quantity = Quantity { label: "Phase of x relative to z (°)", scale: Scale::Linear };
    let about = "Phase: lock-in at the drive frequency, over the whole dwell";
    curves(campaign, points, &quantity, about, |p| unbroken(p.phase_rad.to_degrees()))
}

fn curves(
    campaign: &Campaign,
    points: &[Shown],
    quantity: &Quantity,
    about: &str,
    value: impl Fn(&Shown) -> f64,
) -> Result<Picture, FigureError> {
    let curve = |set_up: &CampaignSetUp| Curve {
        label: set_up.label.clone(),
        detail: describe(set_up),
        points: points
            .iter()
            .filter(|p| p.set_up == set_up.name)
            .map(|p| CurvePoint { frequency_hz: p.frequency_hz, value: value(p), steady: p.steady })
            .collect(),
    };
    let curves: Vec<Curve> = campaign.set_ups.iter().map(curve).filter(|c| !c.points.is_empty()).collect();
    let natural: Vec<f64> = campaign.set_ups.iter().map(CampaignSetUp::natural_frequency_hz).collect();
    let common = natural.first().copied().filter(|first| natural.iter().all(|f| (f - first).abs() < 1e-9 * first));
    let how: Vec<String> = campaign
        .experiments
        .iter()
        .filter_map(Experiment::stepped_sine)
        .map(|e| {
            let start = if e.start == Start::FromRest { "from rest" } else { "carried over" };
            format!("{} s at each frequency, {start}", trimmed(e.dwell_s, 3))
        })
        .collect();
    let caption = format!("{about}. {}.", how.join("; "));
    draw(&curves, quantity, &Notes { natural_frequency_hz: common, caption })
}
