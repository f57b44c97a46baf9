//! Serves a recording to viewers while it is written (`--serve`).
//!
//! Each viewer receives the file from its beginning, and then everything that is added to it.
//! Messages are read from the file, so that they need no memory, and a viewer that connects late or
//! is slow delays neither the run nor other viewers.

use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use re_protos::log_msg::v1alpha1::{LogMsg, log_msg::Msg};
use re_protos::sdk_comms::v1alpha1::message_proxy_service_server::{
    MessageProxyService, MessageProxyServiceServer,
};
use re_protos::sdk_comms::v1alpha1::{
    ReadMessagesRequest, ReadMessagesResponse, ReadTablesRequest, ReadTablesResponse,
    WriteMessagesRequest, WriteMessagesResponse, WriteTableRequest, WriteTableResponse,
};
use rerun::external::re_log_encoding::rrd::DecoderTransport;
use tokio::fs::File;
use tokio::io::AsyncReadExt;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::{Semaphore, mpsc, watch};
use tokio::task::JoinHandle;
use tonic::codegen::tokio_stream::StreamExt;
use tonic::codegen::tokio_stream::wrappers::ReceiverStream;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};

use super::error::RecordingError;
use super::viewer_connection::ViewerConnection;
use crate::record::LiveError;

/// After the recording is complete, the server stops if no viewer receives a message for this time.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(5);

/// Maximum number of waits of [`DRAIN_TIMEOUT`], as long as viewers still receive messages.
const MAX_DRAIN_WAITS: usize = 12;

/// Interval between keepalive pings to viewers that send nothing.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(10);

/// Maximum time for the response to a keepalive ping.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(20);

/// Maximum number of connections at once; further ones are closed. Each has the recording open, too,
/// and a process may open few files (often 1024), of which the run needs some itself.
const MAX_CONNECTIONS: usize = 64;

/// Maximum number of messages that wait for one viewer. The largest messages have about 100 kB.
const CHANNEL_CAPACITY: usize = 16;

/// Number of bytes of the file that are read at once for one viewer.
const READ_CHUNK_BYTES: u64 = 1 << 16;

/// A port of this computer at which a recording will be served.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    port: u16,
    runtime: Runtime,
}

impl Server {
    /// Opens `port`, or any free port if it is 0. Viewers can connect immediately, and receive
    /// messages as soon as there is a recording.
    ///
    /// # Errors
    /// The port is in use or not allowed.
    pub fn bind(port: u16) -> Result<Self, LiveError> {
        let bound = || {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
            listener.set_nonblocking(true)?;
            let runtime = Builder::new_multi_thread()
                .worker_threads(1)
                .enable_all()
                .thread_name("viewers")
                .build()?;
            Ok(Self {
                port: listener.local_addr()?.port(),
                listener,
                runtime,
            })
        };
        bound().map_err(|reason| LiveError::Port { port, reason })
    }

    /// The address to which viewers connect.
    #[must_use]
    pub fn address(&self) -> String {
        format!("rerun+http://{}:{}/proxy", Ipv4Addr::LOCALHOST, self.port)
    }

    /// Starts to serve the recording at `path`, whose first `length` bytes are whole messages.
    pub(super) fn start(self, path: &Path, length: u64) -> Result<RunningServer, RecordingError> {
        let address = self.address();
        let (progress_sender, progress) = watch::channel(FileProgress {
            length,
            complete: false,
        });
        let progress_of_server = progress.clone();
        let service = RecordingService {
            path: path.to_owned(),
            progress,
            sent: Arc::default(),
        };
        let sent = Arc::clone(&service.sent);
        let runtime_guard = self.runtime.enter();
        let listener = tokio::net::TcpListener::from_std(self.listener)?;
        let server_task =
            self.runtime
                .spawn(serve_until_complete(listener, service, progress_of_server));
        drop(runtime_guard);
        Ok(RunningServer {
            address,
            progress_sender,
            sent,
            runtime_and_task: Some((self.runtime, server_task)),
        })
    }
}

