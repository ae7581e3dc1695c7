//! What a faulty or hostile supervisor can send to a learner: a lane's description with any sizes, and frames
//! with any header and any content. A reader ignores frames of another layout, and what it accepts has the
//! right shape.
//!
//! Input: a byte that says which parts of a valid header to keep, the others, the payload; or, if the first
//! byte is 255, a response of the control socket as JSON.

use smaclite_engine::Sizes;
use smaclite_ipc::control::protocol::{ControlRequest, ControlResponse};
use smaclite_ipc::wire::{FrameHeader, MAGIC, ReceivedFrame, frames_lost, read_frame};
use smaclite_pool::fields::{Dtype, FieldSet};
use smaclite_pool::layout::{FORMAT_VERSION, Layout};

pub fn run(bytes: &[u8]) {
    let Some((keep, rest)) = bytes.split_first() else { return };
    if *keep == 255 {
        return read_response(rest);
    }
    let (n_actions, obs_size, state_size) = (5, 3, 4);
    let sizes = Sizes { n_agents: 2, n_enemies: 1, n_actions, obs_size, state_size, ..Sizes::default() };
    let layout = Layout::new(sizes, 40, 4, FieldSet::ALL);
    // The fields that are not kept come first, then the payload.
    let (changed, rest) = rest.split_at((8 * (keep & 0x7f).count_ones() as usize).min(rest.len()));
    let mut words = changed.chunks(8).map(|c| c.iter().rev().fold(0u64, |w, b| w << 8 | u64::from(*b)));
    let mut or = |bit: u8, valid: u64| if keep >> bit & 1 == 0 { valid } else { words.next().unwrap_or(0) };
    let header = FrameHeader {
        magic: or(0, MAGIC.into()) as u32,
        version: or(1, FORMAT_VERSION.into()) as u32,
        layout_hash: or(2, layout.hash()),
        session: 1,
        epoch: 1,
        sequence: or(3, 8),
        slots: or(4, 4) as u32,
        rejection_len: or(5, 0) as u32,
        request: or(6, 3),
    };
    let length = if keep >> 7 & 1 == 0 { layout.bytes() } else { rest.len() };
    let mut payload = rest.to_vec();
    payload.resize(length, 0);
    frames_lost(Some(7), header.sequence);
    match read_frame(&header, &payload, &layout) {
        None => assert!(*keep != 0, "a valid frame was ignored"),
        Some(ReceivedFrame::Rejection { rejection, .. }) => drop(rejection.to_string()),
        Some(ReceivedFrame::Batch) => read_all_fields(&layout, &payload),
    }
}

fn read_all_fields(layout: &Layout, payload: &[u8]) {
    // As in shared memory, where payloads are aligned.
    let mut words = vec![0u64; payload.len().div_ceil(8)];
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
    bytes[..payload.len()].copy_from_slice(payload);
    for field in layout.fields().iter() {
        let elements = match field.spec().dtype {
            Dtype::F32 => layout.view::<f32>(bytes, field).map(<[f32]>::len),
            Dtype::I32 => layout.view::<i32>(bytes, field).map(<[i32]>::len),
            Dtype::U8 | Dtype::Bool => layout.view::<u8>(bytes, field).map(<[u8]>::len),
            other => panic!("a batch has no {other:?}"),
        };
        assert_eq!(elements, Some(layout.slots() * layout.row_len(field)));
    }
}

fn read_response(line: &[u8]) {
    drop(serde_json::from_slice::<ControlRequest>(line));
    match serde_json::from_slice::<ControlResponse>(line) {
        Ok(ControlResponse::Attached { lane, .. } | ControlResponse::Lane(lane)) => {
            drop(lane.layout().map_err(|e| e.to_string()))
        }
        Ok(ControlResponse::Scenario { lane, files }) => {
            drop((lane.layout().map_err(|e| e.to_string()), files.scenario().map_err(|e| e.to_string())))
        }
        Ok(ControlResponse::Refused(refusal)) => drop(refusal.to_string()),
        // The states in `Episodes` are records, which `snapshot` reads.
        Ok(
            ControlResponse::Connected
            | ControlResponse::Status(_)
            | ControlResponse::Episodes { .. }
            | ControlResponse::Refusals { .. },
        )
        | Err(_) => {}
    }
}
