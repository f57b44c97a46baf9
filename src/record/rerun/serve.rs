//! Serves a recording to viewers that come and go while it is made.
//!
//! A viewer is handed what is in the file, from its beginning, and then whatever is added. The file is all the history there is: it
//! takes no memory, and nobody who comes late or is slow holds up the run or another viewer.

use std::io;
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
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tonic::codegen::tokio_stream::wrappers::ReceiverStream;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};

use super::sink::Fault;

/// How long all viewers may take in nothing once the recording is complete.
const PATIENCE: Duration = Duration::from_secs(5);

/// How often they are waited for so long, at most.
const LAST_CALLS: usize = 12;

/// How often a silent viewer is asked whether it is still there, and how long its answer may take.
const ALIVE: [Duration; 2] = [Duration::from_secs(10), Duration::from_secs(20)];

/// Messages that wait for one viewer; the largest are of some 100 kB.
const WAITING: usize = 16;

/// Bytes of the file that are read at once for one viewer.
const PIECE: u64 = 1 << 16;

/// A port of this machine at which a recording will be served.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    port: u16,
    runtime: Runtime,
}

/// A port that cannot be had.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot serve viewers at port {port}: {reason}; choose another with --serve=PORT, or show the run in the viewer there with --live"
)]
pub struct ServeError {
    port: u16,
    reason: io::Error,
}

impl Server {
    /// Takes `port`; 0 is any that is free. From now on viewers can connect; they are served once there is a recording.
    ///
    /// # Errors
    /// The port is taken, or may not be used.
    pub fn bind(port: u16) -> Result<Self, ServeError> {
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
        bound().map_err(|reason| ServeError { port, reason })
    }

    /// What viewers connect to.
    #[must_use]
    pub fn address(&self) -> String {
        format!("rerun+http://{}:{}/proxy", Ipv4Addr::LOCALHOST, self.port)
    }

    /// Serves the recording at `path`, of whose bytes the first `length` are whole messages.
    pub(super) fn open(self, path: &Path, length: u64) -> Result<Serving, Fault> {
        let address = self.address();
        let (written, news) = watch::channel(Written {
            length,
            complete: false,
        });
        let mut end = news.clone();
        let library = Library {
            path: path.to_owned(),
            news,
            handed: Arc::default(),
        };
        let handed = Arc::clone(&library.handed);
        let entered = self.runtime.enter();
        let listener =
            tokio::net::TcpListener::from_std(self.listener).map_err(|error| error.to_string())?;
        let served = self.runtime.spawn(async move {
            let server = tonic::transport::Server::builder()
                .http2_keepalive_interval(Some(ALIVE[0]))
                .http2_keepalive_timeout(Some(ALIVE[1]));
            let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
            let end = async move { drop(end.wait_for(|written| written.complete).await) };
            // Whatever became of the connections, the file has everything.
            drop(
                server
                    .serve_with_incoming_shutdown(
                        MessageProxyServiceServer::new(library),
                        incoming,
                        end,
                    )
                    .await,
            );
        });
        drop(entered);
        Ok(Serving {
            address,
            written,
            handed,
            open: Some((self.runtime, served)),
        })
    }
}

/// How far the file has come.
#[derive(Clone, Copy, Debug)]
struct Written {
    /// Bytes of whole messages.
    length: u64,
    /// Nothing will be added.
    complete: bool,
}

/// A recording that is being served.
#[derive(Debug)]
pub(super) struct Serving {
    address: String,
    written: watch::Sender<Written>,
    /// Messages that viewers took in, all together.
    handed: Arc<AtomicU64>,
    /// None once it was closed.
    open: Option<(Runtime, JoinHandle<()>)>,
}

impl Serving {
    /// The first `length` bytes of the file are whole messages now. Never waits.
    pub(super) fn announce(&self, length: u64) {
        self.written.send_modify(|written| written.length = length);
    }

    /// Waits until all viewers have everything, and closes. Fails if some had to be left behind.
    pub(super) fn finish(&mut self) -> Result<(), Fault> {
        let Some((runtime, served)) = self.open.take() else {
            return Ok(());
        };
        self.written.send_modify(|written| written.complete = true);
        let all_have_it = self.wait_for(&runtime, served);
        runtime.shutdown_background();
        if all_have_it {
            return Ok(());
        }
        Err(format!(
            "not every viewer at {} took in the end of the recording; its file has it",
            self.address
        ))
    }

