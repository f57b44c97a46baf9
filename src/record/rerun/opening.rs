//! How a recording begins: what it is, and how it is shown.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{LogMsg, RowId};

use super::sink::Fault;
use super::{APPLICATION, RecordingAbout, RerunRecorder, about, blueprint};
use crate::record::Colour;
use crate::record::Footage;

impl RerunRecorder {
    /// Writes what is true throughout: what this recording is, names, colours, shapes.
    pub(super) fn introduce(&mut self, about: &RecordingAbout<'_>) -> Result<(), Fault> {
        let info =
            StoreInfo::new(self.sink.store().clone(), StoreSource::Other(format!("seedbed {}", env!("CARGO_PKG_VERSION"))));
        self.sink.send(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: *RowId::new(), info }))?;
        let mut chunks = about::chunks(about)?.to_vec();
        chunks.extend(self.walls.furniture(&self.drawing, &self.pictures)?);
        chunks.extend(self.curves.styles()?);
        let (panels, own) = (self.drawing.pairs.panels().len(), self.drawing.colouring.by == Colour::Agent);
        for (agent, track) in (0..).zip(&self.agents) {
            chunks.extend(track.sample.styles(own.then_some(agent), self.quota.per_round, panels)?);
        }
        chunks.extend(self.team.styles(None, self.quota.per_round, panels)?);
        chunks.extend(self.pictures.styles(&self.drawing.axes, &self.drawing.pairs)?);
        if let Some(film) = &self.film {
            chunks.extend(film.shapes()?);
        }
        chunks.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))
    }

    /// How the recording is shown; the first film tells where its actors are.
    pub(super) fn lay_out(&mut self, footage: Option<&Footage>) -> Result<(), Fault> {
        let colours = self.walls.colours(&self.drawing.colouring)?;
        colours.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))?;
        let messages = blueprint::messages(APPLICATION, &self.layout(footage))?;
        messages.iter().try_for_each(|message| self.sink.send(message))
    }

    fn layout(&self, footage: Option<&Footage>) -> blueprint::Layout {
        blueprint::Layout {
            agents: self.agents.len() as u32,
            walls: self.walls,
            quota: self.quota,
            time_limit: self.spec.time_limit,
            coloured_by: self.drawing.colouring.title(),
            curious: self.largest_bonus.is_some(),
            compared: self.compared,
            filmed: self.film.as_ref().map(|film| blueprint::Filmed {
                agent: film.agent(),
                origin: film.origin(),
                bounds: footage.and_then(|footage| film.view(footage)),
            }),
        }
    }
}
