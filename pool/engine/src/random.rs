//! The battle's random generator: NumPy's `SeedSequence` and `PCG64`, and the shuffle of NumPy's `Generator`,
//! so that a seed gives the same episodes as in the published environment.
//!
//! The execution orders of phase 4 are drawn from it, in `battle`; and where a lane has several opponents or
//! random ones, which of them plays, and its actions.

use std::hint::select_unpredictable;

use rand::Rng;
use rand_pcg::Pcg64;

/// A random generator with the output of `numpy.random.Generator(PCG64(seed))`.
///
/// Equal generators have equal further outputs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Generator {
    pcg: Pcg64,
    /// The high half of the last 64-bit output, not yet used.
    high_half: Option<u32>,
    position: StreamPosition,
}

/// How far a generator has come: its seed, and how much it has drawn since.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StreamPosition {
    /// The seed.
    pub seed: u64,
    /// Number of 32-bit words that were drawn since seeding.
    pub draws: u64,
}

impl Default for Generator {
    /// The generator of seed 0.
    fn default() -> Generator {
        Generator::new(0)
    }
}

impl StreamPosition {
    /// The position after seeding.
    pub fn start(seed: u64) -> StreamPosition {
        StreamPosition { seed, draws: 0 }
    }
}

impl From<StreamPosition> for Generator {
    /// The generator at that position; all positions cost about the same.
    fn from(position: StreamPosition) -> Generator {
        let mut generator = Generator::new(position.seed);
        // Each 64-bit output is two words.
        generator.pcg.advance(u128::from(position.draws / 2));
        if position.draws % 2 == 1 {
            let (_, high) = halves(generator.pcg.next_u64());
            generator.high_half = Some(high);
        }
        Generator { position, ..generator }
    }
}

impl Generator {
    /// The generator of `numpy.random.default_rng(seed)`.
    pub fn new(seed: u64) -> Generator {
        let [state_high, state_low, stream_high, stream_low] = seed_words(seed);
        let join = |high: u64, low: u64| u128::from(high) << 64 | u128::from(low);
        Generator {
            pcg: Pcg64::new(join(state_high, state_low), join(stream_high, stream_low)),
            high_half: None,
            position: StreamPosition::start(seed),
        }
    }

    /// How far it has come.
    pub fn position(&self) -> StreamPosition {
        self.position
    }

    /// The next 32 random bits.
    pub fn next_word(&mut self) -> u32 {
        self.position.draws = self.position.draws.wrapping_add(1);
        self.high_half.take().unwrap_or_else(|| {
            let (low, high) = halves(self.pcg.next_u64());
            self.high_half = Some(high);
            low
        })
    }

    /// A number from 0 to less than 1, a multiple of 2^-32.
    pub(crate) fn next_share(&mut self) -> f64 {
        f64::from(self.next_word()) / 4_294_967_296.0
    }

