//! Following environments: the control thread's part. The log of a followed environment is in the pool; it
//! is read only when a follower requests it.

use super::{Connection, ControlServer, Role};
use crate::control::protocol::{ControlError, ControlResponse, EpisodeMessage};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_pool::{EpisodePart, FollowerId, TooManyFollowed};
use std::collections::BTreeSet;

/// The most followers of a lane at once, and the most environments that one of them follows: limits of the
/// memory of logs.
const MAX_FOLLOWERS: usize = 16;
const MAX_FOLLOWED_ENVS: usize = 64;

/// Bytes of the logs that one answer has, about: it is encoded in less than a millisecond, in which the
/// control thread does nothing else. Sixteen followers that ask all the time delay others by some
/// milliseconds.
const PIECE_BYTES: usize = 128 << 10;

/// What a connection follows.
#[derive(PartialEq)]
pub(super) struct Followed {
    id: FollowerId,
    env_ids: Vec<usize>,
    /// Index of the environment that is read next.
    next: usize,
}

impl ControlServer {
    /// The scenario of a lane.
    pub(super) fn scenario(&self, lane: Option<String>) -> Result<ControlResponse, ControlError> {
        let lane = &self.lanes[self.find(lane)?];
        let files = Box::new(lane.files.clone());
        Ok(ControlResponse::Scenario { lane: Box::new(lane.description.clone()), files })
    }

    /// Makes a connection the follower of environments.
    pub(super) fn follow(
        &mut self,
        connection: &mut Connection,
        lane: Option<String>,
        env_ids: Vec<usize>,
    ) -> Result<ControlResponse, ControlError> {
        self.candidate(connection)?;
        let index = self.find(lane)?;
        let description = &self.lanes[index].description;
        let (name, num_envs) = (description.lane.clone(), description.settings.num_envs);
        let response = self.scenario(Some(name.clone()))?;
        if env_ids.is_empty() || env_ids.len() > MAX_FOLLOWED_ENVS {
            let (given, limit) = (env_ids.len(), MAX_FOLLOWED_ENVS);
            return Err(ControlError::FollowedEnvs { given, limit });
        }
        if let Some(&env_id) = env_ids.iter().find(|env_id| **env_id >= num_envs) {
            return Err(ControlError::NoSuchEnv { lane: name, env_id, num_envs });
        }
        if self.lanes[index].followers == MAX_FOLLOWERS {
            return Err(ControlError::TooManyFollowers { lane: name, limit: MAX_FOLLOWERS });
        }
        let env_ids: Vec<usize> = env_ids.into_iter().collect::<BTreeSet<_>>().into_iter().collect();
        let lane = &mut self.lanes[index];
        let id = FollowerId(lane.next_follower);
        let followed = self.pool.lane(index).follow(&env_ids, id);
        followed.map_err(|TooManyFollowed { limit }| ControlError::TooManyFollowed { lane: name, limit })?;
        lane.next_follower += 1;
        lane.followers += 1;
        connection.take_role(Role::Follower(index, Followed { id, env_ids, next: 0 }));
        Ok(response)
    }

    pub(super) fn unfollow(&mut self, index: usize, followed: &Followed) {
        followed.env_ids.iter().for_each(|env_id| self.pool.lane(index).unfollow(*env_id, followed.id));
        self.lanes[index].followers -= 1;
    }

    /// What the environments that a connection follows did since its last request: a piece of some
    /// environments, from the one on that the last piece did not finish.
    pub(super) fn read_episodes(&self, connection: &mut Connection) -> Result<ControlResponse, ControlError> {
        let Role::Follower(index, followed) = &mut connection.role else {
            return Err(ControlError::Malformed {
                what: "this connection follows no environment".to_owned(),
            });
        };
        let (mut parts, mut budget) = (Vec::new(), PIECE_BYTES);
        while let Some(&env_id) = followed.env_ids.get(followed.next) {
            let read = self.pool.lane(*index).read_log(env_id, followed.id, &mut budget);
            parts.extend(read.into_iter().map(|part| message(env_id, part)));
            if budget == 0 {
                return Ok(ControlResponse::Episodes { parts, more: true });
            }
            followed.next += 1;
        }
        followed.next = 0;
        Ok(ControlResponse::Episodes { parts, more: false })
    }
}

fn message(env_id: usize, part: EpisodePart) -> EpisodeMessage {
    let EpisodePart { number, start, actions, is_over, lost } = part;
    let start = start.map(|record| STANDARD.encode(record));
    EpisodeMessage { env_id, number, start, actions, is_over, lost }
}
