//! Orders, step after step, in battles of standard scenarios. Every joint action is checked by the battle.

use super::*;
use smaclite_engine::{Arena, Rules, Scratch};
use std::sync::Arc;

/// A battle, and the orders of its agents.
struct War {
    scenario: Scenario,
    battle: Battle,
    agents: Vec<usize>,
    enemies: Vec<usize>,
    orders: Orders,
}

impl War {
    fn new(name: &str) -> War {
        War::of(Scenario::standard(name).expect("a standard scenario"), 1)
    }

    fn of(scenario: Scenario, seed: u64) -> War {
        War::under(Rules::Smaclite, scenario, seed)
    }

    fn under(rules: Rules, scenario: Scenario, seed: u64) -> War {
        let battle = Battle::new(Arc::new(Arena::new(&scenario, rules)), seed);
        let orders = Orders::new(&scenario);
        let (agents, enemies) = (orders.agents.clone(), orders.enemies.clone());
        War { scenario, battle, agents, enemies, orders }
    }

    /// Whether an agent heals in this episode, and whether it does in the sample of the scenario.
    fn heals(&self, agent: usize) -> (bool, bool) {
        let unit = self.agents[agent];
        let heals = |unit_type: usize| self.scenario.unit_types[unit_type].is_healer();
        let drawn = self.battle.types().nth(unit).expect("a unit");
        (heals(drawn), heals(self.scenario.units[unit].unit_type))
    }

    fn give(&mut self, agent: usize, order: Order) {
        self.try_give(agent, order).expect("an order");
    }

    fn try_give(&mut self, agent: usize, order: Order) -> Result<(), OrderError> {
        self.orders.give(&self.scenario, &self.battle, &[AgentOrder { agent, order }])
    }

    /// Plays a step; returns its joint action.
    fn step(&mut self) -> Vec<i32> {
        let actions = self.orders.actions(&self.scenario, &self.battle);
        let actions: Vec<i32> = actions.into_iter().map(i32::from).collect();
        self.battle.check(&actions).expect("available actions");
        self.battle.step(&actions, &mut Scratch::new()).expect("available actions");
        actions
    }

    /// Plays until an agent has no order, for fewer than so many steps.
    fn obey(&mut self, agent: usize, most: usize) {
        for _ in 0..most {
            if self.order(agent) == Order::None {
                return;
            }
            self.step();
        }
        panic!("agent {agent} never ends its order, and is at {}", self.position(agent));
    }

    /// Changes the units.
    fn edit(&mut self, change: impl FnOnce(&mut smaclite_engine::Units)) {
        let mut snapshot = self.battle.save();
        change(&mut snapshot.units);
        self.battle.restore(&snapshot).expect("a state of this scenario");
    }

    fn position(&self, agent: usize) -> Vec2 {
        self.battle.units().pos[self.agents[agent]]
    }

    fn order(&self, agent: usize) -> Order {
        self.orders.current()[agent]
    }
}

fn to(point: Vec2) -> Order {
    Order::Move { x: point.x, y: point.y }
}

const MOVES: std::ops::RangeInclusive<i32> = action::NORTH as i32..=action::WEST as i32;

#[test]
fn a_unit_goes_as_near_to_a_point_as_its_moves_bring_it_and_then_stands() {
    for way in [Vec2::new(-3.3, 4.1), Vec2::new(-5.0, -0.4), Vec2::new(0.2, -6.0)] {
        let mut war = War::new("3m");
        let goal = war.position(0) + way;
        war.give(0, to(goal));
        war.obey(0, 20);
        // A marine goes 1.6 squares in a step.
        assert!(war.position(0).distance(goal) < 1.2, "{} is not {goal}", war.position(0));
    }
}

#[test]
fn a_wall_ends_an_order() {
    let mut war = War::new("corridor");
    let blocked = |war: &War| {
        let at = war.position(0);
        MOVES.filter(|&number| !war.battle.is_available(0, number as usize)).count() > 0 || at.x < 1.0
    };
    let goal = war.position(0) - Vec2::new(100.0, 0.0); // off the map
    war.give(0, to(goal));
    war.obey(0, 60);
    assert!(blocked(&war), "it stands at {}", war.position(0));
}

