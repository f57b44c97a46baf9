//! Regions of the state space around visited states, each of which belongs to one agent of a team.
//!
//! A state that is farther than a radius from the centers of all regions becomes the center of a new one. If there are
//! too many regions, the radius doubles, and regions whose centers are within it of an earlier one are added to that
//! one (doubling algorithm, Charikar, Chekuri, Feder & Motwani 1997). The novelty of a state is that of counts: 1/√(1 + n),
//! where n is the number of visits of its region (Strehl & Littman 2008; Bellemare et al. 2016).

use serde::{Deserialize, Serialize};

/// Regions, their visits and their owners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateRegions {
    /// Number of coordinates of a state.
    width: usize,
    /// Maximal number of regions.
    max: usize,
    /// Number of agents K.
    agents: u32,
    /// States within this distance of a center belong to its region.
    radius: f32,
    /// One row per region: `[N × width]`.
    centers: Vec<f32>,
    /// Number of visited states in each region: `[N]`.
    visits: Vec<u32>,
    /// The agent to which each region belongs: `[N]`.
    owners: Vec<u32>,
}

/// The region of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Number of visits: 0 if the state is in no region.
    pub visits: u32,
    /// Owner of the region, or of the nearest one; none without regions.
    pub owner: Option<u32>,
}

/// 1/√(1 + n) after n visits.
#[must_use]
pub fn novelty(visits: u32) -> f32 {
    (1.0 + visits as f32).sqrt().recip()
}

impl StateRegions {
    /// No regions yet.
    #[must_use]
    pub fn new(width: usize, max: usize, agents: u32, radius: f32) -> Self {
        Self {
            width,
            max,
            agents,
            radius,
            centers: Vec::new(),
            visits: Vec::new(),
            owners: Vec::new(),
        }
    }

    /// Distance up to which a state belongs to the region of a center.
    #[must_use]
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Centers: `[N × width]`
    #[must_use]
    pub fn centers(&self) -> &[f32] {
        &self.centers
    }

    /// Number of visits of each region: `[N]`
    #[must_use]
    pub fn visits(&self) -> &[u32] {
        &self.visits
    }

    /// Agent to which each region belongs: `[N]`
    #[must_use]
    pub fn owners(&self) -> &[u32] {
        &self.owners
    }

    /// Whether these regions could have grown from `earlier` ones: of as many agents, for example.
    #[must_use]
    pub fn could_follow(&self, earlier: &Self) -> bool {
        let count = self.visits.len();
        let settings = |regions: &Self| (regions.width, regions.max, regions.agents);
        settings(self) == settings(earlier)
            && self.radius >= earlier.radius
            && count <= self.max
            && self.centers.len() == count * self.width
            && self.owners.len() == count
            && self.owners.iter().all(|owner| *owner < self.agents)
    }

    /// The region of a state.   `state: [width]`
    #[must_use]
    pub fn place(&self, state: &[f32]) -> Place {
        let nearest = self.nearest(state);
        Place {
            visits: nearest.map_or(0, |(region, square)| {
                if self.is_inside(square) {
                    self.visits[region]
                } else {
                    0
                }
            }),
            owner: nearest.map(|(region, _)| self.owners[region]),
        }
    }

    /// Counts a visited state.   `state: [width]`
    pub fn visit(&mut self, state: &[f32]) {
        match self.nearest(state) {
            Some((region, square)) if self.is_inside(square) => {
                self.visits[region] = self.visits[region].saturating_add(1);
            }
            _ => self.add(state),
        }
    }

    fn add(&mut self, state: &[f32]) {
        let owner = self.owner_of_new_region(state);
        self.centers.extend_from_slice(state);
        self.visits.push(1);
        self.owners.push(owner);
        while self.visits.len() > self.max {
            self.radius *= 2.0;
            self.merge();
        }
    }

    /// The owner of the nearest region, of the agents that have at most N/K regions; if none of these has a region, the
    /// one with the fewest.
    fn owner_of_new_region(&self, state: &[f32]) -> u32 {
        let mut owned = vec![0_usize; self.agents as usize];
        for owner in &self.owners {
            owned[*owner as usize] += 1;
        }
        let most = self.owners.len() / owned.len();
        let candidates =
            self.nearest_where(state, |region| owned[self.owners[region] as usize] <= most);
        candidates.map_or_else(
            || {
                let fewest = (0..self.agents).min_by_key(|agent| owned[*agent as usize]);
                fewest.unwrap_or(0)
            },
            |(region, _)| self.owners[region],
        )
    }

