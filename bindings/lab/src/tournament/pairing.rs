//! Which of some players can meet: who has the agents, who has the enemies, and in which arena.

use super::TournamentError;
use smaclite_engine::{Arena, BattleSetup, Faction, Sides};
use smaclite_learn::battles::{Pairing, Player};
use smaclite_scenarios::Scenario;
use std::sync::Arc;

/// All pairings of these players that can be played.
pub(super) fn pairings(setup: &BattleSetup, players: &[Player]) -> Result<Vec<Pairing>, TournamentError> {
    let (scenario, arena) = setup.arena()?;
    if players.iter().any(|player| player.team().is_some()) {
        check_team(&scenario, &arena)?;
    }
    let arenas = Arenas { scenario, limit: arena.episode_limit(), setup };
    let pairs = (0..players.len()).flat_map(|a| (0..players.len()).map(move |b| (a, b)));
    let pairing = |(agents, enemies): (usize, usize)| {
        let (arena, is_exchanged) = arenas.of(&players[agents], &players[enemies])?;
        Some(Pairing { agents, enemies, arena: Arc::new(arena), is_exchanged })
    };
    Ok(pairs.filter_map(pairing).collect())
}

/// A team has the sizes of the agents, so it can play the enemies only if theirs are the same.
pub(crate) fn check_team(scenario: &Scenario, arena: &Arena) -> Result<(), TournamentError> {
    Sides::Both.check(scenario)?;
    let [agents, enemies] = [Faction::Ally, Faction::Enemy].map(|faction| arena.sizes_of(faction));
    if agents == enemies {
        return Ok(());
    }
    let [n_agents, n_enemies] = [agents.n_agents, enemies.n_agents];
    Err(TournamentError::Asymmetric { name: scenario.name.clone(), n_agents, n_enemies })
}

struct Arenas<'a> {
    scenario: Scenario,
    limit: Option<u32>,
    setup: &'a BattleSetup,
}

impl Arenas<'_> {
    /// The arena of a pairing, and whether its sides are exchanged; `None` if it cannot be played.
    fn of(&self, agents: &Player, enemies: &Player) -> Option<(Arena, bool)> {
        match (agents, enemies) {
            (Player::March(_), Player::March(_)) => None,
            // Drawn sides differ in more than their units: one may surround the other.
            (Player::March(_), _) if self.scenario.generation.is_some() => None,
            // What marches has no actions, so it plays the agents as enemies of the exchanged scenario. A
            // team stands where it did in training after half a turn, as with the mirror.
            (Player::March(march), Player::Tactic(_)) => {
                Some((self.arena(&self.scenario.exchanged()).with_opponents((*march).into()), true))
            }
            (Player::March(march), Player::Team(_)) => {
                let scenario = self.scenario.exchanged().turned();
                Some((self.arena(&scenario).with_opponents((*march).into()), true))
            }
            (_, Player::Team(_)) => Some((self.arena(&self.scenario).with_sides(Sides::Mirrored), false)),
            (_, script) => Some((self.arena(&self.scenario).with_opponents(script.opponent().into()), false)),
        }
    }

    fn arena(&self, scenario: &Scenario) -> Arena {
        Arena::new(scenario, self.setup.rules).with_episode_limit(self.limit)
    }
}