    /// A number from 0 to less than 1, a multiple of 2^-53.
    pub(crate) fn next_f64(&mut self) -> f64 {
        let (low, high) = (u64::from(self.next_word()), u64::from(self.next_word()));
        ((high << 32 | low) >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// Shuffles `items` as NumPy's `Generator.shuffle` shuffles a list of that length.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        let mut last = items.len().saturating_sub(1);
        if last == 0 {
            return;
        }
        // NumPy's Fisher-Yates shuffle draws a uniform number up to `last` by rejection under the smallest
        // mask of ones that covers it. A rejection is as likely as up to one half, so a branch on it would be
        // mispredicted often: instead a rejected word swaps an item with itself and `last` stays.
        let mut mask = usize::MAX >> last.leading_zeros();
        let mut draws = 0;
        let mut place = |word: u32| {
            let word = word as usize & mask;
            let fits = word <= last;
            items.swap(last, select_unpredictable(fits, word, last));
            last -= usize::from(fits);
            draws += 1;
            // Half the mask covers all that is left, or nothing is left to cover.
            if last == mask >> 1 {
                mask = last;
            }
            mask > 0
        };
        let mut goes_on = self.high_half.take().is_none_or(&mut place);
        let mut pcg = self.pcg.clone();
        while goes_on {
            let both = pcg.next_u64();
            let (low, high) = halves(both);
            goes_on = place(low);
            if goes_on {
                goes_on = place(high);
            } else {
                self.high_half = Some(high);
            }
        }
        self.pcg = pcg;
        self.position.draws = self.position.draws.wrapping_add(draws);
    }
}

/// NumPy's 32-bit words are the halves of a 64-bit output, low half first.
fn halves(output: u64) -> (u32, u32) {
    (output as u32, (output >> 32) as u32)
}

/// `SeedSequence(seed).generate_state(4, uint64)`: Melissa O'Neill's `seed_seq_fe` hash with a pool of 4
/// words.
fn seed_words(seed: u64) -> [u64; 4] {
    let pool = seed_pool([seed as u32, (seed >> 32) as u32, 0, 0]);
    let mut hash = HashConstant { value: 0x8b51_f9dd, multiplier: 0x58f3_8ded };
    let mut next = |i: usize| u64::from(hash.mix_in(pool[i % 4]));
    std::array::from_fn(|i| {
        let low = next(2 * i);
        low | next(2 * i + 1) << 32
    })
}

/// The entropy pool of a `SeedSequence`: hashed words, each then mixed into all others.
fn seed_pool(entropy: [u32; 4]) -> [u32; 4] {
    let mut hash = HashConstant { value: 0x43b0_d7e5, multiplier: 0x931e_8875 };
    let mut pool = entropy.map(|word| hash.mix_in(word));
    for source in 0..4 {
        for target in (0..4).filter(|&target| target != source) {
            let word = hash.mix_in(pool[source]);
            let mixed = pool[target].wrapping_mul(0xca01_f9dd).wrapping_sub(word.wrapping_mul(0x4973_f715));
            pool[target] = mixed ^ mixed >> 16;
        }
    }
    pool
}

/// The running constant that makes every word of a `SeedSequence` hash differently.
struct HashConstant {
    value: u32,
    multiplier: u32,
}

impl HashConstant {
    fn mix_in(&mut self, word: u32) -> u32 {
        let word = word ^ self.value;
        self.value = self.value.wrapping_mul(self.multiplier);
        let word = word.wrapping_mul(self.value);
        word ^ word >> 16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The expected numbers of this module were taken from NumPy.

    #[test]
    fn seed_gives_numpys_state_and_outputs() {
        let [a, b, c, d] = seed_words(1);
        let join = |high: u64, low: u64| u128::from(high) << 64 | u128::from(low);
        let increment = join(c, d) << 1 | 1;
        assert_eq!(increment, 194290289479364712180083596243593368443);
        let multiplier = 0x2360_ED05_1FC6_5DA4_4385_DF64_9FCC_F645_u128;
        let state = increment.wrapping_add(join(a, b)).wrapping_mul(multiplier).wrapping_add(increment);
        assert_eq!(state, 207833532711051698738587646355624148094);

        let mut generator = Generator::new(1);
        let outputs: [u64; 3] = std::array::from_fn(|_| generator.pcg.next_u64());
        assert_eq!(outputs, [0x8306_bdf3_7922_e4ff, 0xf351_96bb_c152_a866, 0x24e7_a4f6_08ec_18cd]);
    }

    #[test]
    fn wide_seeds_use_both_words() {
        let mut generator = Generator::new(0x0123_4567_89ab_cdef);
        assert_eq!(generator.pcg.next_u64(), 0xb615_d4ad_31fd_27fc);
    }

    #[test]
    fn shuffles_as_numpy_does() {
        let mut generator = Generator::new(1);
        let mut five: Vec<u32> = (0..5).collect();
        generator.shuffle(&mut five);
        assert_eq!(five, [4, 0, 1, 2, 3]);
        let mut sixteen: Vec<u32> = (0..16).collect();
        generator.shuffle(&mut sixteen);
        assert_eq!(sixteen, [12, 1, 11, 6, 10, 7, 13, 15, 3, 4, 5, 8, 0, 9, 14, 2]);
    }

    #[test]
    fn a_position_gives_the_generator_that_came_there() {
        for n_words in 0..5 {
            let mut generator = Generator::new(7);
            // A shuffle of two items draws one word, of which it never rejects one.
            (0..n_words).for_each(|_| generator.shuffle(&mut [0, 1]));
            let position = StreamPosition { seed: 7, draws: n_words };
            assert_eq!((generator.position(), &generator), (position, &Generator::from(position)));
        }
        let mut generator = Generator::new(7);
        let mut items: Vec<u32> = (0..100).collect();
        (0..50).for_each(|_| generator.shuffle(&mut items));
        assert!(generator.position().draws > 50 * 99, "rejected words count too");
        assert_eq!(Generator::from(generator.position()), generator);
    }

    #[test]
    fn shuffling_one_or_none_draws_nothing() {
        let mut generator = Generator::new(3);
        generator.shuffle(&mut [7]);
        generator.shuffle::<u8>(&mut []);
        assert_eq!(generator, Generator::new(3));
    }
}