/// Serves viewers until the file is complete and all viewers have received everything.
async fn serve_until_complete(
    listener: tokio::net::TcpListener,
    service: RecordingService,
    mut progress: watch::Receiver<FileProgress>,
) {
    let server = tonic::transport::Server::builder()
        .http2_keepalive_interval(Some(KEEPALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEPALIVE_TIMEOUT));
    let places = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let connections = TcpIncoming::from(listener)
        .with_nodelay(Some(true))
        .map(|stream| stream.and_then(|stream| ViewerConnection::new(stream, &places)));
    let completion = async move { drop(progress.wait_for(|progress| progress.complete).await) };
    // Errors of connections are ignored, because the file is complete without viewers.
    drop(
        server
            .serve_with_incoming_shutdown(
                MessageProxyServiceServer::new(service),
                connections,
                completion,
            )
            .await,
    );
}

/// The state of the file.
#[derive(Clone, Copy, Debug)]
struct FileProgress {
    /// Bytes of whole messages.
    length: u64,
    /// Whether the file is complete.
    complete: bool,
}

/// A recording that is being served.
#[derive(Debug)]
pub(super) struct RunningServer {
    address: String,
    progress_sender: watch::Sender<FileProgress>,
    /// Number of messages sent to all viewers together.
    sent: Arc<AtomicU64>,
    /// `None` after the server was closed.
    runtime_and_task: Option<(Runtime, JoinHandle<()>)>,
}

impl RunningServer {
    /// Makes the first `length` bytes of the file, which are whole messages, available to viewers.
    /// Never waits.
    pub(super) fn announce(&self, length: u64) {
        self.progress_sender
            .send_modify(|progress| progress.length = length);
    }

    /// Waits until all viewers have received everything, and closes the server. Returns an error if
    /// some viewers did not receive everything.
    pub(super) fn finish(&mut self) -> Result<(), RecordingError> {
        let Some((runtime, server_task)) = self.runtime_and_task.take() else {
            return Ok(());
        };
        self.progress_sender
            .send_modify(|progress| progress.complete = true);
        let all_received = self.wait_for_viewers(&runtime, server_task);
        runtime.shutdown_background();
        if all_received {
            return Ok(());
        }
        Err(RecordingError::ViewersBehind {
            address: self.address.clone(),
        })
    }

    /// Waits as long as viewers receive messages, and returns whether all viewers received
    /// everything.
    fn wait_for_viewers(&self, runtime: &Runtime, mut server_task: JoinHandle<()>) -> bool {
        let sent = || self.sent.load(Ordering::Relaxed);
        for _ in 0..MAX_DRAIN_WAITS {
            let sent_before = sent();
            if runtime
                .block_on(async { tokio::time::timeout(DRAIN_TIMEOUT, &mut server_task).await })
                .is_ok()
            {
                return true;
            }
            if sent() == sent_before {
                return false;
            }
        }
        false
    }
}

/// If the run is interrupted, viewers receive everything that was written before.
impl Drop for RunningServer {
    fn drop(&mut self) {
        drop(self.finish());
    }
}

/// The gRPC service from which viewers read the recording.
#[derive(Clone)]
struct RecordingService {
    path: PathBuf,
    progress: watch::Receiver<FileProgress>,
    sent: Arc<AtomicU64>,
}

/// Channel of the messages to one viewer.
type MessageSender = mpsc::Sender<Result<ReadMessagesResponse, Status>>;

impl RecordingService {
    /// Sends all messages, including future ones, until the recording is complete or the viewer
    /// disconnects.
    async fn stream_messages(mut self, sender: MessageSender) {
        if let Err(error) = self.send_all_to(&sender).await {
            // If the viewer is disconnected, the error cannot be sent and is ignored.
            drop(sender.send(Err(Status::internal(error.to_string()))).await);
        }
    }

