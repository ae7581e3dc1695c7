//! What a policy sees of a battle. It is what a learner sees: the state and the available actions, so
//! policies decide alike with the battle itself and with the fields of a batch.

use glam::Vec2;
use smaclite_scenarios::Faction;

use crate::arena::Arena;
use crate::battle::Battle;
use crate::encode::{Available, UnitFeatures};

/// What a policy sees of a battle, for one side of it. Units are given by battle-wide id; an agent is a unit
/// of the own side, by in-faction id.
///
/// All numbers of units are those of the state, in f32 and without the shields that the scenario hides. A
/// battle rounds its own numbers in the same way.
pub trait Situation {
    /// What no battle of the scenario changes.
    fn arena(&self) -> &Arena;
    /// The side for which the policy chooses actions.
    fn faction(&self) -> Faction {
        Faction::Ally
    }
    /// The features of a unit in the state; zeros for the dead.
    fn features(&self, id: u32) -> UnitFeatures;
    /// Whether the side knows of a living opponent. Agents' policies see the state, which has all.
    fn is_seen(&self, _id: u32) -> bool {
        true
    }
    /// Where the side goes while it sees no opponent.
    fn attack_point(&self) -> Option<Vec2> {
        None
    }
    /// Whether an action is available to an agent.
    fn is_available(&self, agent: usize, action: usize) -> bool;
    /// How many actions are available to an agent.
    fn n_available(&self, agent: usize) -> u32;
    /// The available action of an agent that has `n` others before it; 0 if there is none.
    fn nth_available(&self, agent: usize, n: u32) -> usize;

    /// Position in squares; the centre of the map for the dead.
    fn position(&self, id: u32) -> Vec2 {
        let UnitFeatures { x, y, .. } = self.features(id);
        self.arena().features.position([x, y])
    }

    /// Health divided by its maximum: 0 to 1.
    fn health_share(&self, id: u32) -> f64 {
        self.features(id).health.into()
    }

    /// Health and shield.
    fn hit_points(&self, id: u32) -> f64 {
        let (stats, features) = (self.arena().stats(id), self.features(id));
        f64::from(features.health) * stats.hp + f64::from(features.shield) * stats.shield
    }

    /// Whether the unit is in the battle.
    fn is_alive(&self, id: u32) -> bool {
        self.features(id).health > 0.0
    }

    /// Seconds until the unit of an agent can act again; 0 for healers.
    fn cooldown(&self, id: u32) -> f64 {
        let stats = self.arena().stats(id);
        if stats.is_healer {
            return 0.0;
        }
        // SMACv2's interface divides by the cooldown without its random delay.
        let greatest =
            if self.arena().interface().is_some() { stats.cooldown } else { stats.greatest_cooldown };
        f64::from(self.features(id).energy_or_cooldown) * greatest
    }
}

/// As the agents see it.
impl Situation for Battle {
    fn arena(&self) -> &Arena {
        Battle::arena(self)
    }

    fn features(&self, id: u32) -> UnitFeatures {
        BattleSide::new(self, Faction::Ally).features(id)
    }

    fn is_available(&self, agent: usize, action: usize) -> bool {
        BattleSide::new(self, Faction::Ally).is_available(agent, action)
    }

    fn n_available(&self, agent: usize) -> u32 {
        BattleSide::new(self, Faction::Ally).n_available(agent)
    }

    fn nth_available(&self, agent: usize, n: u32) -> usize {
        BattleSide::new(self, Faction::Ally).nth_available(agent, n)
    }
}

/// A battle as the learner of a side sees it.
#[derive(Clone, Copy)]
pub struct BattleSide<'a> {
    battle: &'a Battle,
    side: Faction,
}

impl<'a> BattleSide<'a> {
    /// The battle as the learner of this side sees it; joint actions must play the side.
    pub fn new(battle: &'a Battle, side: Faction) -> BattleSide<'a> {
        BattleSide { battle, side }
    }
}

impl Situation for BattleSide<'_> {
    fn arena(&self) -> &Arena {
        self.battle.arena()
    }

    fn faction(&self) -> Faction {
        self.side
    }

