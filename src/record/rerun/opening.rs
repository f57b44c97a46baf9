//! How a recording begins: what it is, and how it is shown.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{LogMsg, RowId};

use super::scene::Film;
use super::sink::Fault;
use super::{APPLICATION, RecordingAbout, RerunRecorder, about, blueprint, quantities};
use crate::record::{Colour, Footage, RecordingSettings};

impl RerunRecorder {
    /// Writes what is true throughout: what this recording is, names, colours, shapes.
    pub(super) fn introduce(
        &mut self,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
    ) -> Result<(), Fault> {
        let info = StoreInfo::new(
            self.sink.store().clone(),
            StoreSource::Other(format!("seedbed {}", env!("CARGO_PKG_VERSION"))),
        );
        self.sink.send(&LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: *RowId::new(),
            info,
        }))?;
        let mut chunks = about::chunks(about, settings)?.to_vec();
        chunks.push(quantities::chunk(about.spec, about.largest_bonus)?);
        chunks.extend(self.walls.furniture(&self.drawing, &self.pictures)?);
        chunks.extend(self.curves.styles()?);
        let (panels, own) = (
            self.drawing.pairs.panels().len(),
            self.drawing.colouring.by == Colour::Agent,
        );
        for (agent, track) in (0..).zip(&self.agents) {
            chunks.extend(track.sample.styles(
                own.then_some(agent),
                self.quota.per_round,
                panels,
            )?);
        }
        chunks.extend(self.team.styles(None, self.quota.per_round, panels)?);
        chunks.extend(
            self.pictures
                .styles(&self.drawing.axes, &self.drawing.pairs)?,
        );
        for film in &self.films {
            chunks.extend(film.shapes()?);
        }
        chunks
            .iter()
            .try_for_each(|chunk| self.sink.send_chunk(chunk))
    }

    /// How the recording is shown; the first films tell where their actors are.
    pub(super) fn lay_out(&mut self, footage: &[Footage]) -> Result<(), Fault> {
        let colours = self.walls.colours(&self.drawing.colouring)?;
        colours
            .iter()
            .try_for_each(|chunk| self.sink.send_chunk(chunk))?;
        let messages = blueprint::messages(APPLICATION, &self.layout(footage))?;
        messages
            .iter()
            .try_for_each(|message| self.sink.send(message))
    }

    fn layout(&self, footage: &[Footage]) -> blueprint::Layout {
        blueprint::Layout {
            agents: self.agents.len() as u32,
            walls: self.walls,
            quota: self.quota,
            window: self.window,
            time_limit: self.spec.time_limit,
            control_step: self.control_step,
            focus: self.focus,
            coloured_by: self.drawing.colouring.title(),
            curious: self.largest_bonus.is_some(),
            compared: self.compared,
            filmed: self
                .films
                .iter()
                .map(|film| filmed(film, footage))
                .collect(),
        }
    }
}

fn filmed(film: &Film, footage: &[Footage]) -> blueprint::Filmed {
    let of_agent = footage.iter().find(|footage| footage.agent == film.agent());
    // An agent that is filmed later is at a place like that of another.
    let bounds = of_agent
        .or(footage.first())
        .and_then(|footage| film.view(footage));
    blueprint::Filmed {
        agent: film.agent(),
        origin: film.origin(),
        bounds,
    }
}
