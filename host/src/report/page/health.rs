//! Sections of the report page on the quality of the run: status, warnings, losses, link, controller, versions.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::data::PageData;
use super::tables::{moment, number, peak_notes, short};
use crate::client::controller::Controller;
use crate::run_folder::ResultRow;
use crate::run_folder::schema::manifest::Manifest;
use crate::run_folder::schema::peak_points::PeakPoints;

/// Relative error of the base amplitude above which a warning is given.
const NOTABLE_BASE_ERROR: f64 = 0.05;

/// Sine of the phase of x relative to z above which x leads z: 30° to 150°.
const LEADS: f64 = 0.5;

/// Status line: how the run ended, points, times.
pub(super) fn state(data: &PageData) -> Markup {
    let m = &data.manifest;
    let is_complete = m.is_complete();
    html! {
        p {
            @if is_complete { span.state.good { "complete" } } @else { span.state.bad { (m.status()) } }
            " " (m.points_taken) " of " (m.points_planned) " points; "
            (rig_time(m))
        }
        @if !is_complete {
            p.note.bad { (m.ending_text()) }
        }
    }
}

/// Rig time of a run and the time that it took; of a run that has not ended, the rig time up to its last point.
fn rig_time(m: &Manifest) -> String {
    let rig_s = number(m.clock.rig_s, 1);
    if m.is_running() {
        return format!("{rig_s} s of rig time up to the last point");
    }
    format!("{rig_s} s of rig time in {} s", number(m.clock.wall_s, 1))
}

/// Warnings about the data.
pub(super) fn warnings(data: &PageData) -> Markup {
    let mut list: Vec<String> = Vec::new();
    list.extend(data.all_unreadable().iter().map(|what| format!("cannot be read: {what}")));
    let counters = data.manifest.counters;
    if counters.lost_rows > 0 {
        list.push(format!("{} rows of samples are missing; see Gaps below", counters.lost_rows));
    }
    if data.taken.left_parts().next().is_some() {
        list.push("some sample files were damaged when they were joined".into());
    }
    let unsteady = data.points.iter().filter(|p| !p.steadiness.is_settled()).count();
    if unsteady > 0 {
        list.push(format!("{unsteady} of {} points were not steady within their dwell", data.points.len()));
    }
    let saturated = data.points.iter().filter(|p| p.drive_saturated).count();
    if saturated > 0 {
        list.push(format!("the drive was at its limit at {saturated} points"));
    }
    list.extend(data.taken.peaks.iter().filter(|points| points.is_notable()).map(PeakPoints::text));
    list.extend(peak_notes(data));
    list.extend(clipped(data));
    list.extend(signs(data));
    list.extend(base_errors(data));
    list.extend(data.manifest.controller.iter().flat_map(Controller::complaints));
    for begin in &data.taken.begun {
        if let Some(crash) = &begin.device.last_crash {
            list.push(format!("{}: the board had restarted after a crash: {crash}", moment(&begin.at)));
        }
        list.extend(begin.device.warnings.iter().map(|warning| format!("{}: {warning}", moment(&begin.at))));
        if begin.device.clock_source == "internal oscillator" {
            let off = "the board's crystal did not start: its tick rate and all frequencies are off by up to 1 %";
            list.push(format!("{}: {off}", moment(&begin.at)));
        }
    }
    html! {
        @if !list.is_empty() {
            section { h2 { "Warnings" } @for text in &list { p.note { (text) } } }
        }
    }
}

/// Sensors that were clipped at measured points.
fn clipped(data: &PageData) -> Option<String> {
    let points = data
        .points
        .iter()
        .map(|p| p.sensors_clipped.as_str())
        .chain(data.taken.transients().iter().map(|t| t.sensors_clipped.as_str()));
    let clipped: Vec<&str> = points.filter(|names| !["", "none"].contains(names)).collect();
    let names: BTreeSet<&str> = clipped.iter().flat_map(|names| names.split(", ")).collect();
    let names: Vec<&str> = names.into_iter().collect();
    (!clipped.is_empty()).then(|| {
        let count = clipped.len();
        format!("a sensor was clipped at the end of its range at {count} points: {}", names.join(", "))
    })
}

/// Points at which x leads z by about 90°. The base supplies energy on average, so x lags z, except perhaps far from
/// resonance with a particle that moves much further than the structure.
fn signs(data: &PageData) -> Option<String> {
    let leads = data.points.iter().filter(|p| f64::from(p.phase_rad).sin() > LEADS).count();
    (leads > 0).then(|| format!("x leads z at {leads} points: check the signs of the sensors of x and z"))
}

