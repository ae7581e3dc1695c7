//! The bytes in shared memory: headers of frames and requests, and the layout of a request's payload.
//! Whatever a peer wrote is checked here before other code sees it.

#![allow(unsafe_code)] // `as_atomics` and `read_once` say why; `ZeroCopySend` asserts plain data

use crate::os::now_ns;
use iceoryx2::prelude::ZeroCopySend;
use smaclite_pool::Rejection;
use smaclite_pool::layout::{BLOCK_ALIGN, FORMAT_VERSION, Layout};
use smaclite_pool::transport::{Epoch, Request, RequestKind, RequestNumber, SEED_WORDS, Seeds, SessionId};
use std::sync::atomic::{AtomicI32, AtomicU64, Ordering};
use std::time::Duration;

/// First word of every header: "SMAC" in ASCII.
pub const MAGIC: u32 = 0x534d_4143;

/// Precedes every frame. Aligned so that iceoryx2 places the payload behind it on a cache line.
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Default, Clone, Copy, ZeroCopySend)]
#[type_name("smaclite_pool.FrameHeader.v1")]
pub struct FrameHeader {
    /// [`MAGIC`].
    pub magic: u32,
    /// [`FORMAT_VERSION`].
    pub version: u32,
    /// [`Layout::hash`] of the payload.
    pub layout_hash: u64,
    /// The session that the frame answers. Frames that a dead supervisor queued are still delivered, so
    /// readers check it.
    pub session: u64,
    /// The request that began the frame's epoch; 0 before a session's first reset.
    pub epoch: u64,
    /// Counts frames of a lane, from 1.
    pub sequence: u64,
    /// Slots filled.
    pub slots: u32,
    /// 0 = a batch; otherwise the length of a JSON rejection at the payload's start.
    pub rejection_len: u32,
    /// The refused request, if this is a rejection; 0 reports that the lane failed.
    pub request: u64,
}

/// What a received frame holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReceivedFrame {
    /// Every slot is filled.
    Batch,
    /// A request was refused.
    Rejection {
        /// Its number; `None` reports that the lane failed.
        request: Option<RequestNumber>,
        /// Why.
        rejection: Rejection,
    },
}

impl FrameHeader {
    /// What the frame belongs to.
    pub fn epoch(&self) -> Epoch {
        Epoch { session: SessionId(self.session), reset: number(self.epoch) }
    }
}

/// In headers, 0 stands for no request.
fn number(number: u64) -> Option<RequestNumber> {
    (number != 0).then_some(RequestNumber(number))
}

/// Reads a frame that another process wrote: `None` if it does not have this lane's layout. Session and epoch
/// are the caller's to check.
pub fn read_frame(header: &FrameHeader, payload: &[u8], layout: &Layout) -> Option<ReceivedFrame> {
    let given = (header.magic, header.version, header.layout_hash, header.slots as usize, payload.len());
    if given != (MAGIC, FORMAT_VERSION, layout.hash(), layout.slots(), layout.bytes()) {
        return None;
    }
    if header.rejection_len == 0 {
        return Some(ReceivedFrame::Batch);
    }
    let text = payload.get(..header.rejection_len as usize).unwrap_or_default();
    Some(ReceivedFrame::Rejection { request: number(header.request), rejection: rejection_of(text) })
}

/// A rejection by its text. One that was cut is told as it is.
pub(crate) fn rejection_of(text: &[u8]) -> Rejection {
    let cut = || Rejection::Malformed { what: String::from_utf8_lossy(text).into_owned() };
    serde_json::from_slice(text).unwrap_or_else(|_| cut())
}

/// The frames, first to last, that are missing between frame `last`, if there was one, and frame `next`.
pub fn frames_lost(last: Option<u64>, next: u64) -> Option<(u64, u64)> {
    let expected = last?.wrapping_add(1);
    (next != expected).then(|| (expected, next.wrapping_sub(1)))
}

const STEP: u32 = 1;
const RESET: u32 = 2;
const RESTORE: u32 = 3;
const FORK: u32 = 4;
const RESET_TO: u32 = 5;

const NO_SEEDS: u64 = 0;
const ONE_SEED: u64 = 1;
const EACH_SEED: u64 = 2;

