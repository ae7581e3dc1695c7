//! The checksum of an episode.

use smaclite_engine::{Battle, ExecutionOrder, IllegalAction, Scratch, Step, Units};
use xxhash_rust::xxh3::Xxh3;

/// XXH3 over the units after every tick, and the reward of every step. Numbers are little-endian.
#[derive(Clone, Default)]
pub(super) struct Checksum {
    hasher: Xxh3,
    bytes: Vec<u8>,
}

impl Checksum {
    /// Plays a step of a battle, and takes it in. `observe` is called with the units after each tick.
    pub fn play_step(
        &mut self,
        battle: &mut Battle,
        actions: &[i32],
        scratch: &mut Scratch,
        mut observe: impl FnMut(&Units),
    ) -> Result<Step, IllegalAction> {
        let step = battle.step_observed(actions, ExecutionOrder::Drawn, scratch, |tick| {
            self.tick(tick.units);
            observe(tick.units);
        })?;
        self.hasher.update(&step.reward.to_le_bytes());
        Ok(step)
    }

    /// Takes in the units after a tick, in the order of their ids.
    fn tick(&mut self, units: &Units) {
        self.bytes.clear();
        for id in 0..units.pos.len() {
            let vectors = [units.pos[id], units.vel[id], units.planned_vel[id]];
            let pairs = vectors.into_iter().flat_map(|v| v.to_array());
            self.bytes.extend(pairs.flat_map(f32::to_le_bytes));
            let numbers = [
                units.hp[id],
                units.shield[id],
                units.energy[id],
                units.cooldown[id],
                units.shield_cooldown[id],
                units.healing[id],
            ];
            self.bytes.extend(numbers.into_iter().flat_map(f64::to_le_bytes));
            self.bytes.extend([u8::from(units.alive[id]), u8::from(units.declared[id])]);
            let target = units.target[id].map_or(u64::MAX, u64::from);
            self.bytes.extend(target.to_le_bytes());
        }
        self.hasher.update(&self.bytes);
    }

    /// The checksum so far.
    pub fn value(&self) -> u64 {
        self.hasher.digest()
    }
}
