//! A worker process: Python with some copies of an environment.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::messages::{Configuration, Description, HEADER, MAX_PAYLOAD, Request, answer};
use super::python::python;
use super::waiting::add_time_waited;
use super::worker_error::{WorkerError, indented};
use crate::cancellation::cancellation_point;

/// The worker's program.
const PROGRAM: &str = include_str!("worker.py");

/// Reads the worker's program from the socket and runs it, so that any Python with Gymnasium will do.
const BOOTSTRAP: &str = "\
import os
def _read(count):
    data = b''
    while len(data) < count:
        part = os.read(0, count - len(data))
        if not part:
            raise SystemExit
        data += part
    return data
exec(compile(_read(int.from_bytes(_read(4), 'little')), 'seedbed/worker.py', 'exec'), globals())
";

/// How often a waiting program looks whether it was interrupted.
const POLL: Duration = Duration::from_millis(50);

/// How long a thread looks for an answer without sleeping, if there is a core for it: a thread that sleeps may need as
/// long to wake up as a short step takes.
const SPIN: Duration = Duration::from_millis(1);

/// Number of workers of this process.
static RUNNING: AtomicUsize = AtomicUsize::new(0);

/// How long importing and making may take at least.
const START_TIMEOUT: Duration = Duration::from_mins(5);

/// How long a worker whose stream has ended may take to end.
const PATIENCE: Duration = Duration::from_millis(500);

/// Number of bytes of the worker's output that are kept.
const KEPT_OUTPUT: usize = 4000;

/// Number of lines of the worker's output that errors show.
const SHOWN_LINES: usize = 10;

/// A running worker.
#[derive(Debug)]
pub(super) struct Worker {
    child: Child,
    socket: UnixStream,
    output: Arc<Mutex<Vec<u8>>>,
    /// The frame that is sent next, then the payload that was received last.
    buffer: Vec<u8>,
    /// How long an answer may take.
    timeout: Duration,
}

impl Worker {
    /// Starts Python and makes the copies. Returns what the environment says of itself.
    pub(super) fn start(
        configuration: &Configuration,
        timeout: Duration,
    ) -> Result<(Self, Description), WorkerError> {
        let mut worker = Self::begin_start(configuration)?;
        let description = worker.finish_start(timeout)?;
        Ok((worker, description))
    }

    /// Starts Python, and does not wait until the copies are made. The worker is killed when the thread
    /// ends that calls this.
    pub(super) fn begin_start(configuration: &Configuration) -> Result<Self, WorkerError> {
        let mut worker = Self::spawn(&configuration.id)?;
        let length = u32::try_from(PROGRAM.len()).expect("the program is short");
        worker.buffer.clear();
        worker.buffer.extend_from_slice(&length.to_le_bytes());
        worker.buffer.extend_from_slice(PROGRAM.as_bytes());
        worker.write_buffer()?;
        worker.send_json(Request::Configure, configuration)?;
        Ok(worker)
    }

    /// Waits until the copies are made. Returns what the environment says of itself. `timeout`: how long
    /// later answers may take
    pub(super) fn finish_start(&mut self, timeout: Duration) -> Result<Description, WorkerError> {
        self.timeout = START_TIMEOUT.max(timeout);
        let description = self.receive_json()?;
        self.timeout = timeout;
        Ok(description)
    }