    async fn send_all_to(&mut self, sender: &MessageSender) -> Result<(), RecordingError> {
        let mut file = File::open(&self.path).await?;
        let mut decoder = DecoderTransport::new();
        let mut bytes_read = 0;
        loop {
            let FileProgress { length, complete } = *self.progress.borrow_and_update();
            while bytes_read < length {
                let mut bytes = vec![0; READ_CHUNK_BYTES.min(length - bytes_read) as usize];
                file.read_exact(&mut bytes).await?;
                bytes_read += bytes.len() as u64;
                decoder.push_byte_chunk(bytes);
                while let Some(message) = decoder.try_read()? {
                    if sender.send(Ok(response(message))).await.is_err() {
                        return Ok(());
                    }
                    self.sent.fetch_add(1, Ordering::Relaxed);
                }
            }
            if complete || self.progress.changed().await.is_err() {
                return Ok(());
            }
        }
    }
}

fn response(message: Msg) -> ReadMessagesResponse {
    ReadMessagesResponse {
        log_msg: Some(LogMsg { msg: Some(message) }),
    }
}

fn read_only<T>() -> Result<T, Status> {
    Err(Status::unimplemented(
        "recordings are read-only and have no tables",
    ))
}

#[tonic::async_trait]
impl MessageProxyService for RecordingService {
    type ReadMessagesStream = ReceiverStream<Result<ReadMessagesResponse, Status>>;
    type ReadTablesStream = ReceiverStream<Result<ReadTablesResponse, Status>>;

    async fn read_messages(
        &self,
        _: Request<ReadMessagesRequest>,
    ) -> Result<Response<Self::ReadMessagesStream>, Status> {
        let (sender, messages) = mpsc::channel(CHANNEL_CAPACITY);
        tokio::spawn(self.clone().stream_messages(sender));
        Ok(Response::new(ReceiverStream::new(messages)))
    }

    async fn read_tables(
        &self,
        _: Request<ReadTablesRequest>,
    ) -> Result<Response<Self::ReadTablesStream>, Status> {
        read_only()
    }

    async fn write_messages(
        &self,
        _: Request<Streaming<WriteMessagesRequest>>,
    ) -> Result<Response<WriteMessagesResponse>, Status> {
        read_only()
    }

    async fn write_table(
        &self,
        _: Request<WriteTableRequest>,
    ) -> Result<Response<WriteTableResponse>, Status> {
        read_only()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, channel};
    use std::thread;
    use std::time::Instant;

    use re_protos::sdk_comms::v1alpha1::message_proxy_service_client::MessageProxyServiceClient;
    use rerun::{EntityPath, StoreId, TextDocument};
    use tempfile::TempDir;
    use tonic::transport::{Channel, Endpoint};

    use super::*;
    use crate::record::rerun::rows::static_chunk;
    use crate::record::rerun::sink::Sink;

    type Client = MessageProxyServiceClient<Channel>;

