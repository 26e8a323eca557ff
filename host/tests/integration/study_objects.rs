//! Studies in an object store: a local S3 server (moto) of the Python that `tests/run` makes. Left out without it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{PATIENCE, python};
use crate::study_work::{STUDY, folder, undisturbed};
use tempfile::TempDir;

/// The server checks no signature, only that there is one.
const SIGNED: &str = "Authorization: AWS4-HMAC-SHA256 Credential=test/20200101/us-east-1/s3/aws4_request, \
                      SignedHeaders=host, Signature=0\r\n";

/// An S3 server on a port of this machine, with a bucket `damprig`.
struct Server {
    process: Child,
    endpoint: String,
}

impl Server {
    fn start() -> Option<Self> {
        let python = python()?;
        let has_moto = Command::new(&python).args(["-c", "import moto.server"]).output();
        if !has_moto.is_ok_and(|output| output.status.success()) {
            assert_ne!(std::env::var("DAMPRIG_PYTHON").as_deref(), Ok("required"), "no moto in {}", python.display());
            println!("left out: no Python with moto[server] (tests/run makes one; DAMPRIG_PYTHON names one)");
            return None;
        }
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut command = Command::new(python);
        command.args(["-m", "moto.server", "-H", "127.0.0.1", "-p", &port.to_string()]);
        let process = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let server = Self { process, endpoint: format!("127.0.0.1:{port}") };
        let start = Instant::now();
        while TcpStream::connect(&server.endpoint).is_err() {
            assert!(start.elapsed() < PATIENCE, "the S3 server does not answer");
            std::thread::sleep(Duration::from_millis(50));
        }
        assert_eq!(server.put("/damprig", ""), 200, "the bucket");
        Some(server)
    }

    /// Status of a PUT without body.
    fn put(&self, path: &str, headers: &str) -> u16 {
        let mut stream = TcpStream::connect(&self.endpoint).unwrap();
        let headers = format!("Host: {}\r\n{SIGNED}{headers}", self.endpoint);
        write!(stream, "PUT {path} HTTP/1.0\r\nContent-Length: 0\r\n{headers}\r\n").unwrap();
        let mut said = String::new();
        stream.read_to_string(&mut said).unwrap();
        said.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or_else(|| panic!("{said}"))
    }

    fn damprig(&self, folder: &TempDir, action: &str, more: &[&str]) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("damprig"));
        command.current_dir(folder.path()).env("RAYON_NUM_THREADS", "1");
        command.env("AWS_ENDPOINT", format!("http://{}", self.endpoint)).env("AWS_ALLOW_HTTP", "true");
        command.env("AWS_ACCESS_KEY_ID", "test").env("AWS_SECRET_ACCESS_KEY", "test").env("AWS_REGION", "us-east-1");
        command.args(["study", action, "study.toml", "--out", "s3://damprig/studies/a"]).args(more);
        command
    }

    fn succeeds(&self, folder: &TempDir, action: &str, more: &[&str]) -> String {
        let output = self.damprig(folder, action, more).output().unwrap();
        let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{said}");
        said
    }

    fn get(&self, path: &str) -> Vec<u8> {
        let mut stream = TcpStream::connect(&self.endpoint).unwrap();
        write!(stream, "GET {path} HTTP/1.0\r\nHost: {}\r\n{SIGNED}\r\n", self.endpoint).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let body = answer.windows(4).position(|window| window == b"\r\n\r\n").expect("an answer") + 4;
        answer.split_off(body)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn two_workers_on_an_object_store_one_killed_make_the_table_of_one_run() {
    let Some(server) = Server::start() else { return };
    let create = "If-None-Match: *\r\n";
    assert_eq!(server.put("/damprig/once", create), 200);
    assert_eq!(
        server.put("/damprig/once", create),
        412,
        "this server does not know conditional puts: the test shows nothing"
    );

    let folder = folder(STUDY);
    let expected = undisturbed(&folder);
    let claim = ["--claim", "--lease-s", "2"];
    let mut killed = server.damprig(&folder, "work", &claim).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(killed.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("  part ")), "it computes parts");
    let other = server.damprig(&folder, "work", &claim).stdout(Stdio::piped()).spawn().unwrap();
    // It computes its next part.
    killed.kill().unwrap();
    killed.wait().unwrap();
    let said = server.succeeds(&folder, "status", &[]);
    assert!(said.contains("of 6 parts done"), "{said}");
    assert!(other.wait_with_output().unwrap().status.success());
    let said = server.succeeds(&folder, "verify", &[]);
    assert!(said.contains("6 of 6 parts are right"), "{said}");
    let said = server.succeeds(&folder, "merge", &[]);
    assert!(said.contains("Table: s3://damprig/studies/a/table.parquet (12 rows"), "{said}");
    assert!(server.get("/damprig/studies/a/table.parquet") == expected, "the table is another one");
}
