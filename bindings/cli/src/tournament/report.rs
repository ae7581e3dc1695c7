//! The result of a tournament as text: tables for people, and CSV.

use crate::csv::quoted;
use crate::table::{Table, percent};
use crate::{CommandResult, other_rules};
use smaclite_lab::{PlayerScore, Score, TournamentResult};

const POINTS: &str = "Wins-draws-losses of the agents (rows) against the enemies (columns)";
const RETURNS: &str = "Mean returns of the agents / of the enemies";

/// Prints the ratings and both matrices.
pub(super) fn print(result: &TournamentResult) -> CommandResult {
    out!("{}", headline(result))?;
    out!()?;
    ratings(result).print()?;
    for (title, table) in [(POINTS, points(result)), (RETURNS, returns(result))] {
        out!("\n{title}:")?;
        table.print()?;
    }
    Ok(())
}

/// The same as a page.
pub(super) fn markdown(result: &TournamentResult) -> String {
    let mut text = format!("# Tournament\n\n{}\n\n{}", headline(result), ratings(result).markdown());
    for (title, table) in [(POINTS, points(result)), (RETURNS, returns(result))] {
        text += &format!("\n{title}:\n\n{}", table.markdown());
    }
    text + "\n![Points of the agents (rows) against the enemies (columns)](matrix.svg)\n"
}

fn headline(result: &TournamentResult) -> String {
    let TournamentResult { scenario, rules, episodes, seed, greedy, players, scores } = result;
    let actions = if *greedy { ", greedy actions" } else { "" };
    let (n_players, n_pairings) = (players.len(), scores.len());
    let battles = format!("{scenario}{}", other_rules(*rules));
    format!(
        "{battles}: {n_players} players, {n_pairings} pairings of {episodes} episodes, seed {seed}{actions}"
    )
}

/// The players, the best one first.
fn ratings(result: &TournamentResult) -> Table {
    let mut players: Vec<&PlayerScore> = result.players.iter().collect();
    players.sort_by(|a, b| b.elo.total_cmp(&a.elo));
    let mut table = Table::new(["player", "Elo", "95 % interval", "points"]);
    for PlayerScore { player, elo, elo_low, elo_high, points } in players {
        let interval = format!("{elo_low:.0} to {elo_high:.0}");
        table.push([player.clone(), format!("{elo:.0}"), interval, percent(*points)]);
    }
    table
}

fn points(result: &TournamentResult) -> Table {
    matrix(result, |Score { wins, draws, losses, .. }| format!("{wins}-{draws}-{losses}"))
}

fn returns(result: &TournamentResult) -> Table {
    matrix(result, |score| format!("{:.1} / {:.1}", score.mean_return, score.mean_enemy_return))
}

/// A row per player with the agents and a column per player with the enemies.
fn matrix(result: &TournamentResult, cell: impl Fn(&Score) -> String) -> Table {
    let names = || result.players.iter().map(|player| player.player.as_str());
    let mut table = Table::new(std::iter::once("agents").chain(names()));
    for agents in names() {
        let cells = names().map(|enemies| score(result, agents, enemies).map_or("-".to_owned(), &cell));
        table.push(std::iter::once(agents.to_owned()).chain(cells));
    }
    table
}

/// The score of a pairing, if it was played.
pub(super) fn score<'a>(result: &'a TournamentResult, agents: &str, enemies: &str) -> Option<&'a Score> {
    result.scores.iter().find(|score| score.agents == agents && score.enemies == enemies)
}

/// A row per player of every pairing, so the rows of a player are all its battles.
pub(super) fn csv(result: &TournamentResult) -> String {
    let mut text =
        "player,opponent,side,episodes,wins,draws,losses,return,opponent_return,length\n".to_owned();
    for score in &result.scores {
        let Score { agents, enemies, episodes, wins, draws, losses, .. } = score;
        let (own, other, length) = (score.mean_return, score.mean_enemy_return, score.mean_length);
        let [agents, enemies] = [agents, enemies].map(|name| quoted(name));
        text += &format!(
            "{agents},{enemies},agents,{episodes},{wins},{draws},{losses},{own:.4},{other:.4},{length:.2}\n\
             {enemies},{agents},enemies,{episodes},{losses},{draws},{wins},{other:.4},{own:.4},{length:.2}\n"
        );
    }
    text
}
