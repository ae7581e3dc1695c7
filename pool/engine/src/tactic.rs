//! The names of the scripted policies; `policy` says what they do.

/// The rule of a scripted policy. All of them let healers heal the available ally with the smallest share of
/// its health, but for random.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tactic {
    /// Uniformly random available actions.
    Random,
    /// [`nearest`](crate::policy::nearest).
    Nearest,
    /// Kills one opponent after the other: a unit targets the opponent within its attack range that will have
    /// the least health and shield left after the attacks of the units before it, and at equality the nearest
    /// one. Opponents that those attacks will kill are left out. Units without such a target play `Nearest`.
    FocusFire,
    /// Plays `FocusFire`, but a unit with a longer attack range than its nearest opponent steps away from
    /// that opponent while its own cooldown lasts and the opponent could attack it after its next step.
    Kite,
    /// Waits: targets the nearest opponent within attack range, otherwise stops. Healers heal those in reach.
    Hold,
    /// Advances in a line: units that are ahead of the last one wait for it, and all attack the opponent that
    /// is nearest to the middle of the team.
    Line,
    /// In two groups, which pass the opponents on either side, and then attack the weaker of the two nearest.
    Flank,
    /// The units with the most health and shield go ahead; the others, and healers, stay behind them.
    Escort,
    /// One attacker per opponent, as far as there are enough: the nearest that no unit before has chosen.
    Spread,
}

impl Tactic {
    /// All of them.
    pub const ALL: [Tactic; 9] = [
        Tactic::Random,
        Tactic::Nearest,
        Tactic::FocusFire,
        Tactic::Kite,
        Tactic::Hold,
        Tactic::Line,
        Tactic::Flank,
        Tactic::Escort,
        Tactic::Spread,
    ];

    /// Its name in commands, files and Python.
    pub const fn name(self) -> &'static str {
        match self {
            Tactic::Random => "random",
            Tactic::Nearest => "nearest",
            Tactic::FocusFire => "focus_fire",
            Tactic::Kite => "kite",
            Tactic::Hold => "hold",
            Tactic::Line => "line",
            Tactic::Flank => "flank",
            Tactic::Escort => "escort",
            Tactic::Spread => "spread",
        }
    }
}
