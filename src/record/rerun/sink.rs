//! Writes messages to the file immediately, in the calling thread, and reports every failure.
//!
//! The SDK's own file sink writes from a thread of its own: on a full disk its log calls still
//! succeed, data is lost silently, and flushing never returns. Here nothing is handed to other
//! threads. The file grows by whole messages only: if a message does not fit on the disk, the file
//! is truncated to the end of the message before it (`length`), because a decoder stops with an
//! error at half a message. So everything written before a failure stays readable.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};

use rerun::StoreId;
use rerun::external::re_log_encoding::rrd::{
    CrateVersion, DecoderApp, EncodeError, Encoder, EncodingOptions, StreamHeader,
};
use rerun::log::{Chunk, LogMsg};

use super::error::RecordingError;
use super::live::Viewer;
use super::serve::{RunningServer, Server};
use crate::storage::written::{Written, WrittenHash};

/// The file to which encoded messages are written, or a replacement in tests.
pub(super) trait Storage: Write + Send {
    /// Truncates the file to `length` bytes.
    fn truncate(&mut self, length: u64) -> io::Result<()>;

    /// Writes all bytes to the disk.
    fn sync(&mut self) -> io::Result<()>;
}

impl Storage for File {
    fn truncate(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        io::Seek::seek(self, io::SeekFrom::Start(length)).map(drop)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_all()
    }
}

/// Maximum product of the number of messages and the number of agents in a file with an index at its
/// end. The encoder keeps the index in memory, as a table with one row per message and several
/// columns per entity. In recordings of many rounds and agents it would need more memory than
/// everything else, and much of the file. Tools read a file without an index from its beginning.
const MAX_INDEX_SIZE: u64 = 8192;

/// The encoded file of one recording.
pub(super) struct Sink {
    store_id: StoreId,
    encoder: Option<Encoder<HashedFile>>,
    message_count: u64,
    max_indexed_messages: u64,
    /// Number of bytes of the header and all messages.
    length: u64,
    /// The file, to which the encoder writes.
    file: HashedFile,
    /// The error of the first failed call, which all later calls return.
    error: Option<RecordingError>,
    viewer: Option<Viewer>,
    server: Option<RunningServer>,
    warning: Option<RecordingError>,
}

impl Sink {
    /// Starts a file for the messages of the recording `store_id` of a team of `agents` agents.
    pub(super) fn new(
        store_id: StoreId,
        agents: u32,
        storage: Box<dyn Storage>,
    ) -> Result<Self, RecordingError> {
        let file = HashedFile::new(storage);
        let encoder = new_encoder(file.clone())?;
        let length = StreamHeader::ENCODED_SIZE_BYTES as u64;
        Ok(Self {
            store_id,
            encoder: Some(encoder),
            message_count: 0,
            max_indexed_messages: MAX_INDEX_SIZE / u64::from(agents.max(1)),
            length,
            file,
            error: None,
            viewer: None,
            server: None,
            warning: None,
        })
    }

    /// Id of the recording.
    pub(super) fn store_id(&self) -> &StoreId {
        &self.store_id
    }

    /// Number of messages in the file.
    pub(super) fn message_count(&self) -> u64 {
        self.message_count
    }

    /// Writes a chunk of rows.
    pub(super) fn send_chunk(&mut self, chunk: &Chunk) -> Result<(), RecordingError> {
        let message = chunk.to_arrow_msg()?;
        self.send(&LogMsg::ArrowMsg(self.store_id.clone(), message))
    }

    /// Writes chunks in order.
    pub(super) fn send_chunks(&mut self, chunks: &[Chunk]) -> Result<(), RecordingError> {
        chunks.iter().try_for_each(|chunk| self.send_chunk(chunk))
    }

    /// Writes a message. After a failure, every call fails with the same error.
    pub(super) fn send(&mut self, message: &LogMsg) -> Result<(), RecordingError> {
        let has_index = self.message_count < self.max_indexed_messages;
        self.length += self.with_encoder(|encoder| {
            if !has_index {
                encoder.do_not_emit_footer();
            }
            encoder.append(message)
        })?;
        self.message_count += 1;
        if let Some(server) = &self.server {
            server.announce(self.length);
        }
        if let Some(viewer) = &mut self.viewer
            && let Err(warning) = viewer.send(message.clone())
        {
            self.warn(warning);
        }
        Ok(())
    }

