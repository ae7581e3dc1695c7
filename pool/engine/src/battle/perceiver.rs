//! The interface in a battle: the units as a frame, what the agents perceived, and what they were ordered.

use crate::arena::Arena;
use crate::buffers::refill;
use crate::command::Command;
use crate::random::Generator;
use crate::smacv2::{Chance, Frame, Interface, NO_SEER, Order, Outcome, POINT, Perception};
use crate::units::Units;

/// What a battle keeps for the interface of its scenario.
#[derive(Clone, Debug, Default)]
pub(crate) struct Perceiver {
    frame: Frame,
    perception: Perception,
    /// By agent: what its unit was ordered last. An action without an order lets it go on.
    commands: Vec<Command>,
}

/// Numbers that decide are drawn from the battle's own generator.
impl Chance for Generator {
    fn share(&mut self) -> f64 {
        self.next_f64()
    }

    fn attack(&mut self, _: usize) -> f64 {
        self.next_f64()
    }

    fn flag(&mut self, _: usize, _: usize, _: usize) -> f64 {
        self.next_f64()
    }

    fn order(&mut self, agents: &mut [u16]) {
        self.shuffle(agents);
    }
}

impl Perceiver {
    /// Begins an episode.
    pub fn begin(&mut self, interface: &Interface, arena: &Arena, units: &Units, generator: &mut Generator) {
        refill(&mut self.commands, arena.agents.iter().map(|_| Command::Stop));
        self.look(interface, arena, units);
        interface.reset(&self.frame, &mut self.perception, generator);
        interface.perceive(&self.frame, &mut self.perception, generator);
    }

    /// Takes the units as they are now.
    #[inline(never)]
    pub fn look(&mut self, interface: &Interface, arena: &Arena, units: &Units) {
        let ids = || arena.agents.iter().chain(&arena.enemies).map(|&id| id as usize);
        let frame = &mut self.frame;
        refill(&mut frame.types, ids().map(|id| arena.approaches[id].unit_type));
        refill(&mut frame.x, ids().map(|id| units.pos[id].x));
        refill(&mut frame.y, ids().map(|id| units.pos[id].y));
        let of_living = |column: &[f64], id: usize| if units.alive[id] { column[id] } else { 0.0 };
        refill(&mut frame.health, ids().map(|id| of_living(&units.hp, id)));
        refill(&mut frame.shield, ids().map(|id| of_living(&units.shield, id)));
        let readiness = |id: usize| match arena.stats(id as u32).is_healer {
            true => units.energy[id],
            false => units.cooldown[id],
        };
        refill(&mut frame.readiness, ids().map(readiness));
        interface.measure(frame);
    }

    /// The command that an agent's unit follows in a step with this action.
    pub fn command(
        &mut self,
        interface: &Interface,
        arena: &Arena,
        agent: usize,
        action: usize,
        generator: &mut Generator,
    ) -> Command {
        let order = interface.order(&self.frame, &mut self.perception, agent, action, generator);
        let command = match order {
            // A unit whose target has died is idle.
            Order::None => match self.commands[agent] {
                Command::Target(id) if !self.frame.is_alive(arena.place(id)) => Command::Stop,
                command => command,
            },
            Order::Stop => Command::Stop,
            Order::MoveTo(point) => Command::MoveTo(point),
            Order::Target(unit) => Command::Target(arena.id_at(unit)),
        };
        self.commands[agent] = command;
        command
    }

    /// Whether agents can die of their health levels.
    pub fn has_levels(&self) -> bool {
        !self.perception.health.is_empty()
    }

    /// Takes the health of agents that is below their level; of the published code by the health at the start
    /// of the step.
    pub fn kill_below_levels(&mut self, interface: &Interface, arena: &Arena, units: &mut Units) {
        if !interface.options().published {
            self.look(interface, arena, units);
        }
        let (frame, perception) = (&self.frame, &self.perception);
        for (agent, &id) in arena.agents.iter().enumerate() {
            if interface.is_below_level(frame, perception, agent) {
                units.hp[id as usize] = 0.0;
            }
        }
    }

