//! How ranks share the episodes of a round.
//!
//! A rank gets those that its agents learn from; of the others it knows the length only. If some rank does
//! not need all, each episode is sent to the ranks that need it.

use std::collections::BTreeSet;

use crate::run::ranks::Ranks;
use seedbed_env::Status;
use seedbed_learn::experience::Episode;
use seedbed_learn::experience::EpisodeInfo;
use seedbed_learn::team::Team;

/// The episodes of a round, in (agent, episode) order. Those that this rank does not need have no
/// steps.
pub(super) struct SharedEpisodes {
    pub(super) episodes: Vec<Episode>,
    /// Lengths of the episodes, with all their steps: one per episode.
    pub(super) lengths: Vec<u32>,
}

impl From<Vec<Episode>> for SharedEpisodes {
    fn from(episodes: Vec<Episode>) -> Self {
        let lengths = episodes.iter().map(|episode| episode.length() as u32);
        Self {
            lengths: lengths.collect(),
            episodes,
        }
    }
}

/// Shares the episodes of all local agents. `needs_first`: whether all ranks need the first episode of
/// the round
pub(super) fn share(
    local: Vec<Episode>,
    team: &dyn Team,
    round: u32,
    needs_first: bool,
    ranks: Ranks,
) -> SharedEpisodes {
    if ranks.is_single() {
        return local.into();
    }
    let local_infos: Vec<EpisodeInfo> = local.iter().map(EpisodeInfo::from).collect();
    let infos = ranks.all_gather(local_infos);
    let team_infos = infos.concat();
    let chosen = team.choose_episodes(&team_infos, round);
    let needed = chosen.map(|chosen| {
        let first = needs_first.then_some(0);
        chosen.into_iter().chain(first).collect::<BTreeSet<usize>>()
    });
    if ranks
        .all_gather(needed.is_none())
        .into_iter()
        .all(|all| all)
    {
        return ranks.all_gather(local).concat().into();
    }
    let needed = needed.unwrap_or_else(|| (0..team_infos.len()).collect());
    SharedEpisodes {
        episodes: exchange(local, &infos, &needed, ranks),
        lengths: team_infos.iter().map(|info| info.length).collect(),
    }
}

/// Gets the needed episodes from their ranks, and sends those that others need. `infos`: the episodes
/// of each rank; `needed`: numbers of episodes, counted over all ranks
fn exchange(
    mut local: Vec<Episode>,
    infos: &[Vec<EpisodeInfo>],
    needed: &BTreeSet<usize>,
    ranks: Ranks,
) -> Vec<Episode> {
    let requests = ranks.exchange(&requests(infos, needed, ranks));
    let wanted = |indices: &Vec<u32>| -> Vec<&Episode> {
        let indices = indices.iter();
        indices.map(|&index| &local[index as usize]).collect()
    };
    let sent: Vec<Vec<&Episode>> = requests.iter().map(wanted).collect();
    let mut received = ranks.exchange_as::<_, Vec<Episode>>(&sent);
    let own_rank = ranks.rank() as usize;
    let mut first = 0;
    let mut episodes = Vec::new();
    for (rank, infos) in infos.iter().enumerate() {
        if rank == own_rank {
            episodes.append(&mut local);
        } else {
            let mut received = std::mem::take(&mut received[rank]).into_iter();
            for (index, info) in (first..).zip(infos) {
                let episode = needed.contains(&index).then(|| received.next()).flatten();
                episodes.push(episode.unwrap_or_else(|| without_steps(info)));
            }
        }
        first += infos.len();
    }
    episodes
}

/// The episodes that this rank needs of each other rank, counted over those of the other rank.
fn requests(infos: &[Vec<EpisodeInfo>], needed: &BTreeSet<usize>, ranks: Ranks) -> Vec<Vec<u32>> {
    let mut first = 0;
    let mut requests = Vec::new();
    for (rank, infos) in infos.iter().enumerate() {
        let is_own = rank == ranks.rank() as usize;
        let needed = needed.range(first..first + infos.len());
        let of_rank = needed
            .filter(|_| !is_own)
            .map(|index| (index - first) as u32);
        requests.push(of_rank.collect());
        first += infos.len();
    }
    requests
}

fn without_steps(info: &EpisodeInfo) -> Episode {
    Episode {
        agent: info.agent,
        episode: info.episode,
        round: 0,
        observations: Vec::new(),
        actions: Vec::new(),
        rewards: Vec::new(),
        log_probs: Vec::new(),
        outcome: Status::Running,
    }
}