    /// Writes the messages of [`MessageBytes`].
    pub(super) fn send_encoded(&mut self, messages: &[u8]) -> Result<(), RecordingError> {
        for message in DecoderApp::decode_lazy(messages) {
            self.send(&message?)?;
        }
        Ok(())
    }

    /// Whether the file gets no index, so that messages can be encoded elsewhere.
    pub(super) fn has_no_index(&self) -> bool {
        self.message_count >= self.max_indexed_messages
    }

    /// Writes no index, whatever the number of messages.
    pub(super) fn without_index(mut self) -> Self {
        self.max_indexed_messages = 0;
        self
    }

    /// Writes chunks that were encoded elsewhere to a file [without an index](Self::has_no_index).
    pub(super) fn append(&mut self, chunks: &EncodedChunks<'_>) -> Result<(), RecordingError> {
        if chunks.messages == 0 {
            return Ok(());
        }
        if self.viewer.is_some() {
            return self.send_encoded(&chunks.as_file()?);
        }
        let mut file = self.file.clone();
        self.with_encoder(|encoder| {
            encoder.do_not_emit_footer();
            file.write_all(chunks.bytes).map_err(EncodeError::Write)
        })?;
        self.length += chunks.bytes.len() as u64;
        self.message_count += chunks.messages;
        if let Some(server) = &self.server {
            server.announce(self.length);
        }
        Ok(())
    }

    /// Also sends all further messages to a viewer.
    pub(super) fn push_to(&mut self, viewer: Viewer) {
        self.viewer = Some(viewer);
    }

    /// Serves the file at `path` to viewers.
    pub(super) fn serve_from(&mut self, server: Server, path: &Path) -> Result<(), RecordingError> {
        self.server = Some(server.start(path, self.length)?);
        Ok(())
    }

    /// Whether messages are also sent or served to viewers.
    pub(super) fn has_viewers(&self) -> bool {
        self.viewer.is_some() || self.server.is_some()
    }

    /// Stores a warning for [`take_warning`](Self::take_warning).
    pub(super) fn warn(&mut self, warning: RecordingError) {
        self.warning = Some(warning);
    }

    /// Takes the latest warning.
    pub(super) fn take_warning(&mut self) -> Option<RecordingError> {
        self.warning.take()
    }

    /// Writes all messages to the disk.
    pub(super) fn sync(&mut self) -> Result<(), RecordingError> {
        self.with_encoder(Encoder::flush_blocking)
    }

    /// What has been written of the file.
    pub(super) fn written(&self) -> Written {
        self.file.lock().hash.written()
    }

    /// Leaves the file without an index if it is dropped as it is now.
    pub(super) fn leave_without_index(&mut self) {
        if let Some(encoder) = &mut self.encoder {
            encoder.do_not_emit_footer();
        }
    }

    /// Completes the file: writes the index at its end, unless the file has too many messages for one.
    pub(super) fn finish(&mut self) -> Result<(), RecordingError> {
        self.with_encoder(|encoder| {
            encoder.finish()?;
            encoder.flush_blocking()
        })?;
        self.encoder = None;
        self.error = Some(RecordingError::Complete);
        let viewer_result = self.viewer.as_mut().map(Viewer::finish);
        let server_result = self.server.as_mut().map(RunningServer::finish);
        self.warning = self
            .warning
            .take()
            .or(viewer_result.or(server_result).and_then(Result::err));
        Ok(())
    }

    fn with_encoder<T>(
        &mut self,
        encode: impl FnOnce(&mut Encoder<HashedFile>) -> Result<T, EncodeError>,
    ) -> Result<T, RecordingError> {
        if let Some(error) = &self.error {
            return Err(error.clone());
        }
        let Some(encoder) = &mut self.encoder else {
            return Err(RecordingError::Complete);
        };
        encode(encoder)
            .map_err(RecordingError::from)
            .inspect_err(|error| self.close_after_error(error))
    }

    /// Truncates the file to its whole messages. The encoder is removed from the sink and replaced
    /// by its file, because the encoder would write an index if it were dropped.
    fn close_after_error(&mut self, error: &RecordingError) {
        self.error = Some(error.clone());
        if let Some(Ok(file)) = self.encoder.take().map(Encoder::into_inner) {
            // Only the first failure is reported.
            drop(file.lock().storage.truncate(self.length));
        }
    }
}