/// Precedes every request.
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Default, Clone, Copy, ZeroCopySend)]
#[type_name("smaclite_pool.RequestHeader.v1")]
pub struct RequestHeader {
    /// [`MAGIC`].
    pub magic: u32,
    /// [`FORMAT_VERSION`].
    pub version: u32,
    /// [`Layout::hash`] of the lane's frames.
    pub layout_hash: u64,
    /// The sender's session.
    pub session: u64,
    /// Counts the requests of a session, from 1.
    pub number: u64,
    /// 1 = step, 2 = reset, 3 = restore, 4 = fork, 5 = reset to levels.
    pub kind: u32,
    /// Environments of the request.
    pub count: u32,
    /// The seed of environment 0 if environment i gets this + i.
    pub seed: u64,
    /// 0 = environments are not seeded, 1 = with `seed`, 2 = each as the body says.
    pub seeds: u64,
    /// When it was sent, in nanoseconds by a clock that both ends share. Only the statistics of `status`
    /// depend on it.
    pub sent_ns: u64,
}

impl RequestHeader {
    /// The header of a request.
    pub fn new(
        layout: &Layout,
        session: SessionId,
        number: RequestNumber,
        kind: RequestKind,
        count: usize,
    ) -> RequestHeader {
        let (seeds, seed) = match kind.seeds() {
            Seeds::Continue => (NO_SEEDS, 0),
            Seeds::From(seed) => (ONE_SEED, seed),
            Seeds::Each(()) => (EACH_SEED, 0),
        };
        let kind = match kind {
            RequestKind::Step => STEP,
            RequestKind::Reset { levels: false, .. } => RESET,
            RequestKind::Reset { levels: true, .. } => RESET_TO,
            RequestKind::Restore { .. } => RESTORE,
            RequestKind::Fork { .. } => FORK,
        };
        let (magic, version, layout_hash) = (MAGIC, FORMAT_VERSION, layout.hash());
        let sent_ns = now_ns();
        RequestHeader {
            magic,
            version,
            layout_hash,
            session: session.0,
            number: number.0,
            kind,
            count: count as u32,
            seed,
            seeds,
            sent_ns,
        }
    }
}

/// Offset of the body in a request to `count` environments: `env_id` i32 `[count]` comes first, and the body
/// begins on the next cache line.
pub fn body_offset(count: usize) -> usize {
    (count * size_of::<i32>()).next_multiple_of(BLOCK_ALIGN)
}

/// Bytes of a request to `count` environments: `env_id`, and what [`RequestKind`] says of its body.
pub fn request_bytes(layout: &Layout, kind: RequestKind, count: usize) -> usize {
    let seed = if kind.seeds() == Seeds::Each(()) { SEED_WORDS * size_of::<i32>() } else { 0 };
    let row = match kind {
        RequestKind::Step => layout.sizes().n_actors() * size_of::<i32>(),
        RequestKind::Reset { levels: false, .. } if seed == 0 => return count * size_of::<i32>(),
        RequestKind::Reset { levels: false, .. } => 0,
        RequestKind::Reset { levels: true, .. } => layout.level_len() * size_of::<f32>(),
        RequestKind::Restore { .. } => layout.snapshot_size(),
        RequestKind::Fork { .. } => size_of::<i32>(),
    };
    // A count is a u32 and sizes are small, so nothing overflows a 64-bit usize.
    body_offset(count) + count * (seed + row)
}

/// Bytes of the largest request to `num_envs` environments.
pub fn max_request_bytes(layout: &Layout, num_envs: usize) -> usize {
    let seeds = Seeds::Each(());
    let (restore, levels) = (RequestKind::Restore { seeds }, RequestKind::Reset { seeds, levels: true });
    let kinds = [RequestKind::Step, RequestKind::Fork { seeds }, restore, levels];
    kinds.map(|kind| request_bytes(layout, kind, num_envs)).into_iter().max().unwrap_or_default()
}

fn malformed(what: String) -> Rejection {
    Rejection::Malformed { what }
}

/// Was the request written for this lane, by a compatible release?
fn check_origin(header: &RequestHeader, layout: &Layout) -> Result<(), Rejection> {
    let RequestHeader { magic, version, layout_hash, .. } = *header;
    if (magic, version) != (MAGIC, FORMAT_VERSION) {
        return Err(malformed(format!(
            "expected format {MAGIC:#x} version {FORMAT_VERSION}, got format {magic:#x} version {version}"
        )));
    }
    if layout_hash != layout.hash() {
        let expected = layout.hash();
        return Err(malformed(format!("expected layout {expected:#018x}, got {layout_hash:#018x}")));
    }
    Ok(())
}

