//! How values are read whose kind says all about them.

use super::Node;
use crate::Keyword;
use crate::file::{Flag, Kind, Range, Reported, Text, Whole, Word, Words};

/// A kind whose values do not depend on other values of the file.
pub trait Scalar: Kind {
    /// Reads a value.
    ///
    /// # Errors
    /// [`Reported`] if the value is not of this kind.
    fn read(&self, node: &Node) -> Result<Self::Value, Reported>;
}

impl Scalar for Range {
    fn read(&self, node: &Node) -> Result<f64, Reported> {
        node.number(*self)
    }
}

impl Scalar for Whole {
    fn read(&self, node: &Node) -> Result<u32, Reported> {
        node.integer(self.from, self.to)
    }
}

impl Scalar for Flag {
    fn read(&self, node: &Node) -> Result<bool, Reported> {
        node.bool()
    }
}

impl Scalar for Text {
    fn read(&self, node: &Node) -> Result<String, Reported> {
        node.text(self.max_bytes).map(str::to_owned)
    }
}

impl<T: Keyword> Scalar for Word<T> {
    fn read(&self, node: &Node) -> Result<T, Reported> {
        node.keyword()
    }
}

impl<T: Keyword> Scalar for Words<T> {
    fn read(&self, node: &Node) -> Result<Vec<T>, Reported> {
        let words: Vec<_> = node.items()?.iter().map(Node::keyword).collect();
        words.into_iter().collect()
    }
}