#[test]
fn a_target_out_of_range_is_approached_until_its_action_is_available() {
    let mut war = War::new("3m");
    let target = war.enemies[2];
    war.give(1, Order::Target { unit: target });
    let attack = (action::FIRST_TARGET + 2) as i32;
    let before = war.position(1).distance(war.battle.units().pos[target]);
    assert!(before > 6.0);
    let mut actions = Vec::new();
    while actions.last() != Some(&attack) {
        actions.push(war.step()[1]);
        assert!(actions.len() < 20, "{actions:?}");
    }
    assert!(actions.len() > 1 && actions[..actions.len() - 1].iter().all(|action| MOVES.contains(action)));
    assert_eq!(war.order(1), Order::Target { unit: target }, "it holds until the target is dead");
}

/// It stopped at every third step of a chase, and let the target out of sight.
#[test]
fn a_target_that_moves_away_is_pursued_without_a_stop() {
    let mut war = War::new("3m");
    let target = war.enemies[0];
    for step in 0..6 {
        let ahead = war.position(1) + Vec2::new(8.0, 0.3); // in sight, out of range
        war.edit(|units| units.pos[target] = ahead);
        if step == 0 {
            war.give(1, Order::Target { unit: target });
        }
        assert_eq!(war.step()[1], action::EAST as i32, "step {step}");
    }
}

#[test]
fn an_order_ends_with_its_target() {
    let mut war = War::new("3m");
    let (first, second) = (war.enemies[0], war.enemies[1]);
    let near = war.position(0) + Vec2::new(3.0, 0.0);
    war.edit(|units| {
        (units.pos[first], units.pos[second]) = (near, near + Vec2::Y * 2.0);
        units.hp[first] = 1.0;
    });
    war.give(0, Order::Target { unit: first });
    assert_eq!(war.step()[0], action::FIRST_TARGET as i32);
    assert!(!war.battle.units().alive[first]);
    assert_eq!(war.step()[0], (action::FIRST_TARGET + 1) as i32, "it goes on with what is near");
    assert_eq!(war.order(0), Order::None);
}

#[test]
fn a_target_out_of_sight_is_sought_where_it_was_seen_last() {
    let mut war = War::new("3m");
    let target = war.enemies[0];
    let start = war.position(2);
    let seen = start + Vec2::new(0.0, 4.5);
    war.edit(|units| units.pos[target] = seen);
    war.give(2, Order::Target { unit: target });
    let mut steps = 0;
    while war.order(2) != Order::None {
        war.edit(|units| units.pos[target] = start + Vec2::new(14.0, 0.0));
        war.step();
        steps += 1;
        assert!(steps < 10, "it never gives up");
    }
    assert!(war.position(2).distance(seen) < 1.2, "it is at {}", war.position(2));
}

#[test]
fn healers_heal_and_other_targets_are_places_to_go() {
    let mut war = War::new("MMM");
    let healer = (0..war.agents.len()).find(|&agent| war.heals(agent).0).expect("a medivac");
    let soldier = (0..war.agents.len()).find(|&agent| !war.heals(agent).0).expect("a marine");
    let (medivac, marine, enemy) = (war.agents[healer], war.agents[soldier], war.enemies[0]);

    let heal = (action::FIRST_TARGET + soldier) as i32;
    assert_eq!(war.step()[healer], action::STOP as i32, "nobody is hurt");
    war.edit(|units| units.hp[marine] = 20.0);
    assert_eq!(war.step()[healer], heal, "without an order it heals");
    war.give(healer, Order::Target { unit: marine });
    assert_eq!(war.step()[healer], heal);

    for (agent, unit) in [(healer, enemy), (healer, medivac), (soldier, medivac)] {
        war.give(agent, Order::Target { unit });
        assert_eq!(war.order(agent), to(war.battle.units().pos[unit]), "agent {agent}, unit {unit}");
    }
}

