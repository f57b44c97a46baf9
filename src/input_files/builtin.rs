//! Tasks and scenarios that are built into the program.

use seedbed_input::BuiltinFile;

/// Paths and texts of files of the repository.
macro_rules! builtin_files {
    ($($path:literal,)*) => {
        &[$(BuiltinFile { path: $path, text: include_str!(concat!("../../", $path)) }),*]
    };
}

/// All built-in files, sorted by directory and name.
#[rustfmt::skip]
pub const BUILTIN_FILES: &[BuiltinFile] = builtin_files![
    "envs/acrobot.ron",
    "envs/acrobot_side.ron",
    "envs/acrobot_side_easy.ron",
    "envs/ball_on_beam.ron",
    "envs/cartpole.ron",
    "envs/cartpole_continuous.ron",
    "envs/cartpole_gym.ron",
    "envs/cartpole_swingup.ron",
    "envs/cartpole_swingup_balance.ron",
    "envs/cartpole_swingup_concurrent.ron",
    "envs/cartpole_swingup_sparse.ron",
    "envs/cartpole_swingup_team.ron",
    "envs/cheetah.ron",
    "envs/corridors.ron",
    "envs/corridors_drawn.ron",
    "envs/corridors_drawn_long.ron",
    "envs/corridors_drawn_short.ron",
    "envs/corridors_noisy.ron",
    "envs/corridors_north_east.ron",
    "envs/corridors_rules.ron",
    "envs/corridors_south_east.ron",
    "envs/deep_sea.ron",
    "envs/deep_sea_20.ron",
    "envs/deep_sea_20_permuted.ron",
    "envs/deep_sea_permuted.ron",
    "envs/dm_acrobot_swingup.ron",
    "envs/dm_acrobot_swingup_sparse.ron",
    "envs/dm_ball_in_cup_catch.ron",
    "envs/dm_cartpole_balance.ron",
    "envs/dm_cartpole_balance_sparse.ron",
    "envs/dm_cartpole_swingup.ron",
    "envs/dm_cartpole_swingup_sparse.ron",
    "envs/dm_cheetah_run.ron",
    "envs/dm_finger_spin.ron",
    "envs/dm_finger_turn_easy.ron",
    "envs/dm_finger_turn_hard.ron",
    "envs/dm_hopper_hop.ron",
    "envs/dm_hopper_stand.ron",
    "envs/dm_pendulum_swingup.ron",
    "envs/dm_point_mass_easy.ron",
    "envs/dm_reacher_easy.ron",
    "envs/dm_reacher_hard.ron",
    "envs/dm_walker_run.ron",
    "envs/dm_walker_stand.ron",
    "envs/dm_walker_walk.ron",
    "envs/double_pendulum_cart.ron",
    "envs/gym_bipedal_walker.ron",
    "envs/gym_half_cheetah.ron",
    "envs/gym_hopper.ron",
    "envs/gym_inverted_double_pendulum.ron",
    "envs/gym_inverted_pendulum.ron",
    "envs/gym_lunar_lander.ron",
    "envs/gym_lunar_lander_continuous.ron",
    "envs/gym_reacher.ron",
    "envs/gym_swimmer.ron",
    "envs/gym_walker2d.ron",
    "envs/hills_1.ron",
    "envs/hills_3.ron",
    "envs/hills_5.ron",
    "envs/hills_easy.ron",
    "envs/hooks_1.ron",
    "envs/hooks_3.ron",
    "envs/hooks_4.ron",
    "envs/hooks_easy.ron",
    "envs/hopper.ron",
    "envs/lander.ron",
    "envs/mountain_car_continuous.ron",
    "envs/mountain_car_continuous_sparse.ron",
    "envs/parking.ron",
    "envs/pendulum.ron",
    "envs/plugs_2.ron",
    "envs/plugs_3.ron",
    "envs/plugs_easy.ron",
    "envs/puck_maze.ron",
    "envs/quadrotor_side.ron",
    "envs/quadrotor_side_easy.ron",
    "envs/ring.ron",
    "envs/rods_3.ron",
    "envs/rods_easy.ron",
    "envs/storeys_1.ron",
    "envs/storeys_2.ron",
    "envs/storeys_easy.ron",
    "envs/swingup_side.ron",
    "envs/swingup_side_easy.ron",
    "envs/travel_side.ron",
    "envs/travel_side_easy.ron",
    "envs/two_poles.ron",
    "envs/valleys_2.ron",
    "envs/valleys_easy.ron",
    "envs/mistakes/ball_on_beam_naive.ron",
    "envs/mistakes/parking_distance.ron",
    "envs/mistakes/parking_naive.ron",
    "envs/mistakes/two_poles_naive.ron",
    "scenarios/ball_on_beam.ron",
    "scenarios/cartpole.ron",
    "scenarios/cartpole_1.ron",
    "scenarios/cartpole_16.ron",
    "scenarios/cartpole_256.ron",
    "scenarios/cartpole_continuous.ron",
    "scenarios/cartpole_fast.ron",
    "scenarios/cartpole_leader.ron",
    "scenarios/cartpole_on_policy.ron",
    "scenarios/cartpole_q.ron",
    "scenarios/cartpole_team.ron",
    "scenarios/corridors.ron",
    "scenarios/corridors_drawn.ron",
    "scenarios/corridors_seed_psrl.ron",
    "scenarios/corridors_team_entropy.ron",
    "scenarios/corridors_vime.ron",
    "scenarios/deep_sea_bootstrapped_dqn.ron",
    "scenarios/deep_sea_egreedy.ron",
    "scenarios/deep_sea_hyperagent.ron",
    "scenarios/deep_sea_seed_ensemble.ron",
    "scenarios/dqn.ron",
    "scenarios/half_cheetah_sac.ron",
    "scenarios/hooks.ron",
    "scenarios/mountain_car.ron",
    "scenarios/mountain_car_seed_psrl.ron",
    "scenarios/mountain_car_team_entropy.ron",
    "scenarios/mountain_car_vime.ron",
    "scenarios/parking.ron",
    "scenarios/pendulum.ron",
    "scenarios/pendulum_sac.ron",
    "scenarios/ppo.ron",
    "scenarios/sac.ron",
    "scenarios/swingup_balance_seed_ensemble.ron",
    "scenarios/swingup_concurrent_egreedy.ron",
    "scenarios/swingup_concurrent_seed_ensemble.ron",
    "scenarios/swingup_concurrent_seed_td.ron",
    "scenarios/swingup_team_seed_ensemble.ron",
    "scenarios/swingup_vime.ron",
    "scenarios/two_poles.ron",
    "scenarios/known_tasks/dm_acrobot_swingup.ron",
    "scenarios/known_tasks/dm_acrobot_swingup_sparse.ron",
    "scenarios/known_tasks/dm_ball_in_cup_catch.ron",
    "scenarios/known_tasks/dm_cartpole_balance.ron",
    "scenarios/known_tasks/dm_cartpole_balance_sparse.ron",
    "scenarios/known_tasks/dm_cartpole_swingup.ron",
    "scenarios/known_tasks/dm_cartpole_swingup_sparse.ron",
    "scenarios/known_tasks/dm_cheetah_run.ron",
    "scenarios/known_tasks/dm_finger_spin.ron",
    "scenarios/known_tasks/dm_finger_turn_easy.ron",
    "scenarios/known_tasks/dm_finger_turn_hard.ron",
    "scenarios/known_tasks/dm_hopper_hop.ron",
    "scenarios/known_tasks/dm_hopper_stand.ron",
    "scenarios/known_tasks/dm_pendulum_swingup.ron",
    "scenarios/known_tasks/dm_point_mass_easy.ron",
    "scenarios/known_tasks/dm_reacher_easy.ron",
    "scenarios/known_tasks/dm_reacher_hard.ron",
    "scenarios/known_tasks/dm_walker_run.ron",
    "scenarios/known_tasks/dm_walker_stand.ron",
    "scenarios/known_tasks/dm_walker_walk.ron",
    "scenarios/known_tasks/gym_bipedal_walker.ron",
    "scenarios/known_tasks/gym_half_cheetah.ron",
    "scenarios/known_tasks/gym_hopper.ron",
    "scenarios/known_tasks/gym_inverted_double_pendulum.ron",
    "scenarios/known_tasks/gym_inverted_pendulum.ron",
    "scenarios/known_tasks/gym_lunar_lander.ron",
    "scenarios/known_tasks/gym_lunar_lander_continuous.ron",
    "scenarios/known_tasks/gym_reacher.ron",
    "scenarios/known_tasks/gym_swimmer.ron",
    "scenarios/known_tasks/gym_walker2d.ron",
    "scenarios/tabular/bipolar_chain.ron",
    "scenarios/tabular/bipolar_chain_thompson.ron",
    "scenarios/tabular/bipolar_chain_ucrl.ron",
    "scenarios/tabular/deep_sea.ron",
    "scenarios/tabular/deep_sea_thompson.ron",
    "scenarios/tabular/deep_sea_ucrl.ron",
    "scenarios/tabular/maximum_reward_path.ron",
    "scenarios/tabular/maximum_reward_path_thompson.ron",
    "scenarios/tabular/maximum_reward_path_ucrl.ron",
    "scenarios/tabular/parallel_chains.ron",
    "scenarios/tabular/parallel_chains_counts.ron",
    "scenarios/tabular/parallel_chains_thompson.ron",
    "scenarios/tabular/parallel_chains_ucrl.ron",
];

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// The RON files in a folder of the repository, but not in its subfolders.
    fn files_in(folder: &str) -> Vec<String> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let entries = std::fs::read_dir(root.join(folder)).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut files: Vec<String> = names
            .filter(|name| seedbed_input::is_ron(Path::new(name)))
            .map(|name| format!("{folder}/{name}"))
            .collect();
        files.sort();
        files
    }

    #[test]
    fn all_tasks_and_scenarios_are_built_in() {
        let folders = [
            "envs",
            "envs/mistakes",
            "scenarios",
            "scenarios/known_tasks",
            "scenarios/tabular",
        ];
        let is_study = |path: &String| path.ends_with("/learning.ron");
        let files = folders.into_iter().flat_map(files_in);
        let expected: Vec<String> = files.filter(|path| !is_study(path)).collect();
        let found: Vec<&str> = BUILTIN_FILES.iter().map(|file| file.path).collect();
        assert_eq!(found, expected);
    }
}
