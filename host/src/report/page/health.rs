//! Whether the run can be relied on: how it ended, what was lost and where, what the link went through, and what deserves
//! a second look.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::facts::Facts;
use super::tables::{moment, number, short};
use crate::client::controller::Controller;

/// A measured base amplitude that is off by more than this share of the one that was set is pointed out.
const NOTABLE_BASE_ERROR: f64 = 0.05;

/// Sine of a phase of x against z above which x is said to lead: 30° to 150°.
const LEADS: f64 = 0.5;

/// How it ended, and how far it came.
pub(super) fn state(facts: &Facts) -> Markup {
    let m = &facts.manifest;
    let is_complete = m.is_complete();
    html! {
        p {
            @if is_complete { span.state.good { "complete" } } @else { span.state.bad { (m.status()) } }
            " " (m.points_taken) " of " (m.points_planned) " points; "
            (number(m.clock.rig_s, 1)) " s of rig time in " (number(m.clock.wall_s, 1)) " s"
        }
        @if !is_complete {
            p.note.bad { (m.ending_text()) }
        }
    }
}

/// What deserves a second look.
pub(super) fn warnings(facts: &Facts) -> Markup {
    let mut list: Vec<String> = Vec::new();
    list.extend(facts.all_unreadable().iter().map(|what| format!("cannot be read: {what}")));
    let counters = facts.manifest.counters;
    if counters.lost_rows > 0 {
        list.push(format!("{} rows of samples are missing; where is told below", counters.lost_rows));
    }
    if facts.taken.left_parts().next().is_some() {
        list.push("parts of the samples were damaged when they were joined".into());
    }
    let unsteady = facts.points.iter().filter(|p| !p.shown.steady).count();
    if unsteady > 0 {
        list.push(format!("{unsteady} of {} points were not steady within their dwell", facts.points.len()));
    }
    let saturated = facts.points.iter().filter(|p| p.saturated).count();
    if saturated > 0 {
        list.push(format!("at {saturated} points the drive was at its limit"));
    }
    list.extend(clipped(facts));
    list.extend(signs(facts));
    list.extend(base_errors(facts));
    list.extend(facts.manifest.controller.iter().flat_map(Controller::complaints));
    for begin in &facts.taken.begun {
        if let Some(crash) = &begin.device.last_crash {
            list.push(format!("{}: the board had begun anew after a crash: {crash}", moment(&begin.at)));
        }
        if begin.device.clock_source == "internal oscillator" {
            let off = "the board's crystal did not start: its ticks, and every frequency, are off by up to 1 %";
            list.push(format!("{}: {off}", moment(&begin.at)));
        }
    }
    html! {
        @if !list.is_empty() {
            section { h2 { "To look at" } @for text in &list { p.note { (text) } } }
        }
    }
}

/// Sensors whose signal reached an end of its span while a point was measured.
fn clipped(facts: &Facts) -> Option<String> {
    let points = facts
        .points
        .iter()
        .map(|p| p.clipped.as_str())
        .chain(facts.taken.transients().iter().map(|t| t.sensors_clipped.as_str()));
    let clipped: Vec<&str> = points.filter(|names| !["", "none"].contains(names)).collect();
    let names: BTreeSet<&str> = clipped.iter().flat_map(|names| names.split(", ")).collect();
    let names: Vec<&str> = names.into_iter().collect();
    (!clipped.is_empty()).then(|| {
        let count = clipped.len();
        format!("at {count} points a sensor's signal reached an end of its span and is cut there: {}", names.join(", "))
    })
}

/// Points at which x leads z by a right angle or nearly. In the mean the base feeds a structure energy, so x lags behind z.
/// Only a particle that swings much further than the structure, far from its resonance, could make an exception.
fn signs(facts: &Facts) -> Option<String> {
    let leads = facts.points.iter().filter(|p| p.shown.phase_rad.sin() > LEADS).count();
    (leads > 0)
        .then(|| format!("at {leads} points x leads z, as with a sensor of the wrong sign: check those of x and z"))
}

