//! What must hold for every picture: equal moments give equal bytes, every living unit is visible where it
//! is, and no size, map or moment is too extreme.

mod animations;
mod battles;
mod extremes;
mod kit;
mod moments;
mod sheets;
mod states;
