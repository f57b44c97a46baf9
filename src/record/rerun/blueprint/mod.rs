//! The blueprint, which determines the views in which the viewer opens a recording. Views of
//! visited states are on the left; returns, updates and the scene are on the right.

mod motion;
mod visitation;

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

use super::error::RecordingError;
use super::layouts::Layouts;
use super::rows::{EPISODE, rgb, single_row_chunk};
use crate::record::visitation::LineQuota;
use crate::run::facts::metrics::{Metric, Range, round_metrics_in_display_order};
use crate::run::recorder::Focus;
use crate::scenario::recording::Difference;
use seedbed_scene::camera::Bounds;

/// Maximum number of agents in a legend. A larger legend would cover the curves.
const MAX_AGENTS_IN_LEGEND: u32 = 8;

/// Color of density images where no state was visited.
const BACKGROUND: [u8; 3] = [0, 0, 4];

/// Properties of a recording on which its blueprint depends.
#[derive(Clone)]
pub(super) struct BlueprintConfig {
    pub(super) agents: u32,
    pub(super) layouts: Layouts,
    pub(super) line_quota: LineQuota,
    /// Number of latest rounds in one image.
    pub(super) window: u32,
    pub(super) time_limit: u32,
    pub(super) control_step: f64,
    pub(super) focus: Focus,
    /// Quantity shown by the color of lines and points.
    pub(super) colored_by: &'static str,
    /// Whether agents have a bonus.
    pub(super) has_bonus: bool,
    /// The two agents that are compared.
    pub(super) difference: Difference,
    pub(super) scenes: Vec<SceneView>,
}

/// The view of one agent's scene.
#[derive(Clone)]
pub(super) struct SceneView {
    /// The agent.
    pub(super) agent: u32,
    /// The entity whose frame the view shows.
    pub(super) origin: String,
    /// The bounds of the scene that are shown when the recording is opened.
    pub(super) bounds: Option<Bounds>,
}

/// Messages that contain the blueprint and activate it.
pub(super) fn messages(
    application: &'static str,
    config: &BlueprintConfig,
) -> Result<Vec<LogMsg>, RecordingError> {
    let mut builder = ViewBuilder::default();
    let blueprint = builder.blueprint(config);
    let mut messages = blueprint_messages(application, &blueprint)?;
    let Some(store) = messages.first().map(|message| message.store_id().clone()) else {
        return Ok(messages);
    };
    // The last message activates the blueprint.
    let activation_index = messages.len() - 1;
    for (entity, property) in &builder.properties {
        let start = TimePoint::default().with(Timeline::new_sequence("blueprint"), 0);
        let chunk = single_row_chunk(entity.clone(), start, property.as_ref())?;
        let message = chunk.to_arrow_msg()?;
        messages.insert(activation_index, LogMsg::ArrowMsg(store.clone(), message));
    }
    Ok(messages)
}

/// Messages of a blueprint. The SDK returns them through a stream only.
fn blueprint_messages(
    application: &'static str,
    blueprint: &Blueprint,
) -> Result<Vec<LogMsg>, RecordingError> {
    // The SDK panics if it has to make a blueprint while it is turned off.
    if !rerun::decide_logging_enabled(true) {
        return Err(RecordingError::TurnedOff);
    }
    let (stream, storage) = RecordingStreamBuilder::new(application)
        .enabled(true)
        .memory()?;
    blueprint.send(&stream, BlueprintActivation::default())?;
    stream.flush_blocking()?;
    Ok(storage
        .take()
        .into_iter()
        .filter(|message| message.store_id().kind() == StoreKind::Blueprint)
        .collect())
}

/// Builds views, and collects properties of views for which the SDK has no setters.
#[derive(Default)]
struct ViewBuilder {
    properties: Vec<(EntityPath, Box<dyn AsComponents>)>,
}

impl ViewBuilder {
    fn blueprint(&mut self, config: &BlueprintConfig) -> Blueprint {
        if config.focus == Focus::Motion && !config.scenes.is_empty() {
            return self.motion_blueprint(config);
        }
        let columns = [self.visitation_tabs(config), self.learning_column(config)];
        let time_panel = TimePanel::new()
            .with_timeline(EPISODE)
            .with_play_state(PlayState::Following);
        blueprint_of_columns(columns, [3.0, 2.0], time_panel)
    }

