//! A connection that stays open until the viewer has received everything.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Sleep, sleep};
use tonic::transport::server::Connected;

/// Time within which a viewer must send its first bytes. A connection that stays silent would take the
/// place of a viewer for ever.
const FIRST_BYTES_TIMEOUT: Duration = Duration::from_secs(10);

/// Number of bytes with which every viewer begins: the preface of HTTP/2 and the head of its settings.
const FIRST_BYTES: usize = 24 + 9;

/// A connection to a viewer.
///
/// If a program closes a connection while bytes from the other side are unread, the operating
/// system discards the bytes that it has not sent yet. HTTP/2 viewers send bytes at any time, to
/// acknowledge what they received. So the end of this connection is announced first, and then its
/// bytes are read until the viewer has closed it, too.
#[derive(Debug)]
pub(super) struct ViewerConnection {
    stream: TcpStream,
    /// Whether the viewer was told that nothing more will be sent.
    end_is_announced: bool,
    /// Number of first bytes that have not arrived, and when the connection is closed without them.
    first_bytes: (usize, Pin<Box<Sleep>>),
    /// One of the connections that may be open at once.
    _permit: OwnedSemaphorePermit,
}

impl ViewerConnection {
    /// An error if too many connections are open; then `stream` is closed.
    pub(super) fn new(stream: TcpStream, places: &Arc<Semaphore>) -> io::Result<Self> {
        let permit = Arc::clone(places).try_acquire_owned();
        Ok(Self {
            stream,
            end_is_announced: false,
            first_bytes: (FIRST_BYTES, Box::pin(sleep(FIRST_BYTES_TIMEOUT))),
            _permit: permit.map_err(io::Error::other)?,
        })
    }

    /// Reads and ignores bytes until the viewer has closed the connection.
    fn poll_viewer_closed(&mut self, context: &mut Context<'_>) -> Poll<()> {
        let mut bytes = [0; 1024];
        loop {
            let mut buffer = ReadBuf::new(&mut bytes);
            let result = ready!(Pin::new(&mut self.stream).poll_read(context, &mut buffer));
            if result.is_err() || buffer.filled().is_empty() {
                return Poll::Ready(());
            }
        }
    }
}

impl Connected for ViewerConnection {
    type ConnectInfo = ();

    fn connect_info(&self) {}
}

impl AsyncRead for ViewerConnection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let result = Pin::new(&mut self.stream).poll_read(context, buffer);
        let (missing, end) = &mut self.first_bytes;
        *missing = missing.saturating_sub(buffer.filled().len() - before);
        if *missing > 0 && result.is_pending() {
            ready!(end.as_mut().poll(context));
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        result
    }
}

impl AsyncWrite for ViewerConnection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        if !self.end_is_announced {
            ready!(Pin::new(&mut self.stream).poll_shutdown(context))?;
            self.end_is_announced = true;
        }
        self.poll_viewer_closed(context).map(Ok)
    }
}