/// They followed the sample of a generated scenario: "attack enemy 2" became "heal ally 2", a heal a move.
#[test]
fn orders_follow_the_types_that_an_episode_has_drawn() {
    let terran = || Scenario::standard("terran_5_vs_5").expect("a generated scenario");
    let is_other = |war: &War| (0..5).find(|&agent| war.heals(agent) == (true, false));
    let found = (1..100).map(|seed| War::of(terran(), seed)).find(|war| is_other(war).is_some());
    let mut war = found.expect("a drawn medivac");
    let healer = is_other(&war).expect("a drawn medivac");
    let soldier = (0..5).find(|&agent| !war.heals(agent).0).expect("a soldier");
    let (hurt, enemy) = (war.agents[soldier], war.enemies[2]);
    let beside = war.position(healer) + Vec2::X;
    war.edit(|units| (units.pos[hurt], units.hp[hurt]) = (beside, 5.0));
    war.give(healer, Order::Target { unit: enemy });
    assert_eq!(war.order(healer), to(war.battle.units().pos[enemy]), "it can only go there");
    war.give(healer, Order::Target { unit: hurt });
    assert_eq!(war.step()[healer], (action::FIRST_TARGET + soldier) as i32);
}

/// With a field of view, looks stand before the targets, and "attack enemy 2" was one of them.
#[test]
fn an_attack_is_no_look() {
    let mut scenario = Scenario::standard("protoss_5_vs_5").expect("a generated scenario");
    let options = scenario.smacv2.as_mut().expect("options of SMACv2");
    (options.conic_fov, options.num_fov_actions) = (true, 12);
    let mut war = War::of(scenario, 1);
    let (enemy, east) = (war.enemies[2], war.position(0) + Vec2::X); // where agents look at first
    war.edit(|units| units.pos[enemy] = east);
    assert_eq!(war.step()[0], 6 + 12 + 2, "it attacks what is near");
    war.give(0, Order::Target { unit: enemy });
    assert_eq!(war.step()[0], 6 + 12 + 2);
}

#[test]
fn a_stopped_unit_does_not_attack() {
    let mut war = War::new("3m");
    let near = war.position(0) + Vec2::new(2.0, 0.0);
    let enemy = war.enemies[0];
    war.edit(|units| units.pos[enemy] = near);
    war.give(0, Order::Stop);
    let actions = war.step();
    assert_eq!(actions[0], action::STOP as i32);
    assert_eq!(actions[1], action::FIRST_TARGET as i32, "the others defend themselves");
}

#[test]
fn orders_of_any_kind_are_available_actions_to_the_end() {
    for name in Scenario::standard_names().chain(Scenario::generated_names()) {
        let mut war = War::new(name);
        let (width, height) = (war.scenario.terrain.width() as f32, war.scenario.terrain.height() as f32);
        let mut random = smaclite_engine::Generator::new(7);
        let mut draw = |n: usize| random.next_word() as usize % n;
        for _ in 0..40 {
            let agent = draw(war.agents.len());
            let order = match draw(4) {
                0 => Order::Move { x: draw(100) as f32 / 99.0 * width, y: draw(100) as f32 / 99.0 * height },
                1 => Order::Stop,
                _ => Order::Target { unit: draw(war.scenario.units.len()) },
            };
            war.give(agent, order);
            war.step();
        }
    }
}

#[test]
fn orders_that_make_no_sense_are_refused() {
    let mut war = War::new("3m");
    let error = |war: &mut War, agent, order| war.try_give(agent, order).unwrap_err().to_string();
    assert_eq!(error(&mut war, 3, Order::Stop), "agent must be below 3, got 3");
    assert_eq!(error(&mut war, 0, Order::Target { unit: 6 }), "unit must be below 6, got 6");
    assert!(error(&mut war, 0, Order::Move { x: f32::NAN, y: 0.0 }).contains("finite numbers, got NaN, 0"));
    assert_eq!(war.order(0), Order::None);
}

/// Under `starcraft` a marine goes 1.125 squares in a step, not the 1.575 of SMAClite: an order to go less
/// than half of those ended at once.
#[test]
fn agents_come_as_near_as_the_speed_of_their_rules_allows() {
    for (rules, length) in [(Rules::Smaclite, 1.575), (Rules::Starcraft, 1.125)] {
        let mut war = War::under(rules, Scenario::standard("3m").expect("a standard scenario"), 1);
        let start = war.position(0);
        let to = start - Vec2::new(0.6 * length, 0.0);
        war.give(0, Order::Move { x: to.x, y: to.y });
        war.step();
        let left = war.position(0).distance(to);
        assert!(left < 0.45 * length, "{rules}: {left} of {length}");
    }
}