/// Chunks that are encoded as the messages of a separate file, for [`Sink::send_encoded`] and [`Sink::append`].
pub(super) struct MessageBytes {
    store_id: StoreId,
    encoder: Encoder<Vec<u8>>,
    messages: u64,
}

impl MessageBytes {
    /// Without messages, and without an index at the end.
    pub(super) fn new(store_id: &StoreId) -> Result<Self, RecordingError> {
        let mut encoder = new_encoder(Vec::new())?;
        encoder.do_not_emit_footer();
        Ok(Self {
            store_id: store_id.clone(),
            encoder,
            messages: 0,
        })
    }

    /// Encodes a chunk.
    pub(super) fn add(&mut self, chunk: &Chunk) -> Result<(), RecordingError> {
        let message = LogMsg::ArrowMsg(self.store_id.clone(), chunk.to_arrow_msg()?);
        self.encoder.append(&message)?;
        self.messages += 1;
        Ok(())
    }

    /// The encoded chunks.
    pub(super) fn into_bytes(self) -> Result<Vec<u8>, RecordingError> {
        Ok(self.encoder.into_inner()?)
    }

    /// The encoded chunks behind their number, without the header of a file, for [`EncodedChunks::read`].
    pub(super) fn into_chunks(self) -> Result<Vec<u8>, RecordingError> {
        let number = self.messages.to_le_bytes();
        let bytes = self.into_bytes()?;
        Ok([&number, &bytes[HEADER_LENGTH..]].concat())
    }
}

/// Number of bytes of the header of a file.
const HEADER_LENGTH: usize = StreamHeader::ENCODED_SIZE_BYTES;

/// Encoded chunks of several rows, without the header of a file.
pub(super) struct EncodedChunks<'a> {
    messages: u64,
    bytes: &'a [u8],
}

impl<'a> EncodedChunks<'a> {
    /// Those of [`MessageBytes::into_chunks`].
    pub(super) fn read(bytes: &'a [u8]) -> Self {
        let (number, bytes) = bytes.split_first_chunk().unwrap_or((&[0; 8], &[]));
        Self {
            messages: u64::from_le_bytes(*number),
            bytes,
        }
    }

    /// Those of several lists of [`MessageBytes::into_chunks`], one after the other.
    pub(super) fn join(lists: &[Vec<u8>]) -> Vec<u8> {
        let lists = lists.iter().map(|list| EncodedChunks::read(list));
        let (mut messages, mut joined) = (0, vec![0; 8]);
        for list in lists {
            messages += list.messages;
            joined.extend_from_slice(list.bytes);
        }
        joined[..8].copy_from_slice(&u64::to_le_bytes(messages));
        joined
    }

    /// These chunks as a file of their own, for [`Sink::send_encoded`].
    pub(super) fn as_file(&self) -> Result<Vec<u8>, RecordingError> {
        let mut file = new_encoder(Vec::new())?;
        file.do_not_emit_footer();
        let mut file = file.into_inner()?;
        file.extend_from_slice(self.bytes);
        Ok(file)
    }
}

fn new_encoder<W: Write>(storage: W) -> Result<Encoder<W>, EncodeError> {
    let options = EncodingOptions::PROTOBUF_COMPRESSED;
    Encoder::new_eager(CrateVersion::LOCAL, options, storage)
}

/// A file whose flush also syncs its storage, and which hashes what is written. The encoder and the sink both have it.
#[derive(Clone)]
struct HashedFile(Arc<Mutex<StorageAndHash>>);

struct StorageAndHash {
    storage: Box<dyn Storage>,
    hash: WrittenHash,
}

impl HashedFile {
    fn new(storage: Box<dyn Storage>) -> Self {
        let hash = WrittenHash::new();
        Self(Arc::new(Mutex::new(StorageAndHash { storage, hash })))
    }

    /// # Panics
    /// Never: no thread panics while it writes.
    fn lock(&self) -> MutexGuard<'_, StorageAndHash> {
        self.0.lock().expect("no thread panics while it writes")
    }
}

