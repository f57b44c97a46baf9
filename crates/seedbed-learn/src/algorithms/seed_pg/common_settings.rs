//! The settings that all algorithms have whose agents are [`SeedPgAgent`](super::SeedPgAgent)s. In a scenario they are
//! fields beside the own settings of the algorithm, so that each configuration has them as its own fields.

/// Passes the settings that all algorithms have whose agents are Seed-PG's to another macro.
macro_rules! with_common_settings {
    ($then:ident! { $($first:tt)* }) => {
        $then! {
            $($first)*
            /// Over which samples advantages are standardized, if at all.
            standardize: Standardization,
            /// How targets of the value function are normalized.
            returns: ReturnNormalization,
            /// Discount factor γ.
            discount: Fraction,
            /// Whether the time limit counts as the end of an episode.
            time_limit: TimeLimit,
            /// How observations are scaled for the networks.
            observations: ObservationScaling,
            /// How actions are chosen from the policy's distribution.
            actions: Located<ActionSelection>,
            /// Whether each agent has networks of its own.
            networks: Located<Networks>,
            /// Number of units of each hidden layer, the same for both networks.
            #[serde(deserialize_with = "short_located_list")]
            hidden: Located<Vec<Count<4096>>>,
            /// Number of passes over the trajectories of a round.
            epochs: Count<10_000>,
            /// Samples that one gradient step is computed from.
            minibatch: Minibatch,
            /// Maximal Euclidean norm of each network's gradient; `None`: no maximum.
            gradient_clip: Option<Positive>,
            /// Initial standard deviation of continuous actions, as a share of half their range.
            initial_deviation: Positive,
            /// The policy's optimizer.
            policy_optimizer: AdamSettings,
            /// The value function's optimizer.
            value_optimizer: AdamSettings,
            /// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
            bonus: Located<Bonus>,
        }
    };
}
pub(in crate::algorithms) use with_common_settings;

/// Declares a configuration: its own settings, then the common ones.
macro_rules! configuration {
    (
        $(#[$about:meta])*
        pub struct $name:ident { $($own:tt)* }
        $($(#[$meaning:meta])* $setting:ident: $type:ty,)*
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $($own)*
            $($(#[$meaning])* pub $setting: $type,)*
        }
    };
}
pub(in crate::algorithms) use configuration;

/// Copies the common settings from one configuration to another.
macro_rules! copy_settings {
    ($from:ident to $to:ident: $($(#[$meaning:meta])* $setting:ident: $type:ty,)*) => {
        $($to.$setting.clone_from(&$from.$setting);)*
    };
}
pub(in crate::algorithms) use copy_settings;
