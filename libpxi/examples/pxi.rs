// What a Rust program needs of pxi.h. All zeros are the defaults of a request.
use std::{ffi::c_void, os::raw::c_char};

#[repr(C)]
pub struct Error { pub size: u32, pub status: u32, pub offset: i64, pub rule: [c_char; 16], pub message: [u8; 240] }

#[repr(C)]
pub struct Output { pub size: u32, pub width: u32, pub height: u32, pub opaque: u32, pub row_bytes: usize, pub bytes: usize }

#[repr(C)]
pub struct Request {
    pub size: u32, pub format: u32, pub x: u32, pub y: u32, pub region_width: u32, pub region_height: u32,
    pub width: u32, pub height: u32, pub scale: f64, pub moving: u32, pub without_background: u32, pub time: f64,
    pub layers: *const u32, pub layer_count: usize, pub threads: u32, pub limit_count: u32, pub limits: *const c_void,
    pub progress: Option<extern "C" fn(*mut c_void, f64) -> i32>, pub progress_context: *mut c_void,
}

#[link(name = "pxi")]
extern "C" {
    pub fn pxi_open(bytes: *const u8, count: usize, options: *const c_void, out: *mut *mut c_void, error: *mut Error) -> u32;
    pub fn pxi_measure(file: *const c_void, request: *const Request, output: *mut Output, error: *mut Error) -> u32;
    pub fn pxi_render(file: *mut c_void, request: *const Request, pixels: *mut u8, bytes: usize, stride: usize, error: *mut Error) -> u32;
    pub fn pxi_close(file: *mut c_void);
}

/// A structure of zeros but for its size, which comes first.
pub fn blank<T>() -> T {
    unsafe {
        let mut value = std::mem::zeroed::<T>();
        *(&mut value as *mut T as *mut u32) = std::mem::size_of::<T>() as u32;
        value
    }
}