/// Set-ups whose base amplitude is far from the set value.
fn base_errors(data: &PageData) -> Vec<String> {
    let set_ups = data.manifest.set_ups.iter().filter(|s| s.base_amplitude_m > 0.0);
    // Where the response is kept, Z is the result.
    let drives_base = |point: &&ResultRow| !data.has_own_base(&point.experiment);
    let worst = |name: &str, z_m: f64| {
        let error = |point: &ResultRow| (f64::from(point.z_amplitude_m) / z_m - 1.0, point.frequency_hz);
        data.points_of(name).filter(drives_base).map(error).max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
    };
    let text = |s: &crate::run_folder::schema::manifest::SetUpRecord| {
        let (error, frequency_hz) = worst(&s.name, s.base_amplitude_m)?;
        (error.abs() > NOTABLE_BASE_ERROR).then(|| {
            let at = short(frequency_hz, 4);
            let more = if error > 0.0 { "more" } else { "less" };
            let percent = number(error.abs() * 100.0, 1);
            format!("{}: at {at} Hz the base moved {percent} % {more} than the set Z", s.name)
        })
    };
    set_ups.filter_map(text).collect()
}

/// Samples, drops with their place, and the link.
pub(super) fn link(data: &PageData) -> Markup {
    let m = &data.manifest;
    let c = m.counters;
    let signals: Vec<String> = m
        .signals
        .iter()
        .map(|s| if s.unit.is_empty() { s.name.clone() } else { format!("{} ({})", s.name, s.unit) })
        .collect();
    html! {
        dl {
            dt { "Signals" } dd { (if signals.is_empty() { "none".into() } else { signals.join(", ") }) }
            dt { "Rows" } dd { (m.sample_rows) " at " (short(m.telemetry_rate_hz, 3)) " Hz" }
            @if !data.taken.impacts.is_empty() {
                dt { "Impacts" } dd { (data.taken.impacts.iter().map(|some| some.impacts.len()).sum::<usize>()) }
            }
            dt { "Rows lost" }
            dd { (c.lost_rows) ": " (c.dropped_records) " dropped by the device, " (c.dropped_rows_host)
                " by the host; " (c.missing_records) " messages lost on the link" }
            @if c.misfit_messages > 0 {
                dt { "Misfits" } dd { (c.misfit_messages) " messages of the board did not fit the campaign and were dropped" }
            }
            dt { "Bad frames" } dd { (c.bad_frames_host) " by the host, " (c.bad_frames_device) " by the device" }
            dt { "Interruptions" }
            dd { (c.interruptions) " of the link or the device; resumed " (m.resumed) " times" }
        }
        (controller(data))
        @if data.gaps.count > 0 { (gaps(data)) }
        @if !data.link.is_empty() {
            h3 { "Events" }
            div.wide { table {
                thead { tr { th.word { "Time" } th.word { "Event" } } }
                tbody { @for (at, what) in &data.link { tr { td.word { (moment(at)) } td.word { (what) } } } }
            } }
        }
        (ends(data))
        (starts(data))
    }
}

/// Timing, queues and link counters of the controller.
fn controller(data: &PageData) -> Markup {
    let Some(c) = data.manifest.controller else { return html! {} };
    // A simulated board has no tick duration.
    let is_real = data.taken.begun.iter().any(|begin| !begin.device.simulated);
    let time = |us: f64, digits| if is_real { number(us, digits) } else { "–".into() };
    let row = |what: &str, unit: &str, value: String, since: &str| {
        html! { tr { td.word { (what) } td { (value) } td.word { (unit) } td.word { (since) } } }
    };
    let (run, start) = ("in this run", "since the board started");
    html! {
        h3 { "Controller" }
        div.wide { table {
            thead { tr { th.word { "Quantity" } th { "Value" } th.word { "Unit" } th.word { "Period" } } }
            tbody {
                (row("Late ticks", "", c.overruns.to_string(), run))
                (row("Longest tick", "µs", time(c.longest_tick_us.into(), 0), start))
                (row("Largest tick jitter", "µs", time(c.largest_jitter_us.into(), 0), start))
                (row("Longest time with interrupts masked", "µs", time(c.longest_masked_us(), 1), start))
                (row("Sample rows dropped", "", c.rows_dropped.to_string(), run))
                (row("Replies and events dropped", "", c.replies_dropped.to_string(), run))
                (row("Requests dropped", "", c.requests_dropped.to_string(), run))
                (row("Most queued rows", "", c.most_rows_waiting.to_string(), start))
                (row("Most queued replies and events", "", c.most_replies_waiting.to_string(), start))
                (row("Bad frames", "", c.bad_frames.to_string(), run))
            }
        } }
        @if !is_real { p.under { "Simulated board: no tick durations." } }
    }
}

