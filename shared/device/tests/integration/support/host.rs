//! A host at a simulated board, for tests that go through the protocol.

use damprig_core::control::fault::FaultCause;
use damprig_core::control::friction_spring::SpringCommand;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::point::PointResult;
use damprig_core::plant::PlantConfig;
use damprig_device::control::Name;
use damprig_device::simulated::{Progress, Simulated};
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Answer, Ask, FromDevice, Happening, Refused, Request, ToDevice};

/// A host that talks to a simulated board in bytes.
pub struct Host {
    pub board: Simulated<f64>,
    reader: Reader,
    seq: u16,
    until_tick: u32,
    pub events: Vec<Happening>,
    /// Rows of telemetry, by signal in the order of the selection.
    pub rows: Vec<Vec<f32>>,
}

impl Host {
    /// A board with this plant, its spring as in the source document's rig.
    pub fn new(config: PlantConfig) -> Self {
        let board = Simulated::new(Name::new("test", "none"));
        let (events, rows) = (vec![], vec![]);
        let mut host = Self { board, reader: Reader::default(), seq: 0, until_tick: 0, events, rows };
        host.done(Ask::SetPlant(config));
        host
    }

    fn send(&mut self, message: &ToDevice) -> Vec<FromDevice> {
        let mut out = [0; LONGEST];
        let length = frame::encode(message, &mut out).unwrap();
        self.board.receive(&out[..length]);
        let mut received = vec![];
        while self.board.run(1000, |bytes| received.extend_from_slice(bytes)) == Progress::Running {}
        let messages: Vec<_> =
            received.into_iter().filter_map(|byte| self.reader.push::<FromDevice>(byte)).map(Result::unwrap).collect();
        for message in &messages {
            match message {
                FromDevice::Event { event, .. } => self.events.push(*event),
                FromDevice::Telemetry(rows) => {
                    self.rows.extend(rows.values.chunks(usize::from(rows.width)).map(<[f32]>::to_vec));
                }
                _ => {}
            }
        }
        messages
    }

    /// Sends a request; its reply.
    pub fn ask(&mut self, ask: Ask) -> Result<Answer, Refused> {
        self.seq += 1;
        let starts = ask == Ask::Start;
        let messages = self.send(&ToDevice::Request(Request { seq: self.seq, at_tick: None, ask }));
        let answer = messages.iter().find_map(|message| match message {
            FromDevice::Reply { answer, .. } => Some(answer.clone()),
            _ => None,
        });
        let answer = answer.expect("a reply");
        if starts && answer.is_ok() {
            self.until_tick = 0;
        }
        answer
    }

    /// Sends a request that must be carried out.
    pub fn done(&mut self, ask: Ask) {
        assert_eq!(self.ask(ask), Ok(Answer::Done));
    }

    /// Lets ticks pass.
    pub fn pass(&mut self, ticks: u32) {
        self.until_tick += ticks;
        self.send(&ToDevice::Grant { until_tick: self.until_tick });
    }

    /// Asks the spring for something, and gives it the time.
    pub fn spring(&mut self, command: SpringCommand) {
        self.done(Ask::Spring(command));
        self.pass(16_000);
    }

    pub fn status(&mut self) -> damprig_core::rig::Status {
        let Ok(Answer::Status { status, .. }) = self.ask(Ask::Status) else { panic!() };
        status
    }

    pub fn impacts(&self) -> Vec<ImpactRecord> {
        let impact = |event: &Happening| if let Happening::Impact(record) = event { Some(*record) } else { None };
        self.events.iter().filter_map(impact).collect()
    }

    pub fn points(&self) -> Vec<PointResult> {
        let point = |event: &Happening| if let Happening::Point(result) = event { Some(*result) } else { None };
        self.events.iter().filter_map(point).collect()
    }

    /// Cause of the first fault.
    pub fn fault(&self) -> Option<FaultCause> {
        let fault = |event: &Happening| if let Happening::Fault(fault) = event { Some(fault.cause) } else { None };
        self.events.iter().find_map(fault)
    }
}
