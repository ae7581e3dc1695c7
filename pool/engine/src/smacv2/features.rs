//! The names and positions of all features.
//!
//! This describes what `obs` and `state` write, for readers that pick single features by name.

use super::Interface;
use crate::features::{FeatureBlock, action_names, in_sequence, names};

impl Interface {
    /// The blocks of the observation of one agent: `moves`, `enemies`, `allies` (all but the agent itself),
    /// `own` and `time`.
    pub fn obs_features(&self) -> Vec<FeatureBlock> {
        let o = &self.options;
        let mut moves = names(&["north", "south", "east", "west"]);
        let around =
            ["north", "south", "east", "west", "north_east", "south_west", "south_east", "north_west"];
        if o.obs_pathing_grid {
            moves.extend(around.iter().map(|place| format!("walkable_{place}")));
        }
        if o.obs_terrain_height {
            moves.extend(around.iter().chain(&["here"]).map(|place| format!("height_{place}")));
        }
        let seen = |mark: &str| names(&[mark, "distance", "dx", "dy"]);
        let body = |has_shield: bool| self.body(o.obs_all_health, has_shield);
        let enemy = [seen("targetable"), body(self.enemy_shields), self.type_names()].concat();
        let ally =
            [seen("visible"), body(self.ally_shields), self.capability_names(), self.type_names()].concat();
        let last_action = match o.obs_last_action {
            true => self.action_names().into_iter().map(|name| format!("last_{name}")).collect(),
            false => Vec::new(),
        };
        let ally = [ally, last_action].concat();
        let position = names(if o.obs_own_pos { &["x", "y"] } else { &[] });
        let own = self.body(o.obs_own_health || o.obs_all_health, self.ally_shields);
        let own = [own, self.capability_names(), position, self.look_names(), self.type_names()].concat();
        let others = self.n_agents.saturating_sub(1);
        let units = [
            ("moves", None, moves),
            ("enemies", Some(self.n_enemies), enemy),
            ("allies", Some(others), ally),
            ("own", None, own),
        ];
        let units = units.into_iter().filter(|_| o.obs_starcraft);
        in_sequence(units.chain(time(o.obs_timestep_number)))
    }

    /// The blocks of the state: `allies`, `enemies`, `last_action` and `time`; or `agents`, their
    /// observations.
    pub fn state_features(&self) -> Vec<FeatureBlock> {
        let o = &self.options;
        if o.obs_instead_of_state {
            let features = (0..self.sizes.obs).map(|i| format!("obs_{i}")).collect();
            return in_sequence([("agents", Some(self.n_agents), features)]);
        }
        let shield = |has_shield: bool| names(if has_shield { &["shield"] } else { &[] });
        let ally = [
            names(&["health", "energy/cooldown", "rel_x", "rel_y"]),
            shield(self.ally_shields),
            self.capability_names(),
            self.look_names(),
            self.type_names(),
        ];
        let enemy = [names(&["health", "rel_x", "rel_y"]), shield(self.enemy_shields), self.type_names()];
        let actions = ("last_action", Some(self.n_agents), self.action_names());
        let units = [
            ("allies", Some(self.n_agents), ally.concat()),
            ("enemies", Some(self.n_enemies), enemy.concat()),
        ];
        let actions = o.state_last_action.then_some(actions);
        in_sequence(units.into_iter().chain(actions).chain(time(o.state_timestep_number)))
    }

    /// The names of all actions.
    pub fn action_names(&self) -> Vec<String> {
        action_names(self.n_looks, self.n_actions)
    }

    fn body(&self, has_health: bool, has_shield: bool) -> Vec<String> {
        let names_of = if has_shield { &["health", "shield"][..] } else { &["health"] };
        names(if has_health { names_of } else { &[] })
    }

    fn capability_names(&self) -> Vec<String> {
        let attack = self.options.attack.map(|_| "attack_probability");
        let health = self.options.health.map(|_| "health_level");
        attack.into_iter().chain(health).map(str::to_owned).collect()
    }

    fn look_names(&self) -> Vec<String> {
        names(if self.options.conic_fov { &["look_x", "look_y"] } else { &[] })
    }

