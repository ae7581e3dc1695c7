//! The encoders compared, to the bit, with the definition of every feature, computed one by one.

use glam::Vec2;
use smaclite_scenarios::{Faction, Scenario};

use super::state::types_in_state;
use super::{Available, ObsScratch, UnitFeatures, UnitTables, View, write_obs, write_state};
use crate::arena::Arena;
use crate::command::{DIRECTIONS, action};
use crate::distance::distance;
use crate::rules::Rules;
use crate::units::Units;

/// What the encoders write, by its definition.
struct Definition<'a> {
    arena: &'a Arena,
    units: &'a Units,
    side: Faction,
    mirror: bool,
}

impl Definition<'_> {
    fn own(&self) -> &[u32] {
        self.arena.ids(self.side)
    }

    fn others(&self) -> &[u32] {
        self.arena.ids(self.side.opponent())
    }

    /// An offset as the side sees it.
    fn seen(&self, offset: f32) -> f32 {
        if self.mirror { -offset } else { offset }
    }

    fn alive(&self, id: u32) -> bool {
        self.units.alive[id as usize]
    }

    fn pos(&self, id: u32) -> Vec2 {
        self.units.pos[id as usize]
    }

    fn distance(&self, a: u32, b: u32) -> f64 {
        distance(self.pos(a), self.pos(b))
    }

    fn ratio(value: f64, max: f64) -> f32 {
        if max == 0.0 { 0.0 } else { (value / max) as f32 }
    }

    fn body(&self, id: u32) -> Vec<f32> {
        let (features, stats, i) = (&self.arena.features, self.arena.stats(id), id as usize);
        let mut body = vec![Self::ratio(self.units.hp[i], stats.hp)];
        if features.has_shield(self.arena.faction(id)) {
            body.push(Self::ratio(self.units.shield[i], stats.shield));
        }
        body.extend((0..features.n_types).map(|t| {
            if t == features.of_type[self.arena.approaches[i].unit_type as usize] { 1.0 } else { 0.0 }
        }));
        body
    }

    fn is_available(&self, id: u32, action: usize) -> bool {
        if !self.alive(id) {
            return action == action::NO_OP;
        }
        match action {
            action::NO_OP => false,
            action::STOP => true,
            action::NORTH..action::FIRST_TARGET => {
                let [dx, dy] = DIRECTIONS[action - action::NORTH];
                let sign = f64::from(self.seen(1.0));
                let (dx, dy) = (sign * dx, sign * dy);
                let (x, y) = (f64::from(self.pos(id).x) + dx, f64::from(self.pos(id).y) + dy);
                self.arena.terrain.is_walkable(x.floor() as i64, y.floor() as i64)
            }
            _ => {
                let (is_healer, is_enemy) = (self.arena.stats(id).is_healer, self.arena.is_enemy(id));
                let targets = if is_healer == is_enemy { &self.arena.enemies } else { &self.arena.agents };
                targets.get(action - action::FIRST_TARGET).is_some_and(|&target| {
                    let is_healed = !(is_healer && self.arena.stats(target).is_healer);
                    self.alive(target) && is_healed && self.distance(id, target) <= 6.0
                })
            }
        }
    }

    fn block(&self, id: u32, other: u32, mark: bool) -> Vec<f32> {
        let distance = self.distance(id, other);
        let body = self.body(other);
        if !self.alive(other) || distance >= 9.0 {
            return vec![0.0; 4 + body.len()];
        }
        let offset = self.pos(other) - self.pos(id);
        let mark = if mark { 1.0 } else { 0.0 };
        let [dx, dy] = [offset.x / 9.0, offset.y / 9.0].map(|offset| self.seen(offset));
        [vec![mark, (distance / 9.0) as f32, dx, dy], body].concat()
    }

    fn obs(&self, agent: usize, row_len: usize) -> Vec<f32> {
        let (arena, id) = (self.arena, self.own()[agent]);
        let mut row = Vec::new();
        if self.alive(id) {
            let moves = action::NORTH..action::FIRST_TARGET;
            row.extend(moves.map(|action| f32::from(u8::from(self.is_available(id, action)))));
            for (i, &enemy) in self.others().iter().enumerate() {
                let mark = if arena.stats(id).is_healer {
                    let ally = self.own().get(i);
                    ally.is_some_and(|&ally| ally != id && self.alive(ally) && self.distance(id, ally) <= 6.0)
                } else {
                    self.is_available(id, action::FIRST_TARGET + i)
                };
                row.extend(self.block(id, enemy, mark));
            }
            for &ally in self.own().iter().filter(|&&ally| ally != id) {
                row.extend(self.block(id, ally, true));
            }
            row.extend(self.body(id));
            assert_eq!(row.len(), arena.sizes_of(self.side).obs_size);
        }
        row.resize(row_len, 0.0);
        row
    }

    fn state(&self, last_actions: &[Option<u32>]) -> Vec<f32> {
        let (arena, units) = (self.arena, self.units);
        let mut state = Vec::new();
        for &id in self.own().iter().chain(self.others()) {
            let (mut block, stats, i) = (self.body(id), arena.stats(id), id as usize);
            let [x, y] = arena.features.relative(units.pos[i]).map(|x| self.seen(x));
            block.splice(1..1, [x, y]);
            if arena.faction(id) == self.side {
                let is_healer = stats.is_healer;
                let (value, max) = if is_healer {
                    (units.energy[i], stats.energy)
                } else {
                    (units.cooldown[i], stats.cooldown)
                };
                block.insert(1, Self::ratio(value, max));
            }
            state.extend(block.iter().map(|&value| if units.alive[i] { value } else { 0.0 }));
        }
        for action in last_actions {
            let one_hot = (0..arena.n_actions(self.side)).map(|a| *action == Some(a as u32));
            state.extend(one_hot.map(|is_set| f32::from(u8::from(is_set))));
        }
        state
    }
}

