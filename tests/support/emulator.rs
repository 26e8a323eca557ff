//! Starts QEMU with the emulated board's image, connects to it over TCP, and ends it when the value is dropped.

use std::io::{BufRead, BufReader};
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::process::{Child, Command, Stdio};

const QEMU: &str = "qemu-system-arm";

/// A running emulator; dropping it ends the process.
#[derive(Debug)]
pub struct Emulator {
    process: Child,
    port: u16,
}

impl Emulator {
    /// Starts the image and waits until the emulator listens.
    ///
    /// # Panics
    /// QEMU is missing or does not come up.
    #[must_use]
    pub fn start(image: &Path) -> Self {
        let port = free_port();
        let mut process = board("mps2-an386", image)
            .args(["-serial", &format!("tcp:127.0.0.1:{port},server=on,wait=on")])
            .stdin(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start {QEMU}: {error}"));
        let errors = process.stderr.take().expect("stderr is piped");
        let emulator = Self { process, port };
        let mut lines = BufReader::new(errors);
        let mut said = String::new();
        // QEMU reports that it waits for a connection. Probing the port would count as the host's connection.
        while !said.contains("waiting for connection") {
            let length = lines.read_line(&mut said).expect("the emulator's errors are text");
            assert!(length > 0, "the emulator did not come up: {said}");
        }
        // Later output must not fill the pipe.
        std::thread::spawn(move || std::io::copy(&mut lines, &mut std::io::stderr()));
        emulator
    }

    /// Address of the board's line, for `--rig`.
    #[must_use]
    pub fn address(&self) -> String {
        format!("tcp:127.0.0.1:{}", self.port)
    }

    /// Host and port of the board's line.
    #[must_use]
    pub fn socket(&self) -> (Ipv4Addr, u16) {
        (Ipv4Addr::LOCALHOST, self.port)
    }

    /// Kills the emulator at once, like a power loss.
    pub fn pull_the_plug(&mut self) {
        // The process may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        self.pull_the_plug();
    }
}

/// Runs an image that ends by itself on `machine`, with a clock that counts instructions. Returns its output.
///
/// # Panics
/// QEMU is missing, or the image ended with a failure.
#[must_use]
pub fn run_counting(machine: &str, image: &Path) -> String {
    // At 1 024 ns per instruction the board's 25 MHz timer resolves single instructions.
    let output = board(machine, image)
        .args(["-serial", "null", "-icount", "shift=10,sleep=off"])
        .stdin(Stdio::null())
        .output()
        .unwrap_or_else(|error| panic!("cannot start {QEMU}: {error}"));
    // Semihosting writes to either stream, depending on the version.
    let printed = String::from_utf8([output.stderr, output.stdout].concat()).expect("text");
    let end = printed.len() - printed.len().min(2_000);
    assert!(output.status.success(), "the image ended with {}: … {}", output.status, &printed[end..]);
    printed
}

fn board(machine: &str, image: &Path) -> Command {
    let mut command = Command::new(QEMU);
    command.args(["-M", machine, "-display", "none", "-monitor", "none"]);
    // An image that panics ends the emulator with a failure status.
    command.args(["-semihosting-config", "enable=on,target=native", "-kernel"]).arg(image);
    command
}

fn free_port() -> u16 {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a local port");
    listener.local_addr().expect("the listener is bound").port()
}