/// The header of a request as it is now: its sender can still write to it.
pub(crate) fn read_once(header: &RequestHeader) -> RequestHeader {
    const WORDS: usize = size_of::<RequestHeader>() / size_of::<u64>();
    // SAFETY: a header has the alignment of `AtomicU64`, for which every bit pattern is valid, and is read up
    // to its end. Only loads are made, so the mapping may be read-only. The reference is iceoryx2's view of
    // memory that its sender can still write to; nothing but these loads reads the values in it.
    let words = unsafe { &*std::ptr::from_ref(header).cast::<[AtomicU64; WORDS]>() };
    let words = words.each_ref().map(|word| word.load(Ordering::Relaxed));
    // SAFETY: the sizes are equal (checked by the compiler), and all fields are integers, without padding
    // between.
    unsafe { std::mem::transmute::<[u64; WORDS], RequestHeader>(words) }
}

/// What the header of a request says, checked against its length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadRequest {
    session: SessionId,
    number: RequestNumber,
    kind: RequestKind,
    count: usize,
    sent_ns: u64,
}

impl ReadRequest {
    /// The request, whose payload is the one that was given to [`read_request`], or one of its length.
    pub fn request<'a>(&self, payload: &'a [u8]) -> Request<'a> {
        let ReadRequest { session, number, kind, count, .. } = *self;
        let env_ids = as_atomics(&payload[..count * size_of::<i32>()]);
        let body = as_atomics(payload.get(body_offset(count)..).unwrap_or_default());
        Request { session, number, kind, env_ids, body }
    }

    /// How long ago it was sent, at most a minute. Wrong if the sender lies.
    pub(crate) fn waited(&self) -> Duration {
        Duration::from_nanos(now_ns().saturating_sub(self.sent_ns)).min(Duration::from_secs(60))
    }
}

/// Reads a request whose payload another process wrote and may still be writing.
///
/// # Errors
/// If it is none of this lane: its marks, its length or its environments are wrong.
pub fn read_request(
    header: RequestHeader,
    payload: &[u8],
    layout: &Layout,
) -> Result<ReadRequest, Rejection> {
    check_origin(&header, layout)?;
    let count = header.count as usize;
    let seeds = match header.seeds {
        NO_SEEDS => Seeds::Continue,
        ONE_SEED => Seeds::From(header.seed),
        EACH_SEED => Seeds::Each(()),
        other => {
            return Err(malformed(format!("seeds must be 0 (none), 1 (one) or 2 (one each), got {other}")));
        }
    };
    let kind = match header.kind {
        STEP => RequestKind::Step,
        RESET => RequestKind::Reset { seeds, levels: false },
        RESET_TO => RequestKind::Reset { seeds, levels: true },
        RESTORE => RequestKind::Restore { seeds },
        FORK => RequestKind::Fork { seeds },
        other => {
            return Err(malformed(format!(
                "request kind must be 1 (step), 2 (reset), 3 (restore), 4 (fork) or 5 (reset to levels), got \
                 {other}"
            )));
        }
    };
    let bytes = request_bytes(layout, kind, count);
    if count == 0 || payload.len() != bytes || !payload.as_ptr().cast::<i32>().is_aligned() {
        let given = payload.len();
        return Err(malformed(format!("expected {bytes} bytes for {count} environments, got {given}")));
    }
    let (session, number) = (SessionId(header.session), RequestNumber(header.number));
    Ok(ReadRequest { session, number, kind, count, sent_ns: header.sent_ns })
}

