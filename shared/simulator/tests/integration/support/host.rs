//! A host connected to a simulated board, for tests that go through the protocol.

use damprig_core::control::fault::FaultCause;
use damprig_core::control::friction_spring::SpringCommand;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::point::PointResult;
use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Event, FromDevice, NumberedRequest, Rejected, Reply, Request, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};
use damprig_simulator::messages::set_plant;
use damprig_simulator::plant::{InjectedFault, PlantConfig};

/// A host that exchanges bytes with a simulated board.
pub struct Host {
    pub board: SimulatedDevice<f64>,
    reader: Reader,
    seq: u16,
    until_tick: u32,
    pub events: Vec<Event>,
    /// Rows of telemetry; each has its values in the order of the selection.
    pub rows: Vec<Vec<f32>>,
}

impl Host {
    /// Connects to a board with this plant and with the spring of the source document's rig.
    pub fn new(config: PlantConfig) -> Self {
        let board = SimulatedDevice::new(DeviceInfo::new("test", "none"));
        let (events, rows) = (vec![], vec![]);
        let mut host = Self { board, reader: Reader::default(), seq: 0, until_tick: 0, events, rows };
        host.done(set_plant(config));
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

    /// Sends a request and returns its reply.
    pub fn ask(&mut self, ask: Request) -> Result<Reply, Rejected> {
        self.seq += 1;
        let starts = ask == Request::Start;
        let messages = self.send(&ToDevice::Request(NumberedRequest { seq: self.seq, at_tick: None, request: ask }));
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

    /// Sends a request and expects it to be carried out.
    pub fn done(&mut self, ask: Request) {
        assert_eq!(self.ask(ask), Ok(Reply::Done));
    }

    /// Injects a fault into the simulated rig, or ends it.
    pub fn inject(&mut self, fault: InjectedFault) {
        self.board.plant_mut().unwrap().inject(&fault);
    }

    /// Runs this number of ticks.
    pub fn pass(&mut self, ticks: u32) {
        self.until_tick += ticks;
        self.send(&ToDevice::Grant { until_tick: self.until_tick });
    }

    /// Sends a command to the spring and runs until it is done.
    pub fn spring(&mut self, command: SpringCommand) {
        self.done(Request::Spring(command));
        self.pass(16_000);
    }

    pub fn status(&mut self) -> damprig_core::rig::Status {
        let Ok(Reply::Status { status, .. }) = self.ask(Request::Status) else { panic!() };
        status
    }

    pub fn impacts(&self) -> Vec<ImpactRecord> {
        let impact = |event: &Event| if let Event::Impact(record) = event { Some(*record) } else { None };
        self.events.iter().filter_map(impact).collect()
    }

    pub fn points(&self) -> Vec<PointResult> {
        let point = |event: &Event| if let Event::Point(result) = event { Some(*result) } else { None };
        self.events.iter().filter_map(point).collect()
    }

    /// Returns the cause of the first fault.
    pub fn fault(&self) -> Option<FaultCause> {
        let fault = |event: &Event| if let Event::Fault(fault) = event { Some(fault.cause) } else { None };
        self.events.iter().find_map(fault)
    }
}
