//! What answers a page: the teams and the replay that it has added, and its battle.

use crate::battle::{BattleError, PlayedBattle, Player};
use crate::editor;
use crate::game::Game;
use crate::protocol::{
    BeginBattle, BegunBattle, Choices, EpisodeInfo, OpenedReplay, Outcome, Request, Response, Source,
    TeamFiles, TeamInfo,
};
use crate::source::{SourceError, opened};
use crate::team::{Team, TeamError};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;
use serde_json::Value;
use smaclite_engine::policy::{Scripted, UnknownPolicy};
use smaclite_engine::{Opponent, Rules};
use smaclite_scenarios::{Faction, Scenario};
use smaclite_view::page::{features_info, scenario_info};
use smaclite_view::{Episode, Replay, ReplayError};

/// What became of a request, to be serialised for the page.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct Answer(Outcome);

impl Answer {
    /// Why the request was refused, if it was.
    pub fn error(&self) -> Option<&str> {
        match &self.0 {
            Outcome::Error(error) => Some(error),
            Outcome::Response(_) => None,
        }
    }
}

/// The battle of one page, and what it can be played with.
#[derive(Default)]
pub struct Session {
    teams: Vec<Team>,
    replay: Option<Replay>,
    battle: Option<PlayedBattle>,
}

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
enum SessionError {
    #[error(transparent)]
    Battle(#[from] BattleError),
    #[error(transparent)]
    Team(#[from] TeamError),
    #[error(transparent)]
    Source(#[from] SourceError),
    #[error("no team is called so, and {0}")]
    Policy(#[from] UnknownPolicy),
    #[error("`weights` must be base64: {0}")]
    Base64(base64::DecodeError),
    #[error(transparent)]
    Replay(#[from] ReplayError),
    #[error("the replay `{0}` has no episodes")]
    NoEpisode(String),
    #[error("begin a battle first")]
    NoBattle,
    #[error("the request is not valid: {0}")]
    Request(#[from] serde_json::Error),
}

impl Session {
    /// The response to a request; both are JSON. An error is a response too, and changes nothing.
    pub fn respond_json(&mut self, request: &[u8]) -> String {
        let answer = self.answer_to(serde_json::from_slice(request));
        serde_json::to_string(&answer).unwrap_or_default() // every value of it is valid JSON
    }

    /// The same for a request that was read as JSON.
    pub fn answer(&mut self, request: Value) -> Answer {
        self.answer_to(serde_json::from_value(request))
    }

    fn answer_to(&mut self, request: serde_json::Result<Request>) -> Answer {
        let request = request.map_err(SessionError::from);
        Answer(match request.and_then(|request| self.respond(request)) {
            Ok(response) => Outcome::Response(response),
            Err(error) => Outcome::Error(error.to_string()),
        })
    }

    fn respond(&mut self, request: Request) -> Result<Response, SessionError> {
        let battle = self.battle.as_mut().ok_or(SessionError::NoBattle);
        Ok(match request {
            Request::GetChoices {} => Response::GetChoices(self.choices()),
            Request::AddTeam(files) => self.add_team(&files)?,
            Request::OpenScenario { files } => Response::OpenScenario { scenario: opened(files)? },
            Request::OpenReplay { name, replay } => Response::OpenReplay(self.open(&name, &replay)?),
            Request::BeginBattle(begin) => Response::BeginBattle(Box::new(self.begin(&begin)?)),
            Request::PlaySteps { steps } => Response::PlaySteps(battle?.play(steps)?),
            Request::GiveOrders { orders } => Response::GiveOrders { orders: battle?.give(&orders)? },
            Request::TakeAgents { agents } => {
                battle?.take(&agents)?;
                Response::TakeAgents {}
            }
            Request::GetObservation { step, agent } => {
                Response::GetObservation { obs: battle?.observation(step, agent)? }
            }
            Request::GetReplay {} => Response::GetReplay(battle?.replay()?),
            Request::MoveUnit { unit, x, y } => {
                Response::MoveUnit { scenario: battle?.with_moved_unit(unit, x, y)? }
            }
            Request::PaintMap { rows } => Response::PaintMap { scenario: battle?.with_terrain(&rows) },
            Request::GetBuiltins {} => Response::GetBuiltins(Box::new(editor::builtins())),
            Request::CheckFiles { files, groups, seed } => {
                Response::CheckFiles(editor::check(&files, &groups, &seed))
            }
        })
    }

    fn choices(&self) -> Choices {
        Choices {
            scenarios: Scenario::standard_names().collect(),
            generated: Scenario::generated_names().collect(),
            opponents: Opponent::scripts().map(Opponent::name).collect(),
            policies: Scripted::NAMES.to_vec(),
            rules: Rules::ALL.map(|rules| rules.to_string()).to_vec(),
            teams: self.team_infos(),
        }
    }

    fn team_infos(&self) -> Vec<TeamInfo> {
        let info = |team: &Team| TeamInfo {
            name: team.name().into(),
            scenario: team.scenario().into(),
            source: team.source().into(),
            is_universal: team.is_universal(),
        };
        self.teams.iter().map(info).collect()
    }

    /// Adds a team, in the place of one of the same name.
    fn add_team(&mut self, files: &TeamFiles) -> Result<Response, SessionError> {
        let weights = STANDARD.decode(&files.weights).map_err(SessionError::Base64)?;
        let team = Team::read(&files.name, &files.run, &weights)?;
        self.teams.retain(|other| other.name() != team.name());
        self.teams.push(team);
        Ok(Response::AddTeam { teams: self.team_infos() })
    }

    fn open(&mut self, name: &str, replay: &str) -> Result<OpenedReplay, SessionError> {
        let replay = Replay::from_json(replay.as_bytes(), name)?;
        if replay.episodes().is_empty() {
            return Err(SessionError::NoEpisode(name.to_owned()));
        }
        replay.verify()?;
        let episodes = replay.episodes().iter().map(episode_info).collect();
        let program = replay.program().to_owned();
        self.replay = Some(replay);
        Ok(OpenedReplay { program, episodes })
    }

    fn begin(&mut self, begin: &BeginBattle) -> Result<BegunBattle, SessionError> {
        let enemies = match &begin.of {
            Source::Scenario { opponent, .. } => self.team(opponent),
            Source::Episode { .. } => None,
        };
        let (game, recorder) =
            Game::begin(&begin.of, self.replay.as_ref(), enemies.is_some()).map_err(BattleError::from)?;
        let first_step = recorder.battle().episode_length();
        let player = self.player(&begin.team, &game)?;
        let against = enemies.map_or_else(|| game.setup.opponents.to_string(), |team| team.name().to_owned());
        let enemies = enemies.map(|team| team.on(&game, Faction::Enemy)).transpose()?;
        let mut battle = PlayedBattle::new(game, recorder, player, enemies);
        let recorded = match (&begin.of, &self.replay) {
            (Source::Episode { episode }, Some(replay)) => replay.episodes().get(*episode),
            _ => None,
        };
        let recorded_actions = recorded.map_or(&[][..], |episode| &episode.actions);
        let played = battle.play_actions(begin.actions.as_deref().unwrap_or(recorded_actions))?;
        battle.take(&begin.taken)?;
        let game = battle.game();
        let opponent = recorded.map_or(against, |episode| episode.opponent.name().to_owned());
        let begun = BegunBattle {
            scenario: scenario_info(&game.scenario, &game.arena),
            features: features_info(&game.scenario),
            source: game.source(),
            rules: game.setup.rules.to_string(),
            opponent,
            seed: game.seed.to_string(),
            first_step,
            is_playable: battle.is_playable(),
            warnings: game.warnings(),
            played,
        };
        self.battle = Some(battle);
        Ok(begun)
    }

    fn player(&self, name: &str, game: &Game) -> Result<Player, SessionError> {
        match self.team(name) {
            Some(team) => Ok(Player::Team(team.on(game, Faction::Ally)?)),
            None => Ok(Player::Script(Box::new(Scripted::from_name(name, game.seed)?))),
        }
    }

    fn team(&self, name: &str) -> Option<&Team> {
        self.teams.iter().find(|team| team.name() == name)
    }
}

fn episode_info(episode: &Episode) -> EpisodeInfo {
    EpisodeInfo {
        seed: episode.start.seed.to_string(),
        steps: episode.outcome.steps as usize,
        episode_return: episode.outcome.episode_return,
        result: episode.outcome.result(),
        checksum: format!("{:016x}", episode.checksum),
    }
}

#[cfg(test)]
mod tests;
