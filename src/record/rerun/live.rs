//! Shows a recording in a running viewer while it is made.
//!
//! The file comes first: a viewer gets copies of what is in it, from a thread of its own. One that does not answer, or not fast
//! enough, is given up; nobody ever waits for it longer than [`PATIENCE`].

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::log::LogMsg;
use rerun::sink::{GrpcSink, GrpcSinkConnectionState, LogSink};

use super::sink::Fault;

/// Where a viewer listens unless it is told otherwise.
pub const DEFAULT_VIEWER: &str = rerun::DEFAULT_CONNECT_URL;

/// How long a viewer is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// Messages that may wait for the viewer; the largest are of some 100 kB.
const WAITING: usize = 128;

/// How often a busy viewer is asked again.
const PAUSE: Duration = Duration::from_millis(2);

/// A running viewer.
#[derive(Debug)]
pub struct Viewer {
    address: String,
    /// None once the viewer was given up.
    messages: Option<SyncSender<LogMsg>>,
    /// Disconnected when everything was sent.
    sent: Receiver<()>,
}

/// A viewer that cannot be reached.
#[derive(Debug, thiserror::Error)]
pub enum ViewerError {
    /// What was given is no address.
    #[error("`{0}` is no address of a viewer; expected one such as {DEFAULT_VIEWER}")]
    Address(String),
    /// Nobody listens there.
    #[error("no viewer answers at {0}; start one with `rerun`, or leave out --live")]
    Absent(String),
}

impl Viewer {
    /// Finds the viewer that listens at `address`.
    ///
    /// # Errors
    /// It is no address, or nobody answers there within some seconds.
    ///
    /// # Panics
    /// If the system refuses to start a thread.
    pub fn connect(address: &str) -> Result<Self, ViewerError> {
        let uri = address
            .parse()
            .map_err(|_| ViewerError::Address(address.to_owned()))?;
        let connection = GrpcSink::new(uri);
        let since = Instant::now();
        while matches!(
            connection.status(),
            GrpcSinkConnectionState::Connecting { .. }
        ) && since.elapsed() < PATIENCE
        {
            thread::sleep(PAUSE);
        }
        if connection.status() != GrpcSinkConnectionState::Connected {
            // To close a connection that never came about takes seconds.
            thread::spawn(move || drop(connection));
            return Err(ViewerError::Absent(address.to_owned()));
        }
        let (messages, waiting) = sync_channel(WAITING);
        let (done, sent) = sync_channel(0);
        thread::spawn(move || {
            forward(&connection, &waiting);
            drop(connection);
            drop(done);
        });
        Ok(Self {
            address: address.to_owned(),
            messages: Some(messages),
            sent,
        })
    }

    /// Shows what the recording at `path` holds so far.
    pub(super) fn catch_up(&mut self, path: &Path) -> Result<(), Fault> {
        let file = File::open(path).map_err(|error| error.to_string())?;
        for message in DecoderApp::decode_lazy(BufReader::new(file)) {
            self.show(message.map_err(|error| error.to_string())?)?;
        }
        Ok(())
    }

    /// Shows a message. Fails once, when the viewer is given up; from then on, nothing is shown.
    pub(super) fn show(&mut self, mut message: LogMsg) -> Result<(), Fault> {
        let since = Instant::now();
        while let Some(messages) = &self.messages {
            match messages.try_send(message) {
                Ok(()) => return Ok(()),
                Err(TrySendError::Full(back)) if since.elapsed() < PATIENCE => {
                    message = back;
                    thread::sleep(PAUSE);
                }
                Err(_) => return Err(self.give_up()),
            }
        }
        Ok(())
    }

    /// Waits until the viewer has everything.
    pub(super) fn finish(&mut self) -> Result<(), Fault> {
        match self.messages.take() {
            None => Ok(()),
            Some(messages) => {
                drop(messages);
                let waited = self.sent.recv_timeout(PATIENCE);
                if waited == Err(RecvTimeoutError::Timeout) {
                    Err(self.give_up())
                } else {
                    Ok(())
                }
            }
        }
    }

    fn give_up(&mut self) -> Fault {
        self.messages = None;
        format!(
            "the viewer at {} does not take in any more; the recording goes on without it",
            self.address
        )
    }
}

/// Until there are no more messages, or the viewer is gone.
fn forward(connection: &GrpcSink, waiting: &Receiver<LogMsg>) {
    for message in waiting {
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
    use crate::record::rerun::rows::timeless;

    #[test]
    fn nonsense_is_no_address() {
        let error = Viewer::connect("here").map(drop).unwrap_err().to_string();
        assert!(
            error.starts_with("`here` is no address of a viewer"),
            "{error}"
        );
    }

    #[test]
    fn where_nobody_listens_is_no_viewer() {
        let port = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap()
            .port();
        let address = format!("rerun+http://127.0.0.1:{port}/proxy");
        let since = Instant::now();
        let error = Viewer::connect(&address).map(drop).unwrap_err().to_string();
        assert_eq!(
            error,
            format!("no viewer answers at {address}; start one with `rerun`, or leave out --live")
        );
        assert!(since.elapsed() < 2 * PATIENCE);
    }

    /// It accepts the connection and never reads: a few messages wait in buffers, then it is given up, once.
    #[test]
    fn a_viewer_that_does_not_read_is_given_up() {
        let silent = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("rerun+http://{}/proxy", silent.local_addr().unwrap());
        let mut viewer = Viewer::connect(&address).unwrap();
        let chunk = timeless(
            EntityPath::from("text"),
            &TextDocument::new("words ".repeat(100_000)),
        )
        .unwrap();
        let message = LogMsg::ArrowMsg(
            StoreId::recording("test", "test"),
            chunk.to_arrow_msg().unwrap(),
        );
        let since = Instant::now();
        let fault = (0..10_000)
            .find_map(|_| viewer.show(message.clone()).err())
            .unwrap();
        assert!(fault.contains("does not take in any more"), "{fault}");
        assert_eq!((viewer.show(message), viewer.finish()), (Ok(()), Ok(())));
        assert!(since.elapsed() < 3 * PATIENCE);
    }
}
