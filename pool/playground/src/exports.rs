//! What a page sees: three functions, and one message in memory. The page asks for room, writes a request
//! there, has it answered, and reads the response at the same place (`page/engine.js`).

use crate::Session;
use std::cell::RefCell;

thread_local! {
    static SESSION: RefCell<Session> = RefCell::default();
    static MESSAGE: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Where a request of this many bytes belongs.
#[unsafe(no_mangle)]
pub extern "C" fn request(length: usize) -> *mut u8 {
    MESSAGE.with_borrow_mut(|message| {
        message.clear();
        message.resize(length, 0);
        message.as_mut_ptr()
    })
}

/// Replaces the request by its response, and returns the length of that.
#[unsafe(no_mangle)]
pub extern "C" fn respond() -> usize {
    let request = MESSAGE.take();
    let response = SESSION.with_borrow_mut(|session| session.respond_json(&request)).into_bytes();
    let length = response.len();
    MESSAGE.set(response);
    length
}

/// Where the response is.
#[unsafe(no_mangle)]
pub extern "C" fn response() -> *const u8 {
    MESSAGE.with_borrow(|message| message.as_ptr())
}