    fn type_names(&self) -> Vec<String> {
        (0..self.n_types).map(|i| format!("type_{i}")).collect()
    }
}

fn time(is_there: bool) -> Option<(&'static str, Option<usize>, Vec<String>)> {
    is_there.then(|| ("time", None, names(&["time"])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{obs_features, state_features};
    use smaclite_scenarios::{Capability, Scenario, Smacv2};

    /// Each block as `name from its first feature, rows: features`.
    fn described(blocks: Vec<FeatureBlock>) -> Vec<String> {
        let rows = |rows: Option<usize>| rows.map_or("one row".to_owned(), |n| format!("{n} rows"));
        let block = |block: FeatureBlock| {
            let FeatureBlock { name, start, rows: n, features } = block;
            format!("{name} from {start}, {}: {}", rows(n), features.join(" "))
        };
        blocks.into_iter().map(block).collect()
    }

    #[test]
    fn features_are_named_as_the_options_say() {
        let with = |options: Smacv2| {
            let mut scenario = Scenario::standard("2s3z").unwrap();
            scenario.smacv2 = Some(options);
            let state = state_features(&scenario);
            (described(obs_features(&scenario)), described(state), crate::action_names(&scenario))
        };
        let capability = Capability { lower_bound: 0.1, upper_bound: 0.4, observe: true };
        let (obs, state, actions) = with(Smacv2 {
            conic_fov: true,
            num_fov_actions: 2,
            obs_all_health: false,
            obs_own_health: true,
            obs_last_action: true,
            obs_pathing_grid: true,
            obs_terrain_height: true,
            obs_own_pos: true,
            obs_timestep_number: true,
            state_last_action: true,
            state_timestep_number: true,
            attack: Some(capability),
            health: Some(capability),
            ..Smacv2::default()
        });
        let own = "attack_probability health_level";
        assert_eq!(
            actions.join(" "),
            "no_op stop north south east west look_0 look_1 target_0 target_1 target_2 target_3 target_4"
        );
        let last_action = actions.iter().map(|action| format!(" last_{action}")).collect::<String>();
        let around = |what| {
            ["north", "south", "east", "west", "north_east", "south_west", "south_east", "north_west"]
                .map(|place| format!(" {what}_{place}"))
                .concat()
        };
        let (walkable, height) = (around("walkable"), around("height"));
        assert_eq!(
            obs,
            [
                format!("moves from 0, one row: north south east west{walkable}{height} height_here"),
                "enemies from 21, 5 rows: targetable distance dx dy type_0 type_1".to_owned(),
                format!("allies from 51, 4 rows: visible distance dx dy {own} type_0 type_1{last_action}"),
                format!("own from 135, one row: health shield {own} x y look_x look_y type_0 type_1"),
                "time from 145, one row: time".to_owned(),
            ]
        );
        let ally = "health energy/cooldown rel_x rel_y shield";
        assert_eq!(
            state,
            [
                format!("allies from 0, 5 rows: {ally} {own} look_x look_y type_0 type_1"),
                "enemies from 55, 5 rows: health rel_x rel_y shield type_0 type_1".to_owned(),
                format!("last_action from 85, 5 rows: {}", actions.join(" ")),
                "time from 150, one row: time".to_owned(),
            ]
        );

        let (obs, state, _) =
            with(Smacv2 { obs_all_health: true, obs_own_health: false, ..Smacv2::default() });
        assert_eq!(
            obs,
            [
                "moves from 0, one row: north south east west",
                "enemies from 4, 5 rows: targetable distance dx dy health shield type_0 type_1",
                "allies from 44, 4 rows: visible distance dx dy health shield type_0 type_1",
                "own from 76, one row: health shield type_0 type_1",
            ]
        );
        assert!(!state.iter().any(|block| block.starts_with("time")), "{state:?}");
        let (_, state, _) = with(Smacv2 { obs_instead_of_state: true, ..Smacv2::default() });
        assert!(state[0].starts_with("agents from 0, 5 rows: obs_0 obs_1 "), "{state:?}");
    }
}