    fn learning_column(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let name = if config.agents > 1 {
            "Returns: each agent, and mean of the team over 25 rounds (thick)"
        } else {
            "Returns, and their mean over 25 rounds (thick)"
        };
        let returns: ContainerLike = TimeSeriesView::new(name)
            .with_origin("/curves/return")
            .into();
        self.set_legend(&returns, config);
        self.show_all_times(&returns);
        let metrics = round_metrics_in_display_order().into_iter();
        let updates: Vec<_> = metrics
            .filter(|metric| metric.recorded)
            .map(|metric| self.update_view(metric))
            .collect();
        let [how_to_read, scenario] = text_views();
        let other_tabs = [Some(how_to_read), self.scenes(config), Some(scenario)];
        Vertical::new([
            returns,
            Tabs::new(updates).into(),
            Tabs::new(other_tabs.into_iter().flatten()).into(),
        ])
        .with_row_shares([3.0, 2.0, 3.0])
        .into()
    }

    /// Shows the names of curves if they are few.
    fn set_legend(&mut self, view: &ContainerLike, config: &BlueprintConfig) {
        let legend = PlotLegend::new()
            .with_corner(Corner2D::RightBottom)
            .with_visible(config.agents <= MAX_AGENTS_IN_LEGEND);
        self.set_property(view, "PlotLegend", legend);
    }

    fn update_view(&mut self, metric: &Metric) -> ContainerLike {
        let view: ContainerLike = TimeSeriesView::new(title(metric))
            .with_origin(format!("/curves/{}", metric.key))
            .into();
        self.set_property(&view, "PlotLegend", PlotLegend::new().with_visible(false));
        self.show_all_times(&view);
        if metric.axis_shows_full_range && metric.range == Range::Share {
            self.set_property(
                &view,
                "ScalarAxis",
                ScalarAxis::new().with_range(Range1D::new(0.0, 1.0)),
            );
        }
        view
    }

    /// Makes a plot show all rows, from the first to the last, on every timeline.
    fn show_all_times(&mut self, view: &ContainerLike) {
        let always = TimeRange {
            start: TimeRangeBoundary::Infinite,
            end: TimeRangeBoundary::Infinite,
        };
        self.set_property(view, "TimeAxis", TimeAxis::new().with_view_range(always));
    }

    fn scene(&mut self, scene: &SceneView) -> ContainerLike {
        let name = format!("Motion of agent {}", scene.agent);
        let view = Spatial2DView::new(name).with_origin(scene.origin.as_str());
        let view: ContainerLike = view
            .with_contents([format!("/scene/agent_{}/**", scene.agent)])
            .into();
        if let Some([left, right, top, bottom]) = scene.bounds.map(|bounds| bounds.map(f64::from)) {
            let bounds = Range2D {
                x_range: [left, right].into(),
                y_range: [top, bottom].into(),
            };
            self.set_property(&view, "VisualBounds2D", VisualBounds2D::new(bounds));
        }
        self.set_background(&view);
        view
    }

    fn set_background(&mut self, view: &ContainerLike) {
        self.set_property(
            view,
            "Background",
            Background::new(BackgroundKind::SolidColor).with_color(rgb(BACKGROUND)),
        );
    }

    fn set_property(
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

/// A blueprint of columns with the given shares of the width, in which the panels of the viewer are
/// closed.
fn blueprint_of_columns(
    columns: impl IntoIterator<Item = ContainerLike>,
    shares: [f32; 2],
    time_panel: TimePanel,
) -> Blueprint {
    Blueprint::new(Horizontal::new(columns).with_column_shares(shares))
        .with_auto_views(false)
        .with_auto_layout(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(time_panel.with_state(PanelState::Collapsed))
}

/// The pages of text: how to read the recording, and its scenario.
fn text_views() -> [ContainerLike; 2] {
    [("How to read", "/how_to_read"), ("Scenario", "/scenario")]
        .map(|(name, entity)| TextDocumentView::new(name).with_origin(entity).into())
}

/// The title of a view of a metric, such as `Clipped fraction`.
fn title(metric: &Metric) -> String {
    let label = metric.label();
    label[..1].to_uppercase() + &label[1..]
}