impl Write for HashedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut file = self.lock();
        let count = file.storage.write(bytes)?;
        file.hash.add(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        let mut file = self.lock();
        file.storage.flush()?;
        file.storage.sync()
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use rerun::{EntityPath, TextDocument};

    use super::*;
    use crate::record::rerun::rows::static_chunk;

    const AGENTS: u32 = 4;

    /// A simulated disk with space for `capacity` bytes.
    #[derive(Clone)]
    struct Disk {
        bytes: Arc<Mutex<Vec<u8>>>,
        capacity: Arc<AtomicUsize>,
    }

    impl Disk {
        fn used(&self) -> usize {
            self.bytes.lock().unwrap().len()
        }
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut stored = self.bytes.lock().unwrap();
            let fitting = bytes
                .len()
                .min(self.capacity.load(Ordering::Relaxed) - stored.len());
            stored.extend(&bytes[..fitting]);
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
        fn truncate(&mut self, length: u64) -> io::Result<()> {
            self.bytes.lock().unwrap().truncate(length as usize);
            Ok(())
        }

        fn sync(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn storage_full_error() -> RecordingError {
        io::Error::from(io::ErrorKind::StorageFull).into()
    }

    fn write_messages(capacity: usize, messages: u64) -> (Disk, Sink, Result<(), RecordingError>) {
        let disk = Disk {
            bytes: Arc::default(),
            capacity: Arc::new(capacity.into()),
        };
        let mut sink = Sink::new(
            StoreId::recording("test", "test"),
            AGENTS,
            Box::new(disk.clone()),
        )
        .unwrap();
        let chunk =
            static_chunk(EntityPath::from("text"), &TextDocument::new("some words")).unwrap();
        let sent = (0..messages).try_for_each(|_| sink.send_chunk(&chunk));
        (disk, sink, sent)
    }

    fn count_readable_messages(disk: &Disk) -> u64 {
        let bytes = disk.bytes.lock().unwrap().clone();
        let messages: Result<Vec<_>, _> = DecoderApp::decode_lazy(Cursor::new(bytes)).collect();
        messages.unwrap().len() as u64
    }

    #[test]
    fn messages_written_before_the_disk_is_full_stay_readable() {
        let (disk, mut sink, sent) = write_messages(10_000, 1000);
        assert_eq!(sent, Err(storage_full_error()));
        assert!(sink.message_count() > 3);
        let before = disk.used();
        assert!(before < 10_000);
        assert_eq!(count_readable_messages(&disk), sink.message_count());
        assert_eq!(
            (sink.sync(), sink.finish()),
            (Err(storage_full_error()), Err(storage_full_error()))
        );
        drop(sink);
        assert_eq!(disk.used(), before);
    }

    #[test]
    fn a_file_without_space_for_the_index_stays_readable() {
        let (disk, mut sink, sent) = write_messages(1_000_000, 10);
        sent.unwrap();
        let without_index = disk.used();
        disk.capacity.store(without_index + 100, Ordering::Relaxed);
        assert_eq!(sink.finish(), Err(storage_full_error()));
        drop(sink);
        assert_eq!(disk.used(), without_index);
        assert_eq!(count_readable_messages(&disk), 10);
    }

    /// A file of four agents with at most 8192 / 4 messages has an index, a file with more has none.
    #[test]
    fn a_file_with_many_messages_has_no_index() {
        for (messages, indexed) in [(2048, true), (2049, false)] {
            let (disk, mut sink, sent) = write_messages(100_000_000, messages);
            sent.unwrap();
            let before = disk.used();
            sink.finish().unwrap();
            assert_eq!(disk.used() > before, indexed);
            assert_eq!(count_readable_messages(&disk), messages);
        }
    }

    #[test]
    fn a_dropped_sink_writes_the_index() {
        let (disk, sink, _) = write_messages(1_000_000, 10);
        let without_index = disk.used();
        drop(sink);
        assert!(disk.used() > without_index);
        assert_eq!(count_readable_messages(&disk), 10);
    }

    #[test]
    fn encoded_chunks_are_written_as_messages() {
        let (disk, mut sink, _) = write_messages(1_000_000, 2);
        let store_id = sink.store_id().clone();
        let chunk = static_chunk(EntityPath::from("more"), &TextDocument::new("words")).unwrap();
        let mut encoded = MessageBytes::new(&store_id).unwrap();
        sink.send_encoded(&MessageBytes::new(&store_id).unwrap().into_bytes().unwrap())
            .unwrap();
        assert_eq!(sink.message_count(), 2);
        (0..2).for_each(|_| encoded.add(&chunk).unwrap());
        sink.send_encoded(&encoded.into_bytes().unwrap()).unwrap();
        assert_eq!(
            (sink.message_count(), count_readable_messages(&disk)),
            (4, 4)
        );
    }
}
