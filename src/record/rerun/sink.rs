//! Writes messages to the file, at once and one by one, and says so when that fails.
//!
//! Nothing is handed to other threads, so nothing can be lost silently or wait for ever. The file grows by whole messages only:
//! one that does not fit is cut off again, so that what was written before stays readable.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use rerun::StoreId;
use rerun::external::re_log_encoding::rrd::{
    CrateVersion, EncodeError, Encoder, EncodingOptions, StreamHeader,
};
use rerun::log::{Chunk, LogMsg};

use super::live::Viewer;
use super::serve::{Server, Serving};

/// What went wrong, in words for people.
pub(super) type Fault = String;

/// Where encoded messages go.
pub(super) trait Storage: Write + Send {
    /// Cuts the storage back to `length` bytes.
    fn cut(&mut self, length: u64) -> io::Result<()>;

    /// Brings everything to the disk.
    fn sync(&mut self) -> io::Result<()>;
}

impl Storage for File {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        io::Seek::seek(self, io::SeekFrom::Start(length)).map(drop)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_all()
    }
}

/// Messages that the index at a file's end lists. The encoder keeps the index in memory, and a table of a row for each message with
/// columns for each entity would outgrow all else in a long run; without an index, tools read the file from its beginning.
const INDEXED: u64 = 8192;

/// The encoded file of one recording.
pub(super) struct Sink {
    store: StoreId,
    encoder: Option<Encoder<Synced>>,
    messages: u64,
    /// Bytes of all messages and the head.
    length: u64,
    fault: Option<Fault>,
    viewer: Option<Viewer>,
    serving: Option<Serving>,
    warning: Option<Fault>,
}

impl Sink {
    /// Opens a file for the messages of `store`.
    pub(super) fn new(store: StoreId, storage: Box<dyn Storage>) -> Result<Self, Fault> {
        let whole = Synced { storage };
        let encoder = Encoder::new_eager(
            CrateVersion::LOCAL,
            EncodingOptions::PROTOBUF_COMPRESSED,
            whole,
        );
        let length = StreamHeader::ENCODED_SIZE_BYTES as u64;
        Ok(Self {
            store,
            encoder: Some(encoder.map_err(in_words)?),
            messages: 0,
            length,
            fault: None,
            viewer: None,
            serving: None,
            warning: None,
        })
    }

    /// Which recording this is.
    pub(super) fn store(&self) -> &StoreId {
        &self.store
    }

    /// How many messages the file holds.
    pub(super) fn messages(&self) -> u64 {
        self.messages
    }

    /// Writes columns or single rows.
    pub(super) fn send_chunk(&mut self, chunk: &Chunk) -> Result<(), Fault> {
        let message = chunk.to_arrow_msg().map_err(|error| error.to_string())?;
        self.send(&LogMsg::ArrowMsg(self.store.clone(), message))
    }

    /// Writes a message. After a failure, every call fails.
    pub(super) fn send(&mut self, message: &LogMsg) -> Result<(), Fault> {
        let has_index = self.messages < INDEXED;
        self.length += self.guard(|encoder| {
            if !has_index {
                encoder.do_not_emit_footer();
            }
            encoder.append(message)
        })?;
        self.messages += 1;
        if let Some(serving) = &self.serving {
            serving.announce(self.length);
        }
        if let Some(viewer) = &mut self.viewer
            && let Err(warning) = viewer.show(message.clone())
        {
            self.warn(warning);
        }
        Ok(())
    }

    /// From now on, a viewer gets all messages as well.
    pub(super) fn show_in(&mut self, viewer: Viewer) {
        self.viewer = Some(viewer);
    }

    /// From now on, viewers can read the file, which is at `path`.
    pub(super) fn serve(&mut self, server: Server, path: &Path) -> Result<(), Fault> {
        self.serving = Some(server.open(path, self.length)?);
        Ok(())
    }

    /// Keeps what people should know until they ask.
    pub(super) fn warn(&mut self, warning: Fault) {
        self.warning = Some(warning);
    }

    /// What people should know, once.
    pub(super) fn warning(&mut self) -> Option<Fault> {
        self.warning.take()
    }

    /// Brings everything to the disk.
    pub(super) fn sync(&mut self) -> Result<(), Fault> {
        self.guard(Encoder::flush_blocking)
    }

    /// Writes the index that ends a complete file, unless it is very long.
    pub(super) fn finish(&mut self) -> Result<(), Fault> {
        self.guard(|encoder| {
            encoder.finish()?;
            encoder.flush_blocking()
        })?;
        self.encoder = None;
        self.fault = Some("the recording is already complete".to_owned());
        let shown = self.viewer.as_mut().map(Viewer::finish);
        let served = self.serving.as_mut().map(Serving::finish);
        self.warning = self
            .warning
            .take()
            .or(shown.or(served).and_then(Result::err));
        Ok(())
    }