/// Set-ups whose base did not move as it should.
fn base_errors(facts: &Facts) -> Vec<String> {
    let set_ups = facts.manifest.set_ups.iter().filter(|s| s.base_amplitude_m > 0.0);
    let worst = |name: &str, z_m: f64| {
        let error = |point: &super::facts::Point| (point.z_m / z_m - 1.0, point.shown.frequency_hz);
        facts.points_of(name).map(error).max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
    };
    let text = |s: &crate::run_folder::schema::manifest::SetUpRecord| {
        let (error, frequency_hz) = worst(&s.name, s.base_amplitude_m)?;
        (error.abs() > NOTABLE_BASE_ERROR).then(|| {
            let at = short(frequency_hz, 4);
            let more = if error > 0.0 { "more" } else { "less" };
            let percent = number(error.abs() * 100.0, 1);
            format!("{}: at {at} Hz the base moved {percent} % {more} than it was set to", s.name)
        })
    };
    set_ups.filter_map(text).collect()
}

/// Samples, drops with their place, and the link.
pub(super) fn link(facts: &Facts) -> Markup {
    let m = &facts.manifest;
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
            @if !facts.taken.impacts.is_empty() {
                dt { "Impacts" } dd { (facts.taken.impacts.iter().map(|some| some.impacts.len()).sum::<usize>()) }
            }
            dt { "Rows lost" }
            dd { (c.lost_rows) ": " (c.dropped_records) " dropped by the device, " (c.dropped_rows_host)
                " by the host; " (c.missing_records) " messages missing on the way" }
            dt { "Frames refused" } dd { (c.bad_frames_host) " by the host, " (c.bad_frames_device) " by the device" }
            dt { "Interruptions" }
            dd { (c.interruptions) " of the link or the device; taken up again " (m.resumed) " times" }
        }
        (controller(facts))
        @if facts.gaps.count > 0 { (gaps(facts)) }
        @if !facts.link.is_empty() {
            h3 { "Link" }
            div.wide { table {
                thead { tr { th.word { "When" } th.word { "What" } } }
                tbody { @for (at, what) in &facts.link { tr { td.word { (moment(at)) } td.word { (what) } } } }
            } }
        }
        (ends(facts))
        (starts(facts))
    }
}

/// How the controller kept up: its ticks, its queues, its side of the link.
fn controller(facts: &Facts) -> Markup {
    let Some(c) = facts.manifest.controller else { return html! {} };
    // The ticks of a simulated board take no time.
    let is_real = facts.taken.begun.iter().any(|begin| !begin.device.simulated);
    let time = |us: f64, digits| if is_real { number(us, digits) } else { "–".into() };
    let row = |what: &str, unit: &str, value: String, since: &str| {
        html! { tr { td.word { (what) } td { (value) } td.word { (unit) } td.word { (since) } } }
    };
    let (run, start) = ("in this run", "since the board started");
    html! {
        h3 { "Controller" }
        div.wide { table {
            thead { tr { th.word { "What" } th { "Value" } th.word { "Unit" } th.word { "Counted" } } }
            tbody {
                (row("Ticks that came too late", "", c.overruns.to_string(), run))
                (row("Longest tick", "µs", time(c.longest_tick_us.into(), 0), start))
                (row("Largest jitter of a tick", "µs", time(c.largest_jitter_us.into(), 0), start))
                (row("Interrupts masked for at most", "µs", time(c.longest_masked_us(), 1), start))
                (row("Rows of samples without room", "", c.rows_dropped.to_string(), run))
                (row("Replies and events without room", "", c.replies_dropped.to_string(), run))
                (row("Requests without room", "", c.requests_dropped.to_string(), run))
                (row("Most rows waiting", "", c.most_rows_waiting.to_string(), start))
                (row("Most replies and events waiting", "", c.most_replies_waiting.to_string(), start))
                (row("Broken frames", "", c.bad_frames.to_string(), run))
            }
        } }
        @if !is_real { p.under { "A simulated board: its ticks take no time." } }
    }
}

