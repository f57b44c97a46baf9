//! How a recording begins: what it is, and how it is shown.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{LogMsg, RowId};

use super::scene::Film;
use super::sink::Fault;
use super::{APPLICATION, RecordingAbout, RerunRecorder, about, axes, blueprint};
use crate::record::{Footage, RecordingSettings};

impl RerunRecorder {
    /// Writes what is true throughout: what this recording is, names, colours, shapes.
    pub(super) fn introduce(&mut self, about: &RecordingAbout<'_>, settings: &RecordingSettings) -> Result<(), Fault> {
        let info =
            StoreInfo::new(self.sink.store().clone(), StoreSource::Other(format!("seedbed {}", env!("CARGO_PKG_VERSION"))));
        self.sink.send(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: *RowId::new(), info }))?;
        let mut chunks = about::chunks(about, settings)?.to_vec();
        let layout = self.layout(&[]);
        chunks.extend(axes::furniture(&self.axes, layout.wide_lettering(), layout.narrow_lettering())?);
        chunks.extend(self.curves.styles()?);
        for (agent, track) in (0..).zip(&self.agents) {
            chunks.extend(track.visits.styles(&self.axes, agent, self.quota.per_round)?);
        }
        chunks.push(self.team_pictures.style(&self.axes)?);
        for film in &self.films {
            chunks.extend(film.shapes()?);
        }
        chunks.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))
    }

    /// How the recording is shown; the first films tell where their actors are.
    pub(super) fn lay_out(&mut self, footage: &[Footage]) -> Result<(), Fault> {
        let messages = blueprint::messages(APPLICATION, &self.layout(footage))?;
        messages.iter().try_for_each(|message| self.sink.send(message))
    }

    fn layout(&self, footage: &[Footage]) -> blueprint::Layout<'_> {
        blueprint::Layout {
            agents: self.agents.len() as u32,
            axes: &self.axes,
            quota: self.quota,
            time_limit: self.time_limit,
            control_step: self.control_step,
            focus: self.focus,
            filmed: self.films.iter().map(|film| filmed(film, footage)).collect(),
        }
    }
}

fn filmed(film: &Film, footage: &[Footage]) -> blueprint::Filmed {
    let of_agent = footage.iter().find(|footage| footage.agent == film.agent());
    // An agent that is filmed later is at a place like that of another.
    let bounds = of_agent.or(footage.first()).and_then(|footage| film.view(footage));
    blueprint::Filmed { agent: film.agent(), origin: film.origin(), bounds }
}
