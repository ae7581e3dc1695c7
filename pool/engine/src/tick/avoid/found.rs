//! What a search found, in order of distance.

use crate::units::make_room;

/// Units or edges by their place in what was searched, with their squared distances.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// The bits of the squared distance, and below them the place: distances are not negative, and so ordered as
    /// their bits are; of equals the lowest place comes first.
    keys: Vec<u64>,
}

impl Found {
    /// Makes room for so many finds.
    pub fn fit(&mut self, n: usize) {
        make_room(&mut self.keys, n);
    }

    pub fn clear(&mut self) {
        self.keys.clear();
    }

    pub fn push(&mut self, distance_squared: f32, place: usize) {
        self.keys.push(u64::from(distance_squared.to_bits()) << 32 | place as u64);
    }

    /// Sorts what was found, nearest first.
    pub fn sort(&mut self) {
        self.keys.sort_unstable();
    }

    /// Whether two have equal distances; asked once they are sorted.
    pub fn has_equals(&self) -> bool {
        self.keys.windows(2).any(|pair| pair[0] >> 32 == pair[1] >> 32)
    }

    /// Replaces every place by what is there in a list.
    pub fn replace(&mut self, list: &[u32]) {
        for key in &mut self.keys {
            *key = *key >> 32 << 32 | u64::from(list[*key as u32 as usize]);
        }
    }

    /// The places, in the order that they are in.
    pub fn places(&self) -> impl ExactSizeIterator<Item = usize> {
        self.keys.iter().map(|&key| key as u32 as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_keep_their_order() {
        let mut found = Found::default();
        for (place, distance_squared) in [0.5, 0.0, 0.5, 1e-40, 0.25, 0.5].into_iter().enumerate() {
            found.push(distance_squared, place);
        }
        found.sort();
        assert_eq!(found.places().collect::<Vec<_>>(), [1, 3, 4, 0, 2, 5]);
        assert!(found.has_equals());
        found.replace(&[9, 8, 3, 7, 1, 5]);
        assert_eq!(found.places().collect::<Vec<_>>(), [8, 7, 1, 9, 3, 5]);
    }
}