fn gaps(data: &PageData) -> Markup {
    let more = data.gaps.count - data.gaps.list.len();
    html! {
        h3 { "Gaps" }
        div.wide { table {
            thead { tr {
                th.word { "Set-up" } th.word { "Experiment" } th { "Segment" }
                th { "Until" small { "s of device time" } } th { "Rows missing" }
            } }
            tbody {
                @for gap in &data.gaps.list {
                    tr {
                        td.word { (gap.set_up) } td.word { (gap.experiment) } td { (gap.segment) }
                        td { @match gap.until_s { Some(t_s) => (number(t_s, 3)), None => "end of segment" } }
                        td { (gap.rows) }
                    }
                }
            }
        } }
        @if more > 0 { p.under { "and " (more) " more" } }
    }
}

/// Each orderly end of a run before its last point.
fn ends(data: &PageData) -> Markup {
    let early: Vec<_> = data.taken.ended.iter().filter_map(|e| Some((&e.at, e.reason.as_ref()?))).collect();
    html! {
        @if !early.is_empty() {
            h3 { "Ended early" }
            div.wide { table {
                thead { tr { th.word { "Time" } th.word { "Reason" } } }
                tbody { @for (at, why) in early { tr { td.word { (moment(at)) } td.word { (why) } } } }
            } }
        }
    }
}

/// Each segment: a start of the device, with its clock drift.
fn starts(data: &PageData) -> Markup {
    html! {
        @if !data.taken.segments.is_empty() {
            h3 { "Segments" }
            div.wide { table {
                thead { tr {
                    th.word { "Started" } th.word { "Set-up" } th.word { "Experiment" } th { "Segment" } th { "Points" }
                    th.word { "Ended" } th { "Device time" small { "s" } } th { "Clock drift" small { "ppm" } }
                } }
                tbody {
                    @for start in &data.taken.segments {
                        @let end = data.taken.end_of(&start.id);
                        tr {
                            td.word { (moment(&start.at)) } td.word { (start.id.set_up) } td.word { (start.id.experiment) }
                            td { (start.id.segment) } td { (start.points) }
                            td.word.odd[end.is_none()] { (if end.is_some() { "complete" } else { "interrupted" }) }
                            td { (end.map_or("–".into(), |e| number(f64::from(e.end_tick) / tick_hz(data), 1))) }
                            td { (end.and_then(|e| e.clock).map_or("–".into(), |clock| number(clock.drift_ppm, 1))) }
                        }
                    }
                }
            } }
        }
    }
}

fn tick_hz(data: &PageData) -> f64 {
    data.manifest.device.as_ref().map_or(f64::NAN, |d| d.tick_hz)
}

/// Rig, firmware and program versions.
pub(super) fn versions(data: &PageData) -> Markup {
    let m = &data.manifest;
    let programs: Vec<&str> = data.taken.begun.iter().map(|b| b.damprig.as_str()).collect();
    let others: Vec<&str> = programs.iter().copied().filter(|p| *p != m.damprig).collect();
    html! {
        dl {
            @if let Some(d) = &m.device {
                dt { "Rig" } dd { (d.board) " at " code { (d.link) } }
                dt { "Firmware" } dd { (d.firmware) }
                dt { "Tick" } dd { (short(d.tick_hz, 3)) " Hz" }
                @if let Some(begin) = data.taken.begun.first() {
                    @if !begin.device.build.is_empty() { dt { "Build" } dd { (begin.device.build) } }
                    dt { "Plant, clock" }
                    dd { (begin.device.plant) "; " (begin.device.clock)
                        @if !begin.device.clock_source.is_empty() { ", from the " (begin.device.clock_source) } }
                    dt { "Protocol" } dd { "version " (begin.device.protocol_version) ", schema " code { (d.protocol_schema) } }
                }
            } @else {
                dt { "Rig" } dd { "no rig answered" }
            }
            dt { "Program" } dd { (m.damprig) @if !m.host.is_empty() { " on " (m.host) } }
            @if !others.is_empty() { dt { "Other programs" } dd { (others.join(", ")) } }
            dt { "Run folder" } dd { "format " (m.format) }
        }
    }
}
