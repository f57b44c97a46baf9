//! How the viewer opens a recording: pictures of visited states on the left, returns, updates and the scene on the right.

mod stage;
mod visited;

use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel,
    Spatial2DView, Tabs, TextDocumentView, TimePanel, TimeSeriesView, Vertical,
};
use rerun::components::Range1D;
use rerun::datatypes::{Range2D, TimeRange, TimeRangeBoundary};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, PlotLegend, ScalarAxis, TimeAxis, VisualBounds2D,
};
use rerun::external::re_sdk_types::blueprint::components::{
    BackgroundKind, Corner2D, PanelState, PlayState,
};
use rerun::log::LogMsg;
use rerun::{AsComponents, EntityPath, RecordingStreamBuilder, StoreKind, TimePoint, Timeline};

use super::Focus;
use super::curves::{TEAM_CURVES, UPDATE_CURVES};
use super::framing::Bounds;
use super::rows::{EPISODE, rgb, single_row};
use super::sink::Fault;
use super::walls::Walls;
use crate::record::visitation::LineQuota;

/// With more agents than this, a legend would cover the curves.
const AGENTS_IN_LEGEND: u32 = 8;

/// As dark as what the density image shows where nothing was visited.
const BACKGROUND: [u8; 3] = [0, 0, 4];

/// What the layout depends on.
#[derive(Clone)]
pub(super) struct Layout {
    pub(super) agents: u32,
    pub(super) walls: Walls,
    pub(super) quota: LineQuota,
    /// Rounds that are pictured together.
    pub(super) window: u32,
    pub(super) time_limit: u32,
    pub(super) control_step: f64,
    pub(super) focus: Focus,
    /// What the colour of lines and points tells, in a word.
    pub(super) coloured_by: &'static str,
    /// Whether there are bonuses.
    pub(super) curious: bool,
    /// Whether two agents are compared.
    pub(super) compared: bool,
    pub(super) filmed: Vec<Filmed>,
}

/// The scene that is shown.
#[derive(Clone)]
pub(super) struct Filmed {
    /// Whose bodies are drawn.
    pub(super) agent: u32,
    /// The entity from which they are seen.
    pub(super) origin: String,
    /// Where they were at first.
    pub(super) bounds: Option<Bounds>,
}

/// The messages that make the viewer show `layout`.
pub(super) fn messages(application: &'static str, layout: &Layout) -> Result<Vec<LogMsg>, Fault> {
    let mut sheet = Sheet::default();
    let blueprint = sheet.blueprint(layout);
    let mut messages = encoded(application, &blueprint)?;
    let Some(store) = messages.first().map(|message| message.store_id().clone()) else {
        return Ok(messages);
    };
    let activation = messages.len() - 1;
    for (entity, property) in &sheet.properties {
        let start = TimePoint::default().with(Timeline::new_sequence("blueprint"), 0);
        let chunk = single_row(entity.clone(), start, property.as_ref())?;
        let message = chunk.to_arrow_msg().map_err(|error| error.to_string())?;
        messages.insert(activation, LogMsg::ArrowMsg(store.clone(), message));
    }
    Ok(messages)
}

/// The SDK hands out a blueprint's messages only through a stream.
fn encoded(application: &'static str, blueprint: &Blueprint) -> Result<Vec<LogMsg>, Fault> {
    let in_words = |error: rerun::RecordingStreamError| error.to_string();
    let (stream, storage) = RecordingStreamBuilder::new(application)
        .enabled(true)
        .memory()
        .map_err(in_words)?;
    blueprint
        .send(&stream, BlueprintActivation::default())
        .map_err(in_words)?;
    stream.flush_blocking().map_err(|error| error.to_string())?;
    Ok(storage
        .take()
        .into_iter()
        .filter(|message| message.store_id().kind() == StoreKind::Blueprint)
        .collect())
}

/// Collects the properties of views, which the SDK's own views cannot hold.
#[derive(Default)]
struct Sheet {
    properties: Vec<(EntityPath, Box<dyn AsComponents>)>,
}