    /// Whether all viewers have everything, as long as some take in more.
    fn wait_for(&self, runtime: &Runtime, mut served: JoinHandle<()>) -> bool {
        let handed = || self.handed.load(Ordering::Relaxed);
        for _ in 0..LAST_CALLS {
            let before = handed();
            if runtime
                .block_on(async { tokio::time::timeout(PATIENCE, &mut served).await })
                .is_ok()
            {
                return true;
            }
            if handed() == before {
                return false;
            }
        }
        false
    }
}

/// What was written before an interruption is for viewers as well.
impl Drop for Serving {
    fn drop(&mut self) {
        drop(self.finish());
    }
}

/// Where viewers read the recording.
#[derive(Clone)]
struct Library {
    path: PathBuf,
    news: watch::Receiver<Written>,
    handed: Arc<AtomicU64>,
}

type Reader = mpsc::Sender<Result<ReadMessagesResponse, Status>>;

impl Library {
    /// Hands out all messages, those to come as well, until the recording is complete or the reader leaves.
    async fn hand_out(mut self, reader: Reader) {
        if let Err(error) = self.read_to(&reader).await {
            // To tell one who left already is in vain.
            drop(reader.send(Err(Status::internal(error))).await);
        }
    }

    async fn read_to(&mut self, reader: &Reader) -> Result<(), Fault> {
        let mut file = File::open(&self.path)
            .await
            .map_err(|error| error.to_string())?;
        let mut decoder = DecoderTransport::new();
        let mut read = 0;
        loop {
            let Written { length, complete } = *self.news.borrow_and_update();
            while read < length {
                let mut piece = vec![0; PIECE.min(length - read) as usize];
                file.read_exact(&mut piece)
                    .await
                    .map_err(|error| error.to_string())?;
                read += piece.len() as u64;
                decoder.push_byte_chunk(piece);
                while let Some(message) = decoder.try_read().map_err(|error| error.to_string())? {
                    if reader.send(Ok(response(message))).await.is_err() {
                        return Ok(());
                    }
                    self.handed.fetch_add(1, Ordering::Relaxed);
                }
            }
            if complete || self.news.changed().await.is_err() {
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

fn only_to_read<T>() -> Result<T, Status> {
    Err(Status::unimplemented(
        "a run is to be looked at, and has no tables",
    ))
}

#[tonic::async_trait]
impl MessageProxyService for Library {
    type ReadMessagesStream = ReceiverStream<Result<ReadMessagesResponse, Status>>;
    type ReadTablesStream = ReceiverStream<Result<ReadTablesResponse, Status>>;

    async fn read_messages(
        &self,
        _: Request<ReadMessagesRequest>,
    ) -> Result<Response<Self::ReadMessagesStream>, Status> {
        let (reader, messages) = mpsc::channel(WAITING);
        tokio::spawn(self.clone().hand_out(reader));
        Ok(Response::new(ReceiverStream::new(messages)))
    }

    async fn read_tables(
        &self,
        _: Request<ReadTablesRequest>,
    ) -> Result<Response<Self::ReadTablesStream>, Status> {
        only_to_read()
    }

    async fn write_messages(
        &self,
        _: Request<Streaming<WriteMessagesRequest>>,
    ) -> Result<Response<WriteMessagesResponse>, Status> {
        only_to_read()
    }

    async fn write_table(
        &self,
        _: Request<WriteTableRequest>,
    ) -> Result<Response<WriteTableResponse>, Status> {
        only_to_read()
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
    use crate::record::rerun::rows::timeless;
    use crate::record::rerun::sink::Sink;

    type Client = MessageProxyServiceClient<Channel>;

    /// A recording that is served, and where.
    fn served() -> (TempDir, Sink, String) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.rrd.part");
        let mut sink = Sink::new(
            StoreId::recording("test", "test"),
            Box::new(std::fs::File::create(&path).unwrap()),
        )
        .unwrap();
        say(&mut sink, 3);
        let server = Server::bind(0).unwrap();
        let address = server.address().replace("rerun+", "").replace("/proxy", "");
        sink.serve(server, &path).unwrap();
        (folder, sink, address)
    }

    /// Records so many texts of about a megabyte, which are hard to compress.
    fn say(sink: &mut Sink, times: usize) {
        let words: Vec<String> = (0..60_000_u64)
            .map(|n| format!("{:x}", n.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
            .collect();
        let chunk = timeless(
            EntityPath::from("text"),
            &TextDocument::new(words.join(" ")),
        )
        .unwrap();
        (0..times).for_each(|_| sink.send_chunk(&chunk).unwrap());
    }

    fn with_client<T>(address: &str, work: impl AsyncFnOnce(Client) -> T) -> T {
        let runtime = Builder::new_current_thread().enable_all().build().unwrap();
        let endpoint = Endpoint::from_shared(address.to_owned()).unwrap();
        runtime.block_on(async {
            let connection = endpoint.connect().await.unwrap();
            work(Client::new(connection).max_decoding_message_size(usize::MAX)).await
        })
    }

    /// A viewer that has connected, and will tell how many messages it got; it takes none in before it is `told` to.
    fn viewer(address: &str, told: Receiver<()>) -> thread::JoinHandle<u64> {
        let (connected, is_connected) = channel();
        let address = address.to_owned();
        let viewer = thread::spawn(move || {
            with_client(&address, async |mut client| {
                let mut messages = client
                    .read_messages(ReadMessagesRequest {})
                    .await
                    .unwrap()
                    .into_inner();
                connected.send(()).unwrap();
                assert!(told.recv().is_err());
                let mut count = 0;
                while let Ok(Some(_)) = messages.message().await {
                    count += 1;
                }
                count
            })
        });
        is_connected.recv().unwrap();
        viewer
    }

    /// One whom nobody has to tell.
    fn eager(address: &str) -> thread::JoinHandle<u64> {
        viewer(address, channel().1)
    }

    #[test]
    fn viewers_get_everything_whenever_they_come() {
        let (_folder, mut sink, address) = served();
        let early = eager(&address);
        say(&mut sink, 5);
        let late = eager(&address);
        say(&mut sink, 2);
        sink.finish().unwrap();
        assert_eq!((sink.messages(), sink.warning()), (10, None));
        assert_eq!((early.join().unwrap(), late.join().unwrap()), (10, 10));
    }

    #[test]
    fn viewers_get_what_was_recorded_before_an_interruption() {
        let (_folder, mut sink, address) = served();
        let viewer = eager(&address);
        say(&mut sink, 4);
        drop(sink);
        assert_eq!(viewer.join().unwrap(), 7);
    }

    /// What it does not read is in the file and nowhere else; another viewer has all of it long before the run gives the slow one up.
    #[test]
    fn a_viewer_that_does_not_read_holds_nobody_up() {
        let (_folder, mut sink, address) = served();
        let (tell, told) = channel();
        let silent = viewer(&address, told);
        let eager = eager(&address);
        let since = Instant::now();
        say(&mut sink, 27);
        assert!(since.elapsed() < PATIENCE);
        sink.finish().unwrap();
        let waited = since.elapsed();
        assert!(PATIENCE <= waited && waited < 4 * PATIENCE, "{waited:?}");
        let warning = sink.warning().unwrap();
        assert!(warning.contains("not every viewer"), "{warning}");
        drop(tell);
        let got = silent.join().unwrap();
        assert!(got < 30, "{got}");
        assert_eq!(eager.join().unwrap(), 30);
    }

    #[test]
    fn viewers_cannot_write() {
        let (_folder, mut sink, address) = served();
        let table = WriteTableRequest::default();
        let refused = with_client(&address, async |mut client| {
            client.write_table(table).await.map(drop).unwrap_err()
        });
        assert_eq!(
            refused.message(),
            "a run is to be looked at, and has no tables"
        );
        sink.finish().unwrap();
    }

    #[test]
    fn a_taken_port_is_refused() {
        let taken = Server::bind(0).unwrap();
        let error = Server::bind(taken.port).map(drop).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("cannot serve viewers at port {}: ", taken.port)),
            "{error}"
        );
        assert_eq!(
            taken.address(),
            format!("rerun+http://127.0.0.1:{}/proxy", taken.port)
        );
    }

    /// The command line names it in words.
    #[test]
    fn the_default_is_where_viewers_look() {
        assert_eq!(rerun::DEFAULT_SERVER_PORT, 9876);
    }
}