    /// Sets how long an answer may take from now on.
    pub(super) fn allow(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    fn spawn(id: &str) -> Result<Self, WorkerError> {
        let failed = |error: std::io::Error| {
            let interpreter = python();
            WorkerError::NoPython(format!("cannot start {}: {error}", interpreter.display()))
        };
        let (socket, of_child) = UnixStream::pair().map_err(failed)?;
        socket.set_read_timeout(Some(POLL)).map_err(failed)?;
        socket.set_write_timeout(Some(POLL)).map_err(failed)?;
        let mut child = Command::new(python())
            .args(["-c", BOOTSTRAP, "seedbed-worker", id])
            // Sets of texts have the same order in each process.
            .env("PYTHONHASHSEED", "0")
            .stdin(Stdio::from(OwnedFd::from(of_child)))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        RUNNING.fetch_add(1, Ordering::Relaxed);
        let output = Arc::default();
        if let Some(stream) = child.stderr.take() {
            let kept = Arc::clone(&output);
            thread::spawn(move || keep_end(stream, &kept));
        }
        Ok(Self {
            child,
            socket,
            output,
            buffer: Vec::new(),
            timeout: START_TIMEOUT,
        })
    }

    /// Sends a JSON request and reads the JSON answer.
    pub(super) fn ask<T: DeserializeOwned>(
        &mut self,
        request: Request,
        contents: &impl Serialize,
    ) -> Result<T, WorkerError> {
        self.send_json(request, contents)?;
        self.receive_json()
    }

    fn send_json(
        &mut self,
        request: Request,
        contents: &impl Serialize,
    ) -> Result<(), WorkerError> {
        let payload = serde_json::to_vec(contents).expect("plain data always serializes");
        self.begin(request).extend_from_slice(&payload);
        self.send()
    }

    fn receive_json<T: DeserializeOwned>(&mut self) -> Result<T, WorkerError> {
        let payload = self.receive(answer::JSON)?;
        let read = serde_json::from_slice(payload);
        read.map_err(|error| {
            WorkerError::Ended(format!("the worker sent an unreadable answer: {error}"))
        })
    }

    /// The payload of the frame that is sent next, to be filled.
    pub(super) fn begin(&mut self, request: Request) -> &mut Vec<u8> {
        self.buffer.clear();
        self.buffer.extend_from_slice(&[0, 0, 0, 0, request as u8]);
        &mut self.buffer
    }

    /// Sends the frame that was filled.
    pub(super) fn send(&mut self) -> Result<(), WorkerError> {
        let length = u32::try_from(self.buffer.len() - HEADER).expect("payloads are short");
        self.buffer[..4].copy_from_slice(&length.to_le_bytes());
        self.write_buffer()
    }

    fn write_buffer(&mut self) -> Result<(), WorkerError> {
        let deadline = Instant::now() + self.timeout;
        let mut sent = 0;
        while sent < self.buffer.len() {
            match self.socket.write(&self.buffer[sent..]) {
                Ok(count) => sent += count,
                Err(error) => self.wait_or_fail(&error, deadline)?,
            }
        }
        Ok(())
    }

    /// Waits for a frame with this tag and returns its payload.
    pub(super) fn receive(&mut self, expected: u8) -> Result<&[u8], WorkerError> {
        let start = Instant::now();
        let received = self.receive_frame(expected, start + self.timeout);
        add_time_waited(start.elapsed());
        received?;
        Ok(&self.buffer)
    }

    /// The payload that was received last.
    pub(super) fn payload(&self) -> &[u8] {
        &self.buffer
    }

    /// Reads a frame into the buffer.
    fn receive_frame(&mut self, expected: u8, deadline: Instant) -> Result<(), WorkerError> {
        let mut header = [0; HEADER];
        let read = self.read_soon(&mut header);
        self.read_exact(&mut header[read..], deadline)?;
        let [a, b, c, d, tag] = header;
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        if length > MAX_PAYLOAD || !(tag == expected || tag == answer::ERROR) {
            return Err(WorkerError::Ended(
                "the worker sent something unexpected".to_owned(),
            ));
        }
        let mut payload = std::mem::take(&mut self.buffer);
        payload.resize(length, 0);
        let read = self.read_exact(&mut payload, deadline);
        self.buffer = payload;
        read?;
        if tag == answer::ERROR {
            return Err(python_error(&self.buffer));
        }
        Ok(())
    }

    /// Reads what comes without sleeping for long. Returns the number of bytes.
    fn read_soon(&mut self, bytes: &mut [u8]) -> usize {
        let start = Instant::now();
        let mut read = 0;
        if !has_cores_to_spare() || self.socket.set_nonblocking(true).is_err() {
            return 0;
        }
        while read == 0 && start.elapsed() < SPIN {
            read = self.socket.read(bytes).unwrap_or(0);
            thread::yield_now();
        }
        // If this fails, reading fails with the same error.
        let _ = self.socket.set_nonblocking(false);
        read
    }

    fn read_exact(&mut self, bytes: &mut [u8], deadline: Instant) -> Result<(), WorkerError> {
        let mut read = 0;
        while read < bytes.len() {
            match self.socket.read(&mut bytes[read..]) {
                Ok(0) => return Err(WorkerError::Ended(self.how_it_ended())),
                Ok(count) => read += count,
                Err(error) => self.wait_or_fail(&error, deadline)?,
            }
        }
        Ok(())
    }

    /// Goes on after an operation that only was not possible yet.
    fn wait_or_fail(
        &mut self,
        error: &std::io::Error,
        deadline: Instant,
    ) -> Result<(), WorkerError> {
        match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => {
                cancellation_point();
                if Instant::now() >= deadline {
                    return Err(WorkerError::Timeout(self.timeout));
                }
                Ok(())
            }
            _ => Err(WorkerError::Ended(self.how_it_ended())),
        }
    }