impl Sheet {
    fn blueprint(&mut self, layout: &Layout) -> Blueprint {
        if layout.focus == Focus::Motion && !layout.filmed.is_empty() {
            return self.stage(layout);
        }
        let columns = [self.visited(layout), self.learned(layout)];
        let time = TimePanel::new()
            .with_timeline(EPISODE)
            .with_play_state(PlayState::Following);
        page(columns, [3.0, 2.0], time)
    }

    fn learned(&mut self, layout: &Layout) -> ContainerLike {
        let name = "Returns: each agent, and the team's mean of 25 rounds in white";
        let returns: ContainerLike = TimeSeriesView::new(name)
            .with_origin("/curves/return")
            .into();
        let legend = PlotLegend::new()
            .with_corner(Corner2D::RightBottom)
            .with_visible(layout.agents <= AGENTS_IN_LEGEND);
        self.property(&returns, "PlotLegend", legend);
        self.all_times(&returns);
        let updates: Vec<_> = UPDATE_CURVES
            .iter()
            .chain(&TEAM_CURVES)
            .map(|(name, _)| self.update(name))
            .collect();
        let mut rest: Vec<ContainerLike> = vec![
            TextDocumentView::new("Scenario")
                .with_origin("/scenario")
                .into(),
        ];
        if let Some(scenes) = self.scenes(layout) {
            rest.insert(0, scenes);
        }
        Vertical::new([returns, Tabs::new(updates).into(), Tabs::new(rest).into()])
            .with_row_shares([3.0, 2.0, 3.0])
            .into()
    }

    fn update(&mut self, curve: &str) -> ContainerLike {
        let view: ContainerLike = TimeSeriesView::new(title(curve))
            .with_origin(format!("/curves/{curve}"))
            .into();
        self.property(&view, "PlotLegend", PlotLegend::new().with_visible(false));
        self.all_times(&view);
        if curve == "clipped_fraction" {
            self.property(
                &view,
                "ScalarAxis",
                ScalarAxis::new().with_range(Range1D::new(0.0, 1.0)),
            );
        }
        view
    }

    /// From the first to the last moment, on any timeline.
    fn all_times(&mut self, view: &ContainerLike) {
        let always = TimeRange {
            start: TimeRangeBoundary::Infinite,
            end: TimeRangeBoundary::Infinite,
        };
        self.property(view, "TimeAxis", TimeAxis::new().with_view_range(always));
    }

    fn scene(&mut self, filmed: &Filmed) -> ContainerLike {
        let name = format!("Agent {} in motion", filmed.agent);
        let view = Spatial2DView::new(name).with_origin(filmed.origin.as_str());
        let view: ContainerLike = view
            .with_contents([format!("/scene/agent_{}/**", filmed.agent)])
            .into();
        if let Some([left, right, top, bottom]) = filmed.bounds.map(|bounds| bounds.map(f64::from))
        {
            let bounds = Range2D {
                x_range: [left, right].into(),
                y_range: [top, bottom].into(),
            };
            self.property(&view, "VisualBounds2D", VisualBounds2D::new(bounds));
        }
        self.background(&view);
        view
    }

    fn background(&mut self, view: &ContainerLike) {
        self.property(
            view,
            "Background",
            Background::new(BackgroundKind::SolidColor).with_color(rgb(BACKGROUND)),
        );
    }

    fn property(
        &mut self,
        view: &ContainerLike,
        name: &str,
        property: impl AsComponents + 'static,
    ) {
        if let ContainerLike::View(view) = view {
            self.properties
                .push((view.blueprint_path().join(&name.into()), Box::new(property)));
        }
    }
}

/// Columns with these shares of the width, and nothing of the viewer's own open beside them.
fn page(
    columns: impl IntoIterator<Item = ContainerLike>,
    shares: [f32; 2],
    time: TimePanel,
) -> Blueprint {
    Blueprint::new(Horizontal::new(columns).with_column_shares(shares))
        .with_auto_views(false)
        .with_auto_layout(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(time.with_state(PanelState::Collapsed))
}

/// `clipped_fraction` becomes `Clipped fraction`.
fn title(curve: &str) -> String {
    let words = curve.replace('_', " ");
    words[..1].to_uppercase() + &words[1..]
}
