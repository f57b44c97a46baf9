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
mod runs;
mod settings;
mod states;

pub use self::error::FigureError;
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
}

impl RunFigure {
    /// Reads what the settings choose of some runs. Calls `on_episode` for each episode that is read.
    ///
    /// # Errors
    /// A run has no recording, agent or axis that is chosen, or cannot be read.
    pub fn read(
        settings: FigureSettings,
        runs: Vec<LoadedRun>,
        on_episode: &mut dyn FnMut(),
    ) -> Result<Self, FigureError> {
        let runs = runs::read(&settings, runs, on_episode)?;
        Ok(Self { settings, runs })
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
        page.figure()
    }
}
