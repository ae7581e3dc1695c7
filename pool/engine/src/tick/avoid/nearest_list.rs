//! What a search found, in order of distance.

use crate::units::make_room;

/// Units or edges by their index in what was searched, with their squared distances.
#[derive(Debug, Default)]
pub(super) struct NearestList {
    /// The bits of the squared distance, and below them the index: distances are not negative, and so ordered
    /// as their bits are; of equals the lowest index comes first.
    keys: Vec<u64>,
}

impl NearestList {
    /// Makes room for so many finds.
    pub fn fit(&mut self, n: usize) {
        make_room(&mut self.keys, n);
    }

    pub fn clear(&mut self) {
        self.keys.clear();
    }

    /// Puts a find where it belongs, the nearest being first. There are seldom more than two or three.
    pub fn insert(&mut self, distance_squared: f32, index: usize) {
        let key = u64::from(distance_squared.to_bits()) << 32 | index as u64;
        let mut at = self.keys.len();
        self.keys.push(key);
        while at > 0 && self.keys[at - 1] > key {
            self.keys[at] = self.keys[at - 1];
            at -= 1;
        }
        self.keys[at] = key;
    }

    /// Whether two have equal distances.
    pub fn has_equals(&self) -> bool {
        self.keys.windows(2).any(|pair| pair[0] >> 32 == pair[1] >> 32)
    }

    /// Replaces every index by what is there in a list.
    pub fn replace(&mut self, list: &[u32]) {
        for key in &mut self.keys {
            *key = *key >> 32 << 32 | u64::from(list[*key as u32 as usize]);
        }
    }

    /// The indices, in the order that they are in.
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