/// Pseudo-random numbers below `n`.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }

    /// Changes everything that is encoded. Most units are on a grid of 0.5, so that many are exactly at the
    /// limits of ranges, and next to them; some are off the map.
    fn place(&mut self, arena: &Arena, units: &mut Units) {
        for id in arena.unit_ids() {
            let (i, stats) = (id as usize, arena.stats(id));
            let mut coordinate = || {
                let x = self.below(48) as f32 / 2.0 - 1.0;
                [x, x, x, x.next_up(), x.next_down(), x + self.below(1000) as f32 / 999.0]
                    [self.below(6) as usize]
            };
            units.pos[i] = Vec2::new(coordinate(), coordinate());
            units.alive[i] = self.below(5) > 0;
            let mut share = || self.below(1001) as f64 / 1000.0;
            (units.hp[i], units.shield[i]) = (stats.hp * share(), stats.shield * share());
            (units.energy[i], units.cooldown[i]) = (stats.energy * share(), stats.cooldown * share());
        }
    }
}

fn bits(floats: &[f32]) -> Vec<u32> {
    floats.iter().map(|x| x.to_bits()).collect()
}

fn check(scenario: &Scenario, extra: usize, numbers: &mut Numbers, scratch: &mut ObsScratch) {
    let arena = Arena::new(scenario, Rules::Smaclite);
    let mut units = Units::default();
    units.reset(&arena);
    let mut tables = UnitTables::new(&arena);
    for _ in 0..4 {
        numbers.place(&arena, &mut units);
        tables.update(&arena, &units);
        for (side, mirror) in [(Faction::Ally, false), (Faction::Enemy, false), (Faction::Enemy, true)] {
            let mut available = Available::new(&arena, side);
            available.update(&arena, &units, &tables);
            if mirror {
                available.mirror();
            }
            let definition = Definition { arena: &arena, units: &units, side, mirror };
            let (arena, units, tables, available) = (&arena, &units, &tables, &available);
            let view = View { arena, units, tables, available, faction: side, mirror };
            let types = scenario.num_unit_types;
            let which = format!("{side:?}, mirror {mirror}, of {} with {types} types", scenario.name);
            check_side(&view, &definition, extra, numbers, scratch, &which);
        }
    }
}