    /// Ends a step.
    pub fn settle(
        &mut self,
        interface: &Interface,
        arena: &Arena,
        units: &Units,
        generator: &mut Generator,
    ) -> Outcome {
        self.look(interface, arena, units);
        let outcome = interface.settle(&self.frame, &mut self.perception);
        interface.perceive(&self.frame, &mut self.perception, generator);
        outcome
    }

    /// Looks once more without a step, as every call of `get_obs` of the published code does.
    pub fn perceive(&mut self, interface: &Interface, generator: &mut Generator) {
        interface.perceive(&self.frame, &mut self.perception, generator);
    }

    /// Writes the available actions.
    pub fn write_available(&self, interface: &Interface, rows: &mut [u64]) {
        interface.write_available(&self.frame, &self.perception, rows);
    }

    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    pub fn perception(&self) -> &Perception {
        &self.perception
    }

    /// What the units do not tell, as the words of a snapshot's column.
    pub fn words(&self) -> impl Iterator<Item = u64> {
        let p = &self.perception;
        let head = [p.max_reward.to_bits(), u64::from(p.steps) | u64::from(p.has_ended) << 32];
        let numbers = p.attack.iter().chain(&p.health).chain(p.looks.iter().flatten()).map(|x| x.to_bits());
        let seers = p.first_seer.iter().map(|seer| seer.map_or(NO_SEER, u64::from));
        let commands = self.commands.iter().flat_map(|command| match *command {
            Command::Target(id) => [1 + u64::from(id), 0, 0],
            Command::MoveTo(point) => [POINT, point[0].to_bits(), point[1].to_bits()],
            Command::Stop | Command::AttackMove(_) => [0; 3],
        });
        let word = |chunk: &[bool]| {
            chunk.iter().enumerate().fold(0, |word, (bit, flag)| word | u64::from(*flag) << bit)
        };
        let flags =
            [&p.flags, &p.shown, &p.mask].into_iter().flat_map(move |flags| flags.chunks(64).map(word));
        head.into_iter().chain(numbers).chain(seers).chain(commands).chain(flags)
    }

    /// Takes over the words of a snapshot that was [checked](Interface::check_words), and the units. The
    /// step is the episode's: the length of an edited snapshot may be another than its words have.
    pub fn load(&mut self, interface: &Interface, arena: &Arena, units: &Units, words: &[u64], steps: u32) {
        self.look(interface, arena, units);
        let sizes = interface.word_counts();
        let p = &mut self.perception;
        let mut rest = words;
        let mut take = |n: usize| {
            let (taken, others) = rest.split_at(n);
            rest = others;
            taken
        };
        let head = take(2);
        p.max_reward = f64::from_bits(head[0]);
        p.steps = steps;
        p.has_ended = head[1] >> 32 != 0;
        refill(&mut p.attack, take(sizes.attack).iter().map(|word| f64::from_bits(*word)));
        refill(&mut p.health, take(sizes.health).iter().map(|word| f64::from_bits(*word)));
        let looks = take(sizes.looks).chunks_exact(2);
        refill(&mut p.looks, looks.map(|look| [f64::from_bits(look[0]), f64::from_bits(look[1])]));
        let seers = take(sizes.seers).iter();
        refill(&mut p.first_seer, seers.map(|word| (*word != NO_SEER).then_some(*word as u16)));
        let commands = take(sizes.commands).chunks_exact(3).map(|words| match words[0] {
            0 => Command::Stop,
            POINT => Command::MoveTo([f64::from_bits(words[1]), f64::from_bits(words[2])]),
            id => Command::Target(id as u32 - 1),
        });
        refill(&mut self.commands, commands);
        for (flags, n) in
            [(&mut p.flags, sizes.flags), (&mut p.shown, sizes.flags), (&mut p.mask, sizes.mask)]
        {
            let words = take(n.div_ceil(64));
            refill(flags, (0..n).map(|i| words[i / 64] >> (i % 64) & 1 == 1));
        }
        refill(&mut p.dead, (0..self.frame.health.len()).map(|unit| !self.frame.is_alive(unit)));
        interface.begin_step(&self.frame, p);
    }
}
