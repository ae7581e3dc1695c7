//! Requests that any iceoryx2 program can send as a learner: any header with any payload, several in a row.
//! They are read as in production and accepted or rejected by a pool with an in-memory transport; afterwards
//! a valid learner must find the lane intact.
//!
//! Input: a byte that chooses the lane, then messages: a byte that says which parts of a valid header to
//! keep, the fields that are not kept, a byte with the payload's length in words, the payload.

use smaclite_ipc::wire::{ReadRequest, RequestHeader, body_offset, read_request, request_bytes};
use smaclite_pool::fields::Field;
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::{
    Doorbell, Epoch, FrameContent, Inlet, Message, Received, Request, RequestKind, RequestNumber, Seeds,
    SessionId, Transport, TransportError,
};
use smaclite_pool::{Autoreset, Pool, PoolOptions, WaitStrategy};
use smaclite_tests::LanePlan;
use smaclite_tests::in_memory::{self, Bell, Frame, MemoryOutlet};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

/// Requests as bytes, frames in memory.
struct Raw;

impl Transport for Raw {
    type Inlet = RawInlet;
    type Outlet = MemoryOutlet;
    type Doorbell = Bell;
}

struct RawInlet {
    messages: Receiver<(RequestHeader, Vec<u32>, usize)>,
    layout: Layout,
}

struct RawMessage {
    read: ReadRequest,
    /// Aligned as in shared memory; `len` bytes count.
    words: Vec<u32>,
    len: usize,
}

fn payload(words: &[u32], len: usize) -> &[u8] {
    &bytemuck::cast_slice(words)[..len]
}

impl Inlet for RawInlet {
    type Message = RawMessage;

    fn receive(&mut self) -> Result<Received<RawMessage>, TransportError> {
        let Ok((header, words, len)) = self.messages.try_recv() else { return Ok(Received::Nothing) };
        Ok(match read_request(header, payload(&words, len), &self.layout) {
            Ok(read) => Received::Request(RawMessage { read, words, len }),
            Err(rejection) => Received::Malformed(rejection),
        })
    }
}

impl Message for RawMessage {
    fn request(&self) -> Request<'_> {
        self.read.request(payload(&self.words, self.len))
    }
}

struct Lane {
    messages: Sender<(RequestHeader, Vec<u32>, usize)>,
    frames: Receiver<Frame>,
    layout: Layout,
    num_envs: usize,
}

struct Bench {
    pool: Pool<Raw>,
    lanes: Vec<Lane>,
    bell: Bell,
    session: u64,
}

/// A synchronous and an asynchronous lane, served by two workers for as long as the fuzzer runs.
fn bench() -> &'static Mutex<Bench> {
    static BENCH: OnceLock<Mutex<Bench>> = OnceLock::new();
    BENCH.get_or_init(|| {
        let bell = Bell::default();
        let (mut parts, mut lanes) = (Vec::new(), Vec::new());
        for (num_envs, batch_size, autoreset) in [(3, 3, Autoreset::Disabled), (5, 2, Autoreset::SameStep)] {
            let spec = LanePlan { batch_size, autoreset, ..LanePlan::toy(num_envs) }.spec();
            let layout = spec.layout();
            let ((spec, _, outlet), side) = in_memory::lane(spec);
            let (messages, inlet) = channel();
            parts.push((spec, RawInlet { messages: inlet, layout: layout.clone() }, outlet));
            lanes.push(Lane { messages, frames: side.frames, layout, num_envs });
        }
        let options = PoolOptions { threads: 2, wait: WaitStrategy::default() };
        let pool = Pool::start(parts, bell.clone(), options).expect("worker threads");
        Mutex::new(Bench { pool, lanes, bell, session: 0 })
    })
}