    fn features(&self, id: u32) -> UnitFeatures {
        let features = self.battle.unit_features(id, self.side);
        let is_mirrored = self.side == Faction::Enemy && self.arena().sides().are_mirrored();
        let sign = if is_mirrored { -1.0 } else { 1.0 };
        UnitFeatures { x: sign * features.x, y: sign * features.y, ..features }
    }

    fn is_available(&self, agent: usize, action: usize) -> bool {
        self.battle.available_of(self.side).has(agent, action)
    }

    fn n_available(&self, agent: usize) -> u32 {
        self.battle.available_of(self.side).count(agent)
    }

    fn nth_available(&self, agent: usize, n: u32) -> usize {
        self.battle.available_of(self.side).nth(agent, n)
    }
}

/// What the enemies see of a battle: the agents within sight range of one of them.
pub(crate) struct EnemySituation<'a> {
    pub battle: &'a Battle,
    pub available: &'a Available,
    /// Which agents they see, by in-faction id.
    pub seen: &'a [bool],
}

impl Situation for EnemySituation<'_> {
    fn arena(&self) -> &Arena {
        self.battle.arena()
    }

    fn faction(&self) -> Faction {
        Faction::Enemy
    }

    fn features(&self, id: u32) -> UnitFeatures {
        self.battle.unit_features(id, Faction::Enemy)
    }

    fn is_seen(&self, id: u32) -> bool {
        self.seen[self.arena().id_in_faction(id)]
    }

    fn attack_point(&self) -> Option<Vec2> {
        Some(Vec2::from(self.arena().attack_point.map(|x| x as f32)))
    }

    fn is_available(&self, agent: usize, action: usize) -> bool {
        self.available.has(agent, action)
    }

    fn n_available(&self, agent: usize) -> u32 {
        self.available.count(agent)
    }

    fn nth_available(&self, agent: usize, n: u32) -> usize {
        self.available.nth(agent, n)
    }
}

/// What a learner sees of one environment: a row of the fields `state` and `avail_actions` of a batch, or of
/// `enemy_state` and `enemy_avail_actions`, read in place.
#[derive(Clone, Copy, Debug)]
pub struct LearnerView<'a> {
    arena: &'a Arena,
    side: Faction,
    state: &'a [f32],
    avail_actions: &'a [u8],
}

impl<'a> LearnerView<'a> {
    /// `state` is f32 `[state_size]`, `avail_actions` u8 `[n_agents, n_actions]`, where 0 means unavailable.
    ///
    /// # Panics
    /// If one of them has another size.
    pub fn new(arena: &'a Arena, state: &'a [f32], avail_actions: &'a [u8]) -> LearnerView<'a> {
        LearnerView::of(arena, Faction::Ally, state, avail_actions)
    }

    /// As [`new`](Self::new), of a side.
    ///
    /// # Panics
    /// If one of them has another size than the side's.
    pub fn of(arena: &'a Arena, side: Faction, state: &'a [f32], avail_actions: &'a [u8]) -> LearnerView<'a> {
        let sizes = arena.sizes_of(side);
        assert_eq!(state.len(), sizes.state_size, "one state");
        assert_eq!(avail_actions.len(), sizes.n_agents * sizes.n_actions, "one byte per agent and action");
        LearnerView { arena, side, state, avail_actions }
    }

    /// The numbers of the actions that are available to an agent.
    fn available(&self, agent: usize) -> impl Iterator<Item = usize> {
        let n_actions = self.arena.n_actions(self.side);
        let row = &self.avail_actions[agent * n_actions..(agent + 1) * n_actions];
        row.iter().enumerate().filter(|(_, available)| **available != 0).map(|(action, _)| action)
    }
}

impl Situation for LearnerView<'_> {
    fn arena(&self) -> &Arena {
        self.arena
    }

    fn faction(&self) -> Faction {
        self.side
    }

    fn features(&self, id: u32) -> UnitFeatures {
        UnitFeatures::read(self.arena, self.side, id, self.state)
    }

    fn is_available(&self, agent: usize, action: usize) -> bool {
        let n_actions = self.arena.n_actions(self.side);
        action < n_actions && self.avail_actions[agent * n_actions + action] != 0
    }

    fn n_available(&self, agent: usize) -> u32 {
        self.available(agent).count() as u32
    }

    fn nth_available(&self, agent: usize, n: u32) -> usize {
        self.available(agent).nth(n as usize).unwrap_or(0)
    }
}
