//! The page of a person who plays: each open page has a battle of its own, on its thread. The page gives
//! orders and says when a step is played; this side translates orders to actions and plays them.

mod game;

use super::protocol::{BeginBattle, GameInfo, PageRequest, PageResponse};
use super::{App, Page, pages};
use game::{Game, GameError, Played, StartError};
use smaclite_engine::{BattleSetup, EnemySide, Sides};
use smaclite_learn::TrainedTeam;
use smaclite_view::page::scenario_info;

/// The game of one command.
pub(crate) struct Play {
    game: Game,
    /// Who plays the enemies.
    against: String,
    seed: u64,
}

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
enum PlayError {
    #[error("this request is one of another page")]
    OtherPage,
    #[error("begin a battle first")]
    NoBattle,
    #[error("seed must be a whole number from 0 to {max}, got `{0}`", max = u64::MAX)]
    Seed(String),
    #[error(transparent)]
    Game(#[from] GameError),
}

impl Play {
    /// Against the opponents of the setup; `seed` is that of the first battle.
    pub(crate) fn new(setup: BattleSetup, seed: u64) -> Result<Play, StartError> {
        let against = setup.opponents.to_string();
        Ok(Play { game: Game::new(setup, None)?, against, seed })
    }

    /// Against a trained team, which is called by this name.
    pub(crate) fn against_team(
        setup: BattleSetup,
        team: TrainedTeam,
        name: String,
        seed: u64,
    ) -> Result<Play, StartError> {
        let mirrored = Sides::Both(EnemySide { mirror: true, zero_sum: false });
        let game = Game::new(setup.with_sides(mirrored), Some(team))?;
        Ok(Play { game, against: name, seed })
    }

    fn info(&self) -> GameInfo {
        let Game { setup, scenario, arena, .. } = &self.game;
        GameInfo {
            scenario: scenario_info(scenario, arena),
            rules: setup.rules.to_string(),
            against: self.against.clone(),
            seed: self.seed.to_string(),
        }
    }

    fn respond<'a>(
        &'a self,
        battle: &mut Option<Played<'a>>,
        request: PageRequest,
    ) -> Result<PageResponse, PlayError> {
        if let PageRequest::BeginBattle(BeginBattle { seed, actions }) = request {
            let seed = seed.parse().map_err(|_| PlayError::Seed(seed))?;
            let (played, steps) = self.game.begin(seed, &actions)?;
            *battle = Some(played);
            return Ok(PageResponse::BeginBattle(steps));
        }
        let battle = battle.as_mut().ok_or(PlayError::NoBattle);
        Ok(match request {
            PageRequest::GiveOrders { orders } => {
                let battle = battle?;
                battle.give(&orders).map_err(GameError::from)?;
                PageResponse::GiveOrders { orders: battle.orders().current() }
            }
            PageRequest::PlayStep {} => PageResponse::PlayStep(battle?.step()?),
            PageRequest::GetReplay {} => PageResponse::GetReplay(battle?.replay()?),
            _ => return Err(PlayError::OtherPage),
        })
    }
}

impl App for Play {
    fn document(&self) -> String {
        pages::play(&self.info())
    }

    fn run(&self, page: Page) {
        let mut battle = None;
        while let Ok(Some(message)) = page.receive(None) {
            if page.respond(message.id, self.respond(&mut battle, message.request)).is_err() {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests;