    /// Adds regions whose centers are within the radius of an earlier one to the nearest of these.
    fn merge(&mut self) {
        let all = std::mem::replace(
            self,
            Self::new(self.width, self.max, self.agents, self.radius),
        );
        for (region, center) in all.centers.chunks_exact(self.width).enumerate() {
            match self.nearest(center) {
                Some((earlier, square)) if self.is_inside(square) => {
                    self.visits[earlier] = self.visits[earlier].saturating_add(all.visits[region]);
                }
                _ => {
                    self.centers.extend_from_slice(center);
                    self.visits.push(all.visits[region]);
                    self.owners.push(all.owners[region]);
                }
            }
        }
    }

    /// Whether a state at this squared distance from a center is in its region.
    fn is_inside(&self, square: f32) -> bool {
        square <= self.radius * self.radius
    }

    /// The region with the nearest center, and the square of its distance.
    fn nearest(&self, state: &[f32]) -> Option<(usize, f32)> {
        self.nearest_where(state, |_| true)
    }

    /// The first of equally near ones.
    fn nearest_where(
        &self,
        state: &[f32],
        is_candidate: impl Fn(usize) -> bool,
    ) -> Option<(usize, f32)> {
        let mut nearest = None;
        for (region, center) in self.centers.chunks_exact(self.width).enumerate() {
            let square = squared_distance(state, center);
            if is_candidate(region) && nearest.is_none_or(|(_, least)| square < least) {
                nearest = Some((region, square));
            }
        }
        nearest
    }
}

fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += (a - b) * (a - b);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn visited(max: usize, agents: u32, states: &[f32]) -> StateRegions {
        let mut regions = StateRegions::new(1, max, agents, 0.25);
        for state in states {
            regions.visit(&[*state]);
        }
        regions
    }

    /// Centers 0 and 1; 0.2 and 0.9 are within 0.25 of them, 0.5 is in no region, and nearer to the first.
    #[test]
    fn states_are_counted_in_the_region_of_the_nearest_center() {
        let regions = visited(10, 2, &[0.0, 1.0, 0.2, 0.9, 0.9]);
        assert_eq!(
            (regions.centers(), regions.visits()),
            (&[0.0, 1.0][..], &[2, 3][..])
        );
        let place = |visits, owner| Place { visits, owner };
        assert_eq!(regions.place(&[0.8]), place(3, Some(1)));
        assert_eq!(regions.place(&[0.45]), place(0, Some(0)));
        assert_eq!(visited(10, 2, &[]).place(&[0.0]), place(0, None));
        assert!((novelty(3) - 0.5).abs() < 1e-7 && novelty(0) == 1.0);
    }

    /// The first regions go to one agent each; then a region goes to the agent that has the nearest one, unless it has
    /// more than its share: 4 and 5 are near the region of agent 2, which has two after the first of them. Of the
    /// others, agent 1 has the nearest.
    #[test]
    fn regions_are_shared_out_evenly_to_the_nearest_agents() {
        let regions = visited(10, 3, &[0.0, 2.0, 3.0, 4.0, 5.0, -1.0]);
        assert_eq!(regions.owners(), [0, 1, 2, 2, 1, 0]);
    }

    /// Five regions are one too many: with a radius of 0.5, those of 0.4 and 1.4 are added to those of 0 and 1. Before,
    /// the regions of 0, 0.4, 1, 1.4 and 3 belonged to the agents 0, 1, 1, 0 and 0.
    #[test]
    fn the_radius_doubles_if_there_are_too_many_regions() {
        let regions = visited(4, 2, &[0.0, 0.4, 1.0, 1.0, 1.4, 3.0]);
        assert_eq!(regions.radius(), 0.5);
        assert_eq!(regions.centers(), [0.0, 1.0, 3.0]);
        assert_eq!(regions.visits(), [2, 3, 1]);
        assert_eq!(regions.owners(), [0, 1, 0]);
    }
}