    /// How the process ended, with the end of its output.
    fn how_it_ended(&mut self) -> String {
        let status = self.wait_for_end();
        let how = status.map_or_else(|| "closed its connection".to_owned(), describe_status);
        let output = self.output();
        let output = if output.is_empty() {
            String::new()
        } else {
            format!("; its last output:\n{output}")
        };
        format!("the worker process {how}{output}")
    }

    fn wait_for_end(&mut self) -> Option<ExitStatus> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let status = self.child.try_wait().ok().flatten();
            if status.is_some() || Instant::now() >= deadline {
                return status;
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// The last lines that the worker has printed.
    fn output(&self) -> String {
        // What was printed last may still be in the pipe.
        thread::sleep(Duration::from_millis(20));
        let kept = self.output.lock().unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(&kept);
        let lines: Vec<&str> = text.trim().lines().collect();
        indented(&lines[lines.len().saturating_sub(SHOWN_LINES)..].join("\n"))
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        RUNNING.fetch_sub(1, Ordering::Relaxed);
        // The worker closes its environments when the stream ends.
        let _ = self.socket.shutdown(std::net::Shutdown::Both);
        if self.wait_for_end().is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// Whether there is a core for each worker and for the thread that waits for it.
fn has_cores_to_spare() -> bool {
    static CORES: LazyLock<usize> =
        LazyLock::new(|| thread::available_parallelism().map_or(1, usize::from));
    2 * RUNNING.load(Ordering::Relaxed) <= *CORES
}

fn python_error(payload: &[u8]) -> WorkerError {
    match serde_json::from_slice(payload) {
        Ok(error) => WorkerError::Python(error),
        Err(error) => WorkerError::Ended(format!("the worker sent an unreadable error: {error}")),
    }
}

fn describe_status(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (_, Some(9)) => "was killed (signal 9), perhaps because memory ran out".to_owned(),
        (_, Some(signal)) => format!("was ended by signal {signal}"),
        (Some(code), None) => format!("ended with exit status {code}"),
        (None, None) => "ended".to_owned(),
    }
}

/// Reads a stream to its end and keeps what came last.
fn keep_end(mut stream: impl Read, kept: &Mutex<Vec<u8>>) {
    let mut part = [0; 4096];
    loop {
        match stream.read(&mut part) {
            Ok(0) => return,
            Ok(count) => {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&part[..count]);
                let excess = kept.len().saturating_sub(KEPT_OUTPUT);
                kept.drain(..excess);
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}
