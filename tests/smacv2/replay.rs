//! Plays a recording through the interface and compares what the interface computes.

use std::collections::VecDeque;
use std::error::Error;

use smaclite_engine::smacv2::{Chance, Choice, Frame, Interface, Order, Perception};
use smaclite_scenarios::{Drawer, Drawn};

use crate::case::Case;
use crate::tally::Tally;

/// Draws are recorded in parts of this.
const PARTS: f64 = 64.0;

/// The recorded random numbers.
#[derive(Default)]
struct Recorded {
    attacks: Vec<i64>,
    /// The agents whose attack needed a number.
    used: Vec<bool>,
    order: Vec<u16>,
    flags: VecDeque<[i64; 4]>,
    /// Numbers that were asked for in another order than recorded.
    n_misplaced: usize,
}

impl Chance for Recorded {
    fn share(&mut self) -> f64 {
        unreachable!("capabilities are recorded")
    }

    fn attack(&mut self, agent: usize) -> f64 {
        self.used[agent] = true;
        self.attacks[agent] as f64 / PARTS
    }

    fn flag(&mut self, first_seer: usize, enemy: usize, agent: usize) -> f64 {
        let asked = [first_seer, enemy, agent].map(|x| x as i64);
        match self.flags.pop_front() {
            Some([seer, of, by, draw]) if [seer, of, by] == asked => draw as f64 / PARTS,
            _ => {
                self.n_misplaced += 1;
                0.0
            }
        }
    }

    fn order(&mut self, agents: &mut [u16]) {
        agents.copy_from_slice(&self.order);
    }
}

/// Compares everything that the interface computes from a recording.
pub fn compare(case: &Case) -> Tally {
    let mut replay = Replay::new(case).expect("the arrays of the format");
    let n_frames = case.arrays.integers("kind").expect("kinds").len();
    for index in 0..n_frames {
        replay.frame(index).expect("the arrays of the format");
    }
    replay.tally
}

struct Replay<'a> {
    case: &'a Case,
    /// With the episode limit of the episode.
    interface: Interface,
    perception: Perception,
    chance: Recorded,
    last_actions: Vec<Option<u32>>,
    goals: Vec<Option<usize>>,
    tally: Tally,
}

type Result<T> = std::result::Result<T, Box<dyn Error>>;

