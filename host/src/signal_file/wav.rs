//! WAV files: each channel as a share of full scale.

use hound::{SampleFormat, WavReader};

use super::{Contents, Signal, SignalAxis};

/// The channels of a file as shares of full scale.
pub(super) fn parse(bytes: &[u8]) -> Result<Contents, String> {
    let reader = WavReader::new(bytes).map_err(|error| {
        format!("this is not a WAV file of a known kind: {error}\n  save it as PCM of 16, 24 or 32 bit, or as 32 bit floating point")
    })?;
    let spec = reader.spec();
    let damaged = |error: hound::Error| format!("it is damaged: {error}\n  copy or record it again");
    let all: Result<Vec<f64>, hound::Error> = match spec.sample_format {
        SampleFormat::Float => reader.into_samples::<f32>().map(|sample| sample.map(f64::from)).collect(),
        SampleFormat::Int => {
            let full = 2f64.powi(i32::from(spec.bits_per_sample) - 1);
            reader.into_samples::<i32>().map(|sample| sample.map(|sample| f64::from(sample) / full)).collect()
        }
    };
    let all = all.map_err(damaged)?;
    if let Some(at) = all.iter().position(|sample| !sample.is_finite()) {
        return Err(format!("sample {} is no number\n  record it again", at + 1));
    }
    if all.is_empty() || spec.sample_rate == 0 {
        return Err("it has no samples".into());
    }
    let channels = usize::from(spec.channels.max(1));
    let one = |channel: usize| {
        let axis = SignalAxis::Time { start_s: 0.0, step_s: 1.0 / f64::from(spec.sample_rate) };
        let values = all.iter().skip(channel).step_by(channels).copied().collect();
        let mut signal = Signal::new(format!("channel {}", channel + 1), "", axis, values);
        signal.remark = Some("shares of full scale: a recorded calibration tone gives the unit".into());
        signal
    };
    Ok(Contents { kind: "WAV recording", signals: (0..channels).map(one).collect(), remarks: Vec::new() })
}