/// Views bytes as integers that another process may change at any time.
fn as_atomics(bytes: &[u8]) -> &[AtomicI32] {
    // SAFETY: every bit pattern is an `i32`, `AtomicI32` has its size and alignment, and `align_to` gives
    // only the part that is aligned (all of it, as `read_request` checked). Only loads are made, so the
    // mapping may be read-only. The slice is iceoryx2's view of memory that its sender can still write to;
    // nothing but these loads reads the values in it.
    let (before, integers, after) = unsafe { bytes.align_to::<AtomicI32>() };
    debug_assert!(before.is_empty() && after.is_empty());
    integers
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::Sizes;
    use smaclite_pool::fields::FieldSet;

    fn layout() -> Layout {
        let sizes = Sizes {
            n_agents: 2,
            n_enemies: 1,
            n_actions: 7,
            obs_size: 3,
            state_size: 5,
            perception_size: 0,
            n_phases: 0,
            enemies: None,
        };
        Layout::new(sizes, 0, 4, FieldSet::without_final())
    }

    #[test]
    fn lies_in_a_frame_are_passed_over() {
        let layout = layout();
        let (version, layout_hash) = (FORMAT_VERSION, layout.hash());
        let good = FrameHeader { magic: MAGIC, version, layout_hash, slots: 4, ..FrameHeader::default() };
        let mut payload = vec![b'x'; layout.bytes()];
        assert_eq!(read_frame(&good, &payload, &layout), Some(ReceivedFrame::Batch));
        let lies = [
            FrameHeader { magic: 1, ..good },
            FrameHeader { version: 9, ..good },
            FrameHeader { layout_hash: 3, ..good },
            FrameHeader { slots: 5, ..good },
        ];
        lies.iter().for_each(|lie| assert_eq!(read_frame(lie, &payload, &layout), None, "{lie:?}"));
        assert_eq!(read_frame(&good, &payload[1..], &layout), None);

        let read = |len: usize, payload: &[u8]| {
            read_frame(&FrameHeader { rejection_len: len as u32, request: 7, ..good }, payload, &layout)
        };
        let text = serde_json::to_vec(&Rejection::NotReset).unwrap();
        payload[..text.len()].copy_from_slice(&text);
        let refused =
            |rejection| Some(ReceivedFrame::Rejection { request: Some(RequestNumber(7)), rejection });
        assert_eq!(read(text.len(), &payload), refused(Rejection::NotReset));
        let unreadable = |what: &str| refused(Rejection::Malformed { what: what.to_owned() });
        assert_eq!(read(2, &payload), unreadable("{\""));
        assert_eq!(read(usize::MAX, &payload), unreadable(""));
    }

    #[test]
    fn gaps_between_frames_are_noticed() {
        assert_eq!(frames_lost(None, 5), None);
        assert_eq!(frames_lost(Some(5), 6), None);
        assert_eq!(frames_lost(Some(5), 9), Some((6, 8)));
        assert_eq!(frames_lost(Some(u64::MAX), 5), Some((0, 4)));
        assert_eq!(frames_lost(Some(5), 0), Some((6, u64::MAX)));
    }

    #[test]
    fn a_request_has_its_environments_and_on_the_next_cache_line_its_body() {
        let (one, each) = (Seeds::From(1), Seeds::Each(()));
        let layout = Layout::new(layout().sizes(), 40, 4, FieldSet::ALL);
        let reset = |seeds, levels| RequestKind::Reset { seeds, levels };
        // Of 17 environments, each with two actors, three units, and a snapshot of 40 bytes.
        for (kind, bytes) in [
            (reset(one, false), 17 * 4),
            (reset(each, false), 128 + 17 * 12),
            (reset(one, true), 128 + 17 * 3 * 5 * 4),
            (reset(each, true), 128 + 17 * (12 + 3 * 5 * 4)),
            (RequestKind::Step, 128 + 17 * 2 * 4),
            (RequestKind::Restore { seeds: one }, 128 + 17 * 40),
            (RequestKind::Restore { seeds: each }, 128 + 17 * (12 + 40)),
            (RequestKind::Fork { seeds: one }, 128 + 17 * 4),
            (RequestKind::Fork { seeds: each }, 128 + 17 * (12 + 4)),
        ] {
            assert_eq!(request_bytes(&layout, kind, 17), bytes, "{kind:?}");
            assert!(bytes <= max_request_bytes(&layout, 17));
        }
        assert_eq!(max_request_bytes(&layout, 17), 128 + 17 * (12 + 3 * 5 * 4));
        assert_eq!([0, 1, 16, 17].map(body_offset), [0, 64, 64, 128]);
    }

    #[test]
    fn lies_in_a_request_are_named() {
        let layout = layout();
        let good = RequestHeader::new(&layout, SessionId(7), RequestNumber(1), RequestKind::Step, 4);
        let aligned = [0u64; 64];
        let bytes: &[u8] = bytemuck::cast_slice(&aligned);
        let payload = &bytes[..request_bytes(&layout, RequestKind::Step, 4)];
        assert!(read_request(good, payload, &layout).is_ok());
        let check = |header: RequestHeader, payload: &[u8], expected: &str| {
            let error = read_request(header, payload, &layout).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        };
        check(RequestHeader { magic: 1, ..good }, payload, "got format 0x1");
        check(RequestHeader { version: 9, ..good }, payload, "version 9");
        check(RequestHeader { layout_hash: 3, ..good }, payload, "got 0x0000000000000003");
        check(RequestHeader { kind: 8, ..good }, payload, "got 8");
        check(RequestHeader { seeds: 3, ..good }, payload, "seeds must be 0 (none), 1 (one) or 2 (one each)");
        check(RequestHeader { count: u32::MAX, ..good }, payload, "4294967295 environments");
        check(RequestHeader { count: 0, ..good }, &[], "0 environments");
        check(good, &payload[1..], "expected 96 bytes for 4 environments, got 95");
        check(good, &bytes[1..97], "expected 96 bytes for 4 environments, got 96");
    }
}
