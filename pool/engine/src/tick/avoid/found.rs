//! What a search found, in order of distance.

/// Units or edges by number, with their squared distances.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// The bits of the squared distance, and below them the place in `numbers`: distances are not negative, and so
    /// ordered as their bits are; of equals the first found stays first.
    keys: Vec<u64>,
    numbers: Vec<u32>,
}

impl Found {
    pub fn clear(&mut self) {
        self.keys.clear();
        self.numbers.clear();
    }

    pub fn push(&mut self, distance_squared: f32, number: u32) {
        let place = self.numbers.len() as u64;
        self.keys.push(u64::from(distance_squared.to_bits()) << 32 | place);
        self.numbers.push(number);
    }

    /// The numbers of what was found, nearest first; of equals the first found.
    pub fn nearest_first(&mut self) -> impl Iterator<Item = u32> {
        self.keys.sort_unstable();
        self.keys.iter().map(|&key| self.numbers[key as u32 as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_keep_their_order() {
        let mut found = Found::default();
        for (distance_squared, number) in [(0.5, 9), (0.0, 8), (0.5, 3), (1e-40, 7), (0.25, 1), (0.5, 5)] {
            found.push(distance_squared, number);
        }
        assert_eq!(found.nearest_first().collect::<Vec<_>>(), [8, 7, 1, 9, 3, 5]);
    }
}