fn gaps(facts: &Facts) -> Markup {
    let more = facts.gaps.count - facts.gaps.list.len();
    html! {
        h3 { "Gaps" }
        div.wide { table {
            thead { tr {
                th.word { "Set-up" } th.word { "Experiment" } th { "Segment" }
                th { "Until" small { "s of device time" } } th { "Rows missing" }
            } }
            tbody {
                @for gap in &facts.gaps.list {
                    tr {
                        td.word { (gap.set_up) } td.word { (gap.experiment) } td { (gap.segment) }
                        td { @match gap.until_s { Some(t_s) => (number(t_s, 3)), None => "its end" } }
                        td { (gap.rows) }
                    }
                }
            }
        } }
        @if more > 0 { p.under { "and " (more) " more" } }
    }
}

/// Each orderly end of the program before the last point.
fn ends(facts: &Facts) -> Markup {
    let early: Vec<_> = facts.taken.ended.iter().filter_map(|e| Some((&e.at, e.reason.as_ref()?))).collect();
    html! {
        @if !early.is_empty() {
            h3 { "Ended early" }
            div.wide { table {
                thead { tr { th.word { "When" } th.word { "Why" } } }
                tbody { @for (at, why) in early { tr { td.word { (moment(at)) } td.word { (why) } } } }
            } }
        }
    }
}

/// Each start of the device, with its clock.
fn starts(facts: &Facts) -> Markup {
    html! {
        @if !facts.taken.segments.is_empty() {
            h3 { "Starts of the device" }
            div.wide { table {
                thead { tr {
                    th.word { "Started" } th.word { "Set-up" } th.word { "Experiment" } th { "Segment" } th { "Points" }
                    th.word { "Ended" } th { "Device time" small { "s" } } th { "Clock drift" small { "ppm" } }
                } }
                tbody {
                    @for start in &facts.taken.segments {
                        @let end = facts.taken.end_of(&start.id);
                        tr {
                            td.word { (moment(&start.at)) } td.word { (start.id.set_up) } td.word { (start.id.experiment) }
                            td { (start.id.segment) } td { (start.points) }
                            td.word.odd[end.is_none()] { (if end.is_some() { "at its end" } else { "interrupted" }) }
                            td { (end.map_or("–".into(), |e| number(f64::from(e.end_tick) / tick_hz(facts), 1))) }
                            td { (end.and_then(|e| e.clock).map_or("–".into(), |clock| number(clock.drift_ppm, 1))) }
                        }
                    }
                }
            } }
        }
    }
}

fn tick_hz(facts: &Facts) -> f64 {
    facts.manifest.device.as_ref().map_or(f64::NAN, |d| d.tick_hz)
}

/// Who measured.
pub(super) fn versions(facts: &Facts) -> Markup {
    let m = &facts.manifest;
    let programs: Vec<&str> = facts.taken.begun.iter().map(|b| b.damprig.as_str()).collect();
    let others: Vec<&str> = programs.iter().copied().filter(|p| *p != m.damprig).collect();
    html! {
        dl {
            @if let Some(d) = &m.device {
                dt { "Rig" } dd { (d.board) " at " code { (d.link) } }
                dt { "Firmware" } dd { (d.firmware) }
                dt { "Tick" } dd { (short(d.tick_hz, 3)) " Hz" }
                @if let Some(begin) = facts.taken.begun.first() {
                    @if !begin.device.build.is_empty() { dt { "Build" } dd { (begin.device.build) } }
                    dt { "Plant, clock" }
                    dd { (begin.device.plant) "; " (begin.device.clock)
                        @if !begin.device.clock_source.is_empty() { ", counted by the " (begin.device.clock_source) } }
                    dt { "Protocol" } dd { "version " (begin.device.protocol_version) ", schema " code { (d.protocol_schema) } }
                }
            } @else {
                dt { "Rig" } dd { "it never answered" }
            }
            dt { "Program" } dd { (m.damprig) @if !m.host.is_empty() { " on " (m.host) } }
            @if !others.is_empty() { dt { "Also begun by" } dd { (others.join(", ")) } }
            dt { "Run folder" } dd { "format " (m.format) }
        }
    }
}
