//! A battle of the edited scenario, with a scripted policy, as the page that plays a replay.

use crate::web::protocol::{PlayBattle, PlayedBattle};
use smaclite_engine::policy::{Scripted, UnknownPolicy};
use smaclite_engine::{BattleSetup, EpisodeLimit, IllegalAction, Rules, UnknownRules};
use smaclite_scenarios::Problems;
use smaclite_view::{Recorder, ReplayError, export_html};

#[derive(Debug, thiserror::Error)]
pub(super) enum PlayError {
    #[error(transparent)]
    Scenario(#[from] Problems),
    #[error(transparent)]
    Policy(#[from] UnknownPolicy),
    #[error(transparent)]
    Rules(#[from] UnknownRules),
    #[error("seed must be a whole number from 0 to {max}, got `{0}`", max = u64::MAX)]
    Seed(String),
    #[error(transparent)]
    Action(#[from] IllegalAction),
    #[error(transparent)]
    Replay(#[from] ReplayError),
}

/// Limits of a battle that is shown: steps, and steps times units. The second one keeps the battles of a
/// thousand units to some seconds of work and some MB.
const MAX_STEPS: u32 = 2000;
const MAX_UNIT_STEPS: u32 = 200_000;

/// Plays one episode.
pub(super) fn play(play: PlayBattle) -> Result<PlayedBattle, PlayError> {
    let rules: Rules = play.rules.parse()?;
    let seed = play.seed.parse().map_err(|_| PlayError::Seed(play.seed))?;
    let mut policy = Scripted::from_name(&play.policy, seed)?;
    let files = play.files;
    let scenario = files.scenario()?;
    let most = MAX_STEPS.min(MAX_UNIT_STEPS / scenario.units.len() as u32);
    let limit = scenario.episode_limit.map_or(most, |limit| limit.min(most));
    let setup = BattleSetup { rules, episode_limit: EpisodeLimit::Steps(limit), ..BattleSetup::new(files) };
    let mut recorder = Recorder::new(setup, seed)?;
    let mut actions = vec![0; scenario.n_agents()];
    while !recorder.battle().is_over() {
        policy.act(recorder.battle(), &mut actions);
        recorder.step(&actions)?;
    }
    let replay = recorder.finish();
    let outcome = replay.episodes()[0].outcome;
    let is_cut = outcome.truncated && scenario.episode_limit != Some(limit);
    Ok(PlayedBattle { page: export_html(&replay)?, steps: outcome.steps, cut_at: is_cut.then_some(limit) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_scenarios::ScenarioFiles;

    fn request(name: &str, change: impl Fn(String) -> String) -> PlayBattle {
        let (_, mut files) = ScenarioFiles::resolve(name).unwrap();
        files.text = change(files.text);
        PlayBattle { files, policy: "nearest".into(), seed: "1".into(), rules: "smaclite".into() }
    }

    #[test]
    fn a_battle_is_played_to_its_end() {
        for policy in Scripted::NAMES {
            let played = play(PlayBattle { policy: policy.into(), ..request("2s3z", |text| text) }).unwrap();
            assert!(played.page.contains("<!doctype html>"));
            assert_eq!(played.cut_at, None, "{policy}");
            assert!((1..=120).contains(&played.steps), "{policy}: {}", played.steps);
        }
    }

    #[test]
    fn a_battle_that_would_not_end_is_cut() {
        // Both sides fly and cannot attack each other.
        let medivacs = |text: String| {
            let text = text.replace("\"STALKER\": 2, \"ZEALOT\": 3", "\"MEDIVAC\": 5");
            text.replace("\"num_unit_types\": 2", "\"num_unit_types\": 0")
                .replace(",\n    \"episode_limit\": 120", "")
        };
        let played = play(request("2s3z", medivacs)).unwrap();
        assert_eq!((played.cut_at, played.steps), (Some(2000), 2000));
    }

    #[test]
    fn what_cannot_be_played_is_refused() {
        let check = |request: PlayBattle, expected: &str| {
            let error = play(request).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        };
        let ok = || request("3m", |text| text);
        check(
            PlayBattle { policy: "best".into(), ..ok() },
            "unknown policy `best`; the policies are random,",
        );
        check(
            PlayBattle { rules: "go".into(), ..ok() },
            "rules must be 'smaclite', 'paper' or 'starcraft', got 'go'",
        );
        check(
            PlayBattle { seed: "-1".into(), ..ok() },
            "seed must be a whole number from 0 to 18446744073709551615",
        );
        check(request("3m", |text| text.replace("MARINE", "MARIN")), "did you mean `MARINE`?");
    }
}
