//! The person who calibrates: questions on standard error, answers from standard input.

use std::io::{BufRead, Write, stderr, stdin};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use crate::calibrate::Channel;
use crate::calibrate::guide::{Ask, GuideReply, Operator, question};
use crate::calibrate::rig::CalibratedRig;
use crate::failure::Failure;
use crate::input::shown;

/// A person at the terminal. Lines are read in a thread of their own, so that the link stays alive while nobody types.
pub(super) struct Person {
    channel: Channel,
    lines: Receiver<String>,
}

impl Person {
    /// Starts to read lines.
    pub(super) fn new(channel: Channel) -> Self {
        Self { channel, lines: lines() }
    }

    fn prompt(&self, ask: &Ask<'_>) {
        let how = match ask {
            Ask::Reference { .. } => {
                ", then press Enter (or type the value with its unit; r repeats the last point, s skips, e ends)"
            }
            Ask::Blow { .. } => "",
            Ask::Impulse { .. } => " (r: this blow does not count, s: next wall, e ends)",
            Ask::Ready(_) => " Press Enter when ready.",
        };
        let end = if matches!(ask, Ask::Blow { .. }) { "\n" } else { ": " };
        // Nobody can answer what is not seen; the reader of the answers notices the closed terminal.
        let _ = write!(stderr(), "{}", shown(&format!("{}{how}{end}", question(ask))));
        let _ = stderr().flush();
    }

    /// The next line; keeps the link alive.
    fn line(&self, rig: &mut CalibratedRig<'_>) -> Result<String, Failure> {
        loop {
            rig.idle_turn()?;
            match self.lines.try_recv() {
                Ok(line) => return Ok(line.trim().to_string()),
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => return Err(Failure::stopped()),
            }
        }
    }
}

fn lines() -> Receiver<String> {
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    lines
}

impl Operator for Person {
    fn ask(&mut self, rig: &mut CalibratedRig<'_>, ask: &Ask<'_>) -> Result<GuideReply, Failure> {
        self.prompt(ask);
        if matches!(ask, Ask::Blow { .. }) {
            // The blow is the answer.
            return Ok(GuideReply::Done);
        }
        loop {
            let line = self.line(rig)?;
            let answer = match line.as_str() {
                "" => Ok(GuideReply::Done),
                "r" => Ok(GuideReply::Repeat),
                "s" => Ok(GuideReply::Skip),
                "e" => Ok(GuideReply::End),
                text => self.channel.parse(text).map(GuideReply::At),
            };
            match answer {
                Ok(GuideReply::Done) if matches!(ask, Ask::Impulse { .. }) => {
                    self.tell("type the impulse, for example 0.085")
                }
                Ok(answer) => return Ok(answer),
                Err(why) => self.tell(&why),
            }
            self.prompt(ask);
        }
    }

    fn tell(&mut self, line: &str) {
        warn!("{line}");
    }
}
