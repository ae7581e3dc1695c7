//! Battles of the engine alone: recorded ones of the published environment, single rules, and what holds in
//! every battle. One program, which is linked once.

mod conformance;
mod determinism;
mod few_units;
mod generated;
mod maps;
mod playground;
mod policies;
mod properties;
mod rewards;
mod rules;
mod smacv2_options;
mod snapshots;
mod starcraft;
mod ticks;