    /// Starts to serve a new recording of three messages. Returns its folder, its sink and its
    /// address.
    fn serve_test_recording() -> (TempDir, Sink, String) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.rrd.part");
        let mut sink = Sink::new(
            StoreId::recording("test", "test"),
            1,
            Box::new(std::fs::File::create(&path).unwrap()),
        )
        .unwrap();
        send_texts(&mut sink, 3);
        let server = Server::bind(0).unwrap();
        let address = server.address().replace("rerun+", "").replace("/proxy", "");
        sink.serve_from(server, &path).unwrap();
        (folder, sink, address)
    }

    /// Records `count` texts of about one megabyte that hardly compress.
    fn send_texts(sink: &mut Sink, count: usize) {
        let numbers: Vec<String> = (0..60_000_u64)
            .map(|n| format!("{:x}", n.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
            .collect();
        let chunk = static_chunk(
            EntityPath::from("text"),
            &TextDocument::new(numbers.join(" ")),
        )
        .unwrap();
        (0..count).for_each(|_| sink.send_chunk(&chunk).unwrap());
    }

    fn with_client<T>(address: &str, use_client: impl AsyncFnOnce(Client) -> T) -> T {
        let runtime = Builder::new_current_thread().enable_all().build().unwrap();
        let endpoint = Endpoint::from_shared(address.to_owned()).unwrap();
        runtime.block_on(async {
            let connection = endpoint.connect().await.unwrap();
            use_client(Client::new(connection).max_decoding_message_size(usize::MAX)).await
        })
    }

    /// Connects a viewer, which starts to read when the sender of `start` is dropped and returns
    /// the number of messages that it received.
    fn connect_viewer(address: &str, start: Receiver<()>) -> thread::JoinHandle<u64> {
        let (connection_sender, connection_receiver) = channel();
        let address = address.to_owned();
        let viewer = thread::spawn(move || {
            with_client(&address, async |mut client| {
                let mut messages = client
                    .read_messages(ReadMessagesRequest {})
                    .await
                    .unwrap()
                    .into_inner();
                connection_sender.send(()).unwrap();
                assert!(start.recv().is_err());
                let mut count = 0;
                while let Ok(Some(_)) = messages.message().await {
                    count += 1;
                }
                count
            })
        });
        connection_receiver.recv().unwrap();
        viewer
    }

    /// Connects a viewer that starts to read immediately.
    fn connect_reading_viewer(address: &str) -> thread::JoinHandle<u64> {
        connect_viewer(address, channel().1)
    }

    #[test]
    fn early_and_late_viewers_receive_all_messages() {
        let (_folder, mut sink, address) = serve_test_recording();
        let early_viewer = connect_reading_viewer(&address);
        send_texts(&mut sink, 5);
        let late_viewer = connect_reading_viewer(&address);
        send_texts(&mut sink, 2);
        sink.finish().unwrap();
        assert_eq!((sink.message_count(), sink.take_warning()), (10, None));
        assert_eq!(
            (early_viewer.join().unwrap(), late_viewer.join().unwrap()),
            (10, 10)
        );
    }

    #[test]
    fn viewers_receive_all_messages_of_an_interrupted_recording() {
        let (_folder, mut sink, address) = serve_test_recording();
        let viewer = connect_reading_viewer(&address);
        send_texts(&mut sink, 4);
        drop(sink);
        assert_eq!(viewer.join().unwrap(), 7);
    }

    /// The viewer that does not read receives only a part of the messages, and causes a warning.
    /// Another viewer receives all messages.
    #[test]
    fn a_viewer_that_does_not_read_does_not_delay_others() {
        let (_folder, mut sink, address) = serve_test_recording();
        let (start, started) = channel();
        let slow_viewer = connect_viewer(&address, started);
        let fast_viewer = connect_reading_viewer(&address);
        let start_time = Instant::now();
        send_texts(&mut sink, 27);
        assert!(start_time.elapsed() < DRAIN_TIMEOUT);
        sink.finish().unwrap();
        let waited = start_time.elapsed();
        assert!(
            DRAIN_TIMEOUT <= waited && waited < 4 * DRAIN_TIMEOUT,
            "{waited:?}"
        );
        let warning = sink.take_warning().unwrap().to_string();
        assert!(warning.contains("not every viewer"), "{warning}");
        drop(start);
        let received = slow_viewer.join().unwrap();
        assert!(received < 30, "{received}");
        assert_eq!(fast_viewer.join().unwrap(), 30);
    }

    #[test]
    fn write_requests_of_viewers_are_refused() {
        let (_folder, mut sink, address) = serve_test_recording();
        let table = WriteTableRequest::default();
        let error = with_client(&address, async |mut client| {
            client.write_table(table).await.map(drop).unwrap_err()
        });
        assert_eq!(
            error.message(),
            "recordings are read-only and have no tables"
        );
        sink.finish().unwrap();
    }

    #[test]
    fn binding_a_port_in_use_fails() {
        let server_on_port = Server::bind(0).unwrap();
        let error = Server::bind(server_on_port.port)
            .map(drop)
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with(&format!(
                "cannot serve viewers at port {}: ",
                server_on_port.port
            )),
            "{error}"
        );
        assert_eq!(
            server_on_port.address(),
            format!("rerun+http://127.0.0.1:{}/proxy", server_on_port.port)
        );
    }

    /// The help text of `--serve` contains the default port of viewers.
    #[test]
    fn the_default_port_equals_the_number_in_the_help_text() {
        assert_eq!(rerun::DEFAULT_SERVER_PORT, 9876);
    }
}