impl<'a> Replay<'a> {
    fn new(case: &'a Case) -> Result<Replay<'a>> {
        let mut chance = Recorded { used: vec![false; case.n_agents], ..Recorded::default() };
        chance.attacks = vec![0; case.n_agents];
        Ok(Replay {
            case,
            interface: case.interface.clone(),
            perception: Perception::default(),
            chance,
            last_actions: vec![None; case.n_agents],
            goals: vec![None; case.n_agents],
            tally: Tally::default(),
        })
    }

    /// A part of a recorded array that has an equal number of items for each frame, episode or call.
    fn integers(&self, name: &str, index: usize, size: usize) -> Result<Vec<i64>> {
        Ok(self.case.arrays.integers(name)?[index * size..][..size].to_vec())
    }

    fn frame(&mut self, index: usize) -> Result<()> {
        let frame = self.case.frame(index);
        if self.case.arrays.integers("kind")?[index] == 0 {
            self.reset(index, &frame)?;
        } else {
            self.step(index, &frame)?;
        }
        self.looks(index)?;
        self.calls(index, &frame)?;
        self.outputs(index, &frame)
    }

    fn reset(&mut self, index: usize, frame: &Frame) -> Result<()> {
        let (case, n_agents, episode) = (self.case, self.case.n_agents, self.case.episode(index));
        let options = case.interface.options();
        let limit = case.arrays.integers("limit_steps")?[episode];
        self.interface = case.interface.clone().with_episode_limit(u32::try_from(limit).ok());
        let shares = |name: &str| -> Result<Vec<f64>> {
            Ok(case.arrays.floats(name)?[episode * n_agents..][..n_agents].to_vec())
        };
        if options.attack.is_some() {
            self.perception.attack = shares("attack_prob")?;
        }
        if options.health.is_some() {
            self.perception.health = shares("health_level")?;
        }
        if options.enemy_mask.is_some() {
            let mask = self.integers("mask", episode, n_agents * case.n_enemies)?;
            self.perception.mask = mask.into_iter().map(|bit| bit != 0).collect();
        }
        self.last_actions.fill(None);
        self.goals.fill(None);
        self.interface.forget(frame, &mut self.perception);
        self.numbers(episode)?;
        self.add_max_reward(frame, episode)?;
        let mut capabilities = vec![0.0; n_agents * self.interface.cap_size()];
        self.interface.write_capabilities(frame, &self.perception, &mut capabilities);
        let size = capabilities.len();
        self.tally.compare("cap", &capabilities, &case.arrays.singles("cap")?[episode * size..][..size]);
        let recorded = case.arrays.floats("max_reward")?[index];
        self.tally.compare("max_reward", &[self.perception.max_reward], &[recorded]);
        Ok(())
    }

    /// While units are missing the recorded environment waits, and each time adds those that are there
    /// already.
    fn add_max_reward(&mut self, frame: &Frame, episode: usize) -> Result<()> {
        let (case, interface) = (self.case, &self.interface);
        let [allies, enemies] = [case.n_agents, case.n_enemies];
        let team = self.integers("enemy_team", episode, enemies)?;
        let of_type = |code: &i64| {
            let unit_type = &case.scenario.unit_types[case.type_of(*code) as usize];
            unit_type.hp + unit_type.shield
        };
        debug_assert_eq!(frame.types.len(), allies + enemies);
        let per_tick = case.spawn_per_tick.unwrap_or(allies + enemies);
        for n_there in (per_tick..allies + enemies + per_tick).step_by(per_tick) {
            let n_enemies = n_there.min(allies + enemies).saturating_sub(allies);
            let worth = team[..n_enemies].iter().map(of_type).sum();
            interface.add_max_reward(worth, &mut self.perception);
        }
        Ok(())
    }

    /// The numbers that units get: allies ordered, enemies as they are.
    fn numbers(&mut self, episode: usize) -> Result<()> {
        let (case, n_units) = (self.case, self.case.n_units());
        let owners = self.integers("spawn_owner", episode, n_units)?;
        let codes = self.integers("spawn_type", episode, n_units)?;
        let positions = &case.arrays.singles("spawn_pos")?[episode * n_units * 2..][..n_units * 2];
        let unit = |i: usize| Drawn {
            unit_type: case.type_of(codes[i]) as usize,
            position: [positions[2 * i].into(), positions[2 * i + 1].into()],
        };
        let of = |owner: i64| (0..n_units).filter(move |i| owners[*i] == owner).collect::<Vec<usize>>();
        let (allies, enemies) = (of.clone()(1), of(2));
        let mut ordered: Vec<Drawn> = allies.iter().map(|i| unit(*i)).collect();
        Drawer::new(&case.scenario).ok_or("not generated")?.number(&mut ordered);
        let mut numbers = vec![-1; n_units];
        for (number, drawn) in ordered.iter().enumerate() {
            let found =
                allies.iter().find(|i| numbers[**i] < 0 && unit(**i) == *drawn).ok_or("a lost unit")?;
            numbers[*found] = number as i64;
        }
        for (number, i) in enemies.into_iter().enumerate() {
            numbers[i] = (case.n_agents + number) as i64;
        }
        let recorded = self.integers("spawn_id", episode, n_units)?;
        self.tally.compare("spawn_id", &numbers, &recorded);
        Ok(())
    }

    fn step(&mut self, index: usize, frame: &Frame) -> Result<()> {
        let (case, n_agents) = (self.case, self.case.n_agents);
        let before = case.frame(index - 1);
        let actions = self.integers("actions", index, n_agents)?;
        match case.is_on("heuristic_ai") {
            true => self.heuristic(index, &before)?,
            false => self.orders(index, &before, &actions)?,
        }
        if self.interface.options().health.is_some() {
            let is_killed = |agent| self.interface.is_below_level(&before, &self.perception, agent);
            let killed: Vec<i64> = (0..n_agents).map(|agent| i64::from(is_killed(agent))).collect();
            let recorded = self.integers("mid_kill", index, n_agents)?;
            self.tally.compare("mid_kill", &killed, &recorded);
        }
        self.last_actions = actions.iter().map(|action| u32::try_from(*action).ok()).collect();
        let outcome = self.interface.settle(frame, &mut self.perception);
        let dead = |units: &[bool]| units.iter().filter(|is_dead| **is_dead).count() as i64;
        let (agents, enemies) = self.perception.dead.split_at(n_agents);
        let at_limit = outcome.at_limit && case.is_on("continuing_episode");
        for (what, ours) in [
            ("terminated", i64::from(outcome.terminated)),
            ("battle_won", i64::from(outcome.battle_won)),
            ("limit", i64::from(at_limit)),
            ("dead_allies", dead(agents)),
            ("dead_enemies", dead(enemies)),
        ] {
            self.tally.compare(what, &[ours], &[case.arrays.integers(what)?[index]]);
        }
        self.tally.compare("reward", &[outcome.reward], &[case.arrays.floats("reward")?[index]]);
        Ok(())
    }

    fn orders(&mut self, index: usize, before: &Frame, actions: &[i64]) -> Result<()> {
        let n_agents = self.case.n_agents;
        self.chance.attacks = self.integers("attack_draw", index, n_agents)?;
        self.chance.used.fill(false);
        let mut available = self.available(before);
        available = available
            .chunks_exact(self.interface.n_actions())
            .zip(actions)
            .map(|(row, action)| row[*action as usize])
            .collect();
        self.tally.compare("recorded actions are available", &available, &vec![1; n_agents]);
        let (mut orders, interface) = (Vec::new(), &self.interface);
        for (agent, action) in actions.iter().enumerate() {
            let action = *action as usize;
            orders.push(interface.order(before, &mut self.perception, agent, action, &mut self.chance));
        }
        let used = self.chance.used.iter().zip(&self.chance.attacks);
        let used: Vec<i64> = used.map(|(used, draw)| if *used { *draw } else { -1 }).collect();
        let recorded = self.chance.attacks.clone();
        self.tally.compare("attack_draw", &used, &recorded);
        self.compare_orders(index, &orders)
    }

    fn heuristic(&mut self, index: usize, before: &Frame) -> Result<()> {
        let (interface, perception) = (&self.interface, &self.perception);
        let rests = self.case.is_on("heuristic_rest");
        let goals = self.goals.iter_mut().enumerate();
        let choose = |(agent, goal)| interface.heuristic(before, perception, agent, goal, rests);
        let choices: Vec<Choice> = goals.map(choose).collect();
        let chosen: Vec<i64> = choices.iter().map(|choice| choice.action as i64).collect();
        let recorded = self.integers("chosen", index, chosen.len())?;
        self.tally.compare("chosen", &chosen, &recorded);
        let orders: Vec<Order> = choices.iter().map(|choice| choice.order).collect();
        self.compare_orders(index, &orders)
    }

    fn compare_orders(&mut self, index: usize, orders: &[Order]) -> Result<()> {
        let n_agents = self.case.n_agents;
        let (mut kinds, mut targets, mut points) = (Vec::new(), Vec::new(), Vec::new());
        for order in orders {
            let (kind, target, point) = match *order {
                Order::None => (0, -1, [0.0; 2]),
                Order::Stop => (1, -1, [0.0; 2]),
                Order::MoveTo(point) => (2, -1, point),
                Order::Target(unit) if unit < n_agents => (4, unit as i64, [0.0; 2]),
                Order::Target(unit) => (3, (unit - n_agents) as i64, [0.0; 2]),
            };
            kinds.push(kind);
            targets.push(target);
            points.extend(point.map(|x| x as f32));
        }
        let recorded = self.integers("order_kind", index, n_agents)?;
        self.tally.compare("order_kind", &kinds, &recorded);
        let recorded = self.integers("order_target", index, n_agents)?;
        self.tally.compare("order_target", &targets, &recorded);
        let recorded = self.case.arrays.singles("order_pos")?;
        self.tally.compare("order_pos", &points, &recorded[index * n_agents * 2..][..n_agents * 2]);
        Ok(())
    }

    /// Where agents look. Sines and cosines may differ in the last place.
    fn looks(&mut self, index: usize) -> Result<()> {
        if self.case.arrays.has("fov") {
            let size = self.case.n_agents * 2;
            let looks: Vec<f64> = self.perception.looks.iter().flatten().copied().collect();
            let recorded = self.case.arrays.floats("fov")?[index * size..][..size].to_vec();
            let is_near = |a: &f64, b: &f64| a == b || (a.to_bits() as i64).abs_diff(b.to_bits() as i64) <= 1;
            self.tally.compare_by("fov", &looks, &recorded, is_near);
        }
        let last: Vec<i64> = self.last_actions.iter().map(|action| action.map_or(-1, i64::from)).collect();
        let recorded = self.integers("last_action", index, last.len())?;
        self.tally.compare("last_action", &last, &recorded);
        Ok(())
    }

    /// The observations of all calls at a frame.
    fn calls(&mut self, index: usize, frame: &Frame) -> Result<()> {
        let arrays = &self.case.arrays;
        let draws = arrays.integers("draws")?;
        let calls = arrays.integers("obs_frame")?.into_iter().enumerate();
        for (call, _) in calls.filter(|(_, at)| *at == index as i64) {
            let order = self.integers("obs_order", call, self.case.n_agents)?;
            self.chance.order = order.into_iter().map(|agent| agent as u16).collect();
            let of_call = draws.chunks_exact(5).filter(|draw| draw[0] == call as i64);
            self.chance.flags = of_call.map(|draw| [draw[1], draw[2], draw[3], draw[4]]).collect();
            self.chance.n_misplaced = 0;
            self.interface.perceive(frame, &mut self.perception, &mut self.chance);
            let n_wrong = self.chance.n_misplaced + self.chance.flags.len();
            self.tally.compare("draws", &[n_wrong], &[0]);
            self.compare_call(call, frame)?;
        }
        Ok(())
    }

    fn compare_call(&mut self, call: usize, frame: &Frame) -> Result<()> {
        let (case, interface) = (self.case, &self.interface);
        let mut obs = vec![0.0; case.n_agents * interface.obs_size()];
        interface.write_obs(frame, &self.perception, &self.last_actions, &mut obs);
        match case.arrays.singles("obs") {
            Ok(recorded) => self.tally.compare("obs", &obs, &recorded[call * obs.len()..][..obs.len()]),
            Err(_) => {
                // With the time as f64 at the end of each row.
                let mut ours: Vec<f64> = obs.iter().map(|x| f64::from(*x)).collect();
                let rows = ours.chunks_exact_mut(interface.obs_size());
                rows.for_each(|row| *row.last_mut().expect("the time") = interface.time(&self.perception));
                let recorded = case.arrays.floats("obs")?;
                self.tally.compare("obs", &ours, &recorded[call * obs.len()..][..obs.len()]);
            }
        }
        let flags: Vec<i64> = self.perception.flags.iter().map(|flag| i64::from(*flag)).collect();
        let recorded = self.integers("flags", call, flags.len())?;
        self.tally.compare("flags", &flags, &recorded);
        let seers = self.perception.first_seer.iter().map(|seer| seer.map_or(-1, i64::from));
        let seers: Vec<i64> = seers.collect();
        let recorded = self.integers("first_seer", call, seers.len())?;
        self.tally.compare("first_seer", &seers, &recorded);
        Ok(())
    }

    fn outputs(&mut self, index: usize, frame: &Frame) -> Result<()> {
        let (case, interface, perception) = (self.case, &self.interface, &self.perception);
        let mut state = vec![0.0; interface.state_size()];
        interface.write_state(frame, perception, &self.last_actions, &mut state);
        let recorded = case.arrays.singles("state")?;
        self.tally.compare("state", &state, &recorded[index * state.len()..][..state.len()]);

        let available = self.available(frame);
        let recorded = self.integers("avail", index, available.len())?;
        self.tally.compare("avail", &available, &recorded);
        let mut truly = vec![0; available.len()];
        self.interface.write_truly_available(frame, &self.perception, &mut truly);
        let truly: Vec<i64> = truly.into_iter().map(i64::from).collect();
        let name = if case.arrays.has("true_avail") { "true_avail" } else { "avail" };
        let recorded = self.integers(name, index, truly.len())?;
        self.tally.compare("true_avail", &truly, &recorded);

        let mut visible = vec![0; case.n_agents * case.n_units()];
        self.interface.write_visibility(frame, &mut visible);
        let visible: Vec<i64> = visible.into_iter().map(i64::from).collect();
        let recorded = self.integers("visibility", index, visible.len())?;
        self.tally.compare("visibility", &visible, &recorded);
        Ok(())
    }

    fn available(&self, frame: &Frame) -> Vec<i64> {
        let (n_agents, n_actions) = (self.case.n_agents, self.interface.n_actions());
        let words = n_actions.div_ceil(64);
        let mut bits = vec![0; n_agents * words];
        self.interface.write_available(frame, &self.perception, &mut bits);
        let bit = |agent: usize, action: usize| bits[agent * words + action / 64] >> (action % 64) & 1;
        (0..n_agents * n_actions).map(|i| bit(i / n_actions, i % n_actions) as i64).collect()
    }
}
