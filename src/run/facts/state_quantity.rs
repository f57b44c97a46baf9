//! The quantities of a visited state: what recordings store, axes and colors show, and conditions,
//! pages and exports name.

use seedbed_env::Quantity;

/// A quantity of a visited state, or of the episode that it is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateQuantity {
    /// The observation with this index.
    Observation(usize),
    /// The component of the action with this index.
    Action(usize),
    /// The entry of `info` with this index, which agents do not see.
    Info(usize),
    /// The environment's reward for the action.
    Reward,
    /// The bonus of the action.
    IntrinsicReward,
    /// The advantage of the action, as the agent estimated it.
    Advantage,
    /// Number of steps since the start of the episode.
    Step,
    /// Number of the agent's episode.
    Episode,
    /// Return of the episode.
    Return,
}

/// Keys of all kinds in their order.
const KEYS: [&str; 9] = [
    "observation",
    "action",
    "info",
    "reward",
    "intrinsic_reward",
    "advantage",
    "step",
    "episode",
    "return",
];

impl StateQuantity {
    /// Those that do not depend on the task.
    pub const OF_ALL_TASKS: [Self; 6] = [
        Self::Reward,
        Self::IntrinsicReward,
        Self::Advantage,
        Self::Step,
        Self::Episode,
        Self::Return,
    ];

    /// Place of the kind in the order in which quantities are shown, from 0.
    #[must_use]
    pub fn order(self) -> usize {
        match self {
            Self::Observation(_) => 0,
            Self::Action(_) => 1,
            Self::Info(_) => 2,
            Self::Reward => 3,
            Self::IntrinsicReward => 4,
            Self::Advantage => 5,
            Self::Step => 6,
            Self::Episode => 7,
            Self::Return => 8,
        }
    }

    /// Name of the kind in files, and of the column of a quantity that all tasks have.
    #[must_use]
    pub fn key(self) -> &'static str {
        KEYS[self.order()]
    }

    /// Name of the kind in figures and on the command line.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::IntrinsicReward => "intrinsic reward",
            other => other.key(),
        }
    }

    /// A quantity that all tasks have, with its title and a range. It has no unit.
    #[must_use]
    pub fn with_range(self, range: [f32; 2]) -> Quantity {
        Quantity {
            name: self.title().to_owned(),
            unit: String::new(),
            range,
        }
    }

    /// The quantities of a task by name: observations, actions, entries of `info`.
    pub fn of_task<'a>(
        observations: &'a [Quantity],
        actions: &'a [Quantity],
        info: &'a [Quantity],
    ) -> impl Iterator<Item = (Self, &'a Quantity)> {
        let numbered = |quantities: &'a [Quantity], quantity: fn(usize) -> Self| {
            let quantities = quantities.iter().enumerate();
            quantities.map(move |(index, named)| (quantity(index), named))
        };
        numbered(observations, Self::Observation)
            .chain(numbered(actions, Self::Action))
            .chain(numbered(info, Self::Info))
    }
}
