//! How a recording begins: what it is, and how it is shown.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{LogMsg, RowId};

use super::sink::Fault;
use super::{APPLICATION, RecordingAbout, RerunRecorder, about, axes, blueprint, quantities};
use crate::record::Footage;

impl RerunRecorder {
    /// Writes what is true throughout: what this recording is, names, colours, shapes.
    pub(super) fn introduce(&mut self, about: &RecordingAbout<'_>) -> Result<(), Fault> {
        let info =
            StoreInfo::new(self.sink.store().clone(), StoreSource::Other(format!("seedbed {}", env!("CARGO_PKG_VERSION"))));
        self.sink.send(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: *RowId::new(), info }))?;
        let mut chunks = about::chunks(about)?.to_vec();
        chunks.push(quantities::chunk(about.spec, about.largest_bonus)?);
        let layout = self.layout(None);
        chunks.extend(axes::furniture(&self.axes, layout.wide_lettering(), layout.narrow_lettering())?);
        chunks.extend(self.curves.styles()?);
        for (agent, track) in (0..).zip(&self.agents) {
            chunks.extend(track.visits.styles(&self.axes, agent, self.quota.per_round)?);
        }
        chunks.push(self.team_pictures.style(&self.axes)?);
        if let Some(film) = &self.film {
            chunks.extend(film.shapes()?);
        }
        chunks.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))
    }

    /// How the recording is shown; the first film tells where its actors are.
    pub(super) fn lay_out(&mut self, footage: Option<&Footage>) -> Result<(), Fault> {
        let messages = blueprint::messages(APPLICATION, &self.layout(footage))?;
        messages.iter().try_for_each(|message| self.sink.send(message))
    }

    fn layout(&self, footage: Option<&Footage>) -> blueprint::Layout<'_> {
        blueprint::Layout {
            agents: self.agents.len() as u32,
            axes: &self.axes,
            quota: self.quota,
            time_limit: self.time_limit,
            filmed: self.film.as_ref().map(|film| blueprint::Filmed {
                agent: film.agent(),
                origin: film.origin(),
                bounds: footage.and_then(|footage| film.view(footage)),
            }),
        }
    }
}
