//! Figures of runs: visited states, differences of agents, returns and curves on one page, and example
//! distributions.
//!
//! [`RunFigure::read`] gathers the states that [`FigureSettings`] choose, [`RunFigure::draw`] arranges the
//! panels of all parts. `states` has the panels of visited states, `curves` those over episodes and
//! rounds. `seedbed-figure` draws them.

mod curves;
pub mod distributions;
mod error;
mod page;
mod progress;
mod runs;
mod settings;
mod states;

pub use self::error::FigureError;
pub use self::progress::Over;
pub use self::settings::{DEFAULT_WIDTH, FigureSettings, Part};

use self::page::PlotPage;
use self::runs::PlottedRun;
use crate::review::LoadedRun;
use seedbed_figure::Figure;

/// A figure of runs before it is drawn.
#[derive(Debug)]
pub struct RunFigure {
    settings: FigureSettings,
    runs: Vec<PlottedRun>,
    /// For people: what is left out.
    notes: Vec<String>,
}

impl RunFigure {
    /// Reads what the settings choose of some runs. Without a recording, the default parts are returns and curves. Calls `on_episode` for each episode that is read.
    ///
    /// # Errors
    /// A run has no recording, agent or axis that is chosen, or cannot be read.
    pub fn read(
        mut settings: FigureSettings,
        runs: Vec<LoadedRun>,
        on_episode: &mut dyn FnMut(),
    ) -> Result<Self, FigureError> {
        let mut notes = Vec::new();
        let unrecorded = runs.iter().find(|run| run.recording.is_none());
        if let (Some(run), true) = (unrecorded, settings.parts.is_empty()) {
            settings.parts = vec![Part::Returns, Part::Curves];
            let run = run.path.display();
            notes.push(format!(
                "only returns and curves are drawn, because {run} has no recording"
            ));
        }
        let runs = runs::read(&settings, runs, on_episode)?;
        notes.extend(runs::note_on_tasks(&settings, &runs));
        Ok(Self {
            settings,
            runs,
            notes,
        })
    }

    /// The figure, and notes for people on what it leaves out.
    ///
    /// # Errors
    /// A run has nothing to draw for a part that is chosen.
    pub fn draw(&self) -> Result<(Figure, Vec<String>), FigureError> {
        let page = PlotPage {
            settings: &self.settings,
            runs: &self.runs,
        };
        let (figure, notes) = page.figure()?;
        Ok((figure, [self.notes.clone(), notes].concat()))
    }
}
