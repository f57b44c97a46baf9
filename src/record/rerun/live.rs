//! Sends a recording to a running viewer while it is written (`--live`).
//!
//! The file has priority: a separate thread sends copies of its messages to the viewer. A viewer
//! that does not respond fast enough is disconnected. The run never waits for it longer than
//! [`RESPONSE_TIMEOUT`].

use std::io::BufReader;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::log::LogMsg;
use rerun::sink::{GrpcSink, GrpcSinkConnectionState, LogSink};

use super::error::RecordingError;
use crate::record::LiveError;
use seedbed_input::limits::open_regular;

/// The address at which a viewer listens by default.
pub const DEFAULT_VIEWER: &str = rerun::DEFAULT_CONNECT_URL;

/// Maximum time to wait for the viewer.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(5);

/// Maximum number of messages that wait for the viewer. The largest messages have about 100 kB.
const CHANNEL_CAPACITY: usize = 128;

/// Interval between attempts to send to a busy viewer.
const RETRY_INTERVAL: Duration = Duration::from_millis(2);

/// A running viewer.
#[derive(Debug)]
pub struct Viewer {
    address: String,
    /// `None` after the viewer was disconnected.
    messages: Option<SyncSender<LogMsg>>,
    /// Channel that is closed after everything was sent.
    sent: Receiver<()>,
}

impl Viewer {
    /// Connects to the viewer that listens at `address`.
    ///
    /// # Errors
    /// The address is invalid, or no viewer responds within 5 seconds.
    ///
    /// # Panics
    /// If the system refuses to start a thread.
    pub fn connect(address: &str) -> Result<Self, LiveError> {
        let uri = address
            .parse()
            .map_err(|_| LiveError::InvalidAddress(address.to_owned()))?;
        let connection = GrpcSink::new(uri);
        let started = Instant::now();
        while matches!(
            connection.status(),
            GrpcSinkConnectionState::Connecting { .. }
        ) && started.elapsed() < RESPONSE_TIMEOUT
        {
            thread::sleep(RETRY_INTERVAL);
        }
        if connection.status() != GrpcSinkConnectionState::Connected {
            // Close the connection in another thread: if it was never established, this takes
            // seconds.
            thread::spawn(move || drop(connection));
            return Err(LiveError::NoViewer(address.to_owned()));
        }
        let (messages, queue) = sync_channel(CHANNEL_CAPACITY);
        let (done, sent) = sync_channel(0);
        thread::spawn(move || {
            forward(&connection, &queue);
            drop(connection);
            drop(done);
        });
        Ok(Self {
            address: address.to_owned(),
            messages: Some(messages),
            sent,
        })
    }

    /// Sends all messages that the recording at `path` contains so far.
    pub(super) fn catch_up(&mut self, path: &Path) -> Result<(), RecordingError> {
        let file = open_regular(path)?;
        for message in DecoderApp::decode_lazy(BufReader::new(file)) {
            self.send(message?)?;
        }
        Ok(())
    }

    /// Sends a message. Returns an error when the viewer is disconnected; later calls do nothing.
    pub(super) fn send(&mut self, mut message: LogMsg) -> Result<(), RecordingError> {
        let started = Instant::now();
        while let Some(messages) = &self.messages {
            match messages.try_send(message) {
                Ok(()) => return Ok(()),
                Err(TrySendError::Full(unsent)) if started.elapsed() < RESPONSE_TIMEOUT => {
                    message = unsent;
                    thread::sleep(RETRY_INTERVAL);
                }
                Err(_) => return Err(self.disconnect()),
            }
        }
        Ok(())
    }

    /// Waits until the viewer has received everything.
    pub(super) fn finish(&mut self) -> Result<(), RecordingError> {
        match self.messages.take() {
            None => Ok(()),
            Some(messages) => {
                drop(messages);
                let waited = self.sent.recv_timeout(RESPONSE_TIMEOUT);
                if waited == Err(RecvTimeoutError::Timeout) {
                    Err(self.disconnect())
                } else {
                    Ok(())
                }
            }
        }
    }

    fn disconnect(&mut self) -> RecordingError {
        self.messages = None;
        RecordingError::ViewerTimeout {
            address: self.address.clone(),
        }
    }
}

/// Sends messages until there are no more, or until the viewer disconnects.
fn forward(connection: &GrpcSink, queue: &Receiver<LogMsg>) {
    for message in queue {
        connection.send(message);
        if matches!(
            connection.status(),
            GrpcSinkConnectionState::Disconnected(_)
        ) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use rerun::{EntityPath, StoreId, TextDocument};

    use super::*;
    use crate::record::rerun::rows::static_chunk;

    #[test]
    fn an_invalid_address_is_refused() {
        let error = Viewer::connect("here").map(drop).unwrap_err().to_string();
        assert!(
            error.starts_with("invalid viewer address `here`"),
            "{error}"
        );
    }

    #[test]
    fn an_address_without_a_viewer_is_refused() {
        let port = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap()
            .port();
        let address = format!("rerun+http://127.0.0.1:{port}/proxy");
        let started = Instant::now();
        let error = Viewer::connect(&address).map(drop).unwrap_err().to_string();
        assert_eq!(
            error,
            format!("no viewer responds at {address}: start one with `rerun`, or omit --live")
        );
        assert!(started.elapsed() < 2 * RESPONSE_TIMEOUT);
    }

    /// The viewer accepts the connection and never reads. After buffers are full it is
    /// disconnected, and exactly one call returns an error.
    #[test]
    fn a_viewer_that_does_not_read_is_disconnected() {
        let silent = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("rerun+http://{}/proxy", silent.local_addr().unwrap());
        let mut viewer = Viewer::connect(&address).unwrap();
        let chunk = static_chunk(
            EntityPath::from("text"),
            &TextDocument::new("words ".repeat(100_000)),
        )
        .unwrap();
        let message = LogMsg::ArrowMsg(
            StoreId::recording("test", "test"),
            chunk.to_arrow_msg().unwrap(),
        );
        let started = Instant::now();
        let error = (0..10_000)
            .find_map(|_| viewer.send(message.clone()).err())
            .unwrap();
        let error = error.to_string();
        assert!(error.contains("does not respond"), "{error}");
        assert_eq!((viewer.send(message), viewer.finish()), (Ok(()), Ok(())));
        assert!(started.elapsed() < 3 * RESPONSE_TIMEOUT);
    }
}
