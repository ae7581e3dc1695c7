//! The results of a search, sorted by distance.

use crate::units::clear_and_reserve;

/// Units or edges by their index in what was searched, with their squared distances.
#[derive(Debug, Default)]
pub(super) struct NearestList {
    /// The bits of the squared distance, and below them the index. Non-negative floats have the order of
    /// their bits, so keys sort by distance, and equal distances by index.
    keys: Vec<u64>,
}

impl NearestList {
    /// Reserves memory for `n` results.
    pub fn reserve(&mut self, n: usize) {
        clear_and_reserve(&mut self.keys, n);
    }

    pub fn clear(&mut self) {
        self.keys.clear();
    }

    /// Inserts a result at its position.
    pub fn insert(&mut self, distance_squared: f32, index: usize) {
        // Insertion sort: there are seldom more than two or three results.
        let key = u64::from(distance_squared.to_bits()) << 32 | index as u64;
        let mut at = self.keys.len();
        self.keys.push(key);
        while at > 0 && self.keys[at - 1] > key {
            self.keys[at] = self.keys[at - 1];
            at -= 1;
        }
        self.keys[at] = key;
    }

    /// Whether two results have equal distances.
    pub fn has_equals(&self) -> bool {
        self.keys.windows(2).any(|pair| pair[0] >> 32 == pair[1] >> 32)
    }

    /// Replaces every index by the entry of a list at that index.
    pub fn replace(&mut self, list: &[u32]) {
        for key in &mut self.keys {
            *key = *key >> 32 << 32 | u64::from(list[*key as u32 as usize]);
        }
    }

    /// The indices, in their current order.
    pub fn indices(&self) -> impl ExactSizeIterator<Item = usize> {
        self.keys.iter().map(|&key| key as u32 as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_keep_their_order() {
        let mut found = NearestList::default();
        for (index, distance_squared) in [0.5, 0.0, 0.5, 1e-40, 0.25, 0.5].into_iter().enumerate() {
            found.insert(distance_squared, index);
        }
        assert_eq!(found.indices().collect::<Vec<_>>(), [1, 3, 4, 0, 2, 5]);
        assert!(found.has_equals());
        found.replace(&[9, 8, 3, 7, 1, 5]);
        assert_eq!(found.indices().collect::<Vec<_>>(), [8, 7, 1, 9, 3, 5]);
    }
}
