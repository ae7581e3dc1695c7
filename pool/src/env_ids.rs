//! The environment ids of a request, which the learner checks before it sends them and the lane when it
//! receives them.

use crate::rejection::Rejection;

/// The index of the environment that `id` names, in a lane of `num_envs`.
///
/// # Errors
/// [`Rejection::UnknownEnv`] if the lane has no such environment.
#[inline]
pub fn env_index(id: i32, num_envs: usize) -> Result<usize, Rejection> {
    let index = usize::try_from(id).ok().filter(|env| *env < num_envs);
    index.ok_or(Rejection::UnknownEnv { env: i64::from(id), num_envs })
}

/// Checks that every id names an environment, and that no two name the same one. `num_envs` ids that pass
/// name all environments of the lane.
///
/// # Errors
/// [`Rejection::UnknownEnv`] or [`Rejection::DuplicateEnv`] for the first id that fails.
pub fn check_distinct(ids: impl IntoIterator<Item = i32>, num_envs: usize) -> Result<(), Rejection> {
    let mut named = vec![false; num_envs];
    ids.into_iter().try_for_each(|id| {
        let env = env_index(id, num_envs)?;
        if std::mem::replace(&mut named[env], true) { Err(Rejection::DuplicateEnv { env }) } else { Ok(()) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_name_every_environment_of_the_lane_once() {
        assert!(check_distinct([2, 0, 1], 3).is_ok() && check_distinct([], 3).is_ok());
        let refused = |ids: &[i32]| check_distinct(ids.iter().copied(), 3).unwrap_err();
        assert!(matches!(refused(&[0, 2, 0]), Rejection::DuplicateEnv { env: 0 }));
        assert!(matches!(refused(&[0, 3]), Rejection::UnknownEnv { env: 3, num_envs: 3 }));
        assert!(matches!(refused(&[-1, 0]), Rejection::UnknownEnv { env: -1, num_envs: 3 }));
    }
}