fn check_side(
    view: &View,
    definition: &Definition,
    extra: usize,
    numbers: &mut Numbers,
    scratch: &mut ObsScratch,
    which: &str,
) {
    let sizes = view.arena.sizes_of(view.faction);
    let row_len = sizes.obs_size + extra;
    let mut obs = vec![f32::NAN; sizes.n_agents * row_len];
    write_obs(view, &mut obs, scratch);
    for (agent, row) in obs.chunks(row_len).enumerate() {
        assert_eq!(bits(row), bits(&definition.obs(agent, row_len)), "{which}: unit {agent}");
    }

    let mut action = || Some(numbers.below(sizes.n_actions as u64) as u32).filter(|&action| action > 0);
    let last_actions: Vec<Option<u32>> = (0..sizes.n_agents).map(|_| action()).collect();
    let mut state = vec![f32::NAN; sizes.state_size];
    write_state(view, &last_actions, &mut state);
    assert_eq!(bits(&state), bits(&definition.state(&last_actions)), "{which}: state");
    check_reading(view, &state, which);

    let mut avail = vec![7; sizes.n_agents * sizes.n_actions];
    view.available.write(&mut avail);
    for (row, &id) in avail.chunks(sizes.n_actions).zip(definition.own()) {
        let is_available = |action| u8::from(definition.is_available(id, action));
        let expected: Vec<u8> = (0..sizes.n_actions).map(is_available).collect();
        assert_eq!(row, expected, "{which}: {id}");
    }
}

/// What is read from a state is what was written.
fn check_reading(view: &View, state: &[f32], which: &str) {
    let (arena, mut types) = (view.arena, Vec::new());
    types_in_state(arena, view.faction, state, &mut types);
    for id in arena.unit_ids() {
        let mut written = UnitFeatures::of(view, id, arena.faction(id) == view.faction);
        (written.x, written.y) = (view.sign() * written.x, view.sign() * written.y);
        assert_eq!(UnitFeatures::read(arena, view.faction, id, state), written, "{which}: {id} in the state");
        let [read, own] = [types[id as usize], arena.approaches[id as usize].unit_type];
        let of_type = |unit_type: u32| arena.features.of_type[unit_type as usize];
        assert_eq!(of_type(read), of_type(own), "{which}: type of {id} in the state");
    }
}

#[test]
fn encoders_write_what_is_defined() {
    let (mut numbers, mut scratch) = (Numbers(1), ObsScratch::default());
    let mut check = |scenario: &Scenario, extra| check(scenario, extra, &mut numbers, &mut scratch);
    for name in Scenario::standard_names() {
        let mut scenario = Scenario::standard(name).unwrap();
        check(&scenario, 0);
        check(&scenario, 11);
        // Bodies of all sizes that have their own code, and more.
        for num_unit_types in [0, 2, 3, 4, 5, 6, 7, 8, 9, 13] {
            scenario.num_unit_types = num_unit_types;
            for (i, type_id) in scenario.type_ids.iter_mut().enumerate() {
                *type_id = i * 7 % num_unit_types.max(1);
            }
            (scenario.ally_has_shields, scenario.enemy_has_shields) =
                (num_unit_types % 3 == 0, num_unit_types % 2 == 0);
            check(&scenario, 0);
        }
    }
}

/// Words of available actions and of targets in range end where they end, however many units there are;
/// healers may follow the last ally that they can heal.
#[test]
fn encoders_take_any_number_of_units() {
    let (mut numbers, mut scratch) = (Numbers(2), ObsScratch::default());
    for (marines, medivacs, zealots) in
        [(1, 0, 1), (1, 2, 1), (2, 1, 7), (57, 3, 58), (58, 9, 3), (61, 70, 59), (63, 1, 66), (130, 2, 129)]
    {
        let medivac = if medivacs > 0 { format!(r#", "MEDIVAC": {medivacs}"#) } else { String::new() };
        let json = format!(
            r#"{{ "name": "{marines}, {medivacs} and {zealots}",
                "num_allied_units": {}, "num_enemy_units": {zealots}, "attack_point": [9, 16], "groups": [
                {{ "x": 9, "y": 16, "faction": "ALLY", "units": {{ "MARINE": {marines}{medivac} }} }},
                {{ "x": 22, "y": 16, "faction": "ENEMY", "units": {{ "ZEALOT": {zealots} }} }} ],
                "terrain_preset": "CHECKERBOARD", "num_unit_types": 0, "ally_has_shields": false,
                "enemy_has_shields": true }}"#,
            marines + medivacs
        );
        let scenario = Scenario::from_json(&json, "units", std::path::Path::new(".")).unwrap();
        check(&scenario, 0, &mut numbers, &mut scratch);
        check(&scenario, 1, &mut numbers, &mut scratch);
    }
}