/// Reads fields from the front of the input; zeros when it is used up.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn u64(&mut self, bytes: usize) -> u64 {
        let (front, rest) = self.0.split_at(bytes.min(self.0.len()));
        self.0 = rest;
        front.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
    }

    /// A message for a lane; a valid step or reset if the input says so.
    fn message(&mut self, lane: &Lane, session: u64, number: u64) -> (RequestHeader, Vec<u32>, usize) {
        let keep = self.u64(1);
        let kinds = [
            RequestKind::Step,
            RequestKind::Reset { seeds: Seeds::Continue, levels: false },
            RequestKind::Reset { seeds: Seeds::From(4), levels: true },
            RequestKind::Restore { seeds: Seeds::Continue },
            RequestKind::Fork { seeds: Seeds::From(4) },
            RequestKind::Reset { seeds: Seeds::Each(()), levels: false },
            RequestKind::Fork { seeds: Seeds::Each(()) },
        ];
        let kind = kinds[self.u64(1) as usize % kinds.len()];
        let count = if keep & 1 == 0 { lane.num_envs } else { self.u64(4) as usize };
        let (session, number) = (SessionId(session), RequestNumber(number));
        let mut header = RequestHeader::new(&lane.layout, session, number, kind, count);
        let parts = [&mut header.layout_hash, &mut header.session, &mut header.number, &mut header.seed];
        for (bit, part) in parts.into_iter().enumerate().filter(|(bit, _)| keep >> (bit + 1) & 1 == 1) {
            *part = self.u64(if bit == 0 { 8 } else { 2 });
        }
        for (bit, part) in [&mut header.magic, &mut header.version, &mut header.kind].into_iter().enumerate()
        {
            if keep >> (bit + 5) & 1 == 1 {
                *part = self.u64(4) as u32;
            }
        }
        let valid_len = request_bytes(&lane.layout, kind, count.min(64));
        let given = self.u64(1) as usize;
        let len = if given == 0 { valid_len } else { given };
        let mut words = vec![0u32; len.div_ceil(4)];
        for (i, word) in words.iter_mut().enumerate() {
            // Mostly the environments in order and small actions, so that some requests are accepted.
            let byte = self.u64(1);
            *word = if byte == 255 { self.u64(4) as u32 } else { byte as u32 };
            if byte == 0 && i < count.min(body_offset(count.min(64)) / 4) {
                *word = i as u32;
            }
        }
        (header, words, len)
    }
}

impl Bench {
    /// The next batch of this session and epoch.
    fn batch(&self, lane: &Lane, epoch: u64) -> Frame {
        loop {
            let frame =
                lane.frames.recv_timeout(Duration::from_secs(20)).expect("a valid learner gets an answer");
            let epoch = Epoch { session: SessionId(self.session), reset: Some(RequestNumber(epoch)) };
            let ours = frame.epoch == Some(epoch);
            assert!(!ours || frame.content == FrameContent::Batch, "{:?}", frame.rejection());
            if ours {
                return frame;
            }
        }
    }
}

pub fn run(bytes: &[u8]) {
    let bench = &mut *bench().lock().unwrap();
    let mut input = Input(bytes);
    let index = input.u64(1) as usize % 2;
    bench.session += 1;
    bench.pool.lane(index).set_session(Some(SessionId(bench.session)));
    let lane = &bench.lanes[index];
    for number in 1..=8 {
        if input.0.is_empty() {
            break;
        }
        let _ = lane.messages.send(input.message(lane, bench.session, number));
        bench.bell.ring();
    }
    // A new learner attaches: what is still in the queue belongs to a session that is over.
    bench.session += 1;
    bench.pool.lane(index).set_session(Some(SessionId(bench.session)));
    let lane = &bench.lanes[index];
    let header = RequestHeader::new(
        &lane.layout,
        SessionId(bench.session),
        RequestNumber(1),
        RequestKind::Reset { seeds: Seeds::From(2), levels: false },
        lane.num_envs,
    );
    let ids: Vec<u32> = (0..lane.num_envs as u32).collect();
    let _ = lane.messages.send((header, ids, lane.num_envs * 4));
    bench.bell.ring();
    let frame = bench.batch(lane, 1);
    let ids = frame.field::<i32>(&lane.layout, Field::EnvId).expect("every lane has it");
    let masks = frame.field::<u8>(&lane.layout, Field::AvailActions).expect("this one has");
    let mut words = vec![0u32; request_bytes(&lane.layout, RequestKind::Step, ids.len()) / 4];
    ids.iter().zip(&mut words).for_each(|(id, word)| *word = *id as u32);
    let masks = masks.chunks(lane.layout.sizes().n_actions);
    for (mask, word) in masks.zip(&mut words[body_offset(ids.len()) / 4..]) {
        *word = mask.iter().position(|a| *a == 1).expect("an available action") as u32;
    }
    let (session, number) = (SessionId(bench.session), RequestNumber(2));
    let header = RequestHeader::new(&lane.layout, session, number, RequestKind::Step, ids.len());
    let len = words.len() * 4;
    let _ = lane.messages.send((header, words, len));
    bench.bell.ring();
    bench.batch(lane, 1);
    assert_eq!(bench.pool.lane(index).failure(), None);
}