    fn guard<T>(
        &mut self,
        work: impl FnOnce(&mut Encoder<Synced>) -> Result<T, EncodeError>,
    ) -> Result<T, Fault> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        let Some(encoder) = &mut self.encoder else {
            return Err("the recording is closed".to_owned());
        };
        work(encoder)
            .map_err(in_words)
            .inspect_err(|fault| self.give_up(fault))
    }

    /// Leaves the file as it was after the latest message. An encoder that is merely dropped would try to write on.
    fn give_up(&mut self, fault: &Fault) {
        self.fault = Some(fault.clone());
        if let Some(Ok(mut whole)) = self.encoder.take().map(Encoder::into_inner) {
            // The first failure is the one to report.
            drop(whole.storage.cut(self.length));
        }
    }
}

fn in_words(error: EncodeError) -> Fault {
    match error {
        EncodeError::Write(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// Brings what is flushed to the disk.
struct Synced {
    storage: Box<dyn Storage>,
}

impl Write for Synced {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.storage.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.storage.flush()?;
        self.storage.sync()
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Arc, Mutex};

    use rerun::external::re_log_encoding::rrd::DecoderApp;
    use rerun::{EntityPath, TextDocument};

    use super::*;
    use crate::record::rerun::rows::timeless;

    /// A disk with room for so many bytes.
    #[derive(Clone)]
    struct Disk {
        bytes: Arc<Mutex<Vec<u8>>>,
        room: Arc<AtomicUsize>,
    }

    impl Disk {
        fn used(&self) -> usize {
            self.bytes.lock().unwrap().len()
        }
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut held = self.bytes.lock().unwrap();
            let fitting = bytes
                .len()
                .min(self.room.load(Ordering::Relaxed) - held.len());
            held.extend(&bytes[..fitting]);
            if fitting == 0 {
                Err(io::ErrorKind::StorageFull.into())
            } else {
                Ok(fitting)
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Storage for Disk {
        fn cut(&mut self, length: u64) -> io::Result<()> {
            self.bytes.lock().unwrap().truncate(length as usize);
            Ok(())
        }

        fn sync(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn full() -> Fault {
        io::Error::from(io::ErrorKind::StorageFull).to_string()
    }

    fn filled(room: usize, messages: u64) -> (Disk, Sink, Result<(), Fault>) {
        let disk = Disk {
            bytes: Arc::default(),
            room: Arc::new(room.into()),
        };
        let mut sink =
            Sink::new(StoreId::recording("test", "test"), Box::new(disk.clone())).unwrap();
        let chunk = timeless(EntityPath::from("text"), &TextDocument::new("some words")).unwrap();
        let sent = (0..messages).try_for_each(|_| sink.send_chunk(&chunk));
        (disk, sink, sent)
    }

    fn readable(disk: &Disk) -> u64 {
        let bytes = disk.bytes.lock().unwrap().clone();
        let messages: Result<Vec<_>, _> = DecoderApp::decode_lazy(Cursor::new(bytes)).collect();
        messages.unwrap().len() as u64
    }

    #[test]
    fn what_fitted_on_a_full_disk_stays_readable() {
        let (disk, mut sink, sent) = filled(10_000, 1000);
        assert_eq!(sent, Err(full()));
        assert!(sink.messages() > 3);
        let before = disk.used();
        assert!(before < 10_000);
        assert_eq!(readable(&disk), sink.messages());
        assert_eq!((sink.sync(), sink.finish()), (Err(full()), Err(full())));
        drop(sink);
        assert_eq!(disk.used(), before);
    }

    #[test]
    fn an_index_that_does_not_fit_is_left_out() {
        let (disk, mut sink, sent) = filled(1_000_000, 10);
        sent.unwrap();
        let without_index = disk.used();
        disk.room.store(without_index + 100, Ordering::Relaxed);
        assert_eq!(sink.finish(), Err(full()));
        drop(sink);
        assert_eq!(disk.used(), without_index);
        assert_eq!(readable(&disk), 10);
    }

    /// An index that grew with the run would be as long as all these messages are.
    #[test]
    fn a_very_long_file_has_no_index() {
        for (messages, indexed) in [(INDEXED, true), (INDEXED + 1, false)] {
            let (disk, mut sink, sent) = filled(100_000_000, messages);
            sent.unwrap();
            let before = disk.used();
            sink.finish().unwrap();
            assert_eq!(disk.used() > before, indexed);
            assert_eq!(readable(&disk), messages);
        }
    }

    #[test]
    fn a_dropped_sink_is_indexed() {
        let (disk, sink, _) = filled(1_000_000, 10);
        let without_index = disk.used();
        drop(sink);
        assert!(disk.used() > without_index);
        assert_eq!(readable(&disk), 10);
    }
}
