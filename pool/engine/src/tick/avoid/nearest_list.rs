//! The results of a search, sorted by distance.

/// Units or edges by their index in what was searched, with their squared distances.
#[derive(Debug, Default)]
pub(super) struct NearestList {
    /// The bits of the squared distance, and below them the index. Non-negative floats have the order of
    /// their bits, so keys sort by distance, and equal distances by index. After `replace` the index alone.
    /// Entries from `n` on are stale.
    keys: Vec<u64>,
    n: usize,
}

impl NearestList {
    /// Reserves memory for `n` results, the most that may be inserted.
    pub fn reserve(&mut self, n: usize) {
        self.n = 0;
        if self.keys.len() < n {
            self.keys.resize(n, 0);
        }
    }

    /// Removes all results.
    pub fn clear(&mut self) {
        self.n = 0;
    }

    /// Inserts a result at its position.
    pub fn insert(&mut self, distance_squared: f32, index: usize) {
        // Insertion sort: there are seldom more than two or three results.
        let key = u64::from(distance_squared.to_bits()) << 32 | index as u64;
        let keys = &mut self.keys[..=self.n];
        let mut at = self.n;
        self.n += 1;
        while at > 0 && keys[at - 1] > key {
            keys[at] = keys[at - 1];
            at -= 1;
        }
        keys[at] = key;
    }

    /// Replaces every index by the entry of a list at that index. Nothing can be inserted then.
    pub fn replace(&mut self, list: &[u32]) {
        for key in &mut self.keys[..self.n] {
            *key = u64::from(list[*key as u32 as usize]);
        }
    }

    /// The indices, in their current order.
    pub fn indices(&self) -> impl ExactSizeIterator<Item = usize> {
        self.keys[..self.n].iter().map(|&key| key as u32 as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_keep_their_order() {
        let mut found = NearestList::default();
        found.reserve(6);
        for (index, distance_squared) in [0.5, 0.0, 0.5, 1e-40, 0.25, 0.5].into_iter().enumerate() {
            found.insert(distance_squared, index);
        }
        assert_eq!(found.indices().collect::<Vec<_>>(), [1, 3, 4, 0, 2, 5]);
        found.replace(&[9, 8, 3, 7, 1, 5]);
        assert_eq!(found.indices().collect::<Vec<_>>(), [8, 7, 1, 9, 3, 5]);
    }
}
